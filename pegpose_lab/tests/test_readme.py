"""The README: its example runs as it stands, and what it names is there."""

import re
import shutil
import subprocess
import sys

import cv2
import pandas as pd
import pytest

from pegpose_lab.files import PROJECT_FOLDER
from pegpose_lab.lab import front_page
from pegpose_lab.paper import paper_experiment

README = (PROJECT_FOLDER / "README.md").read_text(encoding="utf-8")
MAP = (PROJECT_FOLDER / "data" / "paper" / "README.md").read_text(encoding="utf-8")
MOST_LINES = 120


def test_the_example_runs_as_it_stands(tmp_path):
    """On rendered pictures it finds the truth of the rendering: f, and the turn of frame 1 in the plane."""
    experiment = paper_experiment()
    for folder, picture, numbers in (
        ("boards", experiment.board_image, range(5)),
        ("frames", experiment.hub_frame, range(2)),
    ):
        (tmp_path / folder).mkdir()
        for number in numbers:
            cv2.imwrite(str(tmp_path / folder / f"{number}.png"), picture(number))
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    low, high = map(float, re.search(r"f = ([\d.]+) to ([\d.]+) mm", run.stdout).groups())
    ratio = experiment.camera.focal_length / experiment.camera.pixel_pitch[0]
    assert (low + high) / 2 / 0.0371 == pytest.approx(ratio, abs=3 * (high - low) / 2 / 0.0371)
    thetas = [float(theta) for theta in re.findall(r"theta = (-?[\d.]+) deg", run.stdout)]
    assert thetas == pytest.approx([-141.205, -144.205], abs=0.01)
    assert (tmp_path / "camera.yaml").exists()


def test_every_module_and_test_is_named():
    package = PROJECT_FOLDER / "pegpose_lab"
    tests = {path.stem for path in (package / "tests").rglob("test_*.py")}
    modules = {path.stem for path in package.rglob("*.py") if "tests" not in path.parts} - {"__init__"}
    named = set(re.findall(r"`(\w+)`", MAP))
    assert modules | tests <= named, f"not named: {sorted((modules | tests) - named)}"
    assert {name for name in named if name.startswith("test_")} <= tests


def test_the_first_page_is_short_and_shows_the_committed_results():
    assert len(README.splitlines()) <= MOST_LINES
    assert front_page.is_current(PROJECT_FOLDER / "README.md", PROJECT_FOLDER / "data" / "results")


def test_the_audit_finds_what_the_first_finding_says():
    audit = pd.read_csv(PROJECT_FOLDER / "data" / "results" / "08_audit.csv").set_index("item")["what is determined"]
    assert audit[["Lens, distance, scale", "Table 2, tilt"]].str.startswith("determined").all()
    assert "lens, distance, scale and resolution, and the tilts of Tables 1 and 2 (08)" in README


def test_a_changed_result_outdates_the_first_page(tmp_path):
    results, readme = tmp_path / "results", tmp_path / "README.md"
    shutil.copytree(PROJECT_FOLDER / "data" / "results", results)
    shutil.copyfile(PROJECT_FOLDER / "README.md", readme)
    table = pd.read_csv(results / "06_chain_errors.csv")
    table["peg centres (mm)"] *= 2
    table.to_csv(results / "06_chain_errors.csv", index=False)
    assert not front_page.is_current(readme, results)
    front_page.write(readme, results)
    assert front_page.is_current(readme, results)
    readme.write_text("no blocks")
    with pytest.raises(ValueError, match="findings:begin"):
        front_page.write(readme, results)


def test_links_lead_somewhere():
    for page in ("README.md", "data/README.md", "data/paper/README.md", "data/results/README.md"):
        path = PROJECT_FOLDER / page
        targets = re.findall(r"\]\((?!http)([^)#]+)\)", path.read_text(encoding="utf-8"))
        assert [target for target in targets if not (path.parent / target).exists()] == []
