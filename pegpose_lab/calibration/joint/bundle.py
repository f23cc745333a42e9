r"""Bundle adjustment: least squares over all views at once.

The unknowns are the camera's parameters, shared by all views, and six numbers for each view's pose.  The pose of one
view does not affect another view, so the normal equations have the shape of an arrow,

.. math:: \begin{pmatrix} A & B \\ B^T & C \end{pmatrix}, \qquad C = \mathrm{diag}(C_1, \dots, C_V),

and eliminating the poses leaves the Schur complement :math:`S = A - \sum_v B_v C_v^{-1} B_v^T`, which has one row per
parameter of the camera.  So time and memory grow linearly with the number of views.  S is also the information that the
views have about the camera if their poses are unknown; its smallest eigenvalue tells whether they determine it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from .covariance import in_words
from .views import evaluate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .models import Lens
    from .views import State, Views

MAX_STEPS = 200
SMALL_STEP = 1e-7
"""The search ends after a step that is shorter than this many standard deviations."""

NEAR = 1e-3
"""A state whose full step is shorter than this many sigmas is a minimum, even if rounding prevents the step."""

SMALLEST_RMS = 1e-9
"""px; points without noise are fitted to this rms at best."""

HUBER, CAUCHY = 1.501, 2.549
"""Distance at which the robust losses bend, in standard deviations per axis.  With many points per parameter and
normal errors in x and y, the variance is 1/0.95 of that of least squares (1.345 and 2.385 are for a single axis)."""

ROBUST_ROUNDS = 50
SMALL_ROUND = 1e-3
"""The rounds end after one whose step is shorter than this many standard deviations."""


@dataclass(frozen=True)
class Equations:
    """The blocks A (k, k), B (V, k, 6), C (V, 6, 6) of the normal equations, the gradient, and the weighted cost."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    shared_gradient: np.ndarray
    pose_gradient: np.ndarray
    cost: float

    @classmethod
    def of(
        cls, residuals: NDArray[np.float64], jacobian: NDArray[np.float64], weights: NDArray[np.float64]
    ) -> Equations:
        v, m, _, columns = jacobian.shape
        k, root = columns - 6, np.sqrt(weights)[:, :, None]
        rows = (jacobian * root[..., None]).reshape(v, 2 * m, columns)
        residuals = (residuals * root).reshape(v, 2 * m, 1)
        normal, gradient = rows.transpose(0, 2, 1) @ rows, (rows.transpose(0, 2, 1) @ residuals)[:, :, 0]
        blocks = normal[:, :k, :k].sum(axis=0), normal[:, :k, k:], normal[:, k:, k:]
        return cls(*blocks, gradient[:, :k].sum(axis=0), gradient[:, k:], float(np.sum(residuals**2)))

    def with_prior(self, prior: tuple[NDArray[np.float64], NDArray[np.float64], float] | None) -> Equations:
        """The equations with what priors add (`models.Lens.prior`)."""
        if prior is None:
            return self
        weights, gradient, cost = prior
        a, shared_gradient = self.a + np.diag(weights), self.shared_gradient + gradient
        return replace(self, a=a, shared_gradient=shared_gradient, cost=self.cost + cost)

    def eliminated(self, damping: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """S (k, k), C^-1 B^T (V, 6, k), and C^-1 times the gradient by the poses (V, 6, 1)."""
        k = len(self.a)
        c = self.c.copy()
        np.einsum("vii->vi", c)[:] *= 1 + damping  # einsum returns a writable view of the diagonals
        solved = np.linalg.solve(c, np.concatenate([self.b.transpose(0, 2, 1), self.pose_gradient[:, :, None]], axis=2))
        schur = self.a - (self.b @ solved[:, :, :k]).sum(axis=0)
        np.einsum("ii->i", schur)[:] += damping * np.diagonal(self.a)
        return schur, solved[:, :, :k], solved[:, :, k:]

    def directions(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Eigenvalues (k,) of S scaled by A's diagonal, smallest first; their directions (k, k) in the scaled
        parameters, one per row; and the change (V, 6, k) of the poses along each of them."""
        schur, by_shared, _ = self.eliminated()
        scale = np.sqrt(np.diagonal(self.a))
        values, vectors = np.linalg.eigh(schur / np.outer(scale, scale))
        return values, vectors.T, -by_shared @ (vectors / scale[:, None])

    def step(self, damping: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
        """Steps of the camera's parameters, turns and shifts, and the predicted decrease of the cost."""
        schur, by_shared, by_gradient = self.eliminated(damping)
        reduced = self.shared_gradient - (self.b @ by_gradient).sum(axis=0)[:, 0]
        scale = np.sqrt(np.diagonal(self.a))
        shared = -np.linalg.solve(schur / np.outer(scale, scale), reduced / scale) / scale
        pose = -(by_gradient[:, :, 0] + by_shared @ shared)
        promised = -(self.shared_gradient @ shared + np.sum(self.pose_gradient * pose))
        return shared, pose[:, :3], pose[:, 3:], promised


def minimise(model: Lens, views: Views, state: State, weights: NDArray[np.float64]) -> tuple[State, Equations]:
    """The state at the minimum and its `Equations`."""
    state, equations, settled = descend(model, views, state, weights)
    if not settled:
        _, directions, poses = equations.directions()
        raise CalibrationError(
            f"the least squares found no minimum in {MAX_STEPS} steps, because the views hardly determine all of "
            f"{', '.join(model.names)}: {in_words(model.names, directions[0], poses[:, :, 0])}; add views of other "
            "tilts (about 30 deg), or free fewer parameters"
        )
    return state, equations


def descend(
    model: Lens,
    views: Views,
    state: State,
    weights: NDArray[np.float64],
    leave: Callable[[State], bool] | None = None,
) -> tuple[State, Equations, bool]:
    """The Levenberg-Marquardt method: the last state, its `Equations`, and whether it is a minimum.

    The search ends early at a state for which `leave`, if given, is true.
    """
    evaluated = evaluate(model, views, state)
    if evaluated is None:
        raise CalibrationError("the starting solution does not see all points; check their order")
    equations = Equations.of(*evaluated, weights).with_prior(model.prior(state.shared))
    damping, growth = 1e-4, 2.0
    count, floor = views.used.sum(), np.sum(weights) * SMALLEST_RMS**2
    for _ in range(MAX_STEPS):
        step, promised = _step(equations, damping)
        trial = state.moved(*step) if promised > 0 else None
        evaluated = None if trial is None else evaluate(model, views, trial)
        found = None
        if evaluated is not None:
            found = Equations.of(*evaluated, weights).with_prior(model.prior(trial.shared))
        noise = max(equations.cost, floor) / count
        if found is not None and found.cost <= equations.cost:
            gain = min((equations.cost - found.cost) / promised, 1.0)
            damping, growth = damping * max(0.1, 1 - (2 * gain - 1) ** 3), 2.0
            state, equations = trial, found
            if leave and leave(state):
                return state, equations, False
        else:
            damping, growth = damping * growth, 2 * growth
        if promised <= SMALL_STEP**2 * noise and damping < 1 or equations.cost <= floor:
            return state, equations, True
        if damping > 1e12:
            break
    near = _step(equations, 0.0)[1] <= NEAR**2 * max(equations.cost, floor) / count
    return state, equations, bool(near)


def _step(equations, damping):
    """The step and its predicted decrease; None and nan for singular equations, which more damping can solve."""
    try:
        *step, promised = equations.step(damping)
    except np.linalg.LinAlgError:
        return None, np.nan
    return step, promised


def minimise_robust(model: Lens, views: Views, state: State, loss: str) -> tuple[State, NDArray[np.float64], float]:
    """Iteratively reweighted least squares; the median distance gives the scale of the weights.

    Returns the state at the minimum, the weights, and the variance per axis by `_robust_variance`.
    """
    for _ in range(ROBUST_ROUNDS):
        distances = np.hypot(*np.moveaxis(evaluate(model, views, state)[0], -1, 0))
        sigma = sigma_of(distances[views.used > 0])
        weights = robust_weights(distances / sigma, loss)[0] * views.used
        before = state
        state, equations = minimise(model, views, state, weights)
        change = state.shared - before.shared
        if change @ equations.eliminated()[0] @ change <= (SMALL_ROUND * sigma) ** 2:
            return state, weights, _robust_variance(model, views, state, sigma, loss)
    raise CalibrationError(
        f"the {loss} loss found no minimum in {ROBUST_ROUNDS} rounds; look for views with many wrong corners"
    )


def sigma_of(distances: NDArray[np.float64]) -> float:
    """Standard deviation per axis from the median of some distances, as of a Rayleigh distribution."""
    return max(float(np.median(distances)) / np.sqrt(2 * np.log(2)), SMALLEST_RMS)


def robust_weights(scaled: NDArray[np.float64], loss: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Weights w and slopes w' r of distances r in standard deviations; the influence is :math:`\psi = w r`."""
    if loss == "huber":
        weights = HUBER / np.maximum(scaled, HUBER)
        return weights, np.where(scaled > HUBER, -weights, 0.0)
    weights = 1 / (1 + (scaled / CAUCHY) ** 2)
    return weights, -2 * (scaled / CAUCHY) ** 2 * weights**2


def _robust_variance(model, views, state, sigma, loss):
    r"""The s^2, px^2, for which :math:`s^2 (J^T J)^{-1}` is the covariance of the M-estimate.

    A residual e of length r has the influence :math:`\psi(r) e / r`; half the trace of its derivative is
    :math:`\psi_1 = (\psi' + \psi / r) / 2`.  For n points and p parameters (after Huber, Robust Statistics, 1981,
    Sect. 7.6),

    .. math:: s^2 = K^2\, \frac{\sum \psi^2 / (2 n - p)}{(\sum \psi_1 / n)^2},
        \qquad K = 1 + \frac{p}{2 n} \frac{\mathrm{var}\, \psi_1}{(\mathrm{mean}\, \psi_1)^2}.
    """
    distances = np.hypot(*np.moveaxis(evaluate(model, views, state)[0], -1, 0))[views.used > 0]
    weights, slopes = robust_weights(distances / sigma, loss)
    derivative = weights + slopes / 2
    count, unknowns = 2 * len(distances), len(model.names) + 6 * len(views.used)
    correction = 1 + unknowns / count * derivative.var() / derivative.mean() ** 2
    return correction**2 * np.sum((weights * distances) ** 2) / (count - unknowns) / derivative.mean() ** 2
