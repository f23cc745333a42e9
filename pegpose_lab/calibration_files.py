"""Calibrations as files: OpenCV's FileStorage YAML with all that is known, ROS's camera_info with the camera alone.

Only numbers and text are read from either, and nothing in a file is executed.
"""

import cv2
import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import RigidTransform, Rotation

from .camera import OpenCVCamera, TsaiCamera
from .checks import as_points
from .results import replacing

FILE_FORMAT = "pegpose_lab calibration 1"
ROS_MODELS = {5: "plumb_bob", 8: "rational_polynomial"}
"""ROS's names for OpenCV's distortion, by the number of coefficients."""


def write_calibration(path, calibration, form):
    """Write what `Calibration.save` documents."""
    if form not in ("opencv", "ros"):
        raise ValueError(f"form is {form!r}; expected 'opencv' or 'ros'")
    text = _as_storage(calibration) if form == "opencv" else _as_camera_info(calibration.camera)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_calibration(path):
    """Return the fields of the `Calibration` of a file as a dictionary; raises as `Calibration.load` documents."""
    with open(path, encoding="utf-8", errors="replace") as file:
        text = file.read()
    try:
        return _from_nodes(_Nodes(text)) if text.startswith("%YAML") else _from_camera_info(text)
    except (cv2.error, yaml.YAMLError, SystemError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is not a calibration that Calibration.save wrote: {error}") from error


def _as_camera_info(camera):
    """ROS's camera_info of a camera, as its camera_calibration package writes it."""
    camera = camera.to_opencv() if isinstance(camera, TsaiCamera) else camera
    coefficients = np.resize(camera.dist_coeffs, max(camera.dist_coeffs.size, 5))
    coefficients[camera.dist_coeffs.size :] = 0
    if coefficients.size not in ROS_MODELS:
        raise ValueError(f"camera has {coefficients.size} distortion coefficients; ROS names models of 5 or 8")
    width, height = camera.image_size
    projection = np.column_stack([camera.camera_matrix, np.zeros(3)])
    return yaml.safe_dump(
        {
            "image_width": width,
            "image_height": height,
            "camera_name": "pegpose_lab",
            "camera_matrix": _as_matrix(camera.camera_matrix),
            "distortion_model": ROS_MODELS[coefficients.size],
            "distortion_coefficients": _as_matrix(coefficients[None]),
            "rectification_matrix": _as_matrix(np.eye(3)),
            "projection_matrix": _as_matrix(projection),
        },
        sort_keys=False,
        default_flow_style=None,
    )


def _as_matrix(array):
    return {"rows": len(array), "cols": array.shape[1], "data": array.ravel().tolist()}


def _from_camera_info(text):
    """The fields of a `Calibration` that has a camera only."""
    info = yaml.safe_load(text)
    if not isinstance(info, dict) or info.get("distortion_model") not in ROS_MODELS.values():
        raise KeyError("it is neither an OpenCV FileStorage nor a ROS camera_info of a known distortion_model")
    matrices = [np.array(info[name]["data"], dtype=float) for name in ("camera_matrix", "distortion_coefficients")]
    camera = OpenCVCamera(matrices[0].reshape(3, 3), matrices[1], (info["image_width"], info["image_height"]))
    return {"camera": camera, "cam_from_object": [], "residuals": []}


def _as_storage(calibration):
    """OpenCV's FileStorage text of a calibration."""
    storage = cv2.FileStorage(".yml", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    for name, value in _as_nodes(calibration).items():
        storage.write(name, value)
    return storage.releaseAndGetString()


def _as_nodes(calibration):
    """What `Calibration.save` writes: names and values, in order."""
    camera, poses = calibration.camera, calibration.cam_from_object
    nodes = {"format": FILE_FORMAT, "camera_model": type(camera).__name__}
    nodes |= dict(zip(("image_width", "image_height"), camera.image_size, strict=True))
    if isinstance(camera, TsaiCamera):
        for name in ("focal_length", "kappa1", "scale_x"):
            nodes[name] = getattr(camera, name)
        for name in ("pixel_pitch", "principal_point"):
            nodes[name] = np.array([getattr(camera, name)])
        try:
            camera = camera.to_opencv()
        except ValueError:  # a distortion that no OpenCV camera describes
            camera = None
    if camera is not None:
        nodes |= {"camera_matrix": camera.camera_matrix, "distortion_coefficients": camera.dist_coeffs[None]}
    vectors = [np.concatenate([pose.rotation.as_rotvec(), pose.translation]) for pose in poses]
    nodes |= {"extrinsic_parameters": np.array(vectors), "avg_reprojection_error": calibration.rms}
    nodes["points_per_view"] = np.array([[float(len(residuals)) for residuals in calibration.residuals]])
    nodes["residuals"] = np.concatenate(calibration.residuals)
    nodes["flags"] = list(calibration.flags)
    for name in ("history", "covariance"):
        table = getattr(calibration, name)
        if table is not None:
            nodes |= {f"{name}_columns": list(table.columns), name: table.to_numpy(np.float64)}
    return nodes


class _Nodes:
    """Numbers, matrices and texts of a FileStorage text by name; KeyError where one is missing or not such."""

    def __init__(self, text):
        self.storage = cv2.FileStorage(text, cv2.FileStorage_READ | cv2.FileStorage_MEMORY)

    def __contains__(self, name):
        return not self.storage.getNode(name).empty()

    def _get(self, name, wanted):
        node = self.storage.getNode(name)
        if node.empty() or not wanted(node):
            raise KeyError(f"{name} is missing or of another kind")
        return node

    def number(self, name):
        return self._get(name, lambda node: node.isInt() or node.isReal()).real()

    def text(self, name):
        return self._get(name, lambda node: node.isString()).string()

    def texts(self, name):
        node = self.storage.getNode(name)
        return tuple(node.at(index).string() for index in range(node.size()))

    def matrix(self, name, columns):
        array = self._get(name, lambda node: node.isMap()).mat()
        return as_points(array, array.shape[-1] if columns is None else columns, name)

    def table(self, name):
        if name not in self:
            return None
        columns = self.texts(f"{name}_columns")
        return pd.DataFrame(self.matrix(name, len(columns)), columns=list(columns))


def _from_nodes(nodes):
    """The fields of the `Calibration` of a file."""
    if nodes.text("format") != FILE_FORMAT:
        raise ValueError(f"format is {nodes.text('format')!r}; expected {FILE_FORMAT!r}")
    size = nodes.number("image_width"), nodes.number("image_height")
    model = nodes.text("camera_model")
    if model not in (TsaiCamera.__name__, OpenCVCamera.__name__):
        raise KeyError(f"camera_model is {model!r}")
    if model == TsaiCamera.__name__:
        numbers = {name: nodes.number(name) for name in ("focal_length", "kappa1", "scale_x")}
        pairs = {name: tuple(nodes.matrix(name, 2)[0]) for name in ("pixel_pitch", "principal_point")}
        camera = TsaiCamera(image_size=size, **numbers, **pairs)
    else:
        coefficients = nodes.matrix("distortion_coefficients", None)[0]
        camera = OpenCVCamera(nodes.matrix("camera_matrix", 3), coefficients, size)
    poses = [
        RigidTransform.from_components(row[3:], Rotation.from_rotvec(row[:3]))
        for row in nodes.matrix("extrinsic_parameters", 6)
    ]
    ends = np.cumsum(nodes.matrix("points_per_view", len(poses))[0]).astype(int)
    residuals = np.split(nodes.matrix("residuals", 2), ends[:-1])
    history, covariance = nodes.table("history"), nodes.table("covariance")
    if history is not None:
        history = history.astype({"generation": int, "evaluations": int})
    if covariance is not None:
        covariance.index = covariance.columns
    return {
        "camera": camera,
        "cam_from_object": poses,
        "residuals": residuals,
        "flags": nodes.texts("flags"),
        "history": history,
        "covariance": covariance,
    }
