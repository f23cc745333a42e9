"""Drawings of a calibration over the image: how uncertain it projects, and how two calibrations differ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import LogNorm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from ..calibration import ImageMap

LEVELS, DECADES = 16, 1000.0
"""Colours of a map, and the largest ratio of its values that a logarithmic one shows: below it all is as good as none."""

DIGITS = 3
"""Decimal places of the logarithm of a value that is drawn, so that another machine's rounding moves no colour."""

STEP = 0.1
"""The scale of a map with a centre ends at a multiple of this, so that another machine's rounding moves no colour."""

DOT = 1.5
"""Points, the size of a drawn corner: thousands of corners leave the map visible."""


def plot_image_map(
    ax: Axes,
    image_map: ImageMap,
    *,
    image_points: Sequence[ArrayLike] = (),
    title: str | None = None,
    logarithmic: bool = False,
    center: float | None = None,
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
    logarithmic : bool
        Colours in equal ratios, for maps that grow many times where no corner was seen; what is below a thousandth of
        the largest value has the lowest colour.
    center : float, optional
        The value that is drawn white, in the middle of the scale: below it the map is blue, above it red.

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
    >>> float(ax.get_ylim()[0])  # y is down, as in the image
    1199.0
    """
    values, style = image_map.values, {"levels": LEVELS, "cmap": "cividis"}
    if center is not None:
        reach = np.ceil(np.abs(values - center).max() / STEP) * STEP
        style = {"levels": np.linspace(center - reach, center + reach, LEVELS), "cmap": "RdBu_r"}
    elif logarithmic:
        exponents = np.round(np.log10(np.maximum(values, values.max() / DECADES)), DIGITS)
        values = 10**exponents
        low, high = values.min(), values.max()
        style |= {"levels": np.geomspace(low, high, LEVELS), "norm": LogNorm(low, high)}
    filled = ax.contourf(image_map.x, image_map.y, values, **style)
    bar = ax.figure.colorbar(filled, ax=ax, label=image_map.label, shrink=0.85)
    if center is not None:
        ticks = np.linspace(center - reach, center + reach, 5)
        bar.set_ticks(ticks, labels=[f"{value:.2f}" for value in ticks])
    elif logarithmic:
        ticks = _round_values(filled.levels[0], filled.levels[-1])
        bar.set_ticks(ticks, labels=[f"{value:g}" for value in ticks])
        bar.minorticks_off()
    for points in image_points:
        ax.plot(*np.transpose(points), ".", color="white", markersize=DOT, alpha=0.6)
    ax.set(xlim=image_map.x[[0, -1]], ylim=image_map.y[[-1, 0]], aspect="equal", title=title)
    ax.set(xlabel="x (px)", ylabel="y (px)")
    return filled


def _round_values(low, high):
    """1, 2 and 5 times powers of ten from low to high; the ends where there are fewer than two of them."""
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.log10(high) + 1)
    values = np.outer(decades, (1, 2, 5)).ravel()
    inside = values[(values >= low) & (values <= high)]
    return inside if len(inside) > 1 else np.array([low, high])
