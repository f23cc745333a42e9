"""The algebra of Tsai's linear solution of a plane (`tsai`), for many solutions at once.

`tsai` solves and judges one image.  This file has the same equations for arrays, without checks: for the derivatives
with which `tsai` propagates noise, and for simulations of many images of one board.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...camera import Sensor, TsaiCamera, as_sensor
from ...checks import CalibrationError, as_points


def solve_images(
    object_points: ArrayLike, image_points: ArrayLike, camera: Sensor | TsaiCamera
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    r"""Solve many images of one board by the linear solution only, for simulations.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 5, with z = 0.  The world's origin must not lie near the plane y_c = 0; this is not checked.
    image_points : (m, n, 2) array_like
        px.
    camera : Sensor or TsaiCamera
        As for `calibrate_tsai`.

    Returns
    -------
    (m,) ndarray, (m,) ndarray, (m,) ndarray
        f and T_z, mm, and the mean distance of Eq. 7, px, of each image, as by `calibrate_tsai`.

    Raises
    ------
    ValueError
        If the points do not lie in z = 0, or the shapes do not fit.
    CalibrationError
        If an image has no solution with the whole board in front of the camera.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor
    >>> from pegpose_lab.calibration import solve_images
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> images = [sensor.camera(f).project(board, pose) for f in (8.0, 9.0)]
    >>> focal_length, t_z, _ = solve_images(board, images, sensor)
    >>> focal_length.round(3).tolist(), t_z.round(1).tolist()
    ([8.0, 9.0], [500.0, 500.0])
    """
    points, image_points = as_points(object_points, 3, "object_points"), np.asarray(image_points, np.float64)
    if np.any(points[:, 2] != 0):
        raise ValueError(
            f"object_points have z from {points[:, 2].min():g} to {points[:, 2].max():g} mm; expected z = 0"
        )
    if image_points.ndim != 3 or image_points.shape[1:] != (len(points), 2):
        raise ValueError(f"image_points has shape {image_points.shape}; expected (m, {len(points)}, 2)")
    points = points[:, :2]
    sensor = as_sensor(camera)
    sensor_points = sensor.to_sensor(image_points.reshape(-1, 2)).reshape(image_points.shape)
    rows = solve_ratios(points, sensor_points, _ratios(points, sensor_points))
    focal_length = rows[0]
    x_c, y_c, z_c = (row[:, :2] @ points.T + row[:, 2:] for row in rows[1:])
    if not np.all((z_c > 0) & (focal_length[:, None] > 0)):
        raise CalibrationError("an image has no linear solution with the whole board before the camera")
    projected = np.stack([x_c, y_c], axis=-1) * (focal_length[:, None] / z_c)[..., None]
    distances = np.linalg.norm((projected - sensor_points) * sensor.pixels_per_mm, axis=-1)
    return focal_length, rows[3][:, 2], distances.mean(axis=-1)


def _ratios(points, sensor_points):
    """Ratios U (m, 5) of the radial alignment equations, by least squares with scaled columns."""
    x_d, y_d = sensor_points[..., :1], sensor_points[..., 1:]
    design = np.concatenate([y_d * points, y_d, -x_d * points], axis=-1)
    scale = np.linalg.norm(design, axis=1, keepdims=True)
    return (np.linalg.pinv(design / scale) @ x_d)[..., 0] / scale[:, 0]


def solve_ratios(
    points: NDArray[np.float64], sensor_points: NDArray[np.float64], ratios: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    r"""f and the pose from the ratios :math:`U = (r_1, r_2, T_x, r_4, r_5) / T_y` of a plane z = 0.

    Parameters
    ----------
    points : (n, 2) ndarray
        x, y, mm.
    sensor_points : (n, 2) or (m, n, 2) ndarray
        mm, for all sets of ratios or for each.
    ratios : (m, 5) ndarray

    Returns
    -------
    (m,) ndarray
        f, mm.
    (m, 3) ndarray, three times
        :math:`(r_1, r_2, T_x)`, :math:`(r_4, r_5, T_y)` and :math:`(r_7, r_8, T_z)`.
    """
    u1, u2, u3, u4, u5 = ratios.T
    s, d = u1**2 + u2**2 + u4**2 + u5**2, u1 * u5 - u2 * u4
    t_y = np.sqrt(2 / (s + np.sqrt(np.maximum(s**2 - 4 * d**2, 0.0))))
    t_y = t_y * np.where(_votes(points, sensor_points, ratios) >= 0, 1.0, -1.0)
    r1, r2, t_x, r4, r5 = u1 * t_y, u2 * t_y, u3 * t_y, u4 * t_y, u5 * t_y
    product = -(r1 * r4 + r2 * r5)  # equals r3 r6, because the rows are orthogonal
    rest = 1 - r1**2 - r2**2, 1 - r4**2 - r5**2
    larger = np.sqrt(np.maximum(np.maximum(*rest), 0.0))
    smaller = np.divide(product, larger, out=np.zeros_like(product), where=larger > 0)
    r3, r6 = np.where(rest[0] > rest[1], (larger, smaller), (smaller, larger))
    r7, r8 = r2 * r6 - r3 * r5, r3 * r4 - r1 * r6
    y_d = sensor_points[..., 1]
    y_c = np.stack([r4, r5], axis=-1) @ points.T + t_y[:, None]
    side = y_d * (np.stack([r7, r8], axis=-1) @ points.T)
    design = np.stack([y_c, np.broadcast_to(-y_d, y_c.shape)], axis=-1)
    scale = np.linalg.norm(design, axis=1, keepdims=True)
    focal_length, depth = ((np.linalg.pinv(design / scale) @ side[..., None])[..., 0] / scale[:, 0]).T
    sign = np.where(
        focal_length < 0, -1.0, 1.0
    )  # if negative, the other signs of r3, r6, and so of r7, r8, are correct
    return (
        sign * focal_length,
        np.stack([r1, r2, t_x], axis=-1),
        np.stack([r4, r5, t_y], axis=-1),
        np.stack([sign * r7, sign * r8, sign * depth], axis=-1),
    )


def _votes(points, sensor_points, ratios):
    """For T_y > 0: the number of coordinates with the sign of the measured ones, minus the number of the others."""
    x_c, y_c = ratios[:, :2] @ points.T + ratios[:, 2:3], ratios[:, 3:] @ points.T + 1
    x_d, y_d = np.moveaxis(sensor_points, -1, 0)
    return np.sum(np.sign(x_c * x_d) + np.sign(y_c * y_d), axis=-1)
