"""The views that agree on one camera, found from small subsets: for sets in which wrong views spoil the fit of all."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from ..planes import is_planar
from .bundle import descend
from .candidates import in_pixels
from .fitting import fit_views
from .homographies import linear_homographies, plane_rotations, poses_of
from .noise import own_noise
from .sizes import Resized
from .views import State, Views, evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit
    from .models import FisheyeModel, OpenCVModel, TsaiModel

SUBSET, SUBSETS = 3, 30
"""Number of views in a subset, and of subsets that are tried.  If a third of nine views is wrong, a quarter of the subsets
is free of them, and the chance that none of 30 is free is 0.03 %."""

HOPELESS = 8
"""The search ends if none of so many subsets gives a camera, as with boards that are not tilted."""

AGREES = 9.0
"""A view agrees with a camera if its residuals' variance, in units of its own noise (`noise.own_noise`; a smaller picture
has less), is below this many times that of the better half of the views."""

CLEAN = 2.0
"""The search ends at a subset with whose camera half of the views have a variance below this many times their own noise."""

ROUNDS = 5
"""Rounds of fitting the views that agree and looking for them again."""


def agreeing_views(
    model: TsaiModel | OpenCVModel | FisheyeModel,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str,
) -> tuple[list[int], Fit] | None:
    """The views that do not agree with the majority, counted from 0, and the `Fit` of the majority.

    None if no camera has a majority of the views, if all agree, or if a view has too few points to know its noise.
    """
    number = len(object_points)
    if number <= SUBSET or not all(is_planar(points) for points in object_points):
        return None
    views, planes = Views.stack(object_points, image_points), plane_rotations(object_points)
    noise = own_noise(object_points, image_points)
    if not noise.all():
        return None
    noise = np.minimum(noise, AGREES**0.5 * np.median(noise))  # a blurred view does not agree by being blurred
    least, best = np.inf, None
    for count, subset in enumerate(_subsets(number)):
        if count == HOPELESS and not best:
            return None
        fit = _fit(model, subset, object_points, image_points, "linear")
        middle, agree = _agreeing(fit, views, planes, noise)
        if middle < least:
            least, best = middle, agree
        if least <= CLEAN:
            break
    for _ in range(ROUNDS):
        if not best:
            return None
        fit = _fit(model, best, object_points, image_points, loss)
        before, best = best, _agreeing(fit, views, planes, noise)[1]
        if best == before:
            break
    if best != before or not number / 2 < len(best) < number:
        return None
    return [view for view in range(number) if view not in best], fit


def _subsets(number):
    """Subsets of the views, all or `SUBSETS` of them."""
    every = list(combinations(range(number), SUBSET))
    if len(every) <= SUBSETS:
        return every
    return [every[k] for k in np.random.default_rng(0).choice(len(every), SUBSETS, replace=False)]


def _fit(model, subset, object_points, image_points, loss):
    """The fit of some views, or None."""
    try:
        return fit_views(model, *([points[view] for view in subset] for points in (object_points, image_points)), loss)
    except (CalibrationError, np.linalg.LinAlgError):
        return None


def _agreeing(fit, views, planes, noise):
    """The variance, in units of their own noise, below which more than half of the views are with the camera of a fit,
    and the views that agree with it."""
    if fit is None:
        return np.inf, ()
    variances = held_variances(fit, views, planes) / noise**2
    middle = np.sort(variances)[len(variances) // 2]
    return middle, tuple(np.flatnonzero(variances < AGREES * max(middle, 1.0)).tolist())


def held_variances(fit: Fit, views: Views, planes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance per coordinate (V,) of each view's residuals with the camera of a fit, px^2; infinite if it sees none."""
    model = Resized(fit, (False, False, False))
    focal, center, _ = in_pixels(fit)
    rotations, positions = poses_of(linear_homographies(views, planes, (views.image - center) / focal)[0], planes, 1.0)
    variances = np.full(len(views.used), np.inf)
    for view in range(len(variances)):
        one = Views(*(getattr(views, name)[view : view + 1] for name in ("points", "centroids", "image", "used")))
        state = State(np.zeros(0), rotations[view : view + 1], positions[view : view + 1])
        if evaluate(model, one, state) is None:
            continue
        try:
            cost = descend(model, one, state, one.used)[1].cost
        except np.linalg.LinAlgError:
            continue
        variances[view] = cost / max(2 * one.used.sum() - 6, 1)
    return variances
