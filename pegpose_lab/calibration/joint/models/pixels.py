"""What the models in pixels share: f_x, (f_y), (c_x, c_y) and the coefficients that are estimated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .lens import Lens, derivative_by_point

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class PixelModel(Lens):
    """f_x, (f_y), (c_x, c_y), and coefficients that distort the direction (x, y)/z."""

    unit = "px"
    """Unit of f, the first parameter."""

    every: tuple[str, ...]
    """All coefficients of the lens, in its camera's order."""

    def __init__(self, sensor, free_center, two_focal_lengths, coefficients):
        self.sensor, self.two, self.free_center = sensor, two_focal_lengths, free_center
        self.aspect = sensor.pixels_per_mm[1] / sensor.pixels_per_mm[0]
        self.coefficient_names = tuple(coefficients)
        self.coefficients = [self.every.index(name) for name in coefficients]
        self.names = ["f_x", *["f_y"] * two_focal_lengths, *("c_x", "c_y") * free_center, *coefficients]

    def start(self, focal_length: float) -> NDArray[np.float64]:
        """The parameters without distortion for an f, mm of the sensor."""
        center = self.sensor.principal_point
        return self.values(focal_length * self.sensor.pixels_per_mm, center, np.zeros(len(self.every)))

    def values(
        self, focal: Sequence[float] | NDArray[np.float64], center: Sequence[float], coefficients: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The free parameters out of f_x and f_y, the principal point and all coefficients."""
        own = [focal[0], *[focal[1]] * self.two, *tuple(center) * self.free_center, *coefficients[self.coefficients]]
        return self._with_board(own)

    def split(
        self, shared: Sequence[float] | NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """f_x and f_y, the principal point, and all coefficients."""
        shared, coefficients = list(shared[: len(self.lens_names)]), np.zeros(len(self.every))
        f_x = shared.pop(0)
        f_y = shared.pop(0) if self.two else f_x * self.aspect
        center = (shared.pop(0), shared.pop(0)) if self.free_center else self.sensor.principal_point
        coefficients[self.coefficients] = shared
        return np.array([f_x, f_y]), np.array(center), coefficients

    def matrix(self, shared: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """The camera matrix (3, 3), px."""
        focal, center, _ = self.split(shared)
        matrix = np.diag([*focal, 1.0])
        matrix[:2, 2] = center
        return matrix

    def project(
        self, shared: Sequence[float] | NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """As `TsaiModel.project`."""
        focal, center, coefficients = self.split(shared)
        if focal.min() <= 0 or points[:, 2].min() <= 0:
            return None
        normalized = points[:, :2] / points[:, 2:]
        found = self._distorted(normalized, coefficients)
        if found is None:
            return None
        distorted, by_normalized, by_coefficients = found
        by_focal = distorted[:, :, None] * np.eye(2)
        if not self.two:
            by_focal = by_focal @ np.array([[1.0], [self.aspect]])
        by_center = np.broadcast_to(np.eye(2), (len(points), 2, 2))[:, :, : 2 * self.free_center]
        by_coefficients = by_coefficients[:, :, self.coefficients] * focal[:, None]
        by_shared = np.concatenate([by_focal, by_center, by_coefficients], axis=2)
        by_point = derivative_by_point(by_normalized * focal[:, None], normalized, 1.0, points)
        return distorted * focal + center, by_shared, by_point
