"""Drawings of a calibration over the image: how uncertain it projects, and how two calibrations differ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .plotting import plot_map

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from ..calibration import ImageMap

DOT = 1.5
"""Points, the size of a drawn corner: thousands of corners leave the map visible."""


def plot_image_map(
    ax: Axes, image_map: ImageMap, *, image_points: Sequence[ArrayLike] = (), title: str | None = None
) -> Any:
    """Draw a map over the image, with a colour bar and, as dots, the points that the calibration was made from.

    Parameters
    ----------
    ax : Axes
    image_map : ImageMap
        Of `ProjectionUncertainty.map`, `CalibrationDifference.map` or `Halves.map`.
    image_points : sequence of (n, 2) array_like
        px, an entry for each view.
    title : str, optional
        The map's own label stands at the colour bar.

    Returns
    -------
    ContourSet
        The filled contours.

    Examples
    --------
    >>> from pegpose_lab.calibration import difference
    >>> from pegpose_lab.lab import plotting
    >>> from pegpose_lab.paper import paper_camera
    >>> camera = paper_camera()
    >>> fig, ax = plotting.figure()
    >>> found = difference(camera, camera.with_parameters(kappa1=1.1 * camera.kappa1))
    >>> _ = plot_image_map(ax, found.map(), title="10 % more distortion")
    >>> ax.get_ylim()  # y is down, as in the image
    (1199.0, 0.0)
    """
    filled = plot_map(ax, image_map.x, image_map.y, image_map.values)
    ax.figure.colorbar(filled, ax=ax, label=image_map.label, shrink=0.85)
    for points in image_points:
        ax.plot(*np.transpose(points), ".", color="white", markersize=DOT, alpha=0.6)
    ax.set(xlim=image_map.x[[0, -1]], ylim=image_map.y[[-1, 0]], xlabel="x (px)", ylabel="y (px)", title=title)
    return filled
