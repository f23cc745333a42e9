"""What the lens models share: the board's unknowns after their own, one of f held, and the chain rule to the point."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Self

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...board import BoardUnknowns


class Lens:
    """A lens model; its parameters are followed by those of the board, if the board has unknowns (`on`)."""

    names: list[str]
    board: BoardUnknowns | None = None

    def on(self, board: BoardUnknowns | None) -> Self:
        """The same lens with these unknowns of the board."""
        other = copy(self)
        other.names, other.board = self.lens_names + (board.names if board else []), board
        return other

    @property
    def lens_names(self) -> list[str]:
        """The names of the lens's own parameters."""
        return self.names[: len(self.names) - (len(self.board.names) if self.board else 0)]

    def _with_board(self, own):
        """The lens's own values to start from, and those of the board."""
        return np.concatenate([own, self.board.start]) if self.board else np.asarray(own)

    def prior(self, shared: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], float] | None:
        """What the board's priors add to the normal equations' diagonal, the gradient and the cost, px^2; or None."""
        if self.board is None or not self.board.has_prior:
            return None
        number = len(self.names) - len(self.board.names)
        weights = np.concatenate([np.zeros(number), self.board.prior_weights])
        off = np.concatenate([np.zeros(number), shared[number:] - self.board.start])
        return weights, weights * off, float(weights @ off**2)


class GivenFocalLength(Lens):
    """One of the models with its first parameter, f or f_x, held at a given value."""

    def __init__(self, model, focal_length):
        self.model, self.focal_length, self.names, self.board = model, focal_length, model.names[1:], model.board

    def project(
        self, shared: Sequence[float] | NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """As `TsaiModel.project`."""
        projection = self.model.project([self.focal_length, *shared], points)
        if projection is None:
            return None
        image, by_shared, by_point = projection
        return image, by_shared[:, :, 1:], by_point


def derivative_by_point(
    by_x_u: NDArray[np.float64], x_u: NDArray[np.float64], focal_length: float, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Derivatives (n, 2, 3) by the point in the camera frame, from the derivatives by x_u = f (x, y) / z."""
    by_point = np.empty((len(points), 2, 3))
    by_point[:, :, :2] = focal_length * by_x_u
    by_point[:, :, 2] = -(by_x_u @ x_u[:, :, None])[:, :, 0]
    return by_point / points[:, 2, None, None]
