"""OpenCV's lens in the bundle adjustment: radial, tangential and rational coefficients."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....camera import OpenCVCamera
from .pixels import PixelModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class OpenCVModel(PixelModel):
    r"""OpenCV's camera: f_x, (f_y), (c_x, c_y) and the coefficients, which distort.

    With :math:`r^2 = x^2 + y^2` of the direction (x, y)/z, and the same for y with p1 and p2 exchanged,

    .. math:: x_d = x \frac{1 + k_1 r^2 + k_2 r^4 + k_3 r^6}{1 + k_4 r^2 + k_5 r^4 + k_6 r^6}
        + 2 p_1 x y + p_2 (r^2 + 2 x^2).
    """

    every = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

    def camera(self, shared: Sequence[float] | NDArray[np.float64]) -> OpenCVCamera:
        """The camera; with eight coefficients if one of the rational ones is estimated, else with five."""
        number = 8 if {"k4", "k5", "k6"} & set(self.coefficient_names) else 5
        return OpenCVCamera(self.matrix(shared), self.split(shared)[2][:number], self.sensor.image_size)

    def _distorted(self, normalized, coefficients):
        """Distorted directions (n, 2), their derivatives by the directions and by all coefficients; or None."""
        x, y = normalized.T
        k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
        r2 = x * x + y * y
        below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        if below.min() <= 0:
            return None
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
        slope = (k1 + r2 * (2 * k2 + r2 * 3 * k3) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / below
        x_d = radial * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        y_d = radial * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        by_normalized = np.empty((len(x), 2, 2))
        by_normalized[:, 0, 0] = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
        by_normalized[:, 1, 1] = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
        by_normalized[:, 0, 1] = by_normalized[:, 1, 0] = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
        powers = np.stack([r2, r2**2, r2**3]) / below
        columns = [
            [x * powers[0], x * powers[1], 2 * x * y, r2 + 2 * x * x, x * powers[2], *(-radial * x * powers)],
            [y * powers[0], y * powers[1], r2 + 2 * y * y, 2 * x * y, y * powers[2], *(-radial * y * powers)],
        ]
        return np.column_stack([x_d, y_d]), by_normalized, np.array(columns).transpose(2, 0, 1)
