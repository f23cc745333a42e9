"""The paper's lens (Eq. 3) in the bundle adjustment."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ....camera import distort_radius, max_undistorted_radius
from .lens import Lens, derivative_by_point

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ....camera import TsaiCamera


class TsaiModel(Lens):
    """The paper's camera: f, (scale_x), kappa1, (c_x, c_y)."""

    unit = "mm"
    """Unit of f, the first parameter."""

    def __init__(self, sensor, free_center, two_focal_lengths):
        self.sensor, self.free_center, self.two = sensor, free_center, two_focal_lengths
        self.held = [np.nan, sensor.scale_x, 0.0, *sensor.principal_point]
        self.coefficient_names = None
        free = [True, two_focal_lengths, True, free_center, free_center]
        every = ("focal_length", "scale_x", "kappa1", "c_x", "c_y")
        self.names = [name for name, kept in zip(every, free, strict=False) if kept]
        self.columns = np.flatnonzero(free)

    @classmethod
    def known(cls, camera: TsaiCamera) -> TsaiModel:
        """The model of a known camera, without free parameters."""
        model = cls(camera.sensor, False, False)
        model.names, model.columns = [], np.zeros(0, int)
        model.held[0], model.held[2] = camera.focal_length, camera.kappa1
        return model

    def start(self, focal_length: float) -> NDArray[np.float64]:
        """The parameters without distortion for an f, mm."""
        return self.values([focal_length, *self.held[1:]])

    def values(self, every: Sequence[float]) -> NDArray[np.float64]:
        """The free parameters out of f, scale_x, kappa1, c_x and c_y."""
        return self._with_board(np.array(every)[self.columns])

    def _values(self, shared):
        values = list(self.held)
        for column, value in zip(self.columns, shared[: len(self.columns)], strict=True):
            values[column] = value
        return values

    def camera(self, shared: Sequence[float] | NDArray[np.float64]) -> TsaiCamera:
        focal_length, scale_x, kappa1, *center = self._values(shared)
        return replace(self.sensor, scale_x=scale_x, principal_point=tuple(center)).camera(focal_length, kappa1)

    def project(
        self, shared: Sequence[float] | NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        r"""Image points (n, 2) of points in the camera frame, and derivatives by the parameters and by the point.

        None if a point has no image.  With :math:`h = 1 / (1 + \kappa_1 r_d^2)` and
        :math:`s = 1 + 3 \kappa_1 r_d^2`, Eq. 3 solved for :math:`x_d = h x_u` has
        :math:`dx_d/dx_u = h I - (2 \kappa_1 h^3 / s) x_u x_u^T` and
        :math:`dx_d/d\kappa_1 = -(h r_d^2 / s) x_u`.
        """
        focal_length, scale_x, kappa1, *center = self._values(shared)
        if min(focal_length, scale_x) <= 0 or points[:, 2].min() <= 0:
            return None
        x_u = focal_length / points[:, 2:] * points[:, :2]
        radius = np.hypot(*x_u.T)
        if radius.max() > max_undistorted_radius(kappa1):
            return None
        squared = distort_radius(radius, kappa1)[:, None] ** 2
        h, s = 1 / (1 + kappa1 * squared), 1 + 3 * kappa1 * squared
        if s.min() <= 0:
            return None
        scale = np.array([scale_x, 1.0]) / self.sensor.pixel_pitch  # px per mm, with the trial's scale_x
        by_x_u = (-2 * kappa1 * h**3 / s)[:, :, None] * x_u[:, :, None] * x_u[:, None, :]
        by_x_u[:, 0, 0] += h[:, 0]
        by_x_u[:, 1, 1] += h[:, 0]
        by_x_u *= scale[:, None]
        x_d = h * x_u
        by_shared = np.zeros((len(points), 2, 5))
        if len(self.columns):
            by_shared[:, :, 0] = (by_x_u @ x_u[:, :, None])[:, :, 0] / focal_length
            by_shared[:, 0, 1] = x_d[:, 0] * scale[0] / scale_x
            by_shared[:, :, 2] = scale * (-h * squared / s) * x_u
            by_shared[:, 0, 3] = by_shared[:, 1, 4] = 1
        by_point = derivative_by_point(by_x_u, x_u, focal_length, points)
        return x_d * scale + center, by_shared[:, :, self.columns], by_point
