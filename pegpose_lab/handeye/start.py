r"""Closed solution of :math:`A_i Y = X B_i`: the rotations first, then the translations and the target's scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .pairs import Pairs


@dataclass(frozen=True, eq=False)
class Solution:
    """X (mount from camera) and Y (holder from target) as turns (3, 3) and shifts (3,), mm, and the target's scale."""

    x_turn: NDArray[np.float64]
    x_shift: NDArray[np.float64]
    y_turn: NDArray[np.float64]
    y_shift: NDArray[np.float64]
    scale: float


def closed_rotations(pairs: Pairs) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""The rotations of X and Y (3, 3) each, from the largest singular value of a Kronecker product.

    .. math:: \operatorname{vec} R_X = (R_{B,i} \otimes R_{A,i}) \operatorname{vec} R_Y

    summed over the poses, has vec R_X and vec R_Y as its first singular vectors; each is taken to the nearest rotation.

    References
    ----------
    M. Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker product", 2013.
    """
    count = len(pairs)
    products = np.einsum("nij,nkl->nikjl", pairs.b_turns, pairs.a_turns).reshape(count, 9, 9)
    left, _, right = np.linalg.svd(products.mean(axis=0))
    turns = []
    for vector in (left[:, 0], right[0]):
        matrix = vector.reshape(3, 3).T  # vec stacks columns
        u, _, v = np.linalg.svd(matrix * np.sign(np.linalg.det(matrix)))
        turns.append(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v)
    return turns[0], turns[1]


def closed_solution(pairs: Pairs, x_turn: NDArray[np.float64], y_turn: NDArray[np.float64], scaled: bool) -> Solution:
    r"""Translations, and the scale s if `scaled`, by linear least squares with the rotations given.

    .. math:: R_{A,i}\, t_Y + t_{A,i} = s\, R_X\, t_{B,i} + t_X
    """
    count = len(pairs)
    rows = np.concatenate(
        [np.broadcast_to(np.eye(3), (count, 3, 3)), -pairs.a_turns, (pairs.b_shifts @ x_turn.T)[:, :, None]], axis=2
    ).reshape(3 * count, 7)
    values = pairs.a_shifts.ravel() - (0.0 if scaled else rows[:, 6])
    rows = rows if scaled else rows[:, :6]
    size = np.linalg.norm(rows, axis=0)
    size[size == 0] = 1.0
    found = np.linalg.lstsq(rows / size, values, rcond=None)[0] / size
    return Solution(x_turn, found[:3], y_turn, found[3:6], float(found[6]) if scaled else 1.0)


def rotation_misfit(pairs: Pairs, x_turn: NDArray[np.float64], y_turn: NDArray[np.float64]) -> float:
    """Rms angle between the two sides of the equation, rad."""
    both = (pairs.a_turns @ y_turn).transpose(0, 2, 1) @ (x_turn @ pairs.b_turns)
    cosines = (np.trace(both, axis1=1, axis2=2) - 1) / 2
    return float(np.sqrt(np.mean(np.arccos(np.clip(cosines, -1, 1)) ** 2)))


def translation_misfit(pairs: Pairs, solution: Solution) -> float:
    """Rms distance between the two sides of the equation, mm."""
    left = pairs.a_turns @ solution.y_shift + pairs.a_shifts
    right = solution.scale * pairs.b_shifts @ solution.x_turn.T + solution.x_shift
    return float(np.sqrt(np.mean(np.sum((left - right) ** 2, axis=1))))
