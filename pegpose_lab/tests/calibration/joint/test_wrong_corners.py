"""Single wrong corners are listed with their views, and a lens beyond the model makes none look wrong."""

import numpy as np
import pytest

from pegpose_lab import (
    CalibrationError,
    FisheyeCamera,
    OpenCVCamera,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    calibrate_zhang,
)
from pegpose_lab.calibration.joint.models import RATIONAL
from pegpose_lab.study import trial_poses
from pegpose_lab.tests.calibration.joint.boards import EXPERIMENT
from pegpose_lab.tests.calibration.joint.test_wrong_views import BOARD, CAMERA, VIEWS, boards, flag, joint, zhang

WRONG = {(1, 0): (8, -3), (4, 20): (0, 30), (4, 53): (-5, 0)}


def spoiled(seed=0):
    images = boards(seed)
    for (view, corner), shift in WRONG.items():
        images[view][corner] += shift
    return images


@pytest.mark.parametrize("calibrate", [joint, zhang, lambda images: joint(images, loss="cauchy")])
def test_wrong_corners_are_listed_with_their_views(calibrate):
    words = flag(calibrate(spoiled()), "misfit-corner")
    assert words.startswith("Wrong corners (counted from 0): corner 0 of view 1; corners 20, 53 of view 4: ")
    near, far = (float(part) for part in words.split("view 4: ")[1].split(" px")[0].split(" to "))
    assert (near, far) == pytest.approx((5, 30), abs=0.5)


def test_the_sentence_tells_how_far_f_moves_without_them():
    images, every = spoiled(), joint(spoiled())
    rest = [np.delete(np.arange(54), [corner for view, corner in WRONG if view == k]) for k in range(VIEWS)]
    without = calibrate_joint(
        [BOARD[r] for r in rest], [image[r] for image, r in zip(images, rest, strict=True)], CAMERA
    )
    told = float(flag(every, "misfit-corner").split("f moves by ")[1].split(" mm")[0])
    assert told == pytest.approx(without.camera.focal_length - every.camera.focal_length, rel=0.06)
    assert without.flags == ()


def test_a_single_view_has_its_wrong_corners_listed():
    image = spoiled()[4]
    for run in (calibrate_tsai(BOARD, image, CAMERA), calibrate_genetic(BOARD, image, CAMERA, rng=0)):
        assert flag(run, "misfit-corner").startswith("Wrong corners (counted from 0): corners 20, 53: ")
    assert calibrate_tsai(BOARD, boards()[4], CAMERA).flags == ()


def test_corners_that_make_a_view_no_image_of_a_plane_are_named():
    images = boards()
    images[2][[5, 40]] += [[1500, 0], [0, 1300]]
    for calibrate in (joint, zhang):
        with pytest.raises(
            CalibrationError, match=r"^wrong corners: corners 5, 40 of view 2 \(counted from 0\), up to 1"
        ):
            calibrate(images)


def test_a_held_principal_point_far_off_makes_no_corner_wrong():
    camera = CAMERA.sensor.camera(48.0)
    off = type(camera)(48.0, camera.pixel_pitch, (1000.0, 700.0), camera.image_size)
    for seed in (2, 4, 7):
        flags = calibrate_joint([BOARD] * VIEWS, boards(seed), off, principal_point="fixed").flags
        assert [found.code for found in flags if found.code.startswith("misfit")] == ["misfit-lens"]


def test_zhang_on_good_views_lists_none():
    assert calibrate_zhang([BOARD] * VIEWS, boards(5), CAMERA.image_size).flags == ()


def wide_views(camera, noise, seed, number=6):
    rng = np.random.default_rng(seed)
    poses = trial_poses(EXPERIMENT.board, 30.0, number, rng)
    return [camera.project(EXPERIMENT.board.object_points, pose) + noise * rng.normal(size=(48, 2)) for pose in poses]


@pytest.mark.parametrize("k1, wrong", [(-3.0, False), (-0.3, True)])
def test_distortion_makes_no_corner_wrong_where_a_calibration_is_refused(k1, wrong):
    """The rational coefficients trade off; near the rim, distortion puts corners far from a homography."""
    camera = OpenCVCamera([[4800, 0, 799.5], [0, 4800, 599.5], [0, 0, 1]], [k1, 1.0, 0, 0, 0], (1600, 1200))
    board, images = [EXPERIMENT.board.object_points] * 3, wide_views(camera, 0.1, 0, 3)
    images[2][7] += [60 * wrong, 40 * wrong]
    start = "Wrong corners: corner 7 of view 2 " if wrong else "the (views|least squares) .* free fewer"
    with pytest.raises(CalibrationError, match=f"^{start}"):
        calibrate_joint(board, images, CAMERA.sensor, coefficients=RATIONAL)


def test_a_wrong_corner_of_a_fisheye_camera_is_the_only_one():
    camera = FisheyeCamera([[3000, 0, 799.5], [0, 3000, 599.5], [0, 0, 1]], [0.5, -0.2, 0, 0], (1600, 1200))
    images = wide_views(camera, 0.1, 1)
    images[3][40] += [6, 3]
    run = calibrate_joint([EXPERIMENT.board.object_points] * 6, images, CAMERA.sensor, lens="equidistant")
    assert flag(run, "misfit-corner").startswith("Wrong corners (counted from 0): corner 40 of view 3: ")
