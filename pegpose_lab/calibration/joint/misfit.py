"""Goodness of fit: whether the residuals of a bundle adjustment contradict its lens model, some views or some corners.

Stated sigmas are valid if the lens follows the model and the noise is independent and equal at all points.
Three tests check single corners (`corners`), the lens model (`richer`) and the views (`outlying`).  They do not detect
correlated noise or a bent board.  If both of the last two find something, the flag names the explanation that leaves
the smaller variance.  Two more flags need no residuals: copies of a view, and planes seen from behind (`copies`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError, Flag
from .agreeing import agreeing_views
from .bundle import SMALLEST_RMS
from .copies import copied_views, copies_sentence, judge_sides
from .corners import judge_corners, without_wrong, wrong_corners
from .fitting import fit_views
from .outlying import majority, outlying_views, view_sentence, without
from .richer import better_model, model_sentence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit
    from .models import OpenCVModel, TsaiModel


def judge_misfit(
    fit: Fit,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str = "linear",
) -> tuple[Flag, ...]:
    """Flags of a fit; the points and the loss must be those that were fitted."""
    flags, number = judge_sides(object_points, fit.state), len(object_points)
    copies = copied_views(object_points, image_points, np.sqrt(fit.variance))
    if copies:
        flags += (Flag("copied-views", copies_sentence(copies, number)),)
    if fit.variance <= SMALLEST_RMS**2:  # without noise there is no scale to judge by
        return flags
    wrong, rest = wrong_corners(fit, object_points, image_points, loss)
    if wrong:
        flags += (judge_corners(fit, wrong, rest),)
        fit, (object_points, image_points) = rest, without_wrong(wrong, object_points, image_points)
    repeated = [view for group in copies for view in group[1:]]
    return flags + _judge_views_and_lens(fit, object_points, image_points, loss, repeated)


def _judge_views_and_lens(fit, object_points, image_points, loss, repeated):
    """Flags about views and lens; `repeated` are copies of other views, whose noise is not independent."""
    views = object_points, image_points
    better = _better_model(fit, views, loss, repeated)
    outlying, rest = outlying_views(fit, *views, loss)
    explained = better if better and not (outlying and rest.variance <= better.variance) else rest
    if better or outlying:
        outlying, rest = majority(fit, *views, loss, explained.variance) or (outlying, rest)
    if outlying and not (better and better.variance < rest.variance):
        better = _better_model(rest, without(outlying, *views), loss, [])
        flags = (Flag("misfit-view", view_sentence(fit, outlying, rest, *views)),)
        return flags + ((Flag("misfit-lens", f"Without them: {model_sentence(rest, better)}"),) if better else ())
    return (Flag("misfit-lens", model_sentence(fit, better)),) if better else ()


def _better_model(fit, views, loss, repeated):
    """As `richer.better_model`, by one of each group of copies."""
    if repeated:
        views = without(repeated, *views)
        try:
            fit = fit_views(fit.model, *views, loss)
        except (CalibrationError, np.linalg.LinAlgError):
            return None
    return better_model(fit, *views, loss)


def refused(
    error: Exception,
    model: TsaiModel | OpenCVModel,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str = "linear",
) -> CalibrationError:
    """The error of a calibration, led by the copies among the views, or by the views that do not agree with the others.

    There need not be a fit of all views.
    """
    groups = copied_views(object_points, image_points)
    found = None if groups else agreeing_views(model, object_points, image_points, loss)
    if groups:
        doubt = copies_sentence(groups, len(object_points))
    elif found:
        doubt = view_sentence(None, *found, object_points, image_points)
    else:
        return CalibrationError(str(error))
    return CalibrationError(f"{doubt} With all views: {error}")
