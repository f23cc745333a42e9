"""Which corners of a board a grid of corners is, or why this is not determined.

A grid that is seen may be turned by a quarter, half or three quarters against the board's order, and may begin at any of
its lines.  It is tried everywhere; a trial is kept if it agrees with what is seen beyond the four sides and, where the
board's own turns differ by their colours, if the square inside the first corner is dark.  The number of a corner is
determined if one trial is left, apart from turns under which the board looks the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..targets import Checkerboard

ENDS, GOES_ON, UNKNOWN = "ends", "goes on", "unknown"


def numberings(
    board: Checkerboard, shape: tuple[int, int], sides: Sequence[str], first_is_dark: bool
) -> list[list[NDArray[np.intp]]]:
    """All numberings of a grid that agree with what is seen, those that the board's symmetry makes equal together.

    Parameters
    ----------
    board : Checkerboard
    shape : tuple of int
        Rows and columns of the grid.
    sides : sequence of str
        What is seen beyond its upper, right, lower and left side: ENDS, GOES_ON or UNKNOWN.
    first_is_dark : bool
        Whether the square between its first rows and columns is dark.

    Returns
    -------
    list of list of (rows, columns) ndarray of int
        Each inner list has the numberings that differ by a turn of the board only: numbers of rows of
        `board.object_points`.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard
    >>> sides = ENDS, ENDS, UNKNOWN, ENDS
    >>> [[number.tolist() for number in numbers] for numbers in numberings(Checkerboard(4, 3), (2, 4), sides, True)]
    [[[[0, 1, 2, 3], [4, 5, 6, 7]]]]
    """
    order = np.arange(board.columns * board.rows).reshape(board.rows, board.columns)
    turns = range(4) if board.columns == board.rows else (0, 2)
    same = [np.rot90(order, turn).ravel() for turn in turns if _keeps_colours(order.shape, turn)]
    coloured = len(same) < len(turns)
    classes: dict[bytes, list] = {}
    for turn in range(4):
        turned = np.rot90(order, turn)
        spare = np.subtract(turned.shape, shape)
        for row, column in np.ndindex(*np.maximum(spare + 1, 0)):
            number = turned[row : row + shape[0], column : column + shape[1]]
            is_first = row == 0, column == spare[1], row == spare[0], column == 0
            if not all(side == UNKNOWN or (side == ENDS) == first for side, first in zip(sides, is_first, strict=True)):
                continue
            if coloured and _inner_square_is_dark(number, board.columns) != first_is_dark:
                continue
            key = min(np.ascontiguousarray(turn_[number]).tobytes() for turn_ in same)
            classes.setdefault(key, []).append(number)
    return list(classes.values())


def _keeps_colours(shape, turn):
    """Whether a turn by quarters leaves the colours of a board of (rows, columns) corners as they are."""
    rows, columns = shape
    return turn == 0 or (rows + columns if turn == 2 else rows) % 2 == 0


def _inner_square_is_dark(number, columns):
    """Whether the square between the first two rows and columns of a numbering is dark where the board's first is."""
    row, column = np.divmod(number[:2, :2].ravel(), columns)
    return bool((row.min() + column.min()) % 2 == 0)
