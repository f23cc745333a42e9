"""Lens models for the bundle adjustment: their parameters, their camera, and the projection with its derivatives."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...camera import OpenCVCamera, distort_radius, max_undistorted_radius

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...camera import Sensor, TsaiCamera

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3")
"""OpenCV's distortion coefficients in OpenCV's order."""


def lens_model(
    sensor: Sensor, free_center: bool, two_focal_lengths: bool, coefficients: str | Sequence[str] | None
) -> TsaiModel | OpenCVModel:
    """The model for these options of `calibrate_joint`; ValueError if a coefficient is unknown or repeated."""
    if coefficients is None:
        return TsaiModel(sensor, free_center, two_focal_lengths)
    coefficients = tuple(coefficients) if np.iterable(coefficients) else (coefficients,)
    if set(coefficients) - set(COEFFICIENTS) or len(set(coefficients)) < len(coefficients):
        raise ValueError(f"coefficients is {coefficients}; expected each once, of {', '.join(COEFFICIENTS)}")
    return OpenCVModel(sensor, free_center, two_focal_lengths, coefficients)


class TsaiModel:
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
        return np.array([focal_length, *self.held[1:]])[self.columns]

    def _values(self, shared):
        values = list(self.held)
        for column, value in zip(self.columns, shared, strict=True):
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


class OpenCVModel:
    """OpenCV's camera: f_x, (f_y), (c_x, c_y) and the coefficients, which distort."""

    unit = "px"

    def __init__(self, sensor, free_center, two_focal_lengths, coefficients):
        self.sensor, self.two, self.free_center = sensor, two_focal_lengths, free_center
        self.aspect = sensor.pixels_per_mm[1] / sensor.pixels_per_mm[0]
        self.coefficient_names = tuple(coefficients)
        self.coefficients = [COEFFICIENTS.index(name) for name in coefficients]
        self.names = ["f_x", *["f_y"] * two_focal_lengths, *("c_x", "c_y") * free_center, *coefficients]

    def start(self, focal_length: float) -> NDArray[np.float64]:
        f_x, f_y = focal_length * self.sensor.pixels_per_mm
        center = self.sensor.principal_point if self.free_center else ()
        return np.array([f_x, *[f_y] * self.two, *center, *[0.0] * len(self.coefficients)])

    def _split(self, shared):
        """f_x and f_y, the principal point, and all five coefficients."""
        shared, coefficients = list(shared), np.zeros(5)
        f_x = shared.pop(0)
        f_y = shared.pop(0) if self.two else f_x * self.aspect
        center = (shared.pop(0), shared.pop(0)) if self.free_center else self.sensor.principal_point
        coefficients[self.coefficients] = shared
        return np.array([f_x, f_y]), np.array(center), coefficients

    def camera(self, shared: Sequence[float] | NDArray[np.float64]) -> OpenCVCamera:
        focal, center, coefficients = self._split(shared)
        matrix = np.diag([*focal, 1.0])
        matrix[:2, 2] = center
        return OpenCVCamera(matrix, coefficients, self.sensor.image_size)

    def project(
        self, shared: Sequence[float] | NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """As `TsaiModel.project`."""
        focal, center, (k1, k2, p1, p2, k3) = self._split(shared)
        if focal.min() <= 0 or points[:, 2].min() <= 0:
            return None
        x, y = normalized = points[:, :2].T / points[:, 2]
        r2 = x * x + y * y
        radial, slope = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), k1 + r2 * (2 * k2 + r2 * 3 * k3)
        x_d = radial * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        y_d = radial * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
        by_normalized = np.empty((len(points), 2, 2))
        by_normalized[:, 0, 0] = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
        by_normalized[:, 1, 1] = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
        by_normalized[:, 0, 1] = by_normalized[:, 1, 0] = mixed
        by_coefficients = np.stack(
            [
                [x * r2, x * r2**2, 2 * x * y, r2 + 2 * x * x, x * r2**3],
                [y * r2, y * r2**2, r2 + 2 * y * y, 2 * x * y, y * r2**3],
            ]
        ).transpose(2, 0, 1)[:, :, self.coefficients]
        by_focal = np.zeros((len(points), 2, 2))
        by_focal[:, 0, 0], by_focal[:, 1, 1] = x_d, y_d
        if not self.two:
            by_focal = by_focal @ np.array([[1.0], [self.aspect]])
        by_center = np.broadcast_to(np.eye(2), (len(points), 2, 2))[:, :, : 2 * self.free_center]
        by_shared = np.concatenate([by_focal, by_center, by_coefficients * focal[:, None]], axis=2)
        by_point = derivative_by_point(by_normalized * focal[:, None], normalized.T, 1.0, points)
        return np.column_stack([x_d, y_d]) * focal + center, by_shared, by_point


class GivenFocalLength:
    """One of the models with its first parameter, f or f_x, held at a given value."""

    def __init__(self, model, focal_length):
        self.model, self.focal_length, self.names = model, focal_length, model.names[1:]

    def project(
        self, shared: Sequence[float] | NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """As `TsaiModel.project`."""
        projection = self.model.project([self.focal_length, *shared], points)
        if projection is None:
            return None
        image, by_shared, by_point = projection
        return image, by_shared[:, :, 1:], by_point


def derivative_by_point(
    by_x_u: NDArray[np.float64], x_u: NDArray[np.float64], focal_length: float, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Derivatives (n, 2, 3) by the point in the camera frame, from the derivatives by x_u = f (x, y) / z."""
    by_point = np.empty((len(points), 2, 3))
    by_point[:, :, :2] = focal_length * by_x_u
    by_point[:, :, 2] = -(by_x_u @ x_u[:, :, None])[:, :, 0]
    return by_point / points[:, 2, None, None]
