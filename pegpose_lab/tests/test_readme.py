"""The README: its example runs as it stands, and what it names is there."""

import re
import subprocess
import sys

import cv2
import pytest

from pegpose_lab.experiment import paper_experiment
from pegpose_lab.results import PROJECT_FOLDER

README = (PROJECT_FOLDER / "README.md").read_text(encoding="utf-8")


def test_the_example_runs_as_it_stands(tmp_path):
    """On rendered pictures it finds the truth of the rendering: f, and the turn of frame 1 in the plane."""
    experiment = paper_experiment()
    for folder, picture, numbers in (("boards", experiment.board_image, range(5)), ("frames", experiment.hub_frame, range(2))):
        (tmp_path / folder).mkdir()
        for number in numbers:
            cv2.imwrite(str(tmp_path / folder / f"{number}.png"), picture(number))
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    found, half = map(float, re.search(r"f = ([\d.]+) \+- ([\d.]+) mm", run.stdout).groups())
    ratio = experiment.camera.focal_length / experiment.camera.pixel_pitch[0]
    assert found / 0.0371 == pytest.approx(ratio, abs=3 * half / 0.0371)
    thetas = [float(theta) for theta in re.findall(r"theta = (-?[\d.]+) deg", run.stdout)]
    assert thetas == pytest.approx([-141.205, -144.205], abs=0.01)
    assert (tmp_path / "camera.yaml").exists()


def test_every_module_and_test_is_named():
    package = PROJECT_FOLDER / "pegpose_lab"
    modules = {path.stem for path in package.glob("*.py")} - {"__init__"}
    tests = {path.stem for path in (package / "tests").glob("test_*.py")}
    named = set(re.findall(r"`(\w+)`", README))
    assert modules | tests <= named, f"not named: {sorted((modules | tests) - named)}"
    assert {name for name in named if name.startswith("test_")} <= tests
