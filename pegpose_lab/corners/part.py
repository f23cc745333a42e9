"""A part of a board, cut by the border of the image or by something in front of it: its corners and their numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..checks import DetectionError
from .grid import seen_grids
from .grow import grow_grid
from .measure import fit_grid, unclear_corners
from .numbering import ENDS, numberings
from .result import BoardCorners
from .rims import beyond_sides

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..targets import Checkerboard

FEWEST_LINES = 3  # each way
FEWEST_ON_A_LINE = 2  # corners on an outermost line
_SIDES = "upper", "right", "lower", "left"


@dataclass(frozen=True, eq=False)
class Part:
    """Corners that belong together: `grid` (rows, columns, 2) px, `seen` (rows, columns), `levels` as in `beyond_sides`,
    and the `covariances` (n, 2, 2) of those that are seen."""

    grid: np.ndarray
    seen: np.ndarray
    levels: np.ndarray
    covariances: np.ndarray

    @property
    def size(self) -> str:
        """Its lines, the larger number first."""
        return f"{max(self.seen.shape)} x {min(self.seen.shape)}"


def largest_part(image: NDArray[np.uint8], board: Checkerboard) -> Part | None:
    """The corners that are seen around the first grid of any size that has enough of them."""
    for grid, view, scale, offset in seen_grids(image):
        grid, seen = grow_grid(view, _upright(grid), max(board.columns, board.rows))
        grid, seen = _trimmed(grid, seen)
        part = _measured(image, (grid + 0.5) / scale - 0.5 + offset, seen) if len(grid) else None
        if part is not None:
            return part
    return None


def number_part(image: NDArray[np.uint8], board: Checkerboard, part: Part) -> BoardCorners:
    """The corners of a part with their numbers on the board.

    Raises
    ------
    DetectionError
        If the part is not one of the board, or it is not determined which.
    """
    sides = beyond_sides(image, part.grid, part.seen, part.levels)
    dark = bool(np.median((part.levels[..., 1] * _parity(part.seen.shape))[part.seen]) < 0)
    classes = numberings(board, part.seen.shape, sides, dark)
    ends = [side for side, state in zip(_SIDES, sides, strict=True) if state == ENDS]
    rims = f"its rim at the {' and the '.join(ends)} side" if ends else "its rim at no side"
    if not classes:
        raise DetectionError(
            f"no board of {board.columns} x {board.rows} inner corners, nor a part of it: a board of {part.size} is seen, "
            f"with {rims}; check columns and rows"
        )
    if len(classes) > 1:
        raise DetectionError(
            f"no whole board of {board.columns} x {board.rows} inner corners: a part of {part.size} is seen, with {rims}, "
            f"and {len(classes)} places on the board fit; show the light rim of more sides"
        )
    corners = part.grid[part.seen]
    number = min((number[part.seen] for number in classes[0]), key=lambda one: _first_corner(board, one, corners))
    order = np.argsort(number)
    return BoardCorners(board, number[order], corners[order], part.covariances[order])


def _parity(shape):
    """1 and -1 in turns (rows, columns), 1 at the first corner."""
    return 1 - 2 * (np.add.outer(*map(np.arange, shape)) % 2)


def _first_corner(board, number, corners):
    """Distance from the image's first pixel, px, to where a numbering has the board's first corner."""
    homography = cv2.findHomography(board.object_points[number, :2], corners)[0]
    return np.hypot(*homography[:2, 2]) / abs(homography[2, 2])


def _upright(grid):
    """The grid, not mirrored, with its rows as nearly along x as a turn by quarters makes them."""
    if np.linalg.det([(grid[:, -1] - grid[:, 0]).mean(axis=0), (grid[-1] - grid[0]).mean(axis=0)]) < 0:
        grid = grid[::-1]
    return max((np.rot90(grid, turn) for turn in range(4)), key=lambda one: _slope(one[:, -1] - one[:, 0]))


def _slope(steps):
    """The cosine of the angle between the mean of some steps (n, 2) and the x axis."""
    x, y = steps.mean(axis=0)
    return x / np.hypot(x, y)


def _trimmed(grid, seen):
    """The smallest rectangle with two corners or more on each of its outermost lines; empty if it has too few lines."""
    for _ in range(2 * sum(seen.shape)):
        for _turn in range(4):
            while len(seen) and seen[0].sum() < FEWEST_ON_A_LINE:
                grid, seen = grid[1:], seen[1:]
            grid, seen = np.rot90(grid), np.rot90(seen)
        if not len(seen) or all(
            line.sum() >= FEWEST_ON_A_LINE for line in (seen[0], seen[-1], seen[:, 0], seen[:, -1])
        ):
            break
    return (grid, seen) if min(seen.shape) >= FEWEST_LINES else (grid[:0], seen[:0])


def _measured(image, grid, seen):
    """The part with the clear corners of a grid only, None if they are too few."""
    for _ in range(4):
        corners, fits = fit_grid(image, grid, seen=seen)
        unclear = unclear_corners(corners, fits, grid, seen=seen)
        if not unclear.any():
            grid, levels = grid.copy(), np.full(grid.shape, np.nan)
            grid[seen], levels[seen] = corners, fits.parameters[:, 5:7]
            return Part(grid, seen, levels, fits.covariance)
        seen = seen.copy()
        seen[seen] = ~unclear
        grid, seen = _trimmed(grid, seen)
        if not len(grid):
            return None
    return None
