"""Figures of notebook 08: the audit at a glance, Table 2's square, Table 3's drift, shares of points, candidates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..plotting import plot_block_means, plot_dots, plot_quadrilateral
from ..style import COLORS, SERIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

A, B = SERIES[:2]
"""The colours of the two readings."""

STATUS = {
    "determined": (SERIES[2], "o"),
    "not determined": (SERIES[3], "s"),
    "candidate": (SERIES[5], "D"),
}
"""Colour and symbol of an item: settled by printed numbers or an argument, open, and open with a candidate shown."""

_NAMES = {"candidate": "not determined, with a candidate"}  # in the legend
_PLACES = {"status": 0.012, "item": 0.04, "finding": 0.33}  # of the width of the axes


def plot_overview(ax: Axes, rows: Sequence[Mapping[str, str]]) -> None:
    """Draw the audit as a list: status as a coloured symbol, item, and one phrase that says what is found.

    Each of `rows` has "item", "finding" and "status" (a key of `STATUS`).  A finding is bold if its item is determined.
    """
    ax.set(xlim=(0, 1), ylim=(len(rows) - 0.4, -1.2))
    ax.axis("off")
    for name, text in (("item", "item"), ("finding", "what is found")):
        ax.text(_PLACES[name], -0.85, text, va="center", weight="bold")
    ax.axhline(-0.5, color="0.3", linewidth=1)
    for number, row in enumerate(rows):
        color, marker = STATUS[row["status"]]
        if number % 2:
            ax.axhspan(number - 0.5, number + 0.5, color="0.955", linewidth=0, zorder=0)
        ax.plot(_PLACES["status"], number, marker, color=color, markersize=7)
        ax.text(_PLACES["item"], number, row["item"], va="center")
        settled = row["status"] == "determined"
        style = {"color": color if settled else "0.1", "weight": "bold" if settled else "normal"}
        ax.text(_PLACES["finding"], number, row["finding"], va="center", **style)
    counts = {status: sum(row["status"] == status for row in rows) for status in STATUS}
    for status, (color, marker) in STATUS.items():
        label = f"{_NAMES.get(status, status)}: {counts[status]}"
        ax.plot([], [], marker, color=color, markersize=7, label=label)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.005), ncols=len(STATUS))


def plot_square(ax: Axes, pixels: Floats, fitted: Mapping[str, Floats], *, tilts: Mapping[str, float]) -> None:
    """Draw Table 2's pegs and the best fit of a square for either reading.

    Parameters
    ----------
    ax : Axes
    pixels : (4, 2) array
        px.
    fitted : {"A", "B": (4, 2) array}
        The square with Table 1's tilt, with the lengths of its sides outside, and that with its tilt free, as rings; px.
    tilts : {"A", "B": float}
        deg.
    """
    shapes = {
        "Table 2 (lengths inside)": (pixels, COLORS["paper"], 0.24),
        f"A: square with Table 1's tilt, {tilts['A']:.1f}° (lengths outside)": (fitted["A"], A, -0.24),
    }
    for label, (shape, color, inwards) in shapes.items():
        plot_quadrilateral(ax, shape, color=color, label=label)
        for start, end in zip(shape, np.roll(shape, -1, axis=0), strict=True):
            middle = (start + end) / 2
            place = middle + inwards * (shape.mean(axis=0) - middle)
            text = f"{np.linalg.norm(end - start):.0f} px"
            ax.annotate(text, place, ha="center", va="center", color=color)
    ring = {"markersize": 12, "markerfacecolor": "none", "markeredgewidth": 1.8}
    ax.plot(*fitted["B"].T, "o", color=B, label=f"B: square with its tilt free, {tilts['B']:.1f}°", **ring)
    for number, point in enumerate(pixels, 1):
        outward = 0.13 * (point - pixels.mean(axis=0)) * [1, -1]
        ax.annotate(f"peg {number}", point, xytext=outward, textcoords="offset points", ha="center", va="center")
    ax.margins(0.22)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12))


def plot_drift(
    axes: Sequence[Axes],
    angles: Floats,
    curves: Mapping[str, Floats],
    tilts: Mapping[str, float],
    models: Mapping[str, Floats],
    table: pd.DataFrame,
) -> None:
    """Draw the radius's error over the hub's angle (left), and the best motion of each reading beside Table 3 (right).

    Parameters
    ----------
    axes : two Axes
    angles : (n,) array
        rad.
    curves : {"A", "B": (3, n) array}
        True minus estimated radius by major axis, area and minor axis, mm.
    tilts : {"A", "B": float}
        deg.
    models : {"A", "B": (frames,) array}
        The best motion's error in each frame, mm.
    table : DataFrame
        `paper.table3`.
    """
    left, right = axes
    for key, color in (("A", A), ("B", B)):
        band = {"color": color, "alpha": 0.2, "linewidth": 0, "label": f"{key}: minor to major axis"}
        left.fill_between(np.rad2deg(angles), curves[key][2], curves[key][0], **band)
        left.plot(np.rad2deg(angles), curves[key][1], color=color, label=f"{key}: tilt {tilts[key]:.1f}°, by area")
        frames = np.arange(len(models[key])) + 1
        right.plot(frames, models[key], color=color, label=f"{key} by area, best motion, offset free")
    plot_block_means(right, table, label="Table 3: mean ± sd/√n")
    label = "true − estimated radius (mm)"
    left.set(xlabel="angle of peg 1 about the hub (°)", ylabel=label, xticks=range(0, 361, 90), xlim=(0, 360))
    left.set_title("one scale, by geometry alone")
    right.set(ylabel=label, title="beside Table 3", xlim=(0, len(models["A"]) + 1))
    for ax in axes:
        ax.legend(fontsize=9, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=1 + (ax is left))


def plot_shares(
    ax: Axes,
    intervals: Mapping[str, Sequence[Floats]],
    expected: Mapping[str, float],
    *,
    printed: float,
    names: Mapping[str, str],
) -> None:
    """Draw in which interval (%) the share of points lies for each reading, and the printed share as a line.

    Parameters
    ----------
    ax : Axes
    intervals : {"A", "B": two (2,) arrays}
        95 % of samples with independent errors, and with the residuals of the two stages, %.
    expected : {"A", "B": float}
        Of Rayleigh's distribution, %.
    printed : float
        %.
    names : {"A", "B": str}
    """
    ax.axvline(printed, color=COLORS["paper"], linestyle=":", linewidth=1.2, label=f"paper: {printed:g} %")
    rows, labels = [], []
    for (key, pair), color in zip(intervals.items(), (A, B), strict=True):
        for source, (low, high) in zip(("independent errors", "two stages"), pair, strict=True):
            row = len(rows) + 0.4 * (key == "B")
            ax.plot([low, high], [row, row], color=color, linewidth=7, alpha=0.45, solid_capstyle="butt")
            ax.plot(expected[key], row, "|", color=color, markersize=13, markeredgewidth=2)
            rows.append(row)
            labels.append(f"{key}: {names[key]}, {source}")
    ax.plot([], [], "|", color="0.4", markersize=10, markeredgewidth=2, label="expected for many points")
    ax.plot([], [], color="0.4", alpha=0.45, linewidth=7, label="95 % of samples")
    ax.set(yticks=rows, yticklabels=labels, ylim=(rows[-1] + 0.6, -0.6), xlabel="points below the limit (%)")
    ax.figure.legend(loc="outside lower center", ncols=3)


def plot_candidates(ax: Axes, table: pd.DataFrame, printed: Sequence[float]) -> None:
    """Draw each explanation's error of both methods (columns, px) and the printed numbers of the two stages and toolbox."""
    defined = "if no other definition is named"
    methods = {
        f"two stages (Eq. 7, {defined})": COLORS["genetic"],
        f"Zhang (rms, {defined})": COLORS["zhang"],
    }
    names = [name.replace("k_1", "$k_1$") for name in table.index]
    series = dict(zip(methods, table.to_numpy().T, strict=True))
    plot_dots(ax, names, series, colors=methods, unit="error (px)", logarithmic=True)
    style = {"xycoords": ("data", "axes fraction"), "xytext": (0, 3), "textcoords": "offset points", "ha": "center"}
    for number, text in zip(
        printed, (f"printed, two stages:\n{printed[0]:.4f} px", f"printed, toolbox:\n{printed[1]:g} px"), strict=True
    ):
        ax.axvline(number, color=COLORS["paper"], linestyle=":", linewidth=1.2)
        ax.annotate(text, (number, 1), fontsize=9, **style)
    ax.legend(loc="upper right", bbox_to_anchor=(1.02, -0.08))
