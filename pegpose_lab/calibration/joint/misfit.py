r"""Goodness of fit: whether the residuals of a bundle adjustment contradict its lens model or some of its views.

Stated sigmas are valid if the lens follows the model and the noise is independent and equal at all points.
The two tests below check the lens model and the views.  They do not detect correlated noise or a bent board.

*Nested models.*  If the lens follows the model, a richer model removes only its share of the noise, and

.. math:: F = \frac{(SSE - SSE') / q}{SSE' / (\nu - q)}

for q more parameters has an F distribution with (q, :math:`\nu - q`) degrees of freedom.  SSE' is first estimated by
one Gauss-Newton step from the minimum (a score test).  Only a candidate that is significant there is fitted in full
and judged by its own F.

*Views.*  A view with large residuals is left out and the others are fitted again.  If the view is of the same camera
and as accurate as the others, (SSE - SSE') / (SSE' / :math:`\nu'`), divided by its :math:`2 m - 6` degrees of freedom,
also has an F distribution.  A view whose variance is more than `STANDS_OUT` times that of the others is flagged.

If both tests find something, the flag names the explanation that leaves the smaller variance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from ...checks import CalibrationError, Flag
from .bundle import SMALLEST_RMS, Equations
from .fitting import fit_views
from .models import COEFFICIENTS, OpenCVModel, TsaiModel, lens_model
from .views import evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit

LEVEL = 0.01
"""Probability that a richer model or a view is flagged although the data follow the model."""

STANDS_OUT, SUSPECT = 9.0, 4.0
"""A view is tried from `SUSPECT` times the median view's variance, and flagged from `STANDS_OUT` times the others'."""

LEAST_INFORMATION = 1e-9
"""A candidate is not tried if its parameters have less information than this (see `covariance.LEAST_INFORMATION`)."""


@dataclass(frozen=True)
class _Better:
    """A richer model that fits better: its name, its F, the variance it leaves, and how far f, c_x and c_y move."""

    words: str
    statistic: float
    variance: float
    moved: np.ndarray


def judge_misfit(
    fit: Fit,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str = "linear",
) -> tuple[Flag, ...]:
    """Flags of a fit; the points and the loss must be those that were fitted."""
    if fit.variance <= SMALLEST_RMS**2:  # without noise there is no scale to judge by
        return ()
    better = _better_model(fit, object_points, image_points, loss)
    outlying, rest = _outlying_views(fit, object_points, image_points, loss)
    if outlying and not (better and better.variance < rest.variance):
        better = _better_model(rest, *_without(outlying, object_points, image_points), loss)
        flags = (Flag("misfit-view", _view_sentence(fit, outlying, rest)),)
        return flags + ((Flag("misfit-lens", f"Without them: {_model_sentence(rest, better)}"),) if better else ())
    return (Flag("misfit-lens", _model_sentence(fit, better)),) if better else ()


def views_in_doubt(
    fit: Fit,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str = "linear",
) -> str:
    """A sentence about the views that do not fit the others, or ""; arguments as for `judge_misfit`."""
    outlying, rest = _outlying_views(fit, object_points, image_points, loss)
    return _view_sentence(fit, outlying, rest) if outlying else ""


# --- richer models -------------------------------------------------------------------------------------------


def _candidates(model):
    """Richer models: the name, the model (None if there is none here), and the names of its additional columns."""
    named = model.coefficient_names
    known = ("k1",) if named is None else named  # kappa1 undistorts, but has nearly the effect of k1
    missing = [name for name in ("k1", "k2", "k3") if name not in known]

    def richer(coefficients=named, two=model.two, free_center=model.free_center):
        return lens_model(model.sensor, free_center, two, coefficients)

    found = []
    for number in range(1, len(missing) + 1):
        radial = tuple(name for name in COEFFICIENTS if name in (*known, *missing[:number]))
        found.append((f"distortion by {', '.join(radial)}", richer(radial), missing[:number]))
    if not missing:
        found.append(("a radial pattern that none of the models here has", None, ["k4"]))
    if not {"p1", "p2"} & set(known):
        base = missing[:1] if named is None else []  # k1 alone may fit worse than kappa1
        tangential = tuple(name for name in COEFFICIENTS if name in (*known, *base, "p1", "p2"))
        found.append((f"distortion by {', '.join(tangential)}", richer(tangential), [*base, "p1", "p2"]))
    if not model.two:
        found.append(("f_x and f_y apart", richer(two=True), ["f_y"]))
    if not model.free_center:
        found.append(("a free principal point", richer(free_center=True), ["c_x", "c_y"]))
    return found


def _better_model(fit, object_points, image_points, loss):
    """The best richer model by BIC among those that fit significantly better; None if none does."""
    candidates = _candidates(fit.model)
    level, found, coordinates = LEVEL / len(candidates), [], 2 * fit.views.used.sum()
    for (words, model, columns), score in zip(candidates, _scores(fit, candidates), strict=True):
        if score is None or not _tail(fit, score[0], len(columns)) < level:
            continue
        squares, moved = score
        if model is not None:
            try:
                other = fit_views(model, object_points, image_points, loss)
            except (CalibrationError, np.linalg.LinAlgError):  # the views do not determine it
                continue
            moved = _compared(other, fit.model) - _compared(fit, fit.model)
            if loss == "linear":  # with a robust loss each model has its own scale, so squares are not comparable
                squares = other.squares
        if _tail(fit, squares, len(columns)) < level:
            variance = squares / (fit.freedom - len(columns))
            better = _Better(words, _statistic(fit, squares, len(columns)), variance, moved)
            found.append((coordinates * np.log(squares) + len(columns) * np.log(coordinates), better))
    return min(found, key=lambda entry: entry[0], default=(np.inf, None))[1]


def _statistic(fit, squares, number):
    """F of a richer model with `number` more parameters that leaves `squares`."""
    return (fit.squares - squares) / number / (squares / (fit.freedom - number))


def _tail(fit, squares, number):
    """Probability of such an F or a larger one if the lens follows the fitted model."""
    return _f_tail(_statistic(fit, squares, number), number, fit.freedom - number)


def _f_tail(ratio, number, freedom):
    """Probability of an F of at least this ratio."""
    return fdtrc(number, freedom, np.maximum(ratio, 0))


def _scores(fit, candidates):
    """Sum of squares after one Gauss-Newton step, and the moves of f, c_x and c_y; None if not determined."""
    residuals, jacobian = evaluate(fit.model, fit.views, fit.state)
    residuals = residuals * fit.weights[..., None]
    residuals *= np.sqrt(fit.squares / np.sum(residuals**2))  # for a robust loss: Huber's pseudo-residuals
    further = _further_columns(fit)
    k, names = len(fit.model.names), list(further)
    columns = np.stack(list(further.values()), axis=-1).reshape(*residuals.shape, -1)
    wide = np.concatenate([jacobian[..., :k], columns, jacobian[..., k:]], axis=-1)
    equations = Equations.of(residuals, wide, fit.views.used)
    schur, _, by_gradient = equations.eliminated()
    gradient = equations.shared_gradient - (equations.b @ by_gradient).sum(axis=0)[:, 0]
    scale = np.sqrt(np.diagonal(equations.a))
    schur, gradient = schur / np.outer(scale, scale), gradient / scale
    before = gradient[:k] @ np.linalg.solve(schur[:k, :k], gradient[:k])  # OpenCV stops near the minimum, not at it
    found = []
    for _, _, wanted in candidates:
        chosen = [*range(k), *(k + names.index(name) for name in wanted)]
        block = schur[np.ix_(chosen, chosen)]
        if len(chosen) - k >= fit.freedom or not np.linalg.eigvalsh(block)[0] > LEAST_INFORMATION:
            found.append(None)
            continue
        step = -np.linalg.solve(block, gradient[chosen])
        moved = np.zeros(3)
        places = [fit.model.names.index(name) if name in fit.model.names else None for name in ("c_x", "c_y")]
        for target, place in enumerate((0, *places)):
            moved[target] = 0.0 if place is None else step[place] / scale[place]
        found.append((fit.squares + gradient[chosen] @ step + before, moved))
    return found


def _further_columns(fit):
    """Derivatives (V m, 2) of the image points by the additional parameters of richer models, by name."""
    turned = fit.views.points @ fit.state.rotations.transpose(0, 2, 1) + fit.state.positions[:, None]
    points = turned.reshape(-1, 3)
    model = OpenCVModel(fit.model.sensor, True, True, COEFFICIENTS)
    by_shared = model.project(np.concatenate(_in_pixels(fit)), points)[1]
    columns = {name: by_shared[:, :, index] for index, name in enumerate(model.names) if name != "f_x"}
    columns["k4"] = columns["k3"] * np.sum((points[:, :2] / points[:, 2:]) ** 2, axis=1, keepdims=True)
    return columns


def _in_pixels(fit):
    """f_x and f_y, the principal point, and OpenCV's coefficients (zeros for a model with kappa1)."""
    camera = fit.model.camera(fit.state.shared)
    if isinstance(fit.model, TsaiModel):
        return camera.focal_length * camera.pixels_per_mm, np.array(camera.principal_point), np.zeros(5)
    return np.diag(camera.camera_matrix)[:2], camera.camera_matrix[:2, 2], camera.dist_coeffs


def _compared(fit, model):
    """f and the principal point (3,) of a fit of any model; f is in the unit of the given model, the rest in px."""
    (f_x, f_y), center, _ = _in_pixels(fit)
    f = f_y * model.sensor.pixel_pitch[1] if isinstance(model, TsaiModel) else f_x
    return np.array([f, *center])


def _model_sentence(fit, better):
    name, unit = fit.model.names[0], fit.model.unit
    sigmas = _in_sigmas(fit, name, better.moved[0])
    moves = [f"f moves by {_plain(better.moved[0], 2, True)} {unit}, {sigmas:.1f} of its stated sigmas"]
    for center, moved in zip(("c_x", "c_y"), better.moved[1:], strict=True):
        if center in fit.covariance.index and _in_sigmas(fit, center, moved) > 1:
            moves.append(f"{center} by {_plain(moved, 2, True)} px, {_in_sigmas(fit, center, moved):.1f}")
    return (
        f"The points do not fit this model: with {better.words} they fit better (F = {_plain(better.statistic, 3)}), "
        f"and {'; '.join(moves)}. "
        "Stated sigmas and intervals hold for a camera of the model only; free more parameters."
    )


def _plain(value, digits, sign=False):
    """A number with some significant digits, without an exponent."""
    return np.format_float_positional(value, digits, fractional=False, trim="-", sign=sign)


def _in_sigmas(fit, name, moved):
    return abs(moved) / np.sqrt(fit.covariance.loc[name, name])


# --- views ---------------------------------------------------------------------------------------------------


def _outlying_views(fit, object_points, image_points, loss):
    """The views that do not fit the others, counted from 0, and the `Fit` without them (or no views and the same fit).

    Views are left out, worst first, until none is suspect.  Each must then stand out when it alone is put back.
    """
    points, out, rest = (object_points, image_points), [], fit
    try:
        while 2 * len(out) + 2 < len(object_points):
            ratios = _by_the_median(rest)
            if ratios.max() < SUSPECT:
                break
            out.append([view for view in range(len(object_points)) if view not in out][int(np.argmax(ratios))])
            rest = fit_views(fit.model, *_without(out, *points), loss)
        for view in tuple(out):
            others = [other for other in out if other != view]
            with_it = fit_views(fit.model, *_without(others, *points), loss) if others else fit
            if not _stands_out(with_it, rest, len(object_points)):
                return [], fit
    except (CalibrationError, np.linalg.LinAlgError):  # the others do not determine the camera
        return [], fit
    return sorted(out), rest


def _by_the_median(fit):
    """Variance of each view's residuals, relative to that of the median view."""
    residuals = evaluate(fit.model, fit.views, fit.state)[0] * fit.weights[..., None]
    counts = 2 * fit.views.used.sum(axis=1)
    freedom = np.maximum(counts - 6 - len(fit.model.names) * counts / counts.sum(), 1)
    variances = np.sum(residuals**2, axis=(1, 2)) / freedom
    return variances / max(np.median(variances), SMALLEST_RMS**2)


def _stands_out(with_it, rest, number):
    """Whether the one view that two fits differ by fits significantly worse than the rest of `number` views."""
    freedom = with_it.freedom - rest.freedom
    ratio = (with_it.squares - rest.squares) / freedom / rest.variance
    return ratio > STANDS_OUT and _f_tail(ratio, freedom, rest.freedom) < LEVEL / number


def _view_sentence(fit, views, rest):
    """A sentence that names the views that do not fit, and the result without them."""
    residuals = evaluate(fit.model, fit.views, fit.state)[0] * fit.views.used[..., None]
    rms = np.sqrt(np.sum(residuals**2, axis=(1, 2)) / fit.views.used.sum(axis=1))
    which = f"View{'s' * (len(views) > 1)} {', '.join(map(str, views))} (counted from 0)"
    here, alone = np.max(rms[views]), np.sqrt(2 * rest.variance)
    moved = _plain(_compared(rest, fit.model)[0] - _compared(fit, fit.model)[0], 2, True)
    does, it = ("does", "it") if len(views) == 1 else ("do", "them")
    return (
        f"{which} {does} not fit the others: an rms of {_plain(here, 2)} px, where these alone have "
        f"{_plain(alone, 2)} px, and without {it} f moves by {moved} {fit.model.unit}. Check the order of the points, "
        f"wrong corners, and that all images are of one camera, size and focus; or leave {it} out."
    )


def _without(views, *lists):
    """Lists without some of their entries."""
    return [[entry for view, entry in enumerate(entries) if view not in views] for entries in lists]
