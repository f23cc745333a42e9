r"""Least squares over both rotations and both translations together, and what becomes of it without one pose.

The prediction of a pose is :math:`P_i = X^{-1} A_i Y`.  The residuals are the rotation vector of
:math:`R_{B,i} R_{P,i}^T` over its sigma and, over another sigma, the distance between the places that :math:`B_i` and
:math:`P_i` give to the working point of the target.  At a point in the middle of the target, errors of a measured pose's
rotation and position are nearly independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from ..checks import CalibrationError
from .start import Solution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .pairs import Pairs

STEPS, SMALL_STEP = 50, 1e-6
"""Steps at most (six are usual), and the step, in units of the unknowns' sigmas, below which none is left to do."""
WEIGHED = 25
"""Steps in which the sigmas are estimated anew: with five poses they may go on sliding for long."""
LEAST_SIGMAS = (1e-8, 1e-5)
"""rad, mm: sigmas below these are rounding."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The least squares' solution.

    Attributes
    ----------
    solution : Solution
    residuals : (n, 6) ndarray
        Measured minus predicted in the camera's frame: working point, mm, and rotation vector, rad.
    design : (n, 6, k) ndarray
        Derivatives of minus the residuals by the k unknowns: X, Y (shift, turn each), and the scale if it is unknown.
    sigmas : (6,) ndarray
        Of the residuals, mm and rad.
    """

    solution: Solution
    residuals: NDArray[np.float64]
    design: NDArray[np.float64]
    sigmas: NDArray[np.float64]

    @property
    def white_design(self) -> NDArray[np.float64]:
        return self.design / self.sigmas[:, None]

    @property
    def white_residuals(self) -> NDArray[np.float64]:
        return self.residuals / self.sigmas

    @property
    def information(self) -> NDArray[np.float64]:
        """Normal matrix (k, k)."""
        rows = self.white_design.reshape(-1, self.design.shape[2])
        return rows.T @ rows


def cross(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vectors.shape[:-1], 3, 3)


def evaluate(
    pairs: Pairs, solution: Solution, point: NDArray[np.float64], scaled: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (n, 6) and derivatives of the prediction (n, 6, k) at a solution; `point` (3,) in the target's frame."""
    s, x_back = solution.scale, solution.x_turn.T
    turned = pairs.a_turns @ solution.y_turn
    in_holder = s * solution.y_turn @ point
    in_mount = turned @ (s * point) + pairs.a_turns @ solution.y_shift + pairs.a_shifts - solution.x_shift
    seen = pairs.b_turns @ point + pairs.b_shifts
    predicted = x_back @ turned
    residuals = np.empty((len(pairs), 6))
    residuals[:, :3] = s * seen - in_mount @ solution.x_turn
    residuals[:, 3:] = Rotation.from_matrix(pairs.b_turns @ predicted.transpose(0, 2, 1)).as_rotvec()
    by_holder = x_back @ pairs.a_turns
    design = np.zeros((len(pairs), 6, 12 + scaled))
    design[:, :3, :3] = -x_back
    design[:, :3, 3:6] = x_back @ cross(in_mount)
    design[:, :3, 6:9] = by_holder
    design[:, :3, 9:12] = -by_holder @ cross(in_holder)
    design[:, 3:, 3:6] = -x_back
    design[:, 3:, 9:12] = by_holder
    if scaled:
        design[:, :3, 12] = predicted @ point - seen
    return residuals, design


def moved(solution: Solution, step: NDArray[np.float64]) -> Solution:
    """The solution after a left perturbation of X and Y (shift, turn each), and of the scale."""
    x_turn, y_turn = (Rotation.from_rotvec(step[part]).as_matrix() for part in (slice(3, 6), slice(9, 12)))
    return Solution(
        x_turn @ solution.x_turn,
        solution.x_shift + step[:3],
        y_turn @ solution.y_turn,
        solution.y_shift + step[6:9],
        solution.scale + (float(step[12]) if len(step) > 12 else 0.0),
    )


def adjust(
    pairs: Pairs, start: Solution, point: NDArray[np.float64], scaled: bool, given: tuple[float, float] | None
) -> Fit:
    """Gauss-Newton steps, with the sigmas (rotation, translation) `given` or estimated anew from the residuals each time.

    Raises
    ------
    CalibrationError
        If the poses do not determine X and Y, or the steps do not end.
    """
    sigmas = np.repeat([1.0, 0.01] if given is None else given[::-1], 3)  # 1 mm, 0.01 rad to start with
    solution = start
    for number in range(STEPS):
        residuals, design = evaluate(pairs, solution, point, scaled)
        fit = Fit(solution, residuals, design, sigmas)
        information = fit.information
        _demand_determined(information)
        gradient = np.einsum("nik,ni->k", fit.white_design, fit.white_residuals)
        step = np.linalg.solve(information, gradient)
        if np.sqrt(step @ information @ step) < SMALL_STEP * np.sqrt(len(step)):
            return fit
        solution = moved(solution, step)
        if given is None and number < WEIGHED:
            sigmas = _sigmas(fit, residuals - np.einsum("nik,k->ni", design, step))
    raise CalibrationError(
        f"the least squares does not settle in {STEPS} steps; check that the poses are pairs and in one set-up"
    )


def _sigmas(fit, residuals):
    """Sigmas (6,) from residuals (n, 6): sums of squares over their degrees of freedom, counted by the leverages."""
    rows = fit.white_design
    leverage = np.einsum("nik,kl,nil->ni", rows, np.linalg.inv(fit.information), rows)
    free = [max(float(np.sum(1 - leverage[:, part])), 1.0) for part in (slice(0, 3), slice(3, 6))]
    sums = [float(np.sum(residuals[:, part] ** 2)) for part in (slice(0, 3), slice(3, 6))]
    least = LEAST_SIGMAS[::-1]
    return np.repeat([max(np.sqrt(total / dof), low) for total, dof, low in zip(sums, free, least, strict=True)], 3)


def _demand_determined(information):
    size = np.sqrt(np.diag(information))
    if not np.isfinite(size).all() or not size.all() or np.linalg.cond(information / np.outer(size, size)) > 1e13:
        raise CalibrationError(
            "the poses do not determine the camera and the target together; add poses whose turns have other axes"
        )
