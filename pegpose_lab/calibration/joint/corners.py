"""Single wrong corners: points far from where all others put them, found with a robust loss and then left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from ...flags import Flag
from ..planes import is_planar
from .bundle import sigma_of
from .fitting import fit_views
from .models import COEFFICIENTS, EQUIDISTANT, FisheyeModel, lens_model
from .noise import LEAST_POINTS, smooth_residuals
from .orders import far_corners
from .richer import compared, plain
from .views import evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit

WRONG = 10.0
"""A corner is wrong from this many standard deviations per axis on.  Corners that are measured well are within 5 on real
photographs, and within 8 at the rim of a lens that the model does not follow."""

ALONE = 0.5
"""A wrong corner is off from where a smooth image of the other corners of its view puts it by at least this share of its
distance.  Smooth images of all of a view's corners, and of all but one, differ by less than noise at most corners."""

FEW = 1 / 6
"""A view with more wrong corners than this share of its points does not fit as a whole (see `outlying`)."""


def wrong_corners(
    fit: Fit, object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]], loss: str
) -> tuple[dict[int, dict[int, float]], Fit]:
    """Wrong corners by view, both counted from 0, with their distances, px; and the `Fit` without them.

    The fit itself and no corners if none is wrong.  A search starts only if a residual stands out.
    """
    distances = _distances(fit.model, fit.views, fit.state)
    used = fit.views.used > 0
    if distances.max() <= WRONG * sigma_of(distances[used]):
        return {}, fit
    try:
        robust = _robust(fit, object_points, image_points)
        distances = _distances(robust.model, robust.views, robust.state)
        wrong = _few(distances > WRONG * sigma_of(distances[used]), used)
        wrong &= _alone(wrong, distances, object_points, image_points)
        if not wrong.any():
            return {}, fit
        found = {int(view): {} for view in np.flatnonzero(wrong.any(axis=1))}
        for view, corner in np.argwhere(wrong):
            found[int(view)][int(corner)] = float(distances[view, corner])
        return found, fit_views(fit.model, *without_wrong(found, object_points, image_points), loss)
    except (CalibrationError, np.linalg.LinAlgError):  # too little remains, or the robust fit does not settle
        return {}, fit


def without_wrong(
    wrong: dict[int, dict[int, float]], *lists: Sequence[NDArray[np.float64]]
) -> list[list[NDArray[np.float64]]]:
    """Lists of points without the corners that `wrong_corners` found."""
    kept = [~np.isin(np.arange(len(points)), list(wrong.get(view, ()))) for view, points in enumerate(lists[0])]
    return [[points[rows] for points, rows in zip(entries, kept, strict=True)] for entries in lists]


def judge_corners(fit: Fit, wrong: dict[int, dict[int, float]], rest: Fit, loss: str = "linear") -> Flag:
    """The flag that lists the wrong corners with their views."""
    alone = len(fit.views.used) == 1
    parts = [
        f"{'corners' if len(corners) > 1 else 'corner'} {', '.join(map(str, corners))}{'' if alone else f' of view {view}'}"
        for view, corners in wrong.items()
    ]
    distances = [distance for corners in wrong.values() for distance in corners.values()]
    span = " to ".join(dict.fromkeys(plain(end, 2) for end in (min(distances), max(distances))))
    moved = plain(compared(rest, fit.model)[0] - compared(fit, fit.model)[0], 2, True)
    remedy = "leave them out" if alone or loss == "cauchy" else 'leave them out, or use loss="cauchy"'
    text = (
        f"Wrong corners (counted from 0): {'; '.join(parts)}: {span} px from where all others put them, which "
        f"themselves have an rms of {plain(np.sqrt(2 * rest.variance), 2)} px. Without them f moves by {moved} "
        f"{fit.model.unit}: {remedy}."
    )
    return Flag("misfit-corner", text)


def _robust(fit, object_points, image_points):
    """A robust fit of a richer model of the same kind, with the same unknowns of the board, so that a lens beyond the
    fitted model makes no corner look wrong; of the fitted model if the views do not determine the richer one."""
    lens, every = ("equidistant", EQUIDISTANT) if isinstance(fit.model, FisheyeModel) else ("perspective", COEFFICIENTS)
    further = [name for name in fit.model.coefficient_names or () if name not in every]
    richest = lens_model(fit.model.sensor, True, True, (*every, *further), lens).on(fit.model.board)
    try:
        return fit_views(richest, object_points, image_points, "cauchy")
    except (CalibrationError, np.linalg.LinAlgError):
        return fit_views(fit.model, object_points, image_points, "cauchy")


def _distances(model, views, state):
    """Distances (V, m) of the image points from the model's, px; 0 where there is no point."""
    evaluated = evaluate(model, views, state)
    if evaluated is None:
        raise CalibrationError("a point has no image")
    return np.hypot(*np.moveaxis(evaluated[0], -1, 0)) * views.used


def _few(wrong, used):
    """The wrong corners, or none if too many of some view are wrong: then the view is, and spoils the fit."""
    return wrong & bool(np.all(wrong.sum(axis=1) <= FEW * used.sum(axis=1)))


def _alone(wrong, distances, object_points, image_points):
    """Which wrong corners (V, m) are also far from where the other corners of their view put them, whatever the camera.

    Where the camera is wrong, a view's corners are off together.
    """
    alone = wrong.copy()
    for view in np.flatnonzero(wrong.any(axis=1)):
        points, measured = object_points[view], image_points[view]
        kept = ~wrong[view, : len(points)]
        if is_planar(points) and kept.sum() >= LEAST_POINTS:
            off = np.linalg.norm(smooth_residuals(points, measured, kept), axis=1)
            alone[view, : len(points)] &= off > ALONE * distances[view, : len(points)]
    return alone


def stray_corners(object_points: NDArray[np.float64], image_points: NDArray[np.float64]) -> dict[int, float]:
    """Single wrong corners of one view, without a camera: those of `orders.far_corners` that a smooth image of the other
    corners does not explain either, and their distances, px.

    Distortion alone puts corners near the rim far from a homography.
    """
    far = far_corners(object_points, image_points) if is_planar(object_points) else {}
    kept = ~np.isin(np.arange(len(object_points)), list(far))
    if not far or kept.sum() < LEAST_POINTS:
        return {}
    off = np.linalg.norm(smooth_residuals(object_points, image_points, kept), axis=1)
    least = WRONG * sigma_of(off[kept])
    return {corner: distance for corner, distance in far.items() if off[corner] > max(ALONE * distance, least)}
