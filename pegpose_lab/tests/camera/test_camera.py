"""Camera models: both ways exact, and in agreement with OpenCV."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import OpenCVCamera, TsaiCamera
from pegpose_lab.camera import distort_radius, max_undistorted_radius
from pegpose_lab.camera.tsai import OPENCV_LIMIT, OPENCV_PLAIN
from pegpose_lab.paper import paper_camera, paper_pose

POSE = RigidTransform.from_components([10.0, -20.0, 400.0], Rotation.from_euler("xyz", [12, -7, 30], degrees=True))


def pixel_grid(camera, step=25):
    width, height = camera.image_size
    x, y = np.meshgrid(
        np.append(np.arange(0, width, step), width - 1), np.append(np.arange(0, height, step), height - 1)
    )
    return np.column_stack([x.ravel(), y.ravel()]).astype(float)


def test_distortion_is_eq_3_written_out():
    """x_d + D_x = x_u with D_x = x_d k_1 r^2, r^2 = x_d^2 + y_d^2; then x_f = s_x x_d / d_x + c_x."""
    camera = TsaiCamera(8.0, (0.01, 0.012), (310.0, 240.0), (640, 480), kappa1=0.01, scale_x=1.02)
    x_d, y_d = 1.7, -0.9
    d_x = x_d * 0.01 * (x_d**2 + y_d**2)
    d_y = y_d * 0.01 * (x_d**2 + y_d**2)
    point = [[(x_d + d_x) * 50, (y_d + d_y) * 50, 8.0 * 50]]
    image_point = camera.project(point, RigidTransform.identity())
    assert image_point == pytest.approx(np.array([[1.02 * x_d / 0.01 + 310, y_d / 0.012 + 240]]), abs=1e-10)


@pytest.mark.parametrize("camera", [replace(paper_camera(), kappa1=1e-5, scale_x=1.02), paper_camera().to_opencv()])
@pytest.mark.parametrize("scale", [0.25, 1.5])
def test_a_scaled_camera_has_the_same_picture_in_other_pixels(camera, scale):
    """Pixels are squares around whole numbers: their corner (-0.5, -0.5) stays where it is."""
    scaled, points = camera.scaled(scale), np.array([[0.0, 0, 0], [20, -15, 3], [-30, 25, 9]])
    expected = scale * (camera.project(points, POSE) + 0.5) - 0.5
    assert scaled.project(points, POSE) == pytest.approx(expected, abs=1e-9)
    assert type(scaled) is type(camera) and scaled.image_size == tuple(
        round(scale * side) for side in camera.image_size
    )


@pytest.mark.parametrize("camera", [replace(paper_camera(), kappa1=1e-5, scale_x=1.02), paper_camera().to_opencv()])
def test_a_cropped_camera_has_a_part_of_the_picture(camera):
    part, points = camera.cropped(100, 40, 300, 200), np.array([[0.0, 0, 0], [20, -15, 3], [-30, 25, 9]])
    assert part.project(points, POSE) == pytest.approx(camera.project(points, POSE) - (100, 40), abs=1e-9)
    assert type(part) is type(camera) and part.image_size == (300, 200)


@pytest.mark.parametrize("kappa1", [1.097e-5, 0.0, 1e-12, -1e-12, 1e-3, -2e-4, 0.3])
def test_pixels_return_to_themselves(kappa1):
    reference = paper_camera()
    camera = TsaiCamera(47.95, reference.pixel_pitch, reference.principal_point, (1600, 1200), kappa1)
    pixels = pixel_grid(camera)
    assert np.abs(camera.from_normalized(camera.to_normalized(pixels)) - pixels).max() < 1e-12 * 1600


@given(st.floats(-1, 1), st.floats(1e-6, 0.999))
@settings(deadline=None)
def test_closed_form_is_the_root_that_bisection_finds(kappa1, fraction):
    largest = min(float(max_undistorted_radius(kappa1)), 100.0)
    radius = fraction * largest
    end = 1 / np.sqrt(-3 * kappa1) if kappa1 < 0 else radius
    expected = brentq(lambda r: r * (1 + kappa1 * r * r) - radius, 0, min(end, 1e9), xtol=1e-300, rtol=1e-15)
    slope = 1 + 3 * kappa1 * expected**2
    assert abs(distort_radius(radius, kappa1) - expected) <= 1e-13 * radius / max(slope, 1e-3)


def test_no_image_beyond_the_turning_point():
    camera = TsaiCamera(10.0, (0.01, 0.01), (0, 0), (100, 100), kappa1=-0.01)
    assert max_undistorted_radius(-0.01) == pytest.approx(2 / (3 * np.sqrt(0.03)))
    with pytest.raises(ValueError, match="have no image"):
        camera.project([[10.0, 0, 10]], RigidTransform.identity())


@given(st.lists(st.tuples(st.floats(-80, 80), st.floats(-60, 60)), min_size=1, max_size=20), st.floats(-30, 30))
@settings(deadline=None, max_examples=50)
def test_back_projection_undoes_projection(points, z):
    points = np.array([(x, y, z) for x, y in points])
    camera = paper_camera()
    assert camera.back_project(camera.project(points, POSE), POSE, z=z) == pytest.approx(points, abs=1e-9)


def test_opencv_model_agrees_over_the_picture():
    camera = paper_camera()
    converted = camera.to_opencv()
    pixels = pixel_grid(camera)
    assert np.abs(converted.from_normalized(camera.to_normalized(pixels)) - pixels).max() < 1e-4
    assert converted.dist_coeffs[0] == pytest.approx(-camera.kappa1 * camera.focal_length**2, rel=1e-3)
    points = camera.back_project(pixels, paper_pose())
    assert np.abs(converted.project(points, paper_pose()) - camera.project(points, paper_pose())).max() < 1e-4
    assert np.abs(converted.back_project(pixels, paper_pose()) - points).max() < 1e-4


@pytest.mark.parametrize("kappa1", [1.1e-5, -1e-4, -2e-4, 1e-4, 5e-4, -1e-3, 1e-3, 5e-3, 0.05])
@pytest.mark.parametrize("change", [{}, {"principal_point": (500.0, 700.0), "scale_x": 1.04}])
def test_opencv_model_agrees_or_is_refused(kappa1, change):
    """Within the stated limit over the picture, and back; what OpenCV cannot describe is refused in words."""
    camera = replace(paper_camera(), kappa1=kappa1, **change)
    try:
        converted = camera.to_opencv()
    except ValueError as error:
        assert abs(kappa1) > 1e-4 and re.search(r"folds|px off; the limit is 0\.05 px", str(error))
        return
    pixels = pixel_grid(camera)
    directions = camera.to_normalized(pixels)
    error = np.abs(converted.from_normalized(directions) - pixels).max()
    assert error <= (OPENCV_PLAIN if converted.dist_coeffs.size == 5 else OPENCV_LIMIT)
    if kappa1 > 0:  # of a picture that almost folds, Newton's method may find the far side
        assert np.abs(camera.from_normalized(converted.to_normalized(pixels)) - pixels).max() <= 2 * OPENCV_LIMIT


def test_weak_distortion_is_refused_by_no_one():
    for kappa1 in (0.0, 5e-5, -5e-5, -1e-4, 1e-4, 5e-4):
        assert replace(paper_camera(), kappa1=kappa1).to_opencv().dist_coeffs.size in (5, 8)


def test_opencv_camera_is_opencv():
    matrix = np.array([[600.0, 0, 310], [0, 590, 250], [0, 0, 1]])
    coefficients = np.array([-0.3, 0.1, 0.002, -0.001, 0.05])
    points = np.random.default_rng(3).uniform(-80, 80, (50, 3))
    expected = cv2.projectPoints(points, POSE.rotation.as_rotvec(), POSE.translation, matrix, coefficients)[0].reshape(
        -1, 2
    )
    camera = OpenCVCamera(matrix, coefficients, (640, 480))
    assert camera.project(points, POSE) == pytest.approx(expected, abs=1e-9)
    normalized = camera.to_normalized(expected)
    assert camera.from_normalized(normalized) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("kappa1", [0.0, 1e-5, 5e-4, -1e-4])
def test_derivative_of_the_image_by_the_direction(kappa1):
    camera = replace(paper_camera(), kappa1=kappa1, scale_x=1.02)
    directions = camera.to_normalized(pixel_grid(camera, 200))
    points, derivative = camera.image_and_derivative(directions)
    np.testing.assert_allclose(points, camera.from_normalized(directions), atol=1e-10)
    for k, step in enumerate(1e-4 * np.eye(2)):
        far, near = (
            camera.from_normalized(directions + h * step) - camera.from_normalized(directions - h * step)
            for h in (2, 1)
        )
        np.testing.assert_allclose(derivative[:, :, k], (8 * near - far) / 12e-4, atol=1e-5)


def test_opencv_camera_inverts_strong_distortion_where_a_fixed_point_fails():
    camera = OpenCVCamera(
        np.diag([500.0, 500, 1]) + [[0, 0, 320], [0, 0, 240], [0, 0, 0]], [0.9, 0.5, 0, 0, 0], (640, 480)
    )
    directions = np.array([[0.9, 0.6], [-0.8, 0.7], [0.1, -0.9]])
    assert camera.to_normalized(camera.from_normalized(directions)) == pytest.approx(directions, abs=1e-9)


def test_opencv_camera_refuses_pixels_without_a_preimage():
    camera = OpenCVCamera(
        np.diag([500.0, 500, 1]) + [[0, 0, 320], [0, 0, 240], [0, 0, 0]], [-0.5, 0, 0, 0, 0], (640, 480)
    )
    with pytest.raises(ValueError, match="cannot be inverted"):
        camera.to_normalized([[5000.0, 240.0]])


@pytest.mark.parametrize(
    "change, name",
    [
        ({"focal_length": 0}, "focal_length"),
        ({"focal_length": np.nan}, "focal_length"),
        ({"pixel_pitch": (1.0, -1.0)}, "pixel_pitch"),
        ({"pixel_pitch": 0.1}, "pixel_pitch"),
        ({"principal_point": (np.inf, 0)}, "principal_point"),
        ({"image_size": (640.5, 480)}, "image_size"),
        ({"kappa1": "strong"}, "kappa1"),
        ({"scale_x": -1}, "scale_x"),
    ],
)
def test_bad_parameters_are_named(change, name):
    with pytest.raises(ValueError, match=name):
        TsaiCamera(**({"focal_length": 10.0} | change))


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.ones((3, 2)), [[np.nan, 0, 1]], "points", None])
def test_bad_points_are_named(points):
    with pytest.raises(ValueError, match="object_points"):
        paper_camera().project(points, POSE)


def test_points_behind_the_camera_and_rays_off_the_plane():
    camera = paper_camera()
    with pytest.raises(ValueError, match="1 of 2 lie behind the camera"):
        camera.project([[0.0, 0, 0], [0, 0, -500]], POSE)
    with pytest.raises(ValueError, match="do not meet the plane"):
        camera.back_project([[800.0, 600.0]], POSE, z=-5000.0)
    edge_on = RigidTransform.from_components([0, 50, 400], Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]]))
    with pytest.raises(ValueError, match="do not meet the plane"):
        camera.back_project([camera.principal_point], edge_on)
    with pytest.raises(ValueError, match="RigidTransform"):
        camera.project([[0.0, 0, 0]], np.eye(4))


def test_a_folding_picture_has_no_opencv_model():
    with pytest.raises(ValueError, match="folds"):
        TsaiCamera(50.0, (0.04, 0.04), (800, 600), (1600, 1200), kappa1=-1e-3).to_opencv()


@pytest.mark.parametrize(
    "matrix, coefficients, name",
    [
        (np.eye(2), [0] * 5, "camera_matrix"),
        (-np.eye(3), [0] * 5, "camera_matrix"),
        (np.eye(3), [0] * 3, "dist_coeffs"),
    ],
)
def test_bad_opencv_cameras_are_named(matrix, coefficients, name):
    with pytest.raises(ValueError, match=name):
        OpenCVCamera(matrix, coefficients, (640, 480))


@pytest.mark.parametrize("place, value", [((0, 1), 50.0), ((1, 0), 40.0), ((0, 1), 1e-6)])
def test_skew_is_refused_for_opencv_ignores_it(place, value):
    matrix = np.array([[1000.0, 0, 500], [0, 1000, 400], [0, 0, 1]])
    matrix[place] = value
    with pytest.raises(ValueError, match="camera_matrix has skew"):
        OpenCVCamera(matrix, np.zeros(5), (1000, 800))


def test_rounding_is_no_skew():
    camera = OpenCVCamera([[1000.0, 1e-13, 500], [0, 1000, 400], [0, 0, 1]], np.zeros(5), (1000, 800))
    assert camera.camera_matrix[0, 1] == 0


@pytest.mark.parametrize("size", ["ab", 640, (640,), (640, "480"), (640.5, 480), (0, 480), None, (True, True)])
def test_a_size_is_two_whole_numbers(size):
    with pytest.raises(ValueError, match="image_size"):
        OpenCVCamera(np.eye(3), np.zeros(5), size)


def test_sizes_become_ints():
    assert TsaiCamera(1.0, image_size=np.array([640.0, 480.0])).image_size == (640, 480)
    assert all(type(value) is int for value in TsaiCamera(1.0, image_size=np.array([640.0, 480.0])).image_size)
