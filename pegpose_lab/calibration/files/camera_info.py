"""ROS's camera_info and its relatives: a YAML text with the camera's matrix, its distortion and the image size."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...camera import UNKNOWN_SIZE, FisheyeCamera, OpenCVCamera
from .names import COEFFICIENT_KEYS, HEIGHT_KEYS, MATRIX_KEYS, WIDTH_KEYS, found_of, opencv_coefficients

if TYPE_CHECKING:
    from typing import Any

    from ...camera import TsaiCamera

ROS_MODELS = {5: "plumb_bob", 8: "rational_polynomial"}
"""ROS's names for OpenCV's distortion, by the number of coefficients."""

EQUIDISTANT_NAMES = ("equidistant", "fisheye")
"""Names for the distortion of `FisheyeCamera`; ROS's own is the first."""


def as_camera_info(camera: TsaiCamera | OpenCVCamera | FisheyeCamera) -> str:
    """ROS's camera_info of a camera, as ROS's camera_calibration package writes it."""
    if isinstance(camera, FisheyeCamera):
        model, coefficients = EQUIDISTANT_NAMES[0], camera.dist_coeffs
    else:
        camera = camera.to_opencv()
        own = opencv_coefficients(camera.dist_coeffs)
        coefficients = np.concatenate([own, np.zeros(max(5 - own.size, 0))])
        if coefficients.size not in ROS_MODELS:
            raise ValueError(f"camera has {coefficients.size} distortion coefficients; ROS names models of 5 or 8")
        model = ROS_MODELS[coefficients.size]
    width, height = camera.image_size
    projection = np.column_stack([camera.camera_matrix, np.zeros(3)])
    import yaml

    return yaml.safe_dump(
        {
            "image_width": width,
            "image_height": height,
            "camera_name": "pegpose_lab",
            "camera_matrix": _as_matrix(camera.camera_matrix),
            "distortion_model": model,
            "distortion_coefficients": _as_matrix(coefficients[None]),
            "rectification_matrix": _as_matrix(np.eye(3)),
            "projection_matrix": _as_matrix(projection),
        },
        sort_keys=False,
        default_flow_style=None,
    )


def _as_matrix(array):
    return {"rows": len(array), "cols": array.shape[1], "data": array.ravel().tolist()}


def from_camera_info(text: str) -> dict[str, Any]:
    """The fields of a `Calibration` with only a camera."""
    import yaml

    if text.lstrip().startswith("%YAML:"):  # OpenCV's way to write the directive, which YAML does not know
        text = text.lstrip().partition("\n")[2]
    try:
        documents = [document for document in yaml.safe_load_all(text) if document is not None]
    except (yaml.YAMLError, RecursionError) as error:
        place = getattr(error, "problem_mark", None)
        raise ValueError(f"it is no YAML{f' in line {place.line + 1}' if place else ''}") from error
    info = documents[0] if documents else None  # `rostopic echo` writes one message after the other
    if not isinstance(info, dict):
        raise ValueError("it is neither an OpenCV FileStorage nor a ROS camera_info")
    matrix, coefficients = _numbers(info, MATRIX_KEYS), _numbers(info, COEFFICIENT_KEYS)
    if matrix is None:
        raise ValueError(f"it has no camera matrix ({', '.join(MATRIX_KEYS)})")
    if matrix.size != 9:
        raise ValueError(f"its camera matrix has {matrix.size} numbers; expected 9")
    if coefficients is None:
        raise ValueError("it has a camera matrix, but no distortion coefficients; give zeros if there is none")
    size = found_of(info, WIDTH_KEYS), found_of(info, HEIGHT_KEYS)
    size = UNKNOWN_SIZE if None in size else size
    return {"camera": _camera(info, matrix.reshape(3, 3), coefficients, size), "cam_from_object": [], "residuals": []}


def _numbers(info, keys):
    """The numbers under one of the keys, which may be a matrix of rows, cols and data; None if there are none."""
    value = found_of(info, keys)
    if isinstance(value, dict):
        value = value.get("data")
    return None if value is None else np.array(value, dtype=float).ravel()


def _camera(info, matrix, coefficients, size):
    """The camera of the distortion that the file names, or of OpenCV's if it names none."""
    model = info.get("distortion_model") or "opencv"
    if model in EQUIDISTANT_NAMES:
        return FisheyeCamera(matrix, coefficients, size)
    if model not in ("opencv", *ROS_MODELS.values()):
        known = ", ".join((*ROS_MODELS.values(), EQUIDISTANT_NAMES[0]))
        raise ValueError(f"its distortion_model is {model!r}; expected one of {known}")
    coefficients = opencv_coefficients(coefficients)
    if model == "plumb_bob" and coefficients.size > 5:
        raise ValueError(
            f"its distortion_model is plumb_bob with {coefficients.size} coefficients that are not 0; expected 5"
        )
    return OpenCVCamera(matrix, coefficients, size)
