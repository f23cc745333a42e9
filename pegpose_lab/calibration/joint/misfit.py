r"""Whether the model fits: what the residuals of a least squares say against its lens model, or against some views.

Stated sigmas and intervals hold if the lens is one of the model's and the noise is independent and alike at all points.
Two tests look at the first two of these conditions; neither sees noise that is correlated, or a bent board as such.

*Nested models.*  If the lens is of the model, a richer model takes only its share of noise from the residuals, and

.. math:: F = \frac{(SSE - SSE') / q}{SSE' / (\nu - q)}

with q more parameters has Fisher's distribution of (q, :math:`\nu - q`) degrees of freedom.  SSE' comes from one
Gauss-Newton step out of the minimum (a score test: the normal equations once, with a column for each candidate); only
what is significant there is fitted in full, and judged by its own F.

*Views.*  A view whose residuals stand out is left out and the others are fitted again.  If it is of the same camera and
as accurate, (SSE - SSE') / (SSE' / :math:`\nu'`) per its :math:`2 m - 6` degrees of freedom is distributed likewise;
a view that fits worse than `STANDS_OUT` times the others is flagged, by variance.

Where both speak, that explanation is told which leaves the smaller variance.
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
"""Chance that some richer model, or some view, is flagged though all is as the model says."""

STANDS_OUT, SUSPECT = 9.0, 4.0
"""Variance of a view by that of the others from which it is flagged, and by the median view's from which it is tried."""

LEAST_INFORMATION = 1e-9
"""Of a candidate's parameters, as in `covariance.LEAST_INFORMATION`: with less it is not tried."""


@dataclass(frozen=True)
class _Better:
    """A richer model that fits better: in words, its F, the variance it leaves and how far it moves f, c_x and c_y."""

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
    """Flags, a tuple; the points and the loss are those that were fitted."""
    if fit.variance <= SMALLEST_RMS**2:  # no noise: nothing to judge by
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
    """A sentence on the views that do not fit the others, or an empty one; arguments as of `judge_misfit`."""
    outlying, rest = _outlying_views(fit, object_points, image_points, loss)
    return _view_sentence(fit, outlying, rest) if outlying else ""


# --- richer models -------------------------------------------------------------------------------------------


def _candidates(model):
    """Richer models: in words, the model (None if there is none here), and the names of its further columns."""
    named = model.coefficient_names
    known = ("k1",) if named is None else named  # kappa1 undistorts, and does nearly what k1 does
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
    """Of the richer models that fit significantly better the best by Schwarz's criterion (BIC); None if none does."""
    candidates = _candidates(fit.model)
    level, found, coordinates = LEVEL / len(candidates), [], 2 * fit.views.used.sum()
    for (words, model, columns), score in zip(candidates, _scores(fit, candidates), strict=True):
        if score is None or not _tail(fit, score[0], len(columns)) < level:
            continue
        squares, moved = score
        if model is not None:
            try:
                other = fit_views(model, object_points, image_points, loss)
            except (CalibrationError, np.linalg.LinAlgError):  # it is not determined, though it would fit better
                continue
            moved = _compared(other, fit.model) - _compared(fit, fit.model)
            if loss == "linear":  # a robust loss judges by another scale in another model
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
    """Chance of such an F, or a larger one, if the lens is of the fitted model."""
    return _f_tail(_statistic(fit, squares, number), number, fit.freedom - number)


def _f_tail(ratio, number, freedom):
    """Chance of an F of at least this ratio."""
    return fdtrc(number, freedom, np.maximum(ratio, 0))


def _scores(fit, candidates):
    """The squares that each candidate would leave by one Gauss-Newton step, and how far f, c_x and c_y would move.

    None where a candidate's parameters are not determined.
    """
    residuals, jacobian = evaluate(fit.model, fit.views, fit.state)
    residuals = residuals * fit.weights[..., None]
    residuals *= np.sqrt(fit.squares / np.sum(residuals**2))  # of a robust loss: pseudo-residuals, Huber's
    further = _further_columns(fit)
    k, names = len(fit.model.names), list(further)
    columns = np.stack(list(further.values()), axis=-1).reshape(*residuals.shape, -1)
    wide = np.concatenate([jacobian[..., :k], columns, jacobian[..., k:]], axis=-1)
    equations = Equations.of(residuals, wide, fit.views.used)
    schur, _, by_gradient = equations.eliminated()
    gradient = equations.shared_gradient - (equations.b @ by_gradient).sum(axis=0)[:, 0]
    scale = np.sqrt(np.diagonal(equations.a))
    schur, gradient = schur / np.outer(scale, scale), gradient / scale
    before = gradient[:k] @ np.linalg.solve(schur[:k, :k], gradient[:k])  # OpenCV's minimum is one to its tolerance
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
    """Derivatives (V m, 2) of the image by what a richer model may have, by name."""
    turned = fit.views.points @ fit.state.rotations.transpose(0, 2, 1) + fit.state.positions[:, None]
    points = turned.reshape(-1, 3)
    model = OpenCVModel(fit.model.sensor, True, True, COEFFICIENTS)
    by_shared = model.project(np.concatenate(_in_pixels(fit)), points)[1]
    columns = {name: by_shared[:, :, index] for index, name in enumerate(model.names) if name != "f_x"}
    columns["k4"] = columns["k3"] * np.sum((points[:, :2] / points[:, 2:]) ** 2, axis=1, keepdims=True)
    return columns


def _in_pixels(fit):
    """f_x and f_y, the principal point, and OpenCV's coefficients (none for kappa1)."""
    camera = fit.model.camera(fit.state.shared)
    if isinstance(fit.model, TsaiModel):
        return camera.focal_length * camera.pixels_per_mm, np.array(camera.principal_point), np.zeros(5)
    return np.diag(camera.camera_matrix)[:2], camera.camera_matrix[:2, 2], camera.dist_coeffs


def _compared(fit, model):
    """f in the unit of a model, and the principal point in px, (3,), of a fit of any model."""
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
        f"The points do not fit this model: with {better.words} they fit better (F = {_plain(better.statistic, 3)}), and "
        f"{'; '.join(moves)}. Stated sigmas and intervals hold for a camera of the model only; free more parameters."
    )


def _plain(value, digits, sign=False):
    """A number to some significant digits, without an exponent."""
    return np.format_float_positional(value, digits, fractional=False, trim="-", sign=sign)


def _in_sigmas(fit, name, moved):
    return abs(moved) / np.sqrt(fit.covariance.loc[name, name])


# --- views ---------------------------------------------------------------------------------------------------


def _outlying_views(fit, object_points, image_points, loss):
    """The views that do not fit the others, counted from 0, and the `Fit` without them; none, and the fit itself.

    The worst is left out as long as one is suspect; in the end each must stand out from the others by itself.
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
    """Variance of each view's residuals by that of the median view."""
    residuals = evaluate(fit.model, fit.views, fit.state)[0] * fit.weights[..., None]
    counts = 2 * fit.views.used.sum(axis=1)
    freedom = np.maximum(counts - 6 - len(fit.model.names) * counts / counts.sum(), 1)
    variances = np.sum(residuals**2, axis=(1, 2)) / freedom
    return variances / max(np.median(variances), SMALLEST_RMS**2)


def _stands_out(with_it, rest, number):
    """Whether the view by which two fits differ fits worse than the rest, one of a number of views."""
    freedom = with_it.freedom - rest.freedom
    ratio = (with_it.squares - rest.squares) / freedom / rest.variance
    return ratio > STANDS_OUT and _f_tail(ratio, freedom, rest.freedom) < LEVEL / number


def _view_sentence(fit, views, rest):
    """Which views do not fit, and what the others say without them."""
    residuals = evaluate(fit.model, fit.views, fit.state)[0] * fit.views.used[..., None]
    rms = np.sqrt(np.sum(residuals**2, axis=(1, 2)) / fit.views.used.sum(axis=1))
    which = f"View{'s' * (len(views) > 1)} {', '.join(map(str, views))} (counted from 0)"
    here, alone = np.max(rms[views]), np.sqrt(2 * rest.variance)
    moved = _plain(_compared(rest, fit.model)[0] - _compared(fit, fit.model)[0], 2, True)
    does, it = ("does", "it") if len(views) == 1 else ("do", "them")
    return (
        f"{which} {does} not fit the others: an rms of {_plain(here, 2)} px, where these alone have {_plain(alone, 2)} px, "
        f"and without {it} f moves by {moved} {fit.model.unit}. Check the order of the points, wrong corners, and that all "
        f"images are of one camera, size and focus; or leave {it} out."
    )


def _without(views, *lists):
    """Lists without some of their entries."""
    return [[entry for view, entry in enumerate(entries) if view not in views] for entries in lists]
