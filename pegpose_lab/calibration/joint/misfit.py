"""Goodness of fit: whether the residuals of a bundle adjustment contradict its lens model or some of its views.

Two tests check the lens model (`richer`) and the views (`outlying`); whether the errors are independent is tested in
`clustered`.  If both find something, the flag names the explanation that leaves the smaller variance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...checks import Flag
from .bundle import SMALLEST_RMS
from .outlying import outlying_views, view_sentence, without
from .richer import better_model, model_sentence

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from .fitting import Fit


def judge_misfit(
    fit: Fit,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str = "linear",
) -> tuple[Flag, ...]:
    """Flags of a fit; the points and the loss must be those that were fitted."""
    if fit.variance <= SMALLEST_RMS**2:  # without noise there is no scale to judge by
        return ()
    better = better_model(fit, object_points, image_points, loss)
    outlying, rest = outlying_views(fit, object_points, image_points, loss)
    if outlying and not (better and better.variance < rest.variance):
        better = better_model(rest, *without(outlying, object_points, image_points), loss)
        flags = (Flag("misfit-view", view_sentence(fit, outlying, rest)),)
        return flags + ((Flag("misfit-lens", f"Without them: {model_sentence(rest, better)}"),) if better else ())
    return (Flag("misfit-lens", model_sentence(fit, better)),) if better else ()


def views_in_doubt(
    fit: Fit,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str = "linear",
) -> str:
    """A sentence about the views that do not fit the others, or ""; arguments as for `judge_misfit`."""
    outlying, rest = outlying_views(fit, object_points, image_points, loss)
    return view_sentence(fit, outlying, rest) if outlying else ""
