"""Cameras in the files of other tools: loaded where the content is known, else a sentence that says what is missing."""

import cv2
import numpy as np
import pytest
import yaml

from pegpose_lab import Calibration, FisheyeCamera, OpenCVCamera, calibrate_tsai
from pegpose_lab.camera import UNKNOWN_SIZE
from pegpose_lab.tests.calibration.views import CAMERA, view


@pytest.mark.parametrize("padding", [0, 1])
@pytest.mark.parametrize("count", [3, 4, 5, 8, 12])
@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_ros_models_have_their_number_of_coefficients(tmp_path, model, count, padding):
    """A longer list is read if what is beyond is 0: some tools always write 8 or 14 numbers."""
    calibrate_tsai(*view(), CAMERA).save(tmp_path / "camera.yaml", form="ros")
    info = yaml.safe_load((tmp_path / "camera.yaml").read_text())
    longer = {4: 5, 5: 8, 8: 12, 12: 14}.get(count, count) if padding else count
    data = [0.01] * count + [0.0] * (longer - count)
    info |= {"distortion_model": model, "distortion_coefficients": {"rows": 1, "cols": longer, "data": data}}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(info))
    if count == 3 or model == "plumb_bob" and count > 5:
        with pytest.raises(ValueError, match=r"camera\.yaml"):
            Calibration.load(tmp_path / "camera.yaml")
    else:
        found = Calibration.load(tmp_path / "camera.yaml").camera.dist_coeffs
        assert found.size in (count, 5) and np.all(found[:count] == 0.01) and not found[count:].any()


ROS = """image_width: 640
image_height: 480
camera_matrix:
  rows: 3
  cols: 3
  data: [500, 0, 320, 0, 510, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, 0.002, 0.3]
"""
MESSAGE = "header:\n  seq: 1\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\nD: [0.1, -0.2, 0.001, 0.002, 0.3]\n"


@pytest.mark.parametrize(
    "text",
    [
        "%YAML:1.0\n---\n" + ROS,
        "\ufeff" + ROS,
        MESSAGE + "K: [500, 0, 320, 0, 510, 240, 0, 0, 1]\n---\n",
        (MESSAGE + "K: [500, 0, 320, 0, 510, 240, 0, 0, 1]\n---\n") * 2,
        ROS.replace("distortion_model: plumb_bob\n", ""),
    ],
)
def test_relatives_of_camera_info_are_read(tmp_path, text):
    """As rtabmap writes it, with a byte-order mark, as a printed message (one or several), and without a model's name."""
    (tmp_path / "camera.txt").write_text(text, encoding="utf-8")
    camera = Calibration.load(tmp_path / "camera.txt").camera
    assert camera.image_size == (640, 480) and np.diag(camera.camera_matrix).tolist() == [500, 510, 1]
    assert camera.dist_coeffs.tolist() == [0.1, -0.2, 0.001, 0.002, 0.3]


@pytest.mark.parametrize("kind", [".yml", ".xml", ".json"])
@pytest.mark.parametrize(
    "keys", [("camera_matrix", "distortion_coefficients"), ("K", "D"), ("cameraMatrix", "distCoeffs")]
)
@pytest.mark.parametrize("size", [None, (640, 480)])
def test_files_of_opencvs_storage_are_read_in_all_its_forms(tmp_path, kind, keys, size):
    matrix, coefficients = np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]]), np.zeros((1, 14))
    coefficients[0, :2] = 0.1, -0.2
    storage = cv2.FileStorage(str(tmp_path / ("camera" + kind)), cv2.FILE_STORAGE_WRITE)
    for name, value in zip(("image_width", "image_height"), size or (), strict=False):
        storage.write(name, value)
    storage.write(keys[0], matrix)
    storage.write(keys[1], coefficients)
    storage.release()
    text = (tmp_path / ("camera" + kind)).read_bytes()
    for begin in (b"", b"\xef\xbb\xbf"):
        (tmp_path / "camera").write_bytes(begin + text)
        camera = Calibration.load(tmp_path / "camera").camera
        assert np.array_equal(camera.camera_matrix, matrix) and camera.dist_coeffs.tolist() == [0.1, -0.2, 0, 0, 0]
        assert camera.image_size == (size or UNKNOWN_SIZE)


@pytest.mark.parametrize(
    "text, reason",
    [
        (
            "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n",
            "no dist",
        ),
        (ROS.replace("plumb_bob", "thin_plate"), "distortion_model is 'thin_plate'; expected one of plumb_bob"),
        (ROS.replace("[500, 0,", "[500, 7,"), "camera_matrix has skew"),
        (ROS.replace("data: [500, ", "data: ["), "its camera matrix has 8 numbers; expected 9"),
        ("<?xml version='1.0'?><html/>", "OpenCV"),
        ("a: [1,\nb: 2\n", "it is no YAML in line 3"),
        ("image_width: 640\n", "it has no camera matrix"),
    ],
)
def test_what_a_file_lacks_is_told(tmp_path, text, reason):
    (tmp_path / "bad.yml").write_text(text)
    with pytest.raises(ValueError, match=reason):
        Calibration.load(tmp_path / "bad.yml")


@pytest.mark.parametrize("form", ["opencv", "ros"])
def test_fisheye_and_rational_cameras_come_back(tmp_path, form):
    matrix = [[500.0, 0, 320], [0, 510, 240], [0, 0, 1]]
    fisheye = FisheyeCamera(matrix, (0.1, -0.02, 0.003, 0.0004), (640, 480))
    rational = OpenCVCamera(matrix, (0.6, 0.05, 0.001, 0.002, 0.003, 0.9, 0.2, 0.01), (640, 480))
    for camera, model in ((fisheye, "equidistant"), (rational, "rational_polynomial")):
        Calibration(camera, [], []).save(tmp_path / "camera.yaml", form=form)
        back = Calibration.load(tmp_path / "camera.yaml").camera
        assert type(back) is type(camera) and back.image_size == camera.image_size
        assert np.array_equal(back.camera_matrix, matrix) and np.array_equal(back.dist_coeffs, camera.dist_coeffs)
        assert form == "opencv" or yaml.safe_load((tmp_path / "camera.yaml").read_text())["distortion_model"] == model


def test_opencv_reads_a_saved_fisheye_camera(tmp_path):
    Calibration(FisheyeCamera(np.eye(3), (0.1, 0, 0, 0), (640, 480)), [], []).save(tmp_path / "camera.yml")
    storage = cv2.FileStorage(str(tmp_path / "camera.yml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("fisheye_model").real() == 1
    assert storage.getNode("distortion_coefficients").mat().ravel() == pytest.approx([0.1, 0, 0, 0])
