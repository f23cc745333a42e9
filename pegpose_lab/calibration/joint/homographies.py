"""Homographies of planes by the normalised direct linear transform, and the f and the poses that they give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..planes import plane_rotation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...camera import Sensor
    from .views import Views


def plane_rotations(object_points: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Rotations (V, 3, 3) from the objects' frames into the frames of the planes through their points."""
    return np.array([plane_rotation(points) for points in object_points])


def homographies_of(views: Views, planes: NDArray[np.float64], sensor: Sensor) -> NDArray[np.float64]:
    """Homographies (V, 3, 3) from the planes (see `plane_rotations`; origin at the points' centroid) to the sensor in
    mm, by the normalised direct linear transform."""
    return linear_homographies(views, planes, (views.image - sensor.principal_point) / sensor.pixels_per_mm)[0]


def linear_homographies(
    views: Views, planes: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Homographies (V, 3, 3) from planes to target points (V, m, 2), and the rms residual of each per axis, in units
    of the target points' spread per axis."""
    in_plane = views.points @ planes.transpose(0, 2, 1)
    source, from_plane = _normalised(in_plane[:, :, :2], views.used)
    target, from_target = _normalised(target, views.used)
    ones, zeros = views.used[:, :, None], np.zeros_like(source[:, :, :1])
    rows = np.concatenate([source, ones, zeros, zeros, zeros], axis=2)
    other = np.concatenate([zeros, zeros, zeros, source, ones], axis=2)
    plane = np.concatenate([source, ones], axis=2)
    design = np.concatenate(
        [
            np.concatenate([rows, -target[:, :, :1] * plane], axis=2),
            np.concatenate([other, -target[:, :, 1:] * plane], axis=2),
        ],
        axis=1,
    )
    values, vectors = np.linalg.eigh(design.transpose(0, 2, 1) @ design)
    left = np.sqrt(np.maximum(values[:, 0], 0) / views.used.sum(axis=1))
    return np.linalg.inv(from_target) @ vectors[:, :, 0].reshape(-1, 3, 3) @ from_plane, left


def _normalised(points, used):
    """Points scaled to mean 0 and mean square 2, zero where unused, and the matrices (V, 3, 3) that scale them."""
    count = used.sum(axis=1)
    mean = (points * used[:, :, None]).sum(axis=1) / count[:, None]
    points = (points - mean[:, None]) * used[:, :, None]
    scale = np.sqrt(2 * count / np.maximum((points**2).sum(axis=(1, 2)), 1e-300))
    matrix = np.zeros((len(points), 3, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = scale
    matrix[:, :2, 2], matrix[:, 2, 2] = -scale[:, None] * mean, 1
    return points * scale[:, None, None], matrix


def focal_length_of(homographies: NDArray[np.float64]) -> float | None:
    """f, mm, by least squares over Zhang's two constraints of each view: the columns h1, h2 of diag(1/f, 1/f, 1) H are
    orthogonal and of equal length.  None if no f fits."""
    h1, h2 = (homographies / np.linalg.norm(homographies, axis=(1, 2), keepdims=True)).transpose(2, 0, 1)[:2]
    lateral = np.concatenate([h1[:, :2] * h2[:, :2], (h1[:, :2] ** 2 - h2[:, :2] ** 2) / 2]).sum(axis=1)
    axial = np.concatenate([h1[:, 2] * h2[:, 2], (h1[:, 2] ** 2 - h2[:, 2] ** 2) / 2])
    inverse_square = -(lateral @ axial) / max(lateral @ lateral, 1e-300)
    return inverse_square**-0.5 if inverse_square > 0 else None


def poses_of(
    homographies: NDArray[np.float64], planes: NDArray[np.float64], focal_length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (V, 3, 3) of the objects and positions (V, 3) of their centroids, by the planes' homographies."""
    columns = np.diag([1 / focal_length, 1 / focal_length, 1.0]) @ homographies
    scale = (np.linalg.norm(columns[:, :, 0], axis=1) + np.linalg.norm(columns[:, :, 1], axis=1)) / 2
    columns = columns * (np.sign(columns[:, 2, 2]) / scale)[:, None, None]
    third = np.cross(columns[:, :, 0], columns[:, :, 1])
    left, _, right = np.linalg.svd(np.stack([columns[:, :, 0], columns[:, :, 1], third], axis=2))
    return left @ right @ planes, columns[:, :, 2]
