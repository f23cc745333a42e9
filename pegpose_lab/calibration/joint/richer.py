r"""Richer lens models: whether one of them fits the views significantly better than the fitted one.

If the lens follows the model, a richer model removes only its share of the noise, and

.. math:: F = \frac{(SSE - SSE') / q}{SSE' / (\nu - q)}

for q more parameters has an F distribution with (q, :math:`\nu - q`) degrees of freedom.  SSE' is first estimated by
one Gauss-Newton step from the minimum (a score test).  Only a candidate that is significant there is fitted in full
and judged by its own F.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from ...checks import CalibrationError
from .bundle import Equations
from .fitting import fit_views
from .models import COEFFICIENTS, OpenCVModel, TsaiModel, lens_model
from .views import evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit

LEVEL = 0.01
"""Probability that a richer model or a view is flagged although the data follow the model."""

LEAST_INFORMATION = 1e-9
"""A candidate is not tried if its parameters have less information than this (see `covariance.LEAST_INFORMATION`)."""


@dataclass(frozen=True)
class Better:
    """A richer model that fits better: its name, its F, the variance it leaves, and how far f, c_x and c_y move."""

    words: str
    statistic: float
    variance: float
    moved: np.ndarray


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


def better_model(
    fit: Fit, object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]], loss: str
) -> Better | None:
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
            moved = compared(other, fit.model) - compared(fit, fit.model)
            if loss == "linear":  # with a robust loss each model has its own scale, so squares are not comparable
                squares = other.squares
        if _tail(fit, squares, len(columns)) < level:
            variance = squares / (fit.freedom - len(columns))
            better = Better(words, _statistic(fit, squares, len(columns)), variance, moved)
            found.append((coordinates * np.log(squares) + len(columns) * np.log(coordinates), better))
    return min(found, key=lambda entry: entry[0], default=(np.inf, None))[1]


def _statistic(fit, squares, number):
    """F of a richer model with `number` more parameters that leaves `squares`."""
    return (fit.squares - squares) / number / (squares / (fit.freedom - number))


def _tail(fit, squares, number):
    """Probability of such an F or a larger one if the lens follows the fitted model."""
    return f_tail(_statistic(fit, squares, number), number, fit.freedom - number)


def f_tail(ratio: float, number: int, freedom: int) -> float:
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


def compared(fit: Fit, model: TsaiModel | OpenCVModel) -> NDArray[np.float64]:
    """f and the principal point (3,) of a fit of any model; f is in the unit of the given model, the rest in px."""
    (f_x, f_y), center, _ = _in_pixels(fit)
    f = f_y * model.sensor.pixel_pitch[1] if isinstance(model, TsaiModel) else f_x
    return np.array([f, *center])


def model_sentence(fit: Fit, better: Better) -> str:
    """A sentence that names the richer model, and how far f and the principal point move with it."""
    name, unit = fit.model.names[0], fit.model.unit
    sigmas = _in_sigmas(fit, name, better.moved[0])
    moves = [f"f moves by {plain(better.moved[0], 2, True)} {unit}, {sigmas:.1f} of its stated sigmas"]
    for center, moved in zip(("c_x", "c_y"), better.moved[1:], strict=True):
        if center in fit.covariance.index and _in_sigmas(fit, center, moved) > 1:
            moves.append(f"{center} by {plain(moved, 2, True)} px, {_in_sigmas(fit, center, moved):.1f}")
    return (
        f"The points do not fit this model: with {better.words} they fit better (F = {plain(better.statistic, 3)}), "
        f"and {'; '.join(moves)}. "
        "Stated sigmas and intervals hold for a camera of the model only; free more parameters."
    )


def plain(value: float, digits: int, sign: bool = False) -> str:
    """A number with some significant digits, without an exponent."""
    return np.format_float_positional(value, digits, fractional=False, trim="-", sign=sign)


def _in_sigmas(fit, name, moved):
    return abs(moved) / np.sqrt(fit.covariance.loc[name, name])
