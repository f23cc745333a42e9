"""OpenCV's camera: an intrinsic matrix, and distorting coefficients of the lens."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import as_points
from .pinhole import UNKNOWN_SIZE, _as_size, _Camera, _demand_known

COEFFICIENT_NAMES = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"]
"""The names of the values in ``dist_coeffs``, in OpenCV's order."""

LARGEST_SKEW = 1e-9
"""px: largest skew of a computed matrix that still counts as 0; it moves no point by more."""


@dataclass(frozen=True, eq=False)
class OpenCVCamera(_Camera):
    """OpenCV's camera.

    Parameters
    ----------
    camera_matrix : (3, 3) array_like
        px; without skew, which OpenCV's model does not have.
    dist_coeffs : (4,), (5,), (8,), (12,) or (14,) array_like
        k1, k2, p1, p2, k3, ...; distorting.
    image_size : (int, int)
        Width and height, px.

    Raises
    ------
    ValueError
        If a shape or a value is unusable.

    Examples
    --------
    >>> from pegpose_lab import OpenCVCamera
    >>> camera = OpenCVCamera([[800, 0, 319.5], [0, 800, 239.5], [0, 0, 1]], [-0.2, 0.1, 0, 0, 0], (640, 480))
    >>> camera.parameters["f_x"], camera.parameters["k1"], camera.principal_point
    (800.0, -0.2, (319.5, 239.5))
    """

    camera_matrix: NDArray[np.float64]
    dist_coeffs: NDArray[np.float64]
    image_size: tuple[int, int] = UNKNOWN_SIZE

    def __post_init__(self) -> None:
        matrix = as_points(self.camera_matrix, 3, "camera_matrix", 3)
        if matrix.shape != (3, 3) or matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or np.any(matrix[2] != (0, 0, 1)):
            raise ValueError("camera_matrix is not of the form [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0")
        if max(abs(matrix[0, 1]), abs(matrix[1, 0])) > LARGEST_SKEW:
            raise ValueError(
                f"camera_matrix has skew, K[0, 1] = {matrix[0, 1]:g} and K[1, 0] = {matrix[1, 0]:g} px; OpenCV's camera has "
                "none and its functions ignore it: expected 0 (calibrate the camera without skew)"
            )
        matrix[0, 1] = matrix[1, 0] = 0.0
        coefficients = np.array(self.dist_coeffs, dtype=np.float64).ravel()
        if coefficients.size not in (4, 5, 8, 12, 14) or not np.isfinite(coefficients).all():
            raise ValueError(f"dist_coeffs has {coefficients.size} values; expected 4, 5, 8, 12 or 14 finite ones")
        object.__setattr__(self, "camera_matrix", matrix)
        object.__setattr__(self, "dist_coeffs", coefficients)
        object.__setattr__(self, "image_size", _as_size(self.image_size))

    @property
    def principal_point(self) -> tuple[float, float]:
        """(c_x, c_y), px."""
        return float(self.camera_matrix[0, 2]), float(self.camera_matrix[1, 2])

    @property
    def parameters(self) -> dict[str, float]:
        """f_x, f_y, c_x, c_y, px, and the coefficients k1, k2, p1, p2, ... of ``dist_coeffs``."""
        values = [*np.diag(self.camera_matrix)[:2], *self.principal_point, *self.dist_coeffs]
        return dict(zip(("f_x", "f_y", "c_x", "c_y", *COEFFICIENT_NAMES), map(float, values), strict=False))

    def with_parameters(self, **values: float) -> OpenCVCamera:
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
        return OpenCVCamera([[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]], coefficients, self.image_size)

    def to_opencv(self) -> OpenCVCamera:
        """Return the camera itself, so that callers need not ask which model they have."""
        return self

    def from_normalized(self, normalized: ArrayLike) -> NDArray[np.float64]:
        """Undistorted directions (x/z, y/z) to image px."""
        return self.image_and_derivative(normalized)[0]

    def to_normalized(
        self, image_points: ArrayLike, *, iterations: int = 50, tolerance: float = 1e-11
    ) -> NDArray[np.float64]:
        """Image px to undistorted directions (x/z, y/z), by Newton's method.

        Raises
        ------
        ValueError
            If a point has no preimage near it under this distortion.
        """
        image_points = np.asarray(image_points, np.float64)
        normalized = (image_points - self.camera_matrix[:2, 2]) / np.diag(self.camera_matrix)[:2]
        largest = max(self.image_size)
        for _ in range(iterations):
            projected, jacobian = self.image_and_derivative(normalized)
            error = projected - image_points
            if np.abs(error).max() <= tolerance * largest:
                return normalized
            step = _solve_2x2(jacobian, error)
            length = np.linalg.norm(step, axis=1, keepdims=True)
            normalized = normalized - step * np.minimum(1, 0.5 / np.maximum(length, 1e-300))
        worst = np.linalg.norm(error, axis=1).max()
        raise ValueError(f"image_points: the distortion cannot be inverted there (left after Newton: {worst:.3g} px)")

    def image_and_derivative(self, normalized: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Undistorted directions (n, 2) to image px (n, 2), and the derivative (n, 2, 2) by them."""
        points = np.column_stack([normalized, np.ones(len(normalized))])
        zero = np.zeros(3)
        image_points, jacobian = cv2.projectPoints(points, zero, zero, self.camera_matrix, self.dist_coeffs)[:2]
        return image_points.reshape(-1, 2), jacobian[:, 3:5].reshape(-1, 2, 2)

    def scaled(self, scale: float) -> OpenCVCamera:
        """Return the camera with the same image at `scale` times the pixels along each axis."""
        to_scaled = np.array([[scale, 0, 0.5 * scale - 0.5], [0, scale, 0.5 * scale - 0.5], [0, 0, 1]])
        return OpenCVCamera(to_scaled @ self.camera_matrix, self.dist_coeffs, self._scaled_size(scale))


def _solve_2x2(matrices, vectors):
    """Solve stacked 2x2 systems by Cramer's rule; a singular one gives a zero step."""
    a, b, c, d = matrices.reshape(-1, 4).T
    x, y = vectors.T
    determinant = a * d - b * c
    safe = np.where(determinant == 0, np.inf, determinant)
    return np.column_stack([(d * x - b * y) / safe, (a * y - c * x) / safe])
