"""A new contributor's path: what CONTRIBUTING.md shows is written into a copy of the package, and used."""

import re
import shutil
import subprocess
import sys

import pytest

from pegpose_lab.files import PROJECT_FOLDER

PAGE = (PROJECT_FOLDER / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
NEW_FILE = re.compile(r"`(pegpose_lab/[\w/]+\.py)`:\n\n```python\n(\"\"\".*?)```", re.DOTALL)
NEW_LINE = re.compile(r"The line in `\w+_METHODS` of `(pegpose_lab/[\w/]+\.py)`:\n\n```python\n(.*?)```", re.DOTALL)

USE = {
    "circles": """
import cv2, numpy as np
from pegpose_lab import find_circles, fit_discs
image = np.full((120, 160), 60, np.uint8)
cv2.circle(image, (90, 50), 30, 200, -1, cv2.LINE_AA)
image = cv2.GaussianBlur(image, (0, 0), 1.0)
image = np.uint8(image + np.random.default_rng(0).normal(0, 2, image.shape))
found = find_circles(image, (20, 40), method="enclosing")
assert np.allclose([*found.centers[0], found.radii[0]], [90, 50, 30], atol=1) and len(found) == 1
discs = fit_discs(image, found)
assert discs.accepted.all(), discs.reasons
assert len(find_circles(255 - image, (20, 40), method="enclosing", polarity="dark")) == 1
""",
    "calibration": """
from pegpose_lab import Checkerboard, study
from pegpose_lab.paper import paper_camera
from pegpose_lab.study import baselines, trial_poses
table = study.monte_carlo(methods=("closed-form", "joint"), trials=1, progress=False).set_index("method")
assert (table["status"] == "").all(), table["status"].to_list()
assert abs(table.loc["closed-form", "focal_length"] / table.loc["joint", "focal_length"] - 1) < 0.02
board, camera = Checkerboard(8, 6, 29.0), paper_camera()
images = [camera.project(board.object_points, pose) for pose in trial_poses(board, 30.0, 4, 0)]
for name in set(baselines._RIVALS) - {"closed form", "linear only"}:
    del baselines._RIVALS[name]
assert study.compare([board.object_points] * 4, images, camera)["method"].to_list() == ["linear only", "closed form"]
""",
}


@pytest.fixture
def copy(tmp_path):
    """A copy of the package, without its tests, in a folder of its own."""
    shutil.copytree(
        PROJECT_FOLDER / "pegpose_lab", tmp_path / "pegpose_lab", ignore=shutil.ignore_patterns("tests", "__pycache__")
    )
    shutil.copytree(PROJECT_FOLDER / "data" / "paper", tmp_path / "data" / "paper")
    return tmp_path


@pytest.mark.parametrize("room", USE)
def test_a_new_method_is_one_file_and_one_line(copy, room):
    ((file, code),) = [found for found in NEW_FILE.findall(PAGE) if room in found[0]]
    ((table, line),) = [found for found in NEW_LINE.findall(PAGE) if room in found[0]]
    assert not (copy / file).exists() and len(line.splitlines()) == 1
    (copy / file).write_text(code, encoding="utf-8")
    before = (copy / table).read_text(encoding="utf-8")
    after = re.sub(r"(?<=\n)(\w+_METHODS) = \{\n", lambda head: head[0] + line, before)
    assert len(after.splitlines()) == len(before.splitlines()) + 1
    (copy / table).write_text(after, encoding="utf-8")
    run = subprocess.run([sys.executable, "-c", USE[room]], cwd=copy, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def test_the_page_is_one_page():
    assert len(PAGE.splitlines()) <= 120
