"""What is known of a camera before it is calibrated, and that a calibration uses nothing else of a camera."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from pegpose_lab import (
    OpenCVCamera,
    Sensor,
    TsaiCamera,
    calibrate_dlt,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    optimum_in_box,
    profile_focal_length,
)
from pegpose_lab.calibration import repeat_calibration, solve_images
from pegpose_lab.camera import as_sensor
from pegpose_lab.camera.tsai import OPENCV_LIMIT
from pegpose_lab.paper import paper_pose
from pegpose_lab.tests.calibration.views import CAMERA, five_views, view

POINTS, IMAGE = view(noise=0.1)
BOARDS, IMAGES = five_views(0.1)
CALIBRATIONS = {
    "tsai": lambda camera: [calibrate_tsai(POINTS, IMAGE, camera)],
    "genetic": lambda camera: [calibrate_genetic(POINTS, IMAGE, camera, rng=0, generations=3)],
    "repeated": lambda camera: repeat_calibration(POINTS, IMAGE, camera, [0, 1], generations=3),
    "oracle": lambda camera: [optimum_in_box(POINTS, IMAGE, camera)],
    "dlt": lambda camera: [calibrate_dlt(POINTS, IMAGE, camera)],
    "joint": lambda camera: [calibrate_joint(BOARDS, IMAGES, camera)],
    "joint, held centre": lambda camera: [calibrate_joint(BOARDS, IMAGES, camera, principal_point="fixed")],
    "joint, OpenCV's model": lambda camera: [calibrate_joint(BOARDS, IMAGES, camera, coefficients=("k1",))],
}


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_a_sensor_does_for_every_calibration(name):
    """A camera with a wrong f and kappa1 gives the same bits."""
    calibrate = CALIBRATIONS[name]
    known = calibrate(CAMERA.sensor)
    for ours, theirs in zip(known, calibrate(replace(CAMERA, focal_length=1.0, kappa1=-0.1)), strict=True):
        assert repr(ours.camera) == repr(theirs.camera)
        assert np.array_equal(np.concatenate(ours.residuals), np.concatenate(theirs.residuals))


def test_a_sensor_does_for_what_returns_numbers():
    other = replace(CAMERA, focal_length=1.0, kappa1=-0.1)
    assert profile_focal_length([POINTS], [IMAGE], CAMERA.sensor) == profile_focal_length([POINTS], [IMAGE], other)
    flat = POINTS - [0, 0, POINTS[0, 2]]
    ours, theirs = (solve_images(flat, IMAGE[None], camera) for camera in (CAMERA.sensor, other))
    assert np.array_equal(ours, theirs)


def test_sensor_and_camera_hold_the_same():
    sensor = Sensor((0.01, 0.012), (310, 240.5), (640, 480), scale_x=1.02)
    camera = sensor.camera(8.0, kappa1=0.001)
    assert camera == TsaiCamera(8.0, (0.01, 0.012), (310, 240.5), (640, 480), 0.001, 1.02)
    assert camera.sensor == sensor == as_sensor(camera) == as_sensor(sensor)
    pixels = np.array([[0.0, 0.0], [639.0, 479.0]])
    assert np.array_equal(sensor.to_sensor(pixels), camera.to_sensor(pixels))
    assert sensor.to_image(sensor.to_sensor(pixels)) == pytest.approx(pixels)
    assert not hasattr(sensor, "focal_length")
    with pytest.raises(FrozenInstanceError):
        sensor.scale_x = 1.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("pixel_pitch", (0, 1)),
        ("pixel_pitch", (1, 1, 1)),
        ("principal_point", (np.nan, 0)),
        ("image_size", (640.5, 480)),
        ("image_size", 640),
        ("scale_x", 0.0),
    ],
)
def test_unusable_sensors_are_refused(name, value):
    good = {"pixel_pitch": (1, 1), "principal_point": (0, 0), "image_size": (640, 480)}
    with pytest.raises(ValueError, match=name):
        Sensor(**good | {name: value})


@pytest.mark.parametrize("camera", [CAMERA.to_opencv(), None, (640, 480)])
def test_nothing_else_is_a_sensor(camera):
    with pytest.raises(ValueError, match="expected a Sensor or a TsaiCamera"):
        calibrate_joint(BOARDS, IMAGES, camera)


@pytest.mark.parametrize("camera", [CAMERA, CAMERA.to_opencv(), replace(CAMERA, kappa1=2e-4).to_opencv()])
def test_both_cameras_have_one_interface(camera):
    """Nobody has to ask which one it is."""
    points, _ = view()
    pose = paper_pose()
    image = camera.project(points, pose)
    assert camera.back_project(image, pose) == pytest.approx(points, abs=1e-7)
    assert camera.to_opencv().project(points, pose) == pytest.approx(image, abs=OPENCV_LIMIT)
    assert camera.principal_point == (camera.parameters["c_x"], camera.parameters["c_y"]) == CAMERA.principal_point
    assert all(type(value) is float for value in camera.parameters.values())


def test_the_parameters_have_the_names_of_the_covariance():
    models = {"paper": None, "OpenCV": ("k1", "k2", "p1", "p2", "k3")}
    for coefficients in models.values():
        run = calibrate_joint(BOARDS, IMAGES, CAMERA.sensor, focal="two", coefficients=coefficients)
        names = [name for name in run.covariance.index if name[-1] not in "01234" or name in run.camera.parameters]
        assert set(names) == set(run.camera.parameters) and names[0] == next(iter(run.camera.parameters))
    assert CAMERA.parameters["kappa1"] == CAMERA.kappa1 and CAMERA.parameters["scale_x"] == 1.0
    wide = OpenCVCamera(np.diag([800.0, 700.0, 1.0]), np.arange(14) / 1e3, (640, 480))
    assert wide.parameters["f_y"] == 700 and wide.parameters["k3"] == 0.004 and wide.parameters["tau_y"] == 0.013
    assert wide.to_opencv() is wide
