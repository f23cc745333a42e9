"""Figures of notebook 07: re-projection errors (Figs. 6 and 7), shares below a limit, and the motion behind Table 3."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from ..plotting import COLORS, SERIES, plot_error_scatter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

    Floats = NDArray[np.float64]

METHODS = {"stages 1 + 2": COLORS["genetic"], "Zhang": COLORS["zhang"]}
"""The two calibrations that are compared, with their colours."""

READINGS = {"mean": SERIES[2], "rms": SERIES[1]}
"""What the printed error may be, with the colours of the intervals."""


def plot_distances(ax: Axes, distances: Mapping[str, Floats], limit: float, bins: Floats) -> None:
    """Draw histograms of re-projection distances (n,), px, of each of `METHODS`, and Fig. 6's limit.

    The first method is filled and the second an outline; the legend above the axes has the limit and the shares below it.
    """
    styles = ({"histtype": "stepfilled", "alpha": 0.45}, {"histtype": "step", "linewidth": 1.8})
    for (method, values), style in zip(distances.items(), styles, strict=True):
        label = f"{method}: {100 * np.mean(values < limit):.0f} % below"
        ax.hist(values, bins=bins, color=METHODS[method], label=label, **style)
    ax.axvline(limit, color=COLORS["paper"], linestyle=":", label=f"limit of Fig. 6, {limit:g} px")
    ax.set(xlabel="re-projection distance (px)", xlim=(0, bins[-1]))
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=9)


def plot_errors(ax: Axes, residuals: Floats, color: str, limit: float, *, square: bool, reach: float) -> None:
    """Draw errors (n, 2), px, as points up to `reach`, with a limit that is a circle or a square."""
    plot_error_scatter(ax, residuals, color=color, limit=None if square else limit)
    if square:
        style = {"fill": False, "color": COLORS["paper"], "linestyle": ":"}
        ax.add_patch(plt.Rectangle((-limit, -limit), 2 * limit, 2 * limit, **style))
    ticks = np.linspace(-reach, reach, 5)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), xticks=ticks, yticks=ticks)


def plot_share_over_mean(
    ax: Axes, curve: tuple[Floats, Floats], tables: Mapping[str, DataFrame], printed: tuple[float, float]
) -> None:
    """Draw the share below a limit over the mean distance.

    Parameters
    ----------
    ax : Axes
    curve : (means, shares)
        Rayleigh's distribution; px and %.
    tables : {method of METHODS: DataFrame}
        A row for each kind of corners, with the columns "mean distance (px)" and "share" (0 to 1).
    printed : (float, float)
        The paper's mean and share, px and %.
    """
    ax.semilogx(*curve, color="0.6", label="Rayleigh's distribution", zorder=1)
    for method, table in tables.items():
        x, y = table["mean distance (px)"], 100 * table["share"]
        ax.plot(x, y, "o", color=METHODS[method], markersize=4.5, label=method)
    first = next(iter(tables.values()))
    for name, (dx, dy), align in zip(
        first.index, ((0, -14), (-10, -6), (12, 8), (0, 11)), ("center", "right", "left", "center"), strict=True
    ):
        place = (first.loc[name, "mean distance (px)"], 100 * first.loc[name, "share"])
        ax.annotate(name, place, (dx, dy), textcoords="offset points", ha=align, va="center", fontsize=9)
    ax.plot(*printed, "s", color=COLORS["paper"], fillstyle="none", markersize=10, label="printed (Sect. 5)")
    ax.set(xlim=(curve[0][0], 0.9), ylim=(-5, 108))
    ax.set_xticks(ticks := [0.003, 0.01, 0.03, 0.1, 0.3], [f"{tick:g}" for tick in ticks])
    ax.legend(fontsize=9, loc="lower left")


def plot_share_intervals(ax: Axes, table: DataFrame, printed: float) -> None:
    """Draw 95 % intervals of a share, %, over the number of points, and the printed share.

    The first two columns of `table` are the number of points and the reading (one of `READINGS`); for each of two sources
    ("independent", "two stages") it has the columns "<source>: low (%)" and "<source>: high (%)".
    """
    places = {n: place for place, n in enumerate(dict.fromkeys(table.iloc[:, 0]))}
    for number, (reading, color) in enumerate(READINGS.items()):
        rows = table[table.iloc[:, 1] == reading]
        for shift, (source, alpha) in enumerate((("independent", 1.0), ("two stages", 0.45))):
            x = np.array([places[n] for n in rows.iloc[:, 0]]) + 0.36 * number + 0.14 * shift - 0.25
            low, high = rows[f"{source}: low (%)"], rows[f"{source}: high (%)"]
            ax.vlines(x, low, high, color=color, alpha=alpha, linewidth=5, label=f"{reading}, {source}")
    ax.axhline(printed, color=COLORS["paper"], linewidth=1, label="printed")
    ax.set_xticks(list(places.values()), list(places))
    ax.set(xlabel="points", ylabel="share (%)")
    ax.legend(fontsize=9, loc="center left", bbox_to_anchor=(1.0, 0.5))


def plot_turn_scan(
    ax: Axes, turns: Floats, rest: Mapping[float, Floats], lines: Mapping[str, float], adopted: float
) -> None:
    """Draw what remains of Table 3's means over the turn per frame, a curve for each shift per frame.

    `turns` (k,) and `adopted` in deg; `rest` maps a shift, mm, to (k,), mm; `lines` maps a text to a level, mm.
    """
    for (shift, values), color in zip(rest.items(), SERIES, strict=False):
        ax.plot(turns, values, color=color, label=f"shift {shift:g} mm per frame")
    for (text, level), style in zip(lines.items(), ("--", ":"), strict=True):
        ax.axhline(level, color=COLORS["paper"], linestyle=style, label=text)
    ax.axvline(adopted, color=COLORS["truth"], linewidth=0.8, label="turn adopted here")
    ax.set(xlabel="turn per frame (deg, clockwise in the image)", ylabel="standard deviation of the rest (mm)")
    ax.set(xlim=(turns[0], turns[-1]), ylim=(0, None))
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=9)


def plot_radius_errors(ax: Axes, errors: Mapping[str, ArrayLike], unit: float = 1.0) -> None:
    """Draw errors of a radius (frames,), mm, over the frame's number, times `unit`; "one scale" is dark, others green."""
    for name, values in errors.items():
        color = SERIES[0] if name.startswith("one scale") else COLORS["joint"]
        ax.plot(np.arange(1, len(values) + 1), unit * np.asarray(values), color=color, label=f"ours, {name}")
    ax.axhline(0, color="0.85", linewidth=0.8, zorder=0)
    ax.set(xlabel="frame")
