"""Single wrong corners are listed with their views, and a lens beyond the model makes none look wrong."""

import numpy as np
import pytest

from pegpose_lab import CalibrationError, calibrate_genetic, calibrate_joint, calibrate_tsai, calibrate_zhang
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
