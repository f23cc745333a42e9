"""The objective of stage 2: the mean distance (Eq. 7), with kappa1 by Eq. 6."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...camera import distort_radius, max_undistorted_radius
from ...checks import as_choice, as_matched_points
from ..result import MINIMUM_POINTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

PENALTY = 1e6
"""Objective, px, for a chromosome for which a point lies behind the camera or has no image."""


def kappa1_per_point(
    focal_length: float | NDArray[np.float64],
    t_z: float | NDArray[np.float64],
    c1: NDArray[np.float64],
    c2: NDArray[np.float64],
    c3: NDArray[np.float64],
    c4: NDArray[np.float64],
) -> NDArray[np.float64]:
    r"""Eq. 6 as printed: the kappa1, mm^-2, that makes each point's y equation exact.

    .. math:: \kappa_1 = \frac{c_3 f}{c_1 (c_2 + T_z)} - \frac{c_4}{c_1}

    with :math:`c_1 = d_y y_i r^2`, :math:`c_2 = r_7 x_w + r_8 y_w`, :math:`c_3 = r_4 x_w + r_5 y_w + T_y`,
    :math:`c_4 = d_y' y_i` of each point (n,), in mm on the sensor and in the world (see `TwoStageObjective`).
    `focal_length` and `t_z` broadcast against them.  A point on the camera's x axis (c1 = 0) tells nothing
    about distortion and gets 0.
    """
    on_axis = c1 == 0
    safe = np.where(on_axis, 1.0, c1)
    return np.where(on_axis, 0.0, c3 * focal_length / (safe * (c2 + t_z)) - c4 / safe)


def kappa1_shared(
    focal_length: float | NDArray[np.float64],
    t_z: float | NDArray[np.float64],
    c1: NDArray[np.float64],
    c2: NDArray[np.float64],
    c3: NDArray[np.float64],
    c4: NDArray[np.float64],
) -> NDArray[np.float64]:
    r"""One kappa1, mm^-2, for all points, by least squares of Eq. 6's y equation; arguments as for `kappa1_per_point`.

    .. math:: \kappa_1 = \frac{\sum c_1 \, (c_3 f / (c_2 + T_z) - c_4)}{\sum c_1^2}

    The sums run over the last axis, which is kept with length 1.
    """
    y_u = c3 * focal_length / (c2 + t_z)
    return np.sum(c1 * (y_u - c4), axis=-1, keepdims=True) / np.sum(c1**2, axis=-1, keepdims=True)


class TwoStageObjective:
    r"""Eq. 7 for many chromosomes (f, T_z) at once, with R, T_x and T_y held at stage 1.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm.
    image_points : (n, 2) array_like
        Measured, px.
    linear : Calibration
        Stage 1 of the same view (`calibrate_tsai`).
    kappa1 : {"shared", "per-point"}
        One coefficient per chromosome (`kappa1_shared`), or one per point, exactly as Eq. 6 is printed.
        With one per point, each y residual is zero, and with the measured radius in Eq. 3 each x residual depends on
        neither f nor T_z.  So Eq. 7 is then the same for all chromosomes.

    Attributes
    ----------
    c1, c2, c3, c4 : (n,) ndarray
        The constants of Eq. 6.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_tsai
    >>> from pegpose_lab.calibration import TwoStageObjective
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> linear = calibrate_tsai(board, image, sensor)
    >>> TwoStageObjective(board, image, linear)([[8.0, 500.0], [8.4, 500.0]]).round(1).tolist()
    [0.0, 2.3]
    """

    def __init__(self, object_points, image_points, linear, *, kappa1="shared"):
        object_points, image_points = as_matched_points(object_points, image_points, MINIMUM_POINTS)
        pose = linear.cam_from_object[0]
        x_turned, y_turned, self.c2 = pose.rotation.apply(object_points).T
        self.form = as_choice(kappa1, "kappa1", ("shared", "per-point"))
        self.pixels_per_mm = np.array(linear.camera.pixels_per_mm)
        self.sensor_points = linear.camera.to_sensor(image_points)
        self.squared_radius = np.sum(self.sensor_points**2, axis=1)
        self.x_c = x_turned + pose.translation[0]
        self.c3 = y_turned + pose.translation[1]
        self.c4 = self.sensor_points[:, 1]
        self.c1 = self.c4 * self.squared_radius
        self.lateral = np.hypot(self.x_c, self.c3)

    @classmethod
    def stack(cls, objectives: Sequence[TwoStageObjective]) -> TwoStageObjective:
        """Combine r objectives with equal numbers of points; chromosomes (r, m, 2) then have one row per objective."""
        both = object.__new__(cls)
        both.form = objectives[0].form
        for name in ("pixels_per_mm", "sensor_points", "squared_radius", "x_c", "c1", "c2", "c3", "c4", "lateral"):
            setattr(both, name, np.stack([getattr(objective, name) for objective in objectives])[:, None])
        return both

    def __call__(self, chromosomes):
        """Eq. 7, px, of chromosomes (m, 2); `PENALTY` if a point lies behind the camera or has no image."""
        residual_x, residual_y, valid = self._residuals(chromosomes)
        distances = np.sqrt(residual_x**2 + residual_y**2)
        return np.where(valid, np.minimum(distances.mean(axis=-1), PENALTY), PENALTY)

    def residuals(self, chromosomes: ArrayLike) -> NDArray[np.float64]:
        """Projected minus measured, px, (m, n, 2), of chromosomes (m, 2) that see all points."""
        return np.stack(self._residuals(chromosomes)[:2], axis=-1)

    def kappa1(self, chromosomes: ArrayLike) -> NDArray[np.float64]:
        """kappa1, mm^-2, of chromosomes (m, 2): shape (m, 1) if shared, (m, n) if per point."""
        return self._kappa1(*self._in_front(chromosomes)[:2])

    def _in_front(self, chromosomes):
        """Columns f and T_z (m, 1), and whether all points are in front (m,); if not, T_z gets a valid value."""
        focal_length, t_z = np.moveaxis(np.asarray(chromosomes, np.float64), -1, 0)[..., None]
        nearest = self.c2.min(axis=-1, keepdims=True)
        front = nearest + t_z > 0
        return focal_length, np.where(front, t_z, 1 - nearest), front[..., 0]

    def _kappa1(self, focal_length, t_z):
        equation_6 = kappa1_per_point if self.form == "per-point" else kappa1_shared
        return equation_6(focal_length, t_z, self.c1, self.c2, self.c3, self.c4)

    def _residuals(self, chromosomes):
        """Residuals in x and in y (m, n), and whether a chromosome sees all points (m,)."""
        focal_length, t_z, valid = self._in_front(chromosomes)
        magnification = focal_length / (self.c2 + t_z)
        kappa1 = self._kappa1(focal_length, t_z)
        if self.form == "per-point":
            stretch = 1 + kappa1 * self.squared_radius  # Eq. 3 with the measured radius, as printed
            valid = valid & np.all(stretch != 0, axis=-1)
            factor = magnification / np.where(stretch == 0, 1.0, stretch)
        else:
            undistorted = magnification * self.lateral
            valid = valid & np.all(undistorted <= max_undistorted_radius(kappa1), axis=-1)
            factor = distort_radius(undistorted, kappa1) / np.where(self.lateral > 0, self.lateral, 1.0)
        x_d, y_d = np.moveaxis(self.sensor_points, -1, 0)
        scale_x, scale_y = np.moveaxis(self.pixels_per_mm, -1, 0)[..., None]
        return (factor * self.x_c - x_d) * scale_x, (factor * self.c3 - y_d) * scale_y, valid
