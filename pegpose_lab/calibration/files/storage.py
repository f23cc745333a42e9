"""OpenCV's FileStorage, as YAML, XML or JSON: our own files with everything, and OpenCV's with the camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...camera import UNKNOWN_SIZE, FisheyeCamera, OpenCVCamera, TsaiCamera
from ...checks import as_points
from ...flags import Flag
from ..board import BoardShape, BoardUnknowns
from .names import COEFFICIENT_KEYS, HEIGHT_KEYS, MATRIX_KEYS, WIDTH_KEYS, opencv_coefficients
from .texts import as_texts, from_texts

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from ..result import Calibration

FILE_FORMAT = "pegpose_lab calibration 1"


def as_storage(calibration: Calibration) -> str:
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
    if isinstance(camera, FisheyeCamera):
        nodes["fisheye_model"] = 1  # as OpenCV's own calibration files call it
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
    nodes["flags"] = list(as_texts(calibration.flags))
    nodes["flag_codes"] = list(as_texts(getattr(flag, "code", "unknown") for flag in calibration.flags))
    same = calibration.classical_covariance is calibration.covariance
    for name in ("history", "covariance", *["classical_covariance"] * (not same)):
        table = getattr(calibration, name)
        if table is not None:
            nodes |= {f"{name}_columns": list(table.columns), name: table.to_numpy(np.float64)}
    return nodes | (_board_nodes(calibration.board) if calibration.board else {})


def _board_nodes(board):
    """The names and values of an estimated board."""
    unknowns = board.unknowns
    frame = np.concatenate([unknowns.frame.rotation.as_rotvec(), unknowns.frame.translation])
    return {
        "board_names": list(board.values),
        "board_values": np.array([list(board.values.values())]),
        "board_plane": frame[None],
        "board_extent": np.concatenate([unknowns.middle, unknowns.half])[None],
        "board_test": np.array([[board.statistic, board.probability]]),
    }


class Nodes:
    """Numbers, matrices and texts of a FileStorage text by name; KeyError if one is missing or of another kind."""

    def __init__(self, text):
        self.storage = cv2.FileStorage(text, cv2.FileStorage_READ | cv2.FileStorage_MEMORY)

    @property
    def is_open(self) -> bool:
        """Whether OpenCV could read the text."""
        return bool(self.storage.isOpened())

    def __contains__(self, name: str) -> bool:
        return not self.storage.getNode(name).empty()

    def _get(self, name, wanted):
        node = self.storage.getNode(name)
        if node.empty() or not wanted(node):
            raise KeyError(f"{name} is missing or of another kind")
        return node

    def number(self, name: str) -> float:
        """A number."""
        return self._get(name, lambda node: node.isInt() or node.isReal()).real()

    def text(self, name: str) -> str:
        """A text."""
        return self._get(name, lambda node: node.isString()).string()

    def texts(self, name: str) -> tuple[str, ...]:
        """A list of texts."""
        node = self.storage.getNode(name)
        return tuple(node.at(index).string() for index in range(node.size()))

    def matrix(self, name: str, columns: int | None) -> NDArray[np.float64]:
        """A matrix with this number of columns, or any if None."""
        array = self._get(name, lambda node: node.isMap()).mat()
        return as_points(array, array.shape[-1] if columns is None else columns, name)

    def table(self, name: str) -> Any:
        """A table with its columns' names; None if it is not there."""
        if name not in self:
            return None
        import pandas as pd

        columns = self.texts(f"{name}_columns")
        return pd.DataFrame(self.matrix(name, len(columns)), columns=list(columns))


def from_storage(nodes: Nodes) -> dict[str, Any]:
    """The fields of a FileStorage's `Calibration`; one of another tool gives only the camera."""
    if "format" in nodes or "camera_model" in nodes:
        return _from_nodes(nodes)
    model = _fisheye_camera if "fisheye_model" in nodes and nodes.number("fisheye_model") != 0 else _opencv_camera
    return {"camera": model(nodes), "cam_from_object": [], "residuals": []}


def _named(nodes, keys, what):
    """The first of the keys that is there."""
    found = next((key for key in keys if key in nodes), None)
    if found is None:
        raise ValueError(f"it has no {what} ({', '.join(keys)})")
    return found


def _matrix_and_coefficients(nodes):
    matrix = nodes.matrix(_named(nodes, MATRIX_KEYS, "camera matrix"), 3)
    if not any(key in nodes for key in COEFFICIENT_KEYS):
        raise ValueError("it has a camera matrix, but no distortion coefficients; give zeros if there is none")
    name = _named(nodes, COEFFICIENT_KEYS, "distortion coefficients")
    coefficients = nodes.matrix(name, None)
    if 1 not in coefficients.shape:
        raise ValueError(f"{name} has shape {coefficients.shape}; expected a row or a column")
    return matrix, coefficients.ravel()


def _image_size(nodes):
    """Width and height; `UNKNOWN_SIZE` if the file has none."""
    if not any(key in nodes for key in (*WIDTH_KEYS, *HEIGHT_KEYS)):
        return UNKNOWN_SIZE
    return tuple(nodes.number(_named(nodes, keys, "image size")) for keys in (WIDTH_KEYS, HEIGHT_KEYS))


def _opencv_camera(nodes):
    matrix, coefficients = _matrix_and_coefficients(nodes)
    filled = "format" not in nodes  # our own files have the number of coefficients that the camera has
    return OpenCVCamera(matrix, opencv_coefficients(coefficients) if filled else coefficients, _image_size(nodes))


def _fisheye_camera(nodes):
    return FisheyeCamera(*_matrix_and_coefficients(nodes), _image_size(nodes))


def _tsai_camera(nodes):
    numbers = {name: nodes.number(name) for name in ("focal_length", "kappa1", "scale_x")}
    pairs = {name: tuple(nodes.matrix(name, 2)[0]) for name in ("pixel_pitch", "principal_point")}
    return TsaiCamera(image_size=(nodes.number("image_width"), nodes.number("image_height")), **numbers, **pairs)


def _from_nodes(nodes):
    """The fields of the `Calibration` in a file that we wrote."""
    if nodes.text("format") != FILE_FORMAT:
        raise ValueError(f"format is {nodes.text('format')!r}; expected {FILE_FORMAT!r}")
    cameras = {
        TsaiCamera.__name__: _tsai_camera,
        OpenCVCamera.__name__: _opencv_camera,
        FisheyeCamera.__name__: _fisheye_camera,
    }
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
        "classical_covariance": covariance if classical is None else classical,  # written only if it differs
        "freedom": int(nodes.number("freedom")) if "freedom" in nodes else None,
        "n_parameters": int(nodes.number("n_parameters")) if "n_parameters" in nodes else None,
        "board": _board(nodes) if "board_names" in nodes else None,
    }


def _board(nodes):
    names, plane = nodes.texts("board_names"), nodes.matrix("board_plane", 6)[0]
    frame = RigidTransform.from_components(plane[3:], Rotation.from_rotvec(plane[:3]))
    extent, values = nodes.matrix("board_extent", 4)[0], nodes.matrix("board_values", len(names))[0]
    unknowns = BoardUnknowns(frame, extent[:2], extent[2:], list(names), np.full(len(names), np.inf))
    return BoardShape(
        unknowns, dict(zip(names, values.tolist(), strict=True)), *nodes.matrix("board_test", 2)[0].tolist()
    )


def _flags(nodes):
    """The flags; a file of an earlier version has no codes for them."""
    texts = from_texts(nodes.texts("flags"))
    codes = from_texts(nodes.texts("flag_codes")) if "flag_codes" in nodes else ("unknown",) * len(texts)
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
