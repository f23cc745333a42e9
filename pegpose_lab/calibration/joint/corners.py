"""Single wrong corners: points far from where all others put them, found with a robust loss and then left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError, Flag
from .bundle import SMALLEST_RMS, minimise_robust
from .fitting import fit_views
from .richer import compared, plain
from .views import State, evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit

WRONG = 10.0
"""A corner is wrong from this many standard deviations per axis on.  Corners that are measured well are within 5 on real
photographs, and within 8 at the rim of a lens that the model does not follow."""

FEW = 1 / 6
"""A view with more wrong corners than this share of its points does not fit as a whole (see `outlying`)."""

ROUNDS = 4
"""Rounds of leaving corners out and fitting the rest; the second one mostly finds the same corners."""


def wrong_corners(
    fit: Fit, object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]], loss: str
) -> tuple[dict[int, dict[int, float]], Fit]:
    """Wrong corners by view, both counted from 0, with their distances, px; and the `Fit` without them.

    The fit itself and no corners if none is wrong.  A search starts only if a residual stands out.
    """
    distances = _distances(fit.model, fit.views, fit.state)
    used = fit.views.used > 0
    if distances.max() <= WRONG * _sigma(distances[used]):
        return {}, fit
    try:
        state = minimise_robust(fit.model, fit.views, fit.state, "cauchy")[0]
        distances = _distances(fit.model, fit.views, state)
        wrong, rest = _few(distances > WRONG * _sigma(distances[used]), used), fit
        for _ in range(ROUNDS):
            if not wrong.any():
                return {}, fit
            kept = [~row[:count] for row, count in zip(wrong, map(len, object_points), strict=True)]
            rest = fit_views(fit.model, *without_corners(kept, object_points, image_points), loss)
            distances = _distances(fit.model, fit.views, _about_all_points(rest, fit.views))
            before, wrong = wrong, _few(distances > WRONG * np.sqrt(rest.variance), used)
            if np.array_equal(before, wrong):
                break
    except (CalibrationError, np.linalg.LinAlgError):  # too little remains, or the robust fit does not settle
        return {}, fit
    found = {int(view): {} for view in np.flatnonzero(wrong.any(axis=1))}
    for view, corner in np.argwhere(wrong):
        found[int(view)][int(corner)] = float(distances[view, corner])
    return found, rest


def without_corners(
    kept: Sequence[NDArray[np.bool_]], *lists: Sequence[NDArray[np.float64]]
) -> list[list[NDArray[np.float64]]]:
    """Lists of points with those rows only that are kept."""
    return [[points[rows] for points, rows in zip(entries, kept, strict=True)] for entries in lists]


def without_wrong(
    wrong: dict[int, dict[int, float]], *lists: Sequence[NDArray[np.float64]]
) -> list[list[NDArray[np.float64]]]:
    """Lists of points without the corners that `wrong_corners` found."""
    kept = [~np.isin(np.arange(len(points)), list(wrong.get(view, ()))) for view, points in enumerate(lists[0])]
    return without_corners(kept, *lists)


def judge_corners(fit: Fit, wrong: dict[int, dict[int, float]], rest: Fit) -> Flag:
    """The flag that lists the wrong corners with their views."""
    parts = [
        f"{'corners' if len(corners) > 1 else 'corner'} {', '.join(map(str, corners))} of view {view}"
        for view, corners in wrong.items()
    ]
    distances = [distance for corners in wrong.values() for distance in corners.values()]
    span = " to ".join(dict.fromkeys(plain(end, 2) for end in (min(distances), max(distances))))
    moved = plain(compared(rest, fit.model)[0] - compared(fit, fit.model)[0], 2, True)
    text = (
        f"Wrong corners (counted from 0): {'; '.join(parts)}: {span} px from where all others put them, which "
        f"themselves have an rms of {plain(np.sqrt(2 * rest.variance), 2)} px. Without them f moves by {moved} "
        f'{fit.model.unit}: leave them out, or use loss="cauchy".'
    )
    return Flag("misfit-corner", text)


def _distances(model, views, state):
    """Distances (V, m) of the image points from the model's, px; 0 where there is no point."""
    evaluated = evaluate(model, views, state)
    if evaluated is None:
        raise CalibrationError("a point has no image")
    return np.hypot(*np.moveaxis(evaluated[0], -1, 0)) * views.used


def _sigma(distances):
    """Standard deviation per axis from the median distance, as of a Rayleigh distribution."""
    return max(np.median(distances) / np.sqrt(2 * np.log(2)), SMALLEST_RMS)


def _few(wrong, used):
    """Wrong corners without those of views in which too many are wrong."""
    return wrong & (wrong.sum(axis=1) <= FEW * used.sum(axis=1))[:, None]


def _about_all_points(rest, views):
    """The state of a fit without some points, with the positions of the centroids of all points."""
    moved = np.einsum("vij,vj->vi", rest.state.rotations, views.centroids - rest.views.centroids)
    return State(rest.state.shared, rest.state.rotations, rest.state.positions + moved)
