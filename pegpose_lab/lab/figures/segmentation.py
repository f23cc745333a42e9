"""Figures of notebook 01: grey values and thresholds, masks on several backgrounds, and the bias of a mask's radius."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import ListedColormap
from scipy.special import ndtr, ndtri

from ..plotting import COLORS, SERIES, plot_image

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Limits = tuple[float, float, float, float]

THRESHOLD = SERIES[1]
"""Colour of Otsu's threshold."""

PEG = SERIES[4]
"""Colour of the parts of a mask that are pegs, or discs of the hub."""


def plot_part_names(ax: Axes, centers: Mapping[str, Floats]) -> None:
    """Write the name of each part at its centre, px; those of screws, which are small, stand above them."""
    for name, center in centers.items():
        screw = name.startswith("screw")
        color, lift = ("white", 11) if screw else ("black", 0)
        style = {"ha": "center", "va": "center", "fontsize": 8, "color": color}
        ax.annotate(name, center, (0, lift), textcoords="offset points", **style)


def plot_grey_values(
    ax: Axes, image: NDArray[np.uint8], rows: Mapping[int, str], threshold: float, reach: tuple[int, int]
) -> None:
    """Draw the grey values along rows of an image between two columns, and a threshold.

    `rows` maps a row, px, to its colour; `reach` is the first and the last column, px.
    """
    x = np.arange(reach[0], reach[1] + 1)
    for row, color in rows.items():
        ax.plot(x, image[row, x], color=color, linewidth=0.9, label=f"row y = {row} px")
    ax.axhline(threshold, color="black", linestyle=":", label=f"Otsu's threshold, {threshold:.0f}")
    ax.set(xlabel="x (px)", ylabel="grey value", xlim=reach, ylim=(0, 190), title="grey values along two rows")
    ax.set_box_aspect(0.95)


def plot_histogram(ax: Axes, counts: NDArray[np.int_], levels: Mapping[str, float], threshold: float) -> None:
    """Draw a histogram (256,) of grey values on a logarithmic scale, with the names of its levels, and a threshold."""
    ax.stairs(counts, np.arange(257) - 0.5, fill=True, color="0.65")
    for name, grey in levels.items():
        outer = grey < threshold or grey == max(levels.values())
        side, shift = ("left", 5) if outer else ("right", -5)
        ax.annotate(name, (grey, counts[int(grey)]), (shift, 2), textcoords="offset points", ha=side, fontsize=9)
    ax.axvline(threshold, color=THRESHOLD)
    ax.annotate(f"t* = {threshold:.0f}", (threshold, 4 * counts.max()), (5, -9), textcoords="offset points", fontsize=9)
    ax.set(xlabel="grey value", ylabel="pixels", yscale="log", xlim=(25, 186), ylim=(1, 6 * counts.max()))


def plot_between_class_variance(ax: Axes, variance: Floats, flat: Sequence[int], threshold: float) -> None:
    """Draw the between-class variance (255,) over the threshold, and the range `flat` in which it is near its maximum."""
    ax.axvspan(flat[0], flat[-1], color="0.9")
    ax.plot(variance, color=SERIES[0])
    ax.axvline(threshold, color=THRESHOLD)
    ax.annotate("within 1 %\nof the\nmaximum", (threshold + 3, 0.06 * variance.max()), fontsize=9)
    ax.annotate(
        f"t* = {threshold:.0f}", (threshold, 1.06 * variance.max()), (5, 0), textcoords="offset points", fontsize=9
    )
    ax.set(xlabel="threshold t (grey value)", ylabel="$\\sigma_B^2$ (grey values²)")
    ax.set(xlim=(25, 186), ylim=(0, 1.15 * variance.max()))


def plot_masks(
    axes: NDArray,
    image: NDArray[np.uint8],
    masks: Iterable[tuple[NDArray[np.bool_], NDArray[np.bool_], str]],
    title: str,
    limits: Limits,
) -> None:
    """Draw one column: an image, then masks of it, in which the parts that are pegs have a colour of their own.

    Parameters
    ----------
    axes : (1 + masks,) Axes
    image : (height, width) uint8
    masks : iterable of (mask, pegs, title)
        Both (height, width) bool.
    title : str
        Of the image.
    limits : (left, right, top, bottom)
        The part that is drawn, px.
    """
    plot_image(axes[0], image, title, limits=limits)
    for ax, (mask, pegs, text) in zip(axes[1:], masks, strict=True):
        kind = mask.astype(np.uint8) + (mask & pegs)
        plot_image(ax, kind, text, limits=limits)
        ax.images[0].set(cmap=ListedColormap(["#222222", "0.88", PEG]), clim=(0, 2))
    for ax in axes:
        ax.set(xticks=[], yticks=[], xlabel=None, ylabel=None)
        ax.title.set_size(9)
        for spine in ax.spines.values():
            spine.set(visible=True, color="0.5")


def plot_edge(ax: Axes, grey: Mapping[str, float], sigma: float, threshold: float) -> None:
    """Draw the grey value across a blurred straight edge, and where a threshold cuts it.

    Parameters
    ----------
    ax : Axes
    grey : {"outside": float, "inside": float}
    sigma : float
        Standard deviation of blur and pixel together, px.
    threshold : float
        Below half-way between the levels, so that the cut lies outside the edge.
    """
    d = np.linspace(-3, 3, 200)
    low, step = grey["outside"], grey["inside"] - grey["outside"]
    cut = sigma * ndtri((threshold - low) / step)
    ax.plot(d, low + step * ndtr(d / sigma), color=SERIES[0])
    ax.axvline(0, color=COLORS["truth"], linewidth=0.8)
    ax.plot([-3, cut], [threshold] * 2, color="black", linestyle=":")
    ax.plot([cut] * 2, [low - 12, threshold], color=THRESHOLD)
    ax.annotate("Otsu's threshold", (-2.9, threshold + 2), fontsize=9)
    ax.annotate("true edge", (0.1, low - 10), fontsize=9, color=COLORS["truth"])
    ax.annotate("mask's\nedge", (cut - 0.1, low - 10), fontsize=9, ha="right", color=THRESHOLD)
    ax.set(xlabel="distance from the edge (px)", ylabel="grey value", xlim=(-3, 3), ylim=(low - 12, low + step + 8))


def plot_mask_bias(ax: Axes, thresholds: Floats, bias: Floats, calculated: Floats) -> None:
    """Draw the error of radii (thresholds, pegs) as the range of all pegs, and what was calculated (thresholds,); px."""
    ax.fill_between(thresholds, bias.min(axis=1), bias.max(axis=1), color=PEG, label="masks, four pegs", linewidth=0)
    ax.plot(thresholds, calculated, color="black", label="calculated")
    ax.axhline(0, color="0.85", linewidth=0.8, zorder=0)
    ax.set(xlabel="threshold t (grey value)", ylabel="error of the radius (px)", xlim=(thresholds[0], thresholds[-1]))
    ax.legend(fontsize=9)


def plot_bias_left(ax: Axes, thresholds: Floats, left_over: Floats) -> None:
    """Draw measured minus calculated errors of radii (thresholds, pegs), px, one line for each peg."""
    for peg, color in zip(range(left_over.shape[1]), SERIES, strict=False):
        ax.plot(thresholds, left_over[:, peg], color=color, linewidth=1.2, label=f"peg {peg + 1}")
    ax.axhline(0, color="0.85", linewidth=0.8, zorder=0)
    ax.set(
        xlabel="threshold t (grey value)", ylabel="masks minus calculated (px)", xlim=(thresholds[0], thresholds[-1])
    )
    ax.legend(fontsize=9, ncols=2)
