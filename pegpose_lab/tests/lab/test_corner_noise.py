"""The explorer for the corners' noise: every state says what a calibration of those corners computes."""

import re
import time

import numpy as np
import pytest

from pegpose_lab import calibrate_genetic, calibrate_zhang, find_corners, paper, study
from pegpose_lab.lab import widgets

EXPERIMENT = paper.paper_experiment()
BOARD = EXPERIMENT.board.object_points


@pytest.fixture
def explorer():
    return widgets.corner_noise_explorer(EXPERIMENT)


def numbers(explorer):
    """E of two stages, and the rms of Zhang's method, px, as the text has them."""
    stages = re.search(r"stages 1 \+ 2: mean distance \(Eq. 7\) ([\d.]+) px", explorer.text)[1]
    return float(stages), float(re.search(r"Zhang: rms ([\d.]+) px", explorer.text)[1])


def direct(corners):
    """The same by the genetic algorithm and by Zhang's method."""
    sensor = EXPERIMENT.camera.sensor
    runs = [calibrate_genetic(BOARD, points, sensor, rng=[0, view]) for view, points in enumerate(corners)]
    residuals = np.concatenate([run.residuals[0] for run in runs])
    return np.hypot(*residuals.T).mean(), calibrate_zhang([BOARD] * 5, corners, sensor.image_size).rms


@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_simulated_noise_is_as_computed_directly(explorer, noise):
    explorer.controls["noise"].value = noise
    rng = np.random.default_rng(3)
    exact = [EXPERIMENT.camera.project(BOARD, pose) for pose in EXPERIMENT.cam_from_boards]
    corners = [points + noise * rng.standard_normal(points.shape) for points in exact]
    assert numbers(explorer) == pytest.approx(direct(corners), rel=3e-3, abs=1e-4)


def test_detectors_are_as_computed_directly_and_disable_the_noise(explorer):
    images = [EXPERIMENT.board_image(view) for view in range(5)]
    own = [find_corners(image, EXPERIMENT.board) for image in images]
    whole = [np.rint(points) for points in own]
    gradient = list(map(study.sub_pixel_corners, images, whole))
    assert not explorer.controls["noise"].disabled
    for name, corners in {"find_corners": own, "cornerSubPix": gradient, "whole pixels": whole}.items():
        explorer.controls["detector"].value = name
        assert numbers(explorer) == pytest.approx(direct(corners), rel=1e-3, abs=1e-4), name
        assert explorer.controls["noise"].disabled and explorer.text.startswith(f"{name}: ") and not explorer.failed


def test_every_control_changes_the_picture_at_once(explorer):
    for name, value in (("noise", 0.05), ("detector", "whole pixels")):
        before, start = bytes(explorer.picture.value), time.process_time()
        explorer.controls[name].value = value
        assert time.process_time() - start < 0.1 and bytes(explorer.picture.value) != before, name
    explorer.controls["detector"].value = "simulated normal noise"
    assert not explorer.controls["noise"].disabled
