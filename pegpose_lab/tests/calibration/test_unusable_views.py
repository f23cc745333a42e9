"""Views and options that cannot be used are named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import (
    CalibrationError,
    Checkerboard,
    OpenCVCamera,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    calibrate_zhang,
)
from pegpose_lab.tests.calibration.views import BOARD, CAMERA, five_views, view

POINTS, IMAGE = view()
SIX = [0, 7, 18, 29, 40, 47]
LINE = np.column_stack([np.arange(48.0), 2 * np.arange(48.0), np.zeros(48)])


@pytest.mark.parametrize("method", [calibrate_tsai, calibrate_genetic])
@pytest.mark.parametrize(
    ("points", "image", "camera", "named"),
    [
        ([], [], CAMERA, "object_points"),
        (POINTS[:4], IMAGE[:4], CAMERA, "n >= 5"),
        (POINTS[:, :2], IMAGE, CAMERA, "object_points"),
        (POINTS, IMAGE[:-1], CAMERA, "one image point for each"),
        (POINTS, np.full((48, 2), np.nan), CAMERA, "image_points.*NaN"),
        (POINTS, "corners", CAMERA, "image_points"),
        (LINE, IMAGE, CAMERA, "one line"),
        (POINTS, LINE[:, :2], CAMERA, "one line"),
        (POINTS, IMAGE, None, "camera"),
        (POINTS, IMAGE, CAMERA.to_opencv(), "camera"),
        (POINTS[SIX] + np.outer([0, 40, 0, 0, 40, 0], [0, 0, 1.0]), IMAGE[SIX], CAMERA, "n >= 7"),
    ],
)
def test_unusable_views_are_named(method, points, image, camera, named):
    with pytest.raises(ValueError, match=named):
        method(points, image, camera)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"box": 0}, "box"),
        ({"box": 1}, "box"),
        ({"kappa1": "none"}, "kappa1"),
        ({"genes": "none"}, "genes"),
        ({"population_size": 0}, "population_size"),
    ],
)
def test_unusable_options_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        calibrate_genetic(POINTS, IMAGE, CAMERA, **options)


def test_swapped_axes_are_no_silent_success():
    """y measured upwards is a mirrored picture: no camera sees that, so the residual must be large or refused."""
    mirrored = IMAGE * [1, -1] + [0, 1199]
    try:
        run = calibrate_genetic(POINTS, mirrored, CAMERA, rng=0)
    except CalibrationError:
        return
    assert run.cam_from_object[0].rotation.as_matrix()[2, 2] < 0  # the board would be seen from behind


@pytest.mark.parametrize(
    ("points", "image", "named"),
    [
        ([], [], "object_points"),
        (POINTS, IMAGE, "object_points"),
        ([BOARD] * 2, [IMAGE], "2 views and image_points 1"),
        ([BOARD] * 2, [IMAGE, IMAGE[:-1]], "one image point for each"),
        ([BOARD] * 2, [IMAGE, np.full((48, 2), np.inf)], "image_points"),
        ([LINE] * 2, [IMAGE] * 2, "one line"),
        ("views", [IMAGE], "object_points"),
        ([BOARD], 3, "image_points"),
    ],
)
def test_unusable_lists_are_named(points, image, named):
    with pytest.raises(ValueError, match=named):
        calibrate_joint(points, image, CAMERA)
    with pytest.raises(ValueError, match=named):
        calibrate_zhang(points, image, CAMERA.image_size)


def test_unusable_options_of_many_views_are_named():
    views = five_views(0.0)
    with pytest.raises(ValueError, match="principal_point"):
        calibrate_joint(*views, CAMERA, principal_point="centre")
    with pytest.raises(ValueError, match="camera"):
        calibrate_joint(*views, CAMERA.to_opencv())
    with pytest.raises(ValueError, match="coefficients"):
        calibrate_zhang(*views, CAMERA.image_size, coefficients=("k1", "k4"))
    with pytest.raises(ValueError, match="image_size"):
        calibrate_zhang(*views, (0, 1200))
    bowl = BOARD + (np.sum((BOARD - BOARD.mean(axis=0)) ** 2, axis=1) / 500)[:, None] * [0, 0, 1.0]
    with pytest.raises(ValueError, match=r"object_points\[1\] leave the plane"):
        calibrate_zhang([BOARD, bowl, *[BOARD] * 3], views[1], CAMERA.image_size)
    with pytest.raises(ValueError, match="name"):
        calibrate_joint(*views, CAMERA).sigma("k9")
    with pytest.raises(ValueError, match="no covariance"):
        calibrate_tsai(*view(), CAMERA).sigma("focal_length")


@pytest.mark.parametrize(
    "calibrate",
    [
        lambda boards, images: calibrate_joint(boards, images, CAMERA),
        lambda boards, images: calibrate_zhang(boards, images, CAMERA.image_size),
        lambda boards, images: calibrate_tsai(boards[0], images[0], CAMERA),
    ],
)
def test_rows_and_columns_mixed_up_are_told(calibrate):
    boards, images = five_views(0.1)
    with pytest.raises(CalibrationError, match="order of object_points.*columns and rows"):
        calibrate([Checkerboard(6, 8, 29.0).object_points] * len(boards), images)


def test_the_view_in_another_order_is_named():
    boards, images = five_views(0.1)
    images[3] = images[3].reshape(6, 8, 2).transpose(1, 0, 2).reshape(-1, 2)
    with pytest.raises(CalibrationError, match="points of view 3 are no image of the plane"):
        calibrate_joint(boards, images, CAMERA)


def test_a_wrong_image_size_is_told():
    boards, images = five_views(0.1)
    with pytest.raises(ValueError, match=r"image_points\[0\] reach from .* all outside the image of width 100"):
        calibrate_zhang(boards, images, (100, 80))
    assert "size-swapped" in [flag.code for flag in calibrate_zhang(boards, images, CAMERA.image_size[::-1]).flags]
    cut = calibrate_joint(boards, images, replace(CAMERA, image_size=(1000, 760))).flags
    (outside,) = (flag for flag in cut if flag.code == "points-outside")
    assert "lie outside the image of 1000 x 760 px" in outside
    assert calibrate_zhang(boards, images, CAMERA.image_size).flags == ()
    assert calibrate_joint(boards, images, replace(CAMERA, image_size=(1, 1))).flags[1:] == ()


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"loss": "huber"},
        {"coefficients": ("k1", "k2", "p1", "p2", "k3"), "focal": "two"},
    ],
)
def test_folded_lenses_raise_no_linalgerror(options):
    """k1 = -0.4 at f = 500 px folds the image at 0.9 focal lengths from its centre; boards reach beyond."""
    camera, answered = OpenCVCamera([[500, 0, 799.5], [0, 500, 599.5], [0, 0, 1]], [-0.4, 0, 0, 0], (1600, 1200)), 0
    for seed in (0, *range(30, 40)):
        rng, images = np.random.default_rng(seed), []
        while len(images) < 7:
            turn = Rotation.from_rotvec(rng.normal(0, 0.45, 3))
            middle = np.array([rng.uniform(-110, 110), rng.uniform(-80, 80), rng.uniform(120, 300)])
            pose = RigidTransform.from_components(middle - turn.apply(BOARD.mean(axis=0)), turn)
            if pose.apply(BOARD)[:, 2].min() > 20:
                images.append(camera.project(BOARD, pose) + rng.normal(0, 0.1, (48, 2)))
        try:
            calibrate_joint([BOARD] * 7, images, replace(CAMERA, principal_point=(799.5, 599.5)), **options)
        except (CalibrationError, ValueError):
            continue
        answered += 1
    assert answered
