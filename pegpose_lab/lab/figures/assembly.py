"""The figures of notebook 12: the hub in the image, clearances, promised and observed rates, and a servo run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Circle

from ..plotting import COLORS, SERIES, plot_image, plot_rims
from ..style import WHOLE_PIXELS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from ...camera import TsaiCamera
    from ...pegs import PegObservation
    from ...pose import HubPose

AXIS = 40.0
"""mm, length of a drawn axis."""

HALF = 330.0
"""px, half the side of the part of the image that is shown."""

BELOW_ALL = 1e-6
"""mm, a clearance left of every panel, at which the line of a row begins."""

WAYS = {
    "one scale": (COLORS["paper"], 1.5),
    "stage 1": (COLORS["linear"], 1.5),
    "stages 1 + 2, whole pixels": ("#F2B48C", 4.0),
    "joint, whole pixels": (WHOLE_PIXELS, 1.6),
    "joint, integer radii": ("#00543D", 1.5),
    "stages 1 + 2": (COLORS["genetic"], 4.6),
    "Zhang": (COLORS["zhang"], 3.0),
    "joint": (COLORS["joint"], 1.3),
}
"""Colour and line width of each chain: a method's own colour where its circles are measured to a part of a pixel,
a shade of it where they are not.  Chains that coincide have nested widths, so that each is seen."""

LABELS = {
    "one scale": "1",
    "stage 1": "2",
    "joint, whole pixels": "3, 4",
    "joint, integer radii": "5",
    "stages 1 + 2": "6",
    "joint": "7, 8",
}
"""What stands beside a curve: the numbers of its row, and of those that coincide with it."""

COINCIDE = {"exact robot": LABELS, "industrial robot": LABELS | {"stages 1 + 2": "", "joint": "6, 7, 8"}}
"""The same for each robot."""


def plot_located_hub(
    ax: Axes, frame: NDArray[np.uint8], observation: PegObservation, camera: TsaiCamera, pose: HubPose
) -> None:
    """Draw the part of an image round the hub, the rims of its numbered pegs, and the axes of the hub's estimated frame.

    The axes hub x and hub y lie in the plane of the peg tops, so they do not begin in the middle of the bore.
    """
    left, top = np.maximum(observation.hub_center - HALF, 0)
    right, bottom = observation.hub_center + HALF
    bright = np.clip(1.5 * frame.astype(float) - 25, 0, 255).astype(np.uint8)
    plot_image(ax, bright, limits=(left, right, top, bottom))
    plot_rims(ax, observation)
    for number, center in enumerate(observation.peg_centers, 1):
        ax.annotate(str(number), center, (7, 7), textcoords="offset points", color=COLORS["joint"], weight="bold")
    origin, *ends = camera.project(np.vstack([np.zeros(3), AXIS * np.eye(3)[:2]]), pose.cam_from_hub)
    sides = ("hub $x$", (-4, -4), "right", "top"), ("hub $y$", (6, -8), "left", "top")
    for end, color, (name, shift, ha, va) in zip(ends, SERIES[1:3], sides, strict=True):
        ax.annotate("", end, origin, arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 2})
        style = {"textcoords": "offset points", "color": "white", "ha": ha, "va": va}
        ax.annotate(name, (origin + end) / 2, shift, **style)
    ax.set(xlabel=None, ylabel=None, xticks=[], yticks=[])


def plot_clearances(axes: NDArray[np.object_], curves: pd.DataFrame, names: Mapping[str, str]) -> None:
    """Draw the share of insertions that go in freely over the clearance, and below it the clearance for 99.9 %.

    Parameters
    ----------
    axes : (2, 2) Axes
        A column for each robot; both rows have the same scale of clearances.
    curves : DataFrame
        Columns cell, chain, clearance (mm), share; the last row of each cell and chain is the clearance for 99.9 %.
    names : mapping
        Names of the chains, in the order of the rows.
    """
    for (above, below), (cell, table) in zip(axes.T, curves.groupby("cell"), strict=True):
        for row, chain in enumerate(names):
            (color, width), curve = WAYS[chain], table[table["chain"] == chain]
            needed, computed = curve["clearance"].iloc[-1], curve["clearance"].iloc[:-1].max()
            shown = curve[curve["clearance"] <= min(needed, computed)]
            above.plot(shown["clearance"], 100 * shown["share"], color=color, linewidth=width)
            below.plot([BELOW_ALL, needed], [row, row], color="0.88", linewidth=1, zorder=0)
            below.plot(needed, row, "o", color=color, markersize=7)
            text = f"{needed:.3f}" if needed < 0.1 else f"{needed:.2f}"
            below.annotate(text, (needed, row), (7, 0), va="center", textcoords="offset points", fontsize=9)
            label = COINCIDE[cell].get(chain)
            if label:
                level = min(0.5, shown["share"].max())
                place = np.interp(level, shown["share"], shown["clearance"]), 100 * level
                side, align = (-5, "right") if chain == "joint" else (4, "left")
                above.annotate(label, place, (side, 0), textcoords="offset points", fontsize=8, ha=align, va="center")
        above.set(xscale="log", title=cell, xlim=(7e-4, 6), ylim=(-2, 102))
        below.set_xticks([0.001, 0.01, 0.1, 1], ["0.001", "0.01", "0.1", "1"])
        below.set_yticks(range(len(names)), [f"{name}  {row}" for row, name in enumerate(names.values(), 1)])
        below.set(xlabel="clearance (mm)", title="clearance for 99.9 %", ylim=(len(names) - 0.5, -0.5))
    axes[0, 0].set_ylabel("go in freely (%)")


def plot_rates(axes: Sequence[Axes], rates: pd.DataFrame) -> None:
    """Draw the observed less the promised rate of free insertion, a row for each clearance, a colour for each tilt.

    Parameters
    ----------
    axes : Axes
        One for each robot.
    rates : DataFrame
        Columns cell, tilt (deg), clearance (mm), promised, came, low, high (%); low to high is the interval of came.
    """
    for ax, (cell, table) in zip(axes, rates.groupby("cell"), strict=True):
        color = dict(zip(table["tilt"].unique(), SERIES, strict=False))
        for row, rate in enumerate(table.itertuples()):
            bar = [[rate.came - rate.low], [rate.high - rate.came]]
            ax.errorbar(rate.came - rate.promised, row, xerr=bar, fmt="o", color=color[rate.tilt], capsize=3)
        rows = [f"{tilt:g}°, {promised:.0f} %" for tilt, promised in zip(table["tilt"], table["promised"], strict=True)]
        ax.set_yticks(range(len(rows)), rows)
        ax.axvline(0, color=COLORS["truth"], linewidth=1, zorder=0)
        ax.set(title=cell, xlabel="observed − promised (percentage points)", ylim=(len(rows) - 0.5, -0.5))
        ax.set(ylabel="tilt, promised rate", xlim=(-9, 9), xticks=range(-8, 9, 4))


def plot_servo(axes: NDArray[np.object_], steps: pd.DataFrame, tolerances: Sequence[float]) -> None:
    """Draw what is left to the taught place after each motion, and below it the error of its estimate.

    Parameters
    ----------
    axes : (2, 2) Axes
        Columns: distance (mm), angle (deg).
    steps : DataFrame
        Columns step, off, off_turn (true), distance, angle (estimated), sigma, sigma_turn (of the estimate).
    tolerances : two numbers
        mm, deg
    """
    columns = (("off", "distance", "sigma", "mm"), ("off_turn", "angle", "sigma_turn", "deg"))
    for (above, below), (true, estimated, sigma, unit), tolerance in zip(axes.T, columns, tolerances, strict=True):
        above.semilogy(steps["step"], steps[true], "o-", color=COLORS["truth"], label="true")
        error, bars = (steps[estimated] - steps[true]).to_numpy(), 2 * steps[sigma].to_numpy()
        below.errorbar(
            steps["step"], error, bars, fmt="o", color=COLORS["joint"], capsize=3, label="estimate − truth, ±2σ"
        )
        below.axhline(0, color=COLORS["truth"], linewidth=1, zorder=0)
        for ax, level in ((above, tolerance), (below, tolerance), (below, -tolerance)):
            ax.axhline(level, color=COLORS["paper"], linestyle="--", linewidth=1.0, zorder=0, label="tolerance")
        above.set(title=f"{estimated} to the taught place", ylabel=f"true {estimated} ({unit})")
        above.set_yticks([0.01, 0.1, 1, 10], ["0.01", "0.1", "1", "10"])
        below.set(xlabel="motion", ylabel=f"error ({unit})")
    entries = {
        label: handle for ax in axes[:, 0] for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    axes[0, 0].figure.legend(entries.values(), entries, loc="outside lower center", ncols=3)


def plot_frame(ax: Axes, image: NDArray[np.uint8], centers: ArrayLike, radii: ArrayLike, half: float = 235.0) -> None:
    """Draw the image round the places where the pegs belong, with their rims there.

    Parameters
    ----------
    ax : Axes
    image : (height, width) uint8
    centers, radii : (n, 2) and (n,)
        px
    half : float
        px, half the side of the part that is shown.
    """
    left, top = np.mean(centers, axis=0) - half
    plot_image(ax, image, limits=(left, left + 2 * half, top, top + 2 * half))
    for center, radius in zip(np.asarray(centers), np.asarray(radii), strict=True):
        ax.add_patch(Circle(center, radius, fill=False, color=SERIES[1], linewidth=1.8))
    ax.set(xlabel=None, ylabel=None, xticks=[], yticks=[])
