"""The linear solution of many images at once, against that of one."""

import numpy as np
import pytest

from pegpose_lab import CalibrationError, calibrate_tsai
from pegpose_lab.calibration import solve_images
from pegpose_lab.paper import paper_experiment

TRUTH = paper_experiment()
BOARD = TRUTH.board.object_points
WORLD = TRUTH.world_from_board.apply(BOARD)


@pytest.mark.parametrize("view", range(5))
@pytest.mark.parametrize("noise", [0.0, 0.02, 1.0])
def test_many_images_are_solved_as_one_is(view, noise):
    rng = np.random.default_rng(view)
    exact = TRUTH.camera.project(BOARD, TRUTH.cam_from_boards[view])
    images = exact + noise * rng.standard_normal((6, *exact.shape))
    found = np.transpose(solve_images(WORLD, images, TRUTH.camera))
    for (focal_length, t_z, distance), image in zip(found, images, strict=True):
        one = calibrate_tsai(WORLD, image, TRUTH.camera)
        expected = one.camera.focal_length, one.cam_from_object[0].translation[2], one.mean_distance
        assert (focal_length, t_z, distance) == pytest.approx(expected, rel=1e-8)


def test_exact_points_of_a_camera_without_distortion_give_it_back():
    pose = TRUTH.cam_from_boards[1] * TRUTH.world_from_board.inv()
    pinhole = TRUTH.camera.__class__(40.0, (0.04, 0.05), (800, 600), (1600, 1200))
    (focal_length,), (t_z,), (distance,) = solve_images(WORLD, [pinhole.project(WORLD, pose)], pinhole)
    assert (focal_length, t_z) == pytest.approx((40.0, pose.translation[2]), rel=1e-10)
    assert distance < 1e-9


def test_what_is_no_board_or_no_stack_of_images_is_refused():
    image = TRUTH.camera.project(BOARD, TRUTH.cam_from_boards[0])
    with pytest.raises(ValueError, match=r"object_points have z from 0 to 1 mm; expected z = 0"):
        solve_images(WORLD + np.eye(48, 3)[:, ::-1], [image], TRUTH.camera)
    with pytest.raises(ValueError, match=r"image_points has shape \(48, 2\); expected \(m, 48, 2\)"):
        solve_images(WORLD, image, TRUTH.camera)
    with pytest.raises(CalibrationError, match="no linear solution"):
        solve_images(WORLD, [np.random.default_rng(0).permutation(image)], TRUTH.camera)
