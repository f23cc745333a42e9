r"""Views that do not fit the others: a view with large residuals is left out and the others are fitted again.

If the view is of the same camera and as accurate as the others, (SSE - SSE') / (SSE' / :math:`\nu'`), divided by its
:math:`2 m - 6` degrees of freedom, has an F distribution.  A view whose variance is more than `STANDS_OUT` times that
of the others is flagged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from ..planes import is_planar
from .agreeing import agreeing_views, held_variances
from .bundle import SMALLEST_RMS, sigma_of
from .fitting import fit_views
from .homographies import plane_rotations
from .noise import own_noise
from .richer import LEVEL, compared, f_tail, plain
from .sizes import fits_as
from .views import Views, evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray

    from .fitting import Fit

STANDS_OUT, SUSPECT = 9.0, 4.0
"""A view is tried from `SUSPECT` times the median view's variance, and flagged from `STANDS_OUT` times the others'."""


def outlying_views(
    fit: Fit, object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]], loss: str
) -> tuple[list[int], Fit]:
    """The views that do not fit the others, counted from 0, and the `Fit` without them (or no views and the same fit).

    Views are left out, worst first, until none is suspect.  Each must then stand out when it alone is put back.
    """
    points, out, rest = (object_points, image_points), [], fit
    try:
        while 2 * len(out) + 2 < len(object_points):
            ratios = _by_the_median(rest, loss)
            if ratios.max() < SUSPECT:
                break
            out.append([view for view in range(len(object_points)) if view not in out][int(np.argmax(ratios))])
            rest = fit_views(fit.model, *without(out, *points), loss)
        for view in tuple(out):
            others = [other for other in out if other != view]
            with_it = fit_views(fit.model, *without(others, *points), loss) if others else fit
            place = view - sum(other < view for other in others)
            if not _stands_out(with_it, rest, len(object_points), place, loss):
                return [], fit
    except (CalibrationError, np.linalg.LinAlgError):  # the others do not determine the camera
        return [], fit
    return sorted(out), rest


def majority(
    fit: Fit,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str,
    explained: float,
) -> tuple[list[int], Fit] | None:
    """As `outlying_views`, but from subsets: for sets with so many wrong views that they spoil the fit of all.

    None if `explained`, the variance that the best explanation so far leaves, is near the views' own noise.
    """
    noise = np.median(own_noise(object_points, image_points)) if all(map(is_planar, object_points)) else 0.0
    if noise == 0 or explained < SUSPECT * noise**2:
        return None
    return agreeing_views(fit.model, object_points, image_points, loss)


def _variances(fit, loss):
    """Variance of each view's residuals, px^2; with a robust loss by the median distance, as of a Rayleigh distribution,
    for a few wrong corners make no wrong view."""
    residuals = evaluate(fit.model, fit.views, fit.state)[0] * fit.views.used[..., None]
    if loss != "linear":
        distances = np.hypot(*np.moveaxis(residuals, -1, 0))
        return np.square([sigma_of(row[used > 0]) for row, used in zip(distances, fit.views.used, strict=True)])
    counts = 2 * fit.views.used.sum(axis=1)
    freedom = np.maximum(counts - 6 - len(fit.model.names) * counts / counts.sum(), 1)
    return np.sum(residuals**2, axis=(1, 2)) / freedom


def _by_the_median(fit, loss):
    """The views' variances, relative to that of the median view."""
    variances = _variances(fit, loss)
    return variances / max(np.median(variances), SMALLEST_RMS**2)


def _stands_out(with_it, rest, number, place, loss):
    """Whether the one view that two fits differ by fits significantly worse than the rest of `number` views.

    `place` is its place in the fit with it.  A robust loss bounds what the view adds to the sum of squares, so there the
    view's own variance decides.
    """
    if loss != "linear":
        return _variances(with_it, loss)[place] > STANDS_OUT * rest.variance
    freedom = with_it.freedom - rest.freedom
    ratio = (with_it.squares - rest.squares) / freedom / rest.variance
    return ratio > STANDS_OUT and f_tail(ratio, freedom, rest.freedom) < LEVEL / number


def view_sentence(
    fit: Fit | None,
    views: Sequence[int],
    rest: Fit,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
) -> str:
    """A sentence that names the views that do not fit, why, and the result without them.

    `fit` is that of all views, or None if there is none.
    """
    chosen = [[points[view] for view in views] for points in (object_points, image_points)]
    if fit is None:
        rms = np.sqrt(2 * held_variances(rest, Views.stack(*chosen), plane_rotations(chosen[0])))
        moved = f"f is {plain(rest.state.shared[0], 5)} {rest.model.unit}"
    else:
        residuals = evaluate(fit.model, fit.views, fit.state)[0] * fit.views.used[..., None]
        rms = np.sqrt(np.sum(residuals**2, axis=(1, 2)) / fit.views.used.sum(axis=1))[views]
        change = compared(rest, fit.model)[0] - compared(fit, fit.model)[0]
        moved = f"f moves by {plain(change, 2, True)} {fit.model.unit}"
    which = f"View{'s' * (len(views) > 1)} {', '.join(map(str, views))} (counted from 0)"
    does, it = ("does", "it") if len(views) == 1 else ("do", "them")
    return (
        f"{which} {does} not fit the others: an rms of {plain(np.max(rms), 2)} px, where these alone have "
        f"{plain(np.sqrt(2 * rest.variance), 2)} px, and without {it} {moved}. {_reasons(views, rest, *chosen)}; or leave "
        f"{it} out."
    )


def _reasons(views, rest, object_points, image_points):
    """What makes the views fit, in words."""
    noises = own_noise(object_points, image_points)
    found = {}
    for view, *pair, noise in zip(views, object_points, image_points, noises, strict=True):
        found.setdefault(fits_as(rest, *pair, noise), []).append(view)
    parts = [
        f"View{'s' * (len(group) > 1)} {', '.join(map(str, group))} would fit {words}"
        for words, group in found.items()
        if words
    ]
    if "" in found:
        parts.append(
            "Check the order of the points, wrong corners, and that all images are of one camera, size and focus"
        )
    return "; ".join(parts)


def without(views: Sequence[int], *lists: Sequence[Any]) -> list[list[Any]]:
    """Lists without some of their entries."""
    return [[entry for view, entry in enumerate(entries) if view not in views] for entries in lists]
