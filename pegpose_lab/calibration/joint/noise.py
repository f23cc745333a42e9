"""The noise of each view by itself, without a camera: what no smooth image of the plane explains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .homographies import linear_homographies, plane_rotations
from .views import Views

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

LEAST_POINTS = 16
"""A cubic has ten coefficients; with fewer points than this it leaves too little to measure noise by."""


def own_noise(
    object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Sigma per axis, px, of planes' points (V,), about a homography and a cubic of the plane's coordinates.

    The cubic follows the distortion of an ordinary lens, so a view of any camera has about its corners' noise.  0 for
    views of fewer than `LEAST_POINTS` points.
    """
    views, planes = Views.stack(object_points, image_points), plane_rotations(object_points)
    matrices = linear_homographies(views, planes, views.image)[0]
    sigmas = np.zeros(len(object_points))
    for view, (points, measured) in enumerate(zip(object_points, image_points, strict=True)):
        if len(points) < LEAST_POINTS:
            continue
        x, y = ((points - views.centroids[view]) @ planes[view].T)[:, :2].T
        seen = np.column_stack([x, y, np.ones(len(x))]) @ matrices[view].T
        left = measured - seen[:, :2] / seen[:, 2:]
        x, y = x / np.abs(x).max(), y / np.abs(y).max()
        design = np.column_stack([x**i * y**j for i in range(4) for j in range(4 - i)])
        left = left - design @ np.linalg.lstsq(design, left, rcond=None)[0]
        sigmas[view] = np.sqrt(np.sum(left**2) / (2 * len(points) - 20))
    return sigmas
