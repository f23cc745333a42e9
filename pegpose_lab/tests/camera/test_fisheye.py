"""The fisheye camera: exact both ways, in agreement with OpenCV, and refused where it has no image."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Checkerboard, FisheyeCamera, board_pose

MATRIX = np.array([[500.0, 0, 790], [0, 510, 610], [0, 0, 1]])
LENS = (0.05, -0.02, 0.01, -0.003)
CAMERA = FisheyeCamera(MATRIX, LENS, (1600, 1200))


def directions(number=400, widest=1.45):
    """Random directions (x/z, y/z) up to an angle to the axis, rad, and the one along it."""
    rng = np.random.default_rng(0)
    radius, turn = np.tan(rng.uniform(0, widest, number)), rng.uniform(0, 2 * np.pi, number)
    return np.vstack([np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]), [0, 0]])


def test_projection_is_opencvs():
    pose = RigidTransform.from_components([-90, -70, 120], Rotation.from_rotvec([0.4, -0.3, 0.2]))
    board = Checkerboard().object_points
    rotation, shift = pose.rotation.as_rotvec(), pose.translation
    theirs = cv2.fisheye.projectPoints(board[:, None], rotation[:, None], shift[:, None], MATRIX, np.array(LENS))[0]
    assert CAMERA.project(board, pose) == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


def test_both_ways_are_inverse():
    rays = directions()
    assert CAMERA.to_normalized(CAMERA.from_normalized(rays)) == pytest.approx(rays, rel=1e-9, abs=1e-12)


def test_derivatives_are_those_of_the_image():
    rays, step = directions(widest=1.2), 1e-6
    image, derivative = CAMERA.image_and_derivative(rays)
    for axis in range(2):
        shift = step * np.eye(2)[axis]
        numeric = (CAMERA.from_normalized(rays + shift) - CAMERA.from_normalized(rays - shift)) / (2 * step)
        assert derivative[:, :, axis] == pytest.approx(numeric, abs=1e-5)
    assert image[-1] == pytest.approx(CAMERA.principal_point)


def test_a_distortion_that_folds_gives_no_image_beyond_the_fold():
    camera = FisheyeCamera(MATRIX, (-0.3, 0, 0, 0), (1600, 1200))
    assert camera.widest_angle == pytest.approx(1 / np.sqrt(0.9))
    with pytest.raises(ValueError, match=r"rays up to 61\.0 deg .* folds at 60\.4 deg"):
        camera.from_normalized(np.tan([[np.radians(61), 0]]))
    with pytest.raises(ValueError, match=r"image_points: 1 of 2 have no ray within 60\.4 deg"):
        camera.to_normalized([[800, 600], [1500, 600]])


def test_rays_behind_the_camera_are_refused():
    with pytest.raises(ValueError, match=r"image_points: 1 of 1 have no ray within 90\.0 deg"):
        FisheyeCamera(MATRIX, np.zeros(4), (3000, 3000)).to_normalized([[2900.0, 610]])


@pytest.mark.parametrize("name, given", [("dist_coeffs", (MATRIX, np.zeros(5))), ("camera_matrix", (-MATRIX, LENS))])
def test_bad_fisheye_cameras_are_named(name, given):
    with pytest.raises(ValueError, match=name):
        FisheyeCamera(*given, (1600, 1200))


def test_a_scaled_camera_sees_the_scaled_image():
    rays = directions(50)
    half = CAMERA.scaled(0.5)
    assert half.image_size == (800, 600)
    assert half.from_normalized(rays) + 0.5 == pytest.approx((CAMERA.from_normalized(rays) + 0.5) / 2)


def test_it_has_no_perspective_equivalent():
    with pytest.raises(ValueError, match=r"cv2\.fisheye"):
        CAMERA.to_opencv()


def test_the_pose_of_a_board_at_the_edge_of_the_picture():
    board = Checkerboard().object_points
    pose = RigidTransform.from_components([60, -200, 100], Rotation.from_rotvec([0.7, -0.5, 0.2]))
    found = board_pose(board, CAMERA.project(board, pose), CAMERA)
    assert found.as_matrix() == pytest.approx(pose.as_matrix(), abs=1e-7)
    assert CAMERA.back_project(CAMERA.project(board, pose), pose) == pytest.approx(board, abs=1e-8)
