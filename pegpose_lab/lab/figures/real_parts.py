"""The figures of notebook 10: known discs of photographs found and missed, and false circles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..plotting import COLORS

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes

KNOWN = {
    "measured": COLORS["joint"],
    "partly measured": COLORS["linear"],
    "found, fit rejected": COLORS["measured"],
    "missed": "0.8",
}
FALSE = {"false, fit rejected or partial": "0.55", "false, taken for a disc": COLORS["genetic"]}
"""Colours of the discs that are known, and of the circles that fit none of them."""


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
