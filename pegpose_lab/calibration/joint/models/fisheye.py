"""The equidistant fisheye lens in the bundle adjustment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....camera import FisheyeCamera, equidistant
from .pixels import PixelModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class FisheyeModel(PixelModel):
    """The camera of `FisheyeCamera`: f_x, (f_y), (c_x, c_y) and k1 to k4, which distort the angle to the axis."""

    every = ("k1", "k2", "k3", "k4")

    def camera(self, shared: Sequence[float] | NDArray[np.float64]) -> FisheyeCamera:
        """The camera."""
        return FisheyeCamera(self.matrix(shared), self.split(shared)[2], self.sensor.image_size)

    def _distorted(self, normalized, coefficients):
        """As `OpenCVModel._distorted`; None where the distortion folds."""
        radius = np.hypot(*normalized.T)
        angle = np.arctan(radius)
        distorted, slope = equidistant(angle, coefficients)
        if slope.min() <= 0:
            return None
        safe = np.where(radius > 0, radius, 1)
        unit, across = normalized / safe[:, None], np.where(radius > 0, distorted / safe, 1.0)
        by_normalized = (slope / (1 + radius**2) - across)[:, None, None] * unit[:, :, None] * unit[:, None, :]
        by_normalized += across[:, None, None] * np.eye(2)
        powers = angle[:, None] ** np.array([3, 5, 7, 9])
        return across[:, None] * normalized, by_normalized, unit[:, :, None] * powers[:, None, :]
