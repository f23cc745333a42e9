"""The figures of notebook 10: rings found in photographs, known discs found and missed, and false circles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from ..plotting import COLORS, SERIES

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

STATES = {"measured": COLORS["joint"], "partial": COLORS["linear"], "contradicted": COLORS["genetic"]}
"""Colours of the places of a ring that have a disc."""

OTHER = "0.7"
"""Grey of the circles that are found without the ring."""

BESIDE = 0.1
"""Distance from a disc's rim to its number, as a part of half the side of its panel."""

KNOWN = {
    "measured": COLORS["joint"],
    "partly measured": COLORS["linear"],
    "found, fit rejected": COLORS["measured"],
    "missed": "0.8",
}
FALSE = {"false, fit rejected or partial": "0.55", "false, taken for a disc": COLORS["genetic"]}
"""Colours of the discs that are known, and of the circles that fit none of them."""


def plot_rings(axes: Iterable[Axes], rings: pd.DataFrame, places: pd.DataFrame, circles: pd.DataFrame) -> None:
    """Draw each ring in a panel: its numbered places in the colour of their state, other circles grey, and a scale.

    Parameters
    ----------
    axes : Axes
        At least as many as there are rings.
    rings : DataFrame
        A row for each image, with the columns picture, width, height (px).
    places, circles : DataFrame
        A row for each place of a ring (picture, place, x, y, r in px, state) and for each circle that was found without
        the ring (picture, x, y, r).
    """
    axes = list(axes)
    for ax, ring in zip(axes, rings.itertuples(), strict=False):
        found, seen = (table[table["picture"] == ring.picture] for table in (circles, places))
        centers = seen[["x", "y"]].to_numpy()
        middle = centers.mean(axis=0)
        half = min(0.6 * np.ptp(centers, axis=0).max() + seen["r"].max(), ring.width / 2, ring.height / 2)
        for circle in found.itertuples():
            ax.add_patch(Circle((circle.x, circle.y), circle.r, fill=False, color=OTHER, linewidth=0.8))
        for place, center in zip(seen.itertuples(), centers, strict=True):
            ax.add_patch(Circle(center, place.r, fill=False, color=STATES[place.state], linewidth=1.8))
            inwards = (middle - center) / np.linalg.norm(middle - center)
            ax.annotate(place.place, center + (place.r + BESIDE * half) * inwards, ha="center", va="center", fontsize=9)
        x, y = np.clip(
            (centers.min(axis=0) + centers.max(axis=0)) / 2, half, np.array([ring.width, ring.height]) - half
        )
        ax.set(xlim=(x - half, x + half), ylim=(y + half, y - half), aspect="equal", xticks=[], yticks=[])
        ax.set_title(f"{ring.picture.replace('_', ' ')}\nimage of {ring.width} × {ring.height} px", fontsize=9)
        ax.spines[:].set(visible=True, color="0.8")
        _draw_scale(ax, half)
    handles = [Line2D([], [], color=STATES[state], label=state) for state in STATES if (places["state"] == state).any()]
    handles.append(Line2D([], [], color=OTHER, linewidth=0.8, label="circles found without the ring"))
    axes[0].figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def _draw_scale(ax, half):
    """A bar of 10, 20, 50, 100 .. px, about a quarter of the panel long, below the panel."""
    power = 10 ** np.floor(np.log10(half / 2))
    length = power * max(digit for digit in (1, 2, 5) if digit * power <= half / 2)
    share, options = length / (2 * half), {"color": "0.3", "transform": ax.transAxes, "clip_on": False}
    ax.plot([1 - share, 1], [-0.04, -0.04], linewidth=2, solid_capstyle="butt", **options)
    ax.text(0.98 - share, -0.04, f"{length:g} px", ha="right", va="center", fontsize=8, **options)


def plot_counts(axes: Sequence[Axes], counts: pd.DataFrame) -> None:
    """Draw what became of the known discs of each set of photographs, and beside it the false circles.

    Parameters
    ----------
    axes : two Axes
        They share their rows.
    counts : DataFrame
        A row for each set, with the columns pictures, known, found, false, measured, partial, false_measured of
        `study.circle_counts`, summed over the set.
    """
    left, right = axes
    rejected = counts["found"] - counts["measured"] - counts["partial"]
    known = (counts["measured"], counts["partial"], rejected, counts["known"] - counts["found"])
    _stack(left, dict(zip(KNOWN, known, strict=True)), KNOWN)
    wrong = (counts["false"] - counts["false_measured"], counts["false_measured"])
    _stack(right, dict(zip(FALSE, wrong, strict=True)), FALSE)
    for row, (found, there, false) in enumerate(zip(counts["found"], counts["known"], counts["false"], strict=True)):
        left.annotate(f"{found} of {there}", (there, row), (4, 0), textcoords="offset points", va="center")
        right.annotate(f"{false}", (false, row), (4, 0), textcoords="offset points", va="center")
    names = [
        f"{name}\n({pictures} image{'s' * (pictures > 1)})"
        for name, pictures in zip(counts.index, counts["pictures"], strict=True)
    ]
    left.set(xlabel="known discs", title="found by find_circles", yticks=range(len(names)), yticklabels=names)
    right.set(xlabel="false circles", title="circles that fit no disc")
    for ax, highest in ((left, counts["known"].max()), (right, counts["false"].max())):
        ax.set(xlim=(0, 1.2 * max(highest, 1)), ylim=(len(names) - 0.5, -0.5))
    handles, labels = left.get_legend_handles_labels()
    more, further = right.get_legend_handles_labels()
    left.figure.legend(handles + more, labels + further, loc="outside lower center", ncols=3)


def _stack(ax, parts, colors):
    """Horizontal bars of counts, one behind the other."""
    ends = np.zeros(len(next(iter(parts.values()))))
    for name, numbers in parts.items():
        ax.barh(np.arange(len(ends)), numbers, left=ends, color=colors[name], height=0.65, label=name)
        ends = ends + numbers.to_numpy()


def plot_pulls(ax: Axes, pulls: pd.DataFrame, aim: tuple[float, float]) -> None:
    """Draw the pull of each sheet of discs, a row each, beside the honest value 1 and the range that was aimed at.

    `pulls` has the columns dataset and pull.
    """
    rows = np.arange(len(pulls))
    ax.axvspan(*aim, color="0.92", label=f"aim: {aim[0]:g} to {aim[1]:g}")
    ax.axvline(1, color=COLORS["truth"], linewidth=1, label="honest")
    ax.plot(pulls["pull"], rows, "o", color=COLORS["joint"], label=r"residual / stated $\sigma$")
    ax.set(yticks=rows, yticklabels=pulls["dataset"], xlabel="pull", xlim=(0.7, 1.5), ylim=(len(pulls) - 0.5, -0.5))
    ax.figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)


def plot_states(ax: Axes, centers: ArrayLike, radii: ArrayLike, states: Sequence[str]) -> None:
    """Draw the places of a ring (n, 2) into the axes of an image (px), with number and state; dashed without a disc."""
    for number, (center, radius, state) in enumerate(zip(np.asarray(centers), radii, states, strict=True), 1):
        color, line = STATES.get(state, SERIES[1]), "-" if state in STATES else "--"
        ax.add_patch(Circle(center, radius, fill=False, color=color, linewidth=2, linestyle=line))
        ax.annotate(f"{number} {state}", center + [0, radius + 4], color="white", ha="center", va="top", fontsize=8)
