"""A part of a board, cut by the border of the image or by something in front of it: its corners and their numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..checks import DetectionError
from .grid import views
from .grow import LARGEST_RESIDUAL, SMALLEST_MISFIT, grow_grid
from .measure import fit_grid, unclear_corners
from .numbering import ENDS, numberings
from .result import BoardCorners
from .rims import beyond_sides
from .seeds import blocks_of_nine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..targets import Checkerboard

FEWEST_LINES = 3  # each way
FEWEST_ON_A_LINE = 2  # corners on an outermost line
SAME = 3.0  # px: a start this near to a corner of another grid is one of that grid
MOST_GRIDS = 5  # in a view; more patterns than that are no board
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
    """The most corners that are seen around any start, in the first view of the image that shows enough of them."""
    for view, scale, offset in views(image):
        grids = _grown(view, max(board.columns, board.rows))
        for grid, seen in sorted(grids, key=lambda one: -np.sum(one[1])):
            part = _measured(image, (grid + 0.5) / scale - 0.5 + offset, seen)
            if part is not None:
                return part
    return None


def _grown(view, most):
    """The grids that grow from different starts in a view."""
    grids, known = [], np.zeros((0, 2))
    for block in blocks_of_nine(view):
        if len(known) and np.linalg.norm(known - block[1, 1], axis=1).min() < SAME:
            continue
        grid, seen = grow_grid(view, _upright(block), most)
        known = np.vstack([known, block[1, 1][None], grid[seen]])
        grid, seen = _trimmed(grid, seen)
        if len(seen):
            grids.append((grid, seen))
        if len(grids) == MOST_GRIDS:
            break
    return grids


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
    while min(seen.shape) >= FEWEST_LINES:
        thin = [turn for turn in range(4) if np.rot90(seen, turn)[0].sum() < FEWEST_ON_A_LINE]
        if not thin:
            return grid, seen
        grid, seen = (np.rot90(np.rot90(one, thin[0])[1:], -thin[0]) for one in (grid, seen))
    return grid[:0], seen[:0]


def _measured(image, grid, seen):
    """The part with the clear corners of a grid only, None if they are too few."""
    while len(seen):
        corners, fits = fit_grid(image, grid, seen=seen)
        unclear = unclear_corners(corners, fits, grid, seen=seen)
        residuals = fits.misfit * np.abs(fits.parameters[:, 6])
        unclear |= (residuals > LARGEST_RESIDUAL * np.median(residuals)) & (fits.misfit > SMALLEST_MISFIT)
        if not unclear.any():
            grid, levels = grid.copy(), np.full(grid.shape, np.nan)
            grid[seen], levels[seen] = corners, fits.parameters[:, 5:7]
            return Part(grid, seen, levels, fits.covariance)
        seen = seen.copy()
        seen[seen] = ~unclear
        grid, seen = _trimmed(grid, seen)
    return None
