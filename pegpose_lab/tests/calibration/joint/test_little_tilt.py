"""Boards with little tilt: refused, flagged, or right."""

import numpy as np
import pytest

from pegpose_lab import CalibrationError, calibrate_joint
from pegpose_lab.study import trial_poses
from pegpose_lab.tests.calibration.joint.boards import BOARD, CAMERA, EXPERIMENT, little_tilted, outcome

OPTIONS = {
    "default": {},
    "fixed": {"principal_point": "fixed"},
    "k1k2": {"coefficients": ("k1", "k2")},
    "two": {"focal": "two"},
    "two_k1k2": {"focal": "two", "coefficients": ("k1", "k2")},
    "huber": {"loss": "huber"},
}


@pytest.mark.parametrize("name", OPTIONS)
def test_boards_with_little_tilt_are_refused_or_flagged(name):
    """No f is further from the truth than 5 of its sigmas; all below 10 degrees are flagged."""
    tilts, numbers, noises = (0.0, 0.3, 0.5, 1.0, 2.0, 5.0), (2, 3, 10, 30), (0.05, 0.1, 0.5)
    found = [outcome(seed, OPTIONS[name], tilts, numbers, noises) for seed in range(25)]
    answered = [pair for pair in found if pair is not None]
    assert 2 <= len(answered) < 23
    assert all(flagged for _, flagged in answered) and max(error for error, _ in answered) < 5


@pytest.mark.parametrize("name", ["default", "k1k2", "huber"])
def test_well_tilted_boards_are_neither_refused_nor_flagged(name):
    found = [outcome(seed, OPTIONS[name], (15.0, 20.0, 30.0), (5, 10), (0.05, 0.1)) for seed in range(15)]
    assert None not in found and max(error for error, _ in found) < 4
    assert sum(flagged for _, flagged in found) <= 2


@pytest.mark.parametrize(
    "options, number, tilt, noise",
    [
        ({}, 30, 0.3, 0.5),
        ({}, 3, 0.5, 0.5),
        ({"focal": "two"}, 30, 0.3, 0.1),
        ({"focal": "two", "coefficients": ("k1", "k2")}, 20, 0.5, 0.1),
    ],
)
def test_many_noisy_views_of_fronto_parallel_boards_know_nothing(options, number, tilt, noise):
    """The noise alone gives f a small sigma there, a tenth of it, at up to a hundred times its value."""
    for seed in range(5):
        assert outcome(seed, options, (tilt,), (number,), (noise,)) is None


@pytest.mark.parametrize("seed", [22, 335, 619])
def test_two_focal_lengths_of_a_wrong_valley_are_refused(seed):
    """A least squares of its own at f_y = 0.9 f_x, boards of 24 deg and f = 4000 mm, far above the least."""
    rng = np.random.default_rng([seed, 9])
    images = [
        CAMERA.project(BOARD, pose) + 0.2 * rng.standard_normal((48, 2)) for pose in little_tilted(rng, 0.5, 30, True)
    ]
    with pytest.raises(CalibrationError, match="f is not determined.*better"):
        calibrate_joint([BOARD] * 30, images, CAMERA, focal="two", coefficients=("k1", "k2"))


def test_a_search_that_runs_out_of_steps_is_refused():
    """Without noise the sum of squares is a valley with a level floor: it is not followed to its end."""
    poses = little_tilted(np.random.default_rng([5, 20, 100]), 0.1, 20, False)
    images = [CAMERA.project(BOARD, pose) for pose in poses]
    with pytest.raises(CalibrationError, match="no minimum in 200 steps.*trade off"):
        calibrate_joint([BOARD] * 20, images, CAMERA, focal="two", coefficients=("k1", "k2"))


def test_steps_that_promise_nothing_are_rejected():
    """On exactly fronto-parallel boards a step's promise can be rounding; it was divided by."""
    for seed in range(10):
        assert outcome(seed, {}, (0.0,), (10,), (0.1,)) is None


def test_correlation_of_f_and_depth():
    """Of a board that is little tilted f and T_z are nearly one unknown; tilted boards part them."""
    correlations = []
    for tilt in (5.0, 30.0):
        poses = trial_poses(EXPERIMENT.board, tilt, 6, 2)
        images = [CAMERA.project(BOARD, pose) for pose in poses]
        images = [points + 0.02 * np.random.default_rng(k).standard_normal((48, 2)) for k, points in enumerate(images)]
        run = calibrate_joint([BOARD] * 6, images, CAMERA, principal_point="fixed")
        correlations.append(run.correlation("focal_length", "tz_0"))
    assert correlations[0] > 0.98 and correlations[1] < correlations[0]
