"""What several tools call the same fields of a camera, and their padded coefficients."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from numpy.typing import NDArray

MATRIX_KEYS = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K")
"""The camera matrix in OpenCV's and ROS's files, OpenCV's samples of 2.4, many scripts, and ROS's messages."""

COEFFICIENT_KEYS = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "D")
WIDTH_KEYS = ("image_width", "image_Width", "width")
HEIGHT_KEYS = ("image_height", "image_Height", "height")

SIZES = (4, 5, 8, 12, 14)
"""Numbers of coefficients of OpenCV's models."""


def found_of(fields: Mapping[str, Any], keys: Sequence[str]) -> Any:
    """The value of the first of the keys that is there; None if none is."""
    return next((fields[key] for key in keys if key in fields), None)


def opencv_coefficients(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """OpenCV's coefficients without the zeros that fill them up to a longer model; none at all are 5 zeros.

    Examples
    --------
    >>> opencv_coefficients(np.array([0.1, -0.2, 0, 0, 0, 0, 0, 0])).tolist()
    [0.1, -0.2, 0.0, 0.0, 0.0]
    """
    coefficients = np.asarray(coefficients, np.float64).ravel()
    if coefficients.size == 0:
        return np.zeros(5)
    if coefficients.size not in SIZES or coefficients.size <= 5:
        return coefficients
    return next(coefficients[:size] for size in SIZES[1:] if not coefficients[size:].any())
