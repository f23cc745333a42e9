"""The profile likelihood of f, and the weakest direction."""

import numpy as np
import pytest

from pegpose_lab import CalibrationError, calibrate_joint, calibrate_tsai, profile_focal_length, weakest_direction
from pegpose_lab.study import trial_poses
from pegpose_lab.tests.calibration.joint.boards import BOARD, CAMERA, EXPERIMENT, five_views


def test_the_weakest_direction_is_that_of_f_and_depth():
    eigenvalue, words = weakest_direction(calibrate_joint(*five_views(0.1), CAMERA, principal_point="fixed"))
    assert 0 < eigenvalue < 0.1 and words == "focal_length and T_z trade off"
    poses = trial_poses(EXPERIMENT.board, 12.0, 6, 2)
    rng = np.random.default_rng(0)
    images = [CAMERA.project(BOARD, pose) + 0.02 * rng.standard_normal((48, 2)) for pose in poses]
    assert weakest_direction(calibrate_joint([BOARD] * 6, images, CAMERA, principal_point="fixed"))[0] < eigenvalue
    with pytest.raises(ValueError, match="covariance"):
        weakest_direction(calibrate_tsai(BOARD, five_views(0.1)[1][1], CAMERA))


# --- little tilt: refused, flagged, or right ---------------------------------------------------------------


def test_profile_is_the_interval_by_sigma_where_the_views_are_good():
    points, images = five_views(0.1, 2)
    run = calibrate_joint(points, images, CAMERA)
    half = 1.97 * run.sigma("focal_length")
    low, high = profile_focal_length(points, images, CAMERA)
    best = run.camera.focal_length
    assert (low, high) == pytest.approx((best - half, best + half), abs=0.05 * half)
    wider = profile_focal_length(points, images, CAMERA, level=0.99)
    assert wider[0] < low and wider[1] > high


def test_profile_of_a_single_view_holds_the_truth_as_often_as_it_says():
    inside = 0
    for seed in range(60):
        points, images = five_views(0.1, seed)
        low, high = profile_focal_length(points[1:2], images[1:2], CAMERA, principal_point="fixed")
        inside += low < CAMERA.focal_length < high
    assert 52 <= inside <= 60


def test_profile_follows_the_trade_off_and_says_where_it_has_no_end():
    """A board of 3 degrees: a smaller f at a smaller T_z explains it nearly as well, a larger one does not."""
    pose = trial_poses(EXPERIMENT.board, 3.0, 1, 1)[0]
    images = CAMERA.project(BOARD, pose) + 0.5 * np.random.default_rng(0).standard_normal((48, 2))
    low, high = profile_focal_length([BOARD], [images], CAMERA, principal_point="fixed")
    assert low < 0.5 * CAMERA.focal_length < CAMERA.focal_length < high
    narrow = profile_focal_length([BOARD], [images], CAMERA, principal_point="fixed", level=0.01)
    best = np.sqrt(np.prod(narrow))
    assert best / low > 1.3 * high / best
    assert profile_focal_length([BOARD], [images], CAMERA, principal_point="fixed", level=0.9999)[0] == 0
    with pytest.raises(CalibrationError, match="explains the points nearly as well"):
        calibrate_joint([BOARD], [images], CAMERA, principal_point="fixed")
