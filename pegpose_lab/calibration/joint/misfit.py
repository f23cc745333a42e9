"""Goodness of fit: whether the residuals of a bundle adjustment contradict its lens model, some views or some corners.

Three tests check single corners (`corners`), the models of lens and board (`richer`) and the views (`outlying`); whether
the errors are independent is tested in `clustered`.  If both of the last two find something, the flag names the
explanation that leaves the smaller variance.  Two more flags need no residuals: copies of a view, and planes seen from
behind (`copies`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from ...flags import Flag
from ..result import judge_image_size
from .agreeing import agreeing_views
from .bundle import SMALLEST_RMS
from .copies import copied_views, copies_sentence, judge_sides
from .corners import judge_corners, stray_corners, without_wrong, wrong_corners
from .fitting import fit_views
from .orders import far_sentence
from .outlying import majority, outlying_views, view_sentence, without
from .richer import better_model, compared, model_sentence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit
    from .models import FisheyeModel, OpenCVModel, TsaiModel


LEAST_DISTINCT = 3
"""With fewer distinct views than this beside copies, the lens is not judged: they hardly determine it."""


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
        flags += (judge_corners(fit, wrong, rest, loss),)
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
        more = agreeing_views(fit.model, *views, loss) if better else None  # a wrong view may pass for a richer lens
        if more and set(more[0]) > set(outlying):
            outlying, rest = more
            better = _better_model(rest, without(outlying, *views), loss, [])
        flags = (Flag("misfit-view", view_sentence(fit, outlying, rest, *views)),)
        return flags + (_model_flag(rest, better, "Without them: ") if better else ())
    if not better:
        return ()
    flags = ()
    if not fit.model.free_center and better.words.endswith("principal point"):
        center = compared(fit, fit.model)[1:] + better.moved[1:]
        words = f"{better.words}, ({center[0]:.0f}, {center[1]:.0f}) px,"
        better = replace(better, candidate=replace(better.candidate, words=words))
        flags = _swapped_size(fit.model.sensor, center, image_points)
    return _model_flag(fit, better) + flags


def _model_flag(fit, better, before=""):
    text = before + model_sentence(fit, better)
    return (Flag("misfit-board", text) if better.candidate.of_board else Flag("misfit-lens", text),)


def _swapped_size(sensor, center, image_points):
    """A flag if only the principal point that fits tells that width and height are swapped."""
    freed = replace(sensor, principal_point=tuple(center))
    return () if judge_image_size(sensor, image_points) else judge_image_size(freed, image_points)


def _better_model(fit, views, loss, repeated):
    """As `richer.better_model`, by one of each group of copies."""
    if repeated:
        views = without(repeated, *views)
        if len(views[0]) < LEAST_DISTINCT:
            return None
        try:
            fit = fit_views(fit.model, *views, loss)
        except (CalibrationError, np.linalg.LinAlgError):
            return None
    return better_model(fit, *views, loss)


def refused(
    error: Exception,
    model: TsaiModel | OpenCVModel | FisheyeModel,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    fit: Fit | None,
    loss: str = "linear",
) -> CalibrationError:
    """The error of a calibration, led by the copies among the views, by wrong corners, or by the views that do not
    agree with the others.

    `fit` is that of all views, or None if there is none.
    """
    if isinstance(error, np.linalg.LinAlgError):
        error = (
            f"the views do not determine all of {', '.join(model.names)}, to the last digits; add views of other tilts "
            "(about 30 deg), or free fewer parameters"
        )
    groups = copied_views(object_points, image_points)
    if groups:
        return CalibrationError(f"{copies_sentence(groups, len(object_points))} With all views: {error}")
    single = {view: stray_corners(*pair) for view, pair in enumerate(zip(object_points, image_points, strict=True))}
    single = {view: corners for view, corners in single.items() if corners}
    if single:
        words = far_sentence(single, len(object_points) == 1)
        return CalibrationError(f"{words[0].upper()}{words[1:]}; leave them out. With all corners: {error}")
    if fit is None:
        found = agreeing_views(model, object_points, image_points, loss)
    else:
        found = outlying_views(fit, object_points, image_points, loss)
        found = found if found[0] else majority(fit, object_points, image_points, loss, fit.variance)
    if not found:
        return CalibrationError(str(error))
    return CalibrationError(f"{view_sentence(fit, *found, object_points, image_points)} With all views: {error}")
