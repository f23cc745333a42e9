"""Draws images, masks, circles, ellipses and the rims of pegs in pixel coordinates (`plotting` passes them on)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgba
from matplotlib.patches import Ellipse

from .style import COLORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from ..pegs import PegObservation

    Floats = NDArray[np.float64]

TURN = np.linspace(0, 2 * np.pi, 100)


def plot_image(
    ax: Axes,
    image: ArrayLike,
    title: str | None = None,
    *,
    limits: tuple[float, float, float, float] | None = None,
) -> None:
    """Show an image with pixel coordinates; `limits` = (left, right, top, bottom), px, draws only that part.

    Grey values are those of `white_level`, so dark images can be seen.
    """
    image = np.asarray(image)
    left, right, top, bottom = (0, image.shape[1] - 1, 0, image.shape[0] - 1) if limits is None else limits
    box = _shown_box(image.shape, left, right, top, bottom)
    _show_part(ax, image[box], box, vmin=0, vmax=white_level(image))
    if limits is not None:
        ax.set(xlim=(left, right), ylim=(bottom, top))
    ax.set(xlabel="x (px)", ylabel="y (px)", title=title)


def white_level(image: NDArray[np.generic]) -> float:
    """The grey value to show as white: of an 8-bit image the end of the quarter of the range with its brightest pixel.

    So a brighter pixel or two do not change how the rest is shown.
    """
    return int(image.max()) // 64 * 64 + 63 if image.dtype == np.uint8 else image.max()


def _shown_box(shape, left, right, top, bottom):
    """Slices of the rows and columns of the pixels within limits."""
    first = np.clip(np.floor([top, left]), 0, np.array(shape[:2]) - 1).astype(int)
    last = np.clip(np.ceil([bottom, right]), 0, np.array(shape[:2]) - 1).astype(int)
    return tuple(slice(low, high + 1) for low, high in zip(first, last, strict=False))


def _show_part(ax, part, box, **style):
    """Show a part of an image at its position in the image."""
    rows, columns = box
    extent = (columns.start - 0.5, columns.stop - 0.5, rows.stop - 0.5, rows.start - 0.5)
    ax.imshow(part, interpolation="nearest", extent=extent, **style)


def plot_mask(ax: Axes, mask: ArrayLike, *, color: str, label: str | None = None, alpha: float = 0.75) -> None:
    """Draw a mask over the image in `ax`, in one colour."""
    mask = np.asarray(mask, bool)
    y, x = np.nonzero(mask)
    if len(x):
        box = _shown_box(mask.shape, x.min(), x.max(), y.min(), y.max())
        layer = np.zeros((*mask[box].shape, 4))
        layer[mask[box]] = to_rgba(color, alpha)
        _show_part(ax, layer, box)
    ax.fill([], [], color=color, alpha=alpha, label=label)


def plot_circles(
    ax: Axes, centers: ArrayLike, radii: ArrayLike, *, color: str = COLORS["genetic"], label: str | None = None
) -> None:
    """Draw circles with their centres."""
    for center, radius in zip(np.atleast_2d(centers), np.atleast_1d(radii), strict=False):
        ax.add_patch(plt.Circle(center, radius, fill=False, color=color, linewidth=1.2))
    ax.plot(*np.atleast_2d(centers).T, "+", color=color, markersize=7, label=label)


def plot_ellipses(
    ax: Axes,
    centers: Floats,
    semi_axes: Floats,
    angles: Floats,
    *,
    color: str = COLORS["joint"],
    label: str | None = None,
) -> None:
    """Draw ellipses with their centres; semi-axes in px, angles in rad."""
    for center, (major, minor), angle in zip(centers, semi_axes, angles, strict=False):
        ax.add_patch(
            Ellipse(center, 2 * major, 2 * minor, angle=np.rad2deg(angle), fill=False, color=color, linewidth=1.2)
        )
    ax.plot(*np.atleast_2d(centers).T, "x", color=color, markersize=5, label=label)


def plot_rims(ax: Axes, observation: PegObservation, *, color: str = COLORS["joint"]) -> None:
    """Draw the rims of located pegs as they look in their plane's perspective, with the centres of these outlines."""
    for rim in peg_rims(observation):
        ax.plot(*rim.T, color=color, linewidth=1.2)
    ax.plot(*observation.peg_centers.T, "+", color=color, markersize=7)


def peg_rims(observation: PegObservation) -> NDArray[np.float64]:
    """Images of the pegs' rims (n_pegs, 100, 2), px: circles in the plane of the pegs, with the area that was found."""
    center = _mapped(np.linalg.inv(observation.homography), observation.peg_centers)
    outlines = center[:, None] + np.column_stack([np.cos(TURN), np.sin(TURN)])
    images = _mapped(observation.homography, outlines) - observation.peg_centers[:, None]
    x, y = images[:, :-1].transpose(2, 0, 1)
    following = images[:, 1:].transpose(2, 0, 1)
    area = np.abs((x * following[1] - y * following[0]).sum(axis=1)) / 2
    radius = observation.peg_radii / np.sqrt(area / np.pi)
    return _mapped(observation.homography, center[:, None] + radius[:, None, None] * (outlines - center[:, None]))


def _mapped(homography, points):
    """Points (..., 2) through a homography."""
    image = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ homography.T
    return image[..., :2] / image[..., 2:]
