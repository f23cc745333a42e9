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
    sigmas = np.zeros(len(object_points))
    for view, pair in enumerate(zip(object_points, image_points, strict=True)):
        if len(pair[0]) >= LEAST_POINTS:
            left = smooth_residuals(*pair)
            sigmas[view] = np.sqrt(np.sum(left**2) / (2 * len(left) - 20))
    return sigmas


def smooth_residuals(
    object_points: NDArray[np.float64], image_points: NDArray[np.float64], kept: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Residuals (n, 2), px, of a plane's points about a homography and a cubic that are fitted to the points `kept`."""
    kept = np.ones(len(object_points), bool) if kept is None else kept
    x, y, left = _about_homography(object_points, image_points, kept)
    x, y = x / np.abs(x).max(), y / np.abs(y).max()
    design = np.column_stack([x**i * y**j for i in range(4) for j in range(4 - i)])
    return left - design @ np.linalg.lstsq(design[kept], left[kept], rcond=None)[0]


def homography_misses(object_points: NDArray[np.float64], image_points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Residuals (n, 2), px, of a plane's points about a homography."""
    return _about_homography(object_points, image_points, np.ones(len(object_points), bool))[2]


def _about_homography(object_points, image_points, kept):
    """Coordinates x and y in the plane, and the residuals about a homography that is fitted to the points kept."""
    views, planes = Views.stack([object_points[kept]], [image_points[kept]]), plane_rotations([object_points])
    matrix = linear_homographies(views, planes, views.image)[0][0]
    x, y = ((object_points - views.centroids[0]) @ planes[0].T)[:, :2].T
    seen = np.column_stack([x, y, np.ones(len(x))]) @ matrix.T
    return x, y, image_points - seen[:, :2] / seen[:, 2:]
