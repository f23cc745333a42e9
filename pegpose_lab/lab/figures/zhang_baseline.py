"""Figures of notebook 05: errors by definition, focal lengths with intervals, and errors on views held out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plotting import COLORS, plot_dots

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes

TICKS = (0.15, 0.2, 0.3, 0.5, 0.7)  # px, of the held-out errors
RING: dict[str, Any] = {"linestyle": "", "marker": "o", "fillstyle": "none", "color": "k", "markersize": 11}


def plot_definitions(
    axes: Sequence[Axes],
    tables: Mapping[str, pd.DataFrame],
    printed: Mapping[str, str],
    *,
    colors: Mapping[str, str],
) -> None:
    """Draw errors (px) by definition, a panel for each table (rows: methods, columns: definitions), and printed ones.

    `printed` maps a name to a number as it is printed, px.  The legend is left to the caller.
    """
    for ax, (title, table) in zip(axes, tables.items(), strict=True):
        values = {method: table.loc[method].to_numpy(float) for method in colors}
        plot_dots(ax, list(table.columns), values, colors=colors, unit="error (px)", logarithmic=True)
        for name, number in printed.items():
            line = ax.axvline(float(number), color=COLORS["paper"], linestyle=":", linewidth=1.2, zorder=0)
            above = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom", "fontsize": 9}
            ax.annotate(f"{name}:\n{number} px", (float(number), 1.0), **above)
        ax.set_title(title, pad=34)
        ax.set_xlim(2e-4, 1.5)
        line.set_label("printed in Sect. 5")


def plot_focal_by_detector(
    axes: Sequence[Axes], intervals: pd.DataFrame, truth: float, *, colors: Mapping[str, str]
) -> None:
    """Draw f minus the truth (µm) with its 95 % interval: an axes for each detector, a row for each method.

    `intervals` has the columns detector, method, f, low and high (mm); `colors` gives the methods from top to bottom.
    Each axes has its own scale, with the truth in the middle, so half the width of each interval is written beside it.
    """
    beside = {"ha": "right", "va": "center", "fontsize": 9}
    for ax, (detector, table) in zip(axes, intervals.groupby("detector", sort=False), strict=True):
        off = 1000 * (table.set_index("method")[["f", "low", "high"]] - truth)
        for row, (method, color) in enumerate(colors.items()):
            f, low, high = off.loc[method]
            ax.errorbar(f, row, xerr=[[f - low], [high - f]], fmt="o", color=color, markersize=5, capsize=3)
            width = f"±{(high - low) / 2:{'.1f' if high - low < 20 else '.0f'}} µm"
            ax.text(1.1, row, width, color=color, transform=ax.get_yaxis_transform(), **beside)
        ax.axvline(0, color=COLORS["truth"], linewidth=1.0, zorder=0)
        reach = 1.08 * np.abs(off.to_numpy()).max()
        rows = {"yticks": range(len(colors)), "yticklabels": list(colors), "ylim": (len(colors) - 0.5, -0.5)}
        ax.set(title=detector, xlim=(-reach, reach), **rows)
    axes[-1].set_xlabel("focal length minus the truth (µm); each panel has its own scale")


def plot_real_focal_lengths(axes: Sequence[Axes], views: pd.DataFrame, interval: tuple[float, float]) -> None:
    """Draw the f (px) of each view by both stages, beside the interval of the joint solution.

    `views` has a row a view, and for each panel's letter, (c)entre or (k)nown, the columns ``f 1 (c)``, ``f 1+2 (c)`` and
    ``edge (c)`` ("*" where the solution is on the edge of its box, which gets a ring).
    """
    colors = {"stage 1": COLORS["linear"], "stages 1 + 2": COLORS["genetic"]}
    titles = "principal point at the centre", "principal point of the joint solution"
    for ax, letter, title in zip(axes, "ck", titles, strict=True):
        values = dict(zip(colors, views[[f"f 1 ({letter})", f"f 1+2 ({letter})"]].to_numpy().T, strict=True))
        plot_dots(ax, list(views.index), values, colors=colors, unit="focal length (px)")
        ax.axvspan(*interval, color=COLORS["joint"], alpha=0.6, linewidth=0, label="joint, 95 % interval")
        rows = np.flatnonzero(views[f"edge ({letter})"] == "*")
        ax.plot(views[f"f 1+2 ({letter})"].iloc[rows], rows + 0.08, **RING, label="on the edge of its box")
        ax.set(title=title, xlim=(450, 740))


def plot_held_out(
    axes: Sequence[Axes],
    in_sample: pd.DataFrame,
    held_out: pd.DataFrame,
    *,
    colors: Mapping[str, str],
    single_view: Sequence[str],
) -> None:
    """Draw rms errors (px) in sample and held out, a row a view and a colour a method (the columns of both tables).

    The methods held out have two of the three axes: the rows of the `single_view` methods name the view that gave the camera,
    those of the others the view that is judged.
    """
    others, n_others = [method for method in colors if method not in single_view], len(in_sample) - 1
    panels = (
        (in_sample, list(colors), "in sample"),
        (held_out, list(single_view), f"held out: camera of this view,\nrms over the {n_others} others"),
        (held_out, others, f"held out: camera of the {n_others} others,\nrms over this view"),
    )
    for ax, (table, methods, title) in zip(axes, panels, strict=True):
        values = {method: table[method] for method in methods}
        shown = {method: colors[method] for method in methods}
        plot_dots(ax, list(table.index), values, colors=shown, unit="rms, pose fitted (px)", logarithmic=True)
        ax.set_title(title)
        ax.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
        ax.set_xticks([], minor=True)
        ax.set_xlim(0.125, 0.75)
