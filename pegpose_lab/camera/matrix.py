"""What the cameras with OpenCV's intrinsic matrix share: its checks, the principal point, and scaled images."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import as_points
from .pinhole import UNKNOWN_SIZE, _as_size, _Camera, _demand_known

LARGEST_SKEW = 1e-9
"""px: largest skew of a computed matrix that still counts as 0; it moves no point by more."""


class _MatrixCamera(_Camera):
    """A camera of ``camera_matrix``, ``dist_coeffs`` and ``image_size``; the subclass gives the lens."""

    camera_matrix: NDArray[np.float64]
    dist_coeffs: NDArray[np.float64]
    image_size: tuple[int, int] = UNKNOWN_SIZE

    def _check(self, numbers):
        """Check and convert the fields; `numbers` are the possible numbers of coefficients."""
        coefficients = np.array(self.dist_coeffs, dtype=np.float64).ravel()
        matrix = as_camera_matrix(self.camera_matrix)
        if coefficients.size not in numbers or not np.isfinite(coefficients).all():
            *most, last = map(str, numbers)
            expected = f"{', '.join(most)} or {last}" if most else last
            raise ValueError(f"dist_coeffs has {coefficients.size} values; expected {expected} finite ones")
        object.__setattr__(self, "camera_matrix", matrix)
        object.__setattr__(self, "dist_coeffs", coefficients)
        object.__setattr__(self, "image_size", _as_size(self.image_size))

    @property
    def principal_point(self) -> tuple[float, float]:
        """(c_x, c_y), px."""
        return float(self.camera_matrix[0, 2]), float(self.camera_matrix[1, 2])

    def _parameters(self, names):
        values = [*np.diag(self.camera_matrix)[:2], *self.principal_point, *self.dist_coeffs]
        return dict(zip(("f_x", "f_y", "c_x", "c_y", *names), map(float, values), strict=False))

    def with_parameters(self, **values: float) -> Self:
        """As of every camera: the one with other values of some of `parameters`; ValueError for an unknown name.

        Examples
        --------
        >>> from pegpose_lab import OpenCVCamera
        >>> camera = OpenCVCamera([[800, 0, 319.5], [0, 800, 239.5], [0, 0, 1]], [-0.2, 0.1, 0, 0, 0], (640, 480))
        >>> camera.with_parameters(f_x=801.0, k1=-0.3).parameters["k1"]
        -0.3
        """
        _demand_known(values, self.parameters)
        f_x, f_y, c_x, c_y, *coefficients = (self.parameters | values).values()
        return type(self)([[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]], coefficients, self.image_size)

    def scaled(self, scale: float) -> Self:
        """Return the camera with the same image at `scale` times the pixels along each axis."""
        to_scaled = np.array([[scale, 0, 0.5 * scale - 0.5], [0, scale, 0.5 * scale - 0.5], [0, 0, 1]])
        return type(self)(to_scaled @ self.camera_matrix, self.dist_coeffs, self._scaled_size(scale))

    def cropped(self, left: int, top: int, width: int, height: int) -> Self:
        """Return the camera of a part of its image: pixel (left, top) becomes pixel (0, 0)."""
        to_part = np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])
        return type(self)(to_part @ self.camera_matrix, self.dist_coeffs, (width, height))


def as_camera_matrix(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return the matrix (3, 3) as an array; ValueError if it is not of the form [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]."""
    matrix = as_points(matrix, 3, "camera_matrix", 3)
    if matrix.shape != (3, 3) or matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or np.any(matrix[2] != (0, 0, 1)):
        raise ValueError("camera_matrix is not of the form [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0")
    if max(abs(matrix[0, 1]), abs(matrix[1, 0])) > LARGEST_SKEW:
        raise ValueError(
            f"camera_matrix has skew, K[0, 1] = {matrix[0, 1]:g} and K[1, 0] = {matrix[1, 0]:g} px; OpenCV's camera has "
            "none and its functions ignore it: expected 0 (calibrate the camera without skew)"
        )
    matrix[0, 1] = matrix[1, 0] = 0.0
    return matrix
