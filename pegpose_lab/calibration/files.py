"""Calibrations as files: OpenCV's FileStorage YAML with everything, ROS's camera_info with the camera only.

Only numbers and text are read from either, and nothing in a file is executed.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from urllib.parse import quote, unquote

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import OpenCVCamera, TsaiCamera
from ..checks import Flag, as_choice, as_points
from ..files import replacing

if TYPE_CHECKING:
    from os import PathLike
    from typing import Any

    from .result import Calibration

FILE_FORMAT = "pegpose_lab calibration 1"
ROS_MODELS = {5: "plumb_bob", 8: "rational_polynomial"}
"""ROS's names for OpenCV's distortion, by the number of coefficients."""

UNSAFE = re.compile(r"""%(?=[0-9A-Fa-f]{2}|\Z)|[^ -~]|["\\]|\A[ ']| \Z""")
"""Characters that FileStorage does not read back as they were, or that would look like an escape: written as %XX."""

LONGEST_TEXT = 1000
"""Longest piece of a text: FileStorage cuts texts at 4096 characters, so longer ones are written in pieces, and each
piece except the last ends with %."""


def write_calibration(path: str | PathLike[str], calibration: Calibration, form: str) -> None:
    """Write a calibration as `Calibration.save` documents."""
    form = as_choice(form, "form", ("opencv", "ros"))
    text = _as_storage(calibration) if form == "opencv" else _as_camera_info(calibration.camera)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_calibration(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the fields of a file's `Calibration` as a dictionary; raises as `Calibration.load` documents."""
    import yaml

    with open(path, encoding="utf-8", errors="replace") as file:
        text = file.read()
    try:
        return _from_storage(_Nodes(text)) if text.startswith("%YAML") else _from_camera_info(text)
    except (cv2.error, yaml.YAMLError, SystemError, RecursionError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is not a calibration that Calibration.save, OpenCV or ROS wrote: {error}") from error


def _as_camera_info(camera):
    """ROS's camera_info of a camera, as ROS's camera_calibration package writes it."""
    camera = camera.to_opencv()
    coefficients = np.resize(camera.dist_coeffs, max(camera.dist_coeffs.size, 5))
    coefficients[camera.dist_coeffs.size :] = 0
    if coefficients.size not in ROS_MODELS:
        raise ValueError(f"camera has {coefficients.size} distortion coefficients; ROS names models of 5 or 8")
    width, height = camera.image_size
    projection = np.column_stack([camera.camera_matrix, np.zeros(3)])
    import yaml

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
    """The fields of a `Calibration` with only a camera."""
    import yaml

    info = yaml.safe_load(text)
    if not isinstance(info, dict) or info.get("distortion_model") not in ROS_MODELS.values():
        raise KeyError("it is neither an OpenCV FileStorage nor a ROS camera_info of a known distortion_model")
    matrix, coefficients = (
        np.array(info[name]["data"], dtype=float) for name in ("camera_matrix", "distortion_coefficients")
    )
    if info["distortion_model"] != ROS_MODELS.get(max(coefficients.size, 5)):  # a plumb_bob may lack k3
        raise ValueError(f"distortion_model is {info['distortion_model']} with {coefficients.size} coefficients")
    camera = OpenCVCamera(matrix.reshape(3, 3), coefficients, (info["image_width"], info["image_height"]))
    return {"camera": camera, "cam_from_object": [], "residuals": []}


def _as_storage(calibration):
    """OpenCV's FileStorage text of a calibration."""
    storage = cv2.FileStorage(".yml", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    for name, value in _as_nodes(calibration).items():
        storage.write(name, value)
    return storage.releaseAndGetString()


def _as_nodes(calibration):
    """The names and values that `Calibration.save` writes, in order."""
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
    if poses:
        vectors = [np.concatenate([pose.rotation.as_rotvec(), pose.translation]) for pose in poses]
        nodes["extrinsic_parameters"] = np.array(vectors)
    if calibration.residuals:
        nodes["avg_reprojection_error"] = calibration.rms
        nodes["points_per_view"] = np.array([[float(len(residuals)) for residuals in calibration.residuals]])
        nodes["residuals"] = np.concatenate(calibration.residuals)
    if calibration.n_parameters is not None:
        nodes["n_parameters"] = calibration.n_parameters
    if calibration.freedom is not None:
        nodes["freedom"] = calibration.freedom
    nodes["flags"] = list(_as_texts(calibration.flags))
    nodes["flag_codes"] = list(_as_texts(getattr(flag, "code", "unknown") for flag in calibration.flags))
    same = calibration.classical_covariance is calibration.covariance
    for name in ("history", "covariance", *["classical_covariance"] * (not same)):
        table = getattr(calibration, name)
        if table is not None:
            nodes |= {f"{name}_columns": list(table.columns), name: table.to_numpy(np.float64)}
    return nodes


def _as_texts(flags):
    """Flags as texts that FileStorage reads back unchanged (see `UNSAFE` and `LONGEST_TEXT`)."""
    for flag in flags:
        text = UNSAFE.sub(lambda found: quote(found[0], safe="", errors="surrogatepass"), flag)
        while len(text) > LONGEST_TEXT:
            yield text[:LONGEST_TEXT] + "%"
            text = text[LONGEST_TEXT:]
        yield text


def _from_texts(texts):
    """The flags that `_as_texts` wrote."""
    flags, begun = [], ""
    for text in texts:
        if text.endswith("%"):
            begun += text[:-1]
        else:
            flags.append(unquote(begun + text, errors="surrogatepass"))
            begun = ""
    return tuple(flags)


class _Nodes:
    """Numbers, matrices and texts of a FileStorage text by name; KeyError if one is missing or of another kind."""

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
        import pandas as pd

        columns = self.texts(f"{name}_columns")
        return pd.DataFrame(self.matrix(name, len(columns)), columns=list(columns))


def _from_storage(nodes):
    """The fields of a FileStorage's `Calibration`; one of OpenCV's own files gives only the camera."""
    if "format" in nodes or "camera_model" in nodes or "camera_matrix" not in nodes:
        return _from_nodes(nodes)
    if "fisheye_model" in nodes and nodes.number("fisheye_model") != 0:
        raise ValueError("it is of a fisheye camera")
    return {"camera": _opencv_camera(nodes), "cam_from_object": [], "residuals": []}


def _opencv_camera(nodes):
    coefficients = nodes.matrix("distortion_coefficients", None)
    if 1 not in coefficients.shape:
        raise ValueError(f"distortion_coefficients has shape {coefficients.shape}; expected a row or a column")
    size = nodes.number("image_width"), nodes.number("image_height")
    return OpenCVCamera(nodes.matrix("camera_matrix", 3), coefficients.ravel(), size)


def _tsai_camera(nodes):
    numbers = {name: nodes.number(name) for name in ("focal_length", "kappa1", "scale_x")}
    pairs = {name: tuple(nodes.matrix(name, 2)[0]) for name in ("pixel_pitch", "principal_point")}
    return TsaiCamera(image_size=(nodes.number("image_width"), nodes.number("image_height")), **numbers, **pairs)


def _from_nodes(nodes):
    """The fields of the `Calibration` in a file that we wrote."""
    if nodes.text("format") != FILE_FORMAT:
        raise ValueError(f"format is {nodes.text('format')!r}; expected {FILE_FORMAT!r}")
    cameras = {TsaiCamera.__name__: _tsai_camera, OpenCVCamera.__name__: _opencv_camera}
    model = nodes.text("camera_model")
    if model not in cameras:
        raise KeyError(f"camera_model is {model!r}")
    poses = _poses(nodes) if "extrinsic_parameters" in nodes else []
    history, covariance, classical = map(nodes.table, ("history", "covariance", "classical_covariance"))
    if history is not None:
        history = history.astype({"generation": int, "evaluations": int})
    for table in (covariance, classical):
        if table is not None:
            table.index = table.columns
    return {
        "camera": cameras[model](nodes),
        "cam_from_object": poses,
        "residuals": _residuals(nodes, len(poses)) if "residuals" in nodes or "points_per_view" in nodes else [],
        "flags": _flags(nodes),
        "history": history,
        "covariance": covariance,
        "n_parameters": int(nodes.number("n_parameters")) if "n_parameters" in nodes else None,
        "classical_covariance": covariance if classical is None else classical,  # written only if it differs
        "freedom": int(nodes.number("freedom")) if "freedom" in nodes else None,
    }


def _flags(nodes):
    """The flags; a file of an earlier version has no codes for them."""
    texts = _from_texts(nodes.texts("flags"))
    codes = _from_texts(nodes.texts("flag_codes")) if "flag_codes" in nodes else ("unknown",) * len(texts)
    if len(codes) != len(texts):
        raise ValueError(f"flag_codes has {len(codes)} codes; expected one for each of {len(texts)} flags")
    return tuple(map(Flag, codes, texts))


def _poses(nodes):
    return [
        RigidTransform.from_components(row[3:], Rotation.from_rotvec(row[:3]))
        for row in nodes.matrix("extrinsic_parameters", 6)
    ]


def _residuals(nodes, views):
    """The residuals, one array per view; ValueError if their number does not match points_per_view."""
    counts, residuals = nodes.matrix("points_per_view", None), nodes.matrix("residuals", 2)
    whole = np.all(counts >= 1) and np.all(counts == np.round(counts))
    if counts.shape != (1, views) or not whole or counts.sum() != len(residuals):
        raise ValueError(
            f"points_per_view is {counts.tolist()}; expected {views} whole numbers with the sum {len(residuals)}"
        )
    return np.split(residuals, np.cumsum(counts[0]).astype(int)[:-1])
