r"""Richer models of the lens or the board: whether one of them fits the views significantly better than the fitted one.

If the lens and the board follow the model, a richer model removes only its share of the noise, and

.. math:: F = \frac{(SSE - SSE') / q}{SSE' / (\nu - q)}

for q more parameters has an F distribution with (q, :math:`\nu - q`) degrees of freedom.  SSE' is first estimated by
one Gauss-Newton step from the minimum (a score test).  Only a candidate that is significant there is fitted in full
and judged by its own F.  A model of which the fitted one is no special case (an equidistant lens beside a perspective one)
has no F: it is fitted if the powers of the radius that it differs by are significant, and named if it is best by BIC.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from ...checks import CalibrationError
from .bundle import Equations
from .candidates import candidates_for, further_columns, in_pixels
from .fitting import fit_views
from .models import TsaiModel
from .views import State, evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .candidates import Candidate
    from .fitting import Fit
    from .models import FisheyeModel, OpenCVModel

LEVEL = 0.01
"""Probability that a richer model or a view is flagged although the data follow the model."""

LEAST_INFORMATION = 1e-9
"""A candidate is not tried if its parameters have less information than this (see `covariance.LEAST_INFORMATION`)."""

SMALL_GAIN = 0.1
"""The sentence warns of correlated noise if the rms falls by less than this fraction: real corners that err together have
given F up to 20 with gains of 1 %."""


@dataclass(frozen=True)
class Better:
    """A richer model that fits better: the candidate, its F (nan if it has none), the variance that it leaves, how far f,
    c_x and c_y move, and the values of the board's unknowns that it adds."""

    candidate: Candidate
    statistic: float
    variance: float
    moved: np.ndarray
    board: dict[str, float]

    @property
    def words(self) -> str:
        """What the flag calls it."""
        shape = ", ".join(
            f"{name} = {value:.5f}" if name == "aspect" else f"{name} = {value:+.2f} mm"
            for name, value in self.board.items()
        )
        return self.candidate.words + (f", {shape}," if shape else "")


def better_model(
    fit: Fit, object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]], loss: str
) -> Better | None:
    """The best richer model by BIC among those that fit significantly better; None if none does."""
    candidates = candidates_for(fit, object_points)
    level, found, coordinates = LEVEL / len(candidates), [], 2 * fit.views.used.sum()
    for candidate, score in zip(candidates, _scores(fit, candidates), strict=True):
        if score is None or not _tail(fit, score[0], len(candidate.columns)) < level:
            continue
        squares, moved = score
        number, board = len(candidate.columns), {}
        if candidate.model is not None:
            try:
                start = _restart(fit, candidate.model) if candidate.nested else None
                other = fit_views(candidate.model, object_points, image_points, loss, start)
            except (CalibrationError, np.linalg.LinAlgError):  # the views do not determine it
                continue
            number = fit.freedom - other.freedom
            moved = compared(other, fit.model) - compared(fit, fit.model)
            if candidate.of_board:
                values = dict(zip(other.model.names, other.state.shared.tolist(), strict=True))
                board = {name: values[name] for name in other.model.board.names}
            if loss == "linear" or not candidate.nested:  # with a robust loss each model has its own scale
                squares = other.squares
        criterion = coordinates * np.log(squares) + number * np.log(coordinates)
        least = coordinates * np.log(fit.squares)
        if _tail(fit, squares, number) < level if candidate.nested else criterion < least:
            statistic = _statistic(fit, squares, number) if candidate.nested else np.nan
            found.append((criterion, Better(candidate, statistic, squares / (fit.freedom - number), moved, board)))
    return min(found, key=lambda entry: entry[0], default=(np.inf, None))[1]


def _restart(fit, model):
    """The fitted state in a richer model of the same kind, with what is new at its start; None for another kind."""
    if type(model) is not type(fit.model):
        return None
    start = dict(zip(model.names, model.start(1.0), strict=True))
    if "f_y" in start:
        start["f_y"] = in_pixels(fit)[0][1]
    start |= dict(zip(fit.model.names, fit.state.shared, strict=True))
    return State(np.array([start[name] for name in model.names]), fit.state.rotations, fit.state.positions)


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
    further = further_columns(fit, candidates)
    k, names = len(fit.model.names), list(further)
    columns = np.stack(list(further.values()), axis=-1).reshape(*residuals.shape, -1)
    wide = np.concatenate([jacobian[..., :k], columns, jacobian[..., k:]], axis=-1)
    equations = Equations.of(residuals, wide, fit.views.used)
    schur, _, by_gradient = equations.eliminated()
    gradient = equations.shared_gradient - (equations.b @ by_gradient).sum(axis=0)[:, 0]
    scale = np.sqrt(np.diagonal(equations.a))
    scale[scale == 0] = 1.0  # what moves no point, as the S-shaped bend of three rows, has no information
    schur, gradient = schur / np.outer(scale, scale), gradient / scale
    before = gradient[:k] @ np.linalg.solve(schur[:k, :k], gradient[:k])  # OpenCV stops near the minimum, not at it
    found = []
    for candidate in candidates:
        chosen = [*range(k), *(k + names.index(name) for name in candidate.columns)]
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


def compared(fit: Fit, model: TsaiModel | OpenCVModel | FisheyeModel) -> NDArray[np.float64]:
    """f and the principal point (3,) of a fit of any model; f is in the unit of the given model, the rest in px."""
    (f_x, f_y), center, _ = in_pixels(fit)
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
    before, after = np.sqrt(2 * fit.variance), np.sqrt(2 * better.variance)
    gain = f"an rms of {plain(after, 3)} instead of {plain(before, 3)} px"
    if np.isfinite(better.statistic):
        gain += f", F = {plain(better.statistic, 3)}"
    ending = f"Stated sigmas and intervals hold for {_held(better.candidate)}"
    if after > (1 - SMALL_GAIN) * before:
        ending += " The gain is small: noise that neighbouring points share can also cause it."
    what = "board" if better.candidate.of_board else "model"
    return f"The points do not fit this {what}: with {better.words} they fit better ({gain}), and {'; '.join(moves)}. {ending}"


def _held(candidate):
    """What the stated sigmas hold for, and what to do."""
    if candidate.of_board:
        return "an exact board only; measure it, or free its unknowns (board)."
    if candidate.model is None:
        return "a camera of the model only; none here describes this, so take them for too small."
    if not candidate.nested:
        return "a camera of the model only; choose that lens in calibrate_joint (lens)."
    return "a camera of the model only; free more parameters."


def plain(value: float, digits: int, sign: bool = False) -> str:
    """A number with some significant digits, without an exponent."""
    return np.format_float_positional(value, digits, fractional=False, trim="-", sign=sign)


def _in_sigmas(fit, name, moved):
    return abs(moved) / np.sqrt(fit.covariance.loc[name, name])
