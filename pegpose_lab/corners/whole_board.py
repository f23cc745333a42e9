"""Whether a measured grid of corners is the whole board that was asked for, seen at one instant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import DetectionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_OUTSIDE = 1.2, 1.35, 1.5, 1.65  # squares beyond the outermost corners: in the second square, its nearer half
_INSIDE = -0.35, -0.5, -0.65  # in the first square inside
_ACROSS = 0.35, 0.5, 0.65  # of a square
SMALLEST_CONTRAST = 0.4  # of the contrast inside: what alternates less is not a square
LARGEST_COMBING = 1.2  # 0.2 to 0.4 in photographs, 1 in noise; two fields 2 px apart have 1.3 to 3, 6 px 4 to 18
_SIDES = "left", "right", "upper", "lower"


def check_ends(image: NDArray[np.uint8], grid: NDArray[np.float64]) -> None:
    """Raise if the pattern goes on beyond a side of a grid: the board is larger than asked for.

    Parameters
    ----------
    image : (height, width) uint8
    grid : (rows, columns, 2) ndarray
        px, the corners, columns along x of the board.

    Raises
    ------
    DetectionError
        If a second row of squares beyond a side alternates in step with the board's own.  The first row always
        does; a board's rim, or squares that are longer there, do not.

    Notes
    -----
    Only what lies in the image can be checked; a side with fewer than four squares of the second row in the image is
    not.
    """
    sides = grid.transpose(1, 0, 2), grid[:, ::-1].transpose(1, 0, 2), grid, grid[::-1]
    for name, lines in zip(_SIDES, sides, strict=True):
        if _goes_on(image, lines):
            rows, columns = grid.shape[:2]
            x, y = _beyond(lines, 1.0).mean(axis=0)
            raise DetectionError(
                f"the pattern goes on beyond the grid of {columns} x {rows} corners at its {name} side, near "
                f"({x:.0f}, {y:.0f}) px: the board has more inner corners; check columns and rows"
            )


def check_fields(image: NDArray[np.uint8], grid: NDArray[np.float64]) -> None:
    """Raise if odd and even lines show the board at different places, as in an interlaced image of a moving board.

    Parameters
    ----------
    image : (height, width) uint8
    grid : (rows, columns, 2) ndarray
        px, the corners.

    Raises
    ------
    DetectionError
        If lines differ more from their neighbours than from the lines after those.  A shift of one pixel is not noticed.
    """
    (left, top), (right, bottom) = grid.reshape(-1, 2).min(axis=0), grid.reshape(-1, 2).max(axis=0)
    part = image[max(int(top), 0) : int(bottom) + 2, max(int(left), 0) : int(right) + 2].astype(float)
    near, far = (
        np.sum((part[2:-2] - (part[2 - k : -2 - k] + part[2 + k : len(part) - 2 + k]) / 2) ** 2) for k in (1, 2)
    )
    if near > LARGEST_COMBING * far:
        raise DetectionError(
            "odd and even lines show the board at different places (an interlaced image of a moving board?): hold "
            "it still, or use every other line only"
        )


def _goes_on(image, lines):
    """Whether squares beyond the first of `lines` (lines, corners, 2) alternate as the squares inside do."""
    outside, inside = (_square_values(image, lines, depths) for depths in (_OUTSIDE, _INSIDE))
    both = np.isfinite(outside) & np.isfinite(inside)
    steps = np.diff(outside)[both[1:] & both[:-1]]
    expected = np.diff(inside)[both[1:] & both[:-1]]
    if len(steps) < 3 or np.median(np.abs(expected)) == 0:
        return False
    # two squares on, the colours are the same again
    alternating = steps * np.sign(expected) > SMALLEST_CONTRAST * np.median(np.abs(expected))
    return bool(alternating.mean() > 0.8)


def _square_values(image, lines, depths):
    """Grey values of the squares along the first line at some depths beyond it; NaN outside of the image."""
    samples = []
    for depth in depths:
        row = _beyond(lines, depth)
        row = np.vstack([_outward(row), row, _outward(row[::-1])])
        samples += [row[:-1] + across * (row[1:] - row[:-1]) for across in _ACROSS]
    x, y = np.rint(np.stack(samples)).astype(int).transpose(2, 0, 1)
    height, width = image.shape
    seen = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    values = np.where(seen, image[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)], np.nan)
    enough = seen.mean(axis=0) >= 0.5
    result = np.full(values.shape[1], np.nan)
    result[enough] = np.nanmedian(values[:, enough], axis=0)
    return result


def _beyond(lines, depth):
    """Points (corners, 2), `depth` squares beyond the first line, by a parabola through the first three."""
    first, second, third = lines[:3]
    return first + depth * (first - second) + 0.5 * depth * (depth + 1) * (first - 2 * second + third)


def _outward(row):
    """The point (1, 2) a square before a row's first."""
    return 3 * row[:1] - 3 * row[1:2] + row[2:3]
