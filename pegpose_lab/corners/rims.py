"""What lies beyond each side of a grid of corners: the board's light rim, more squares, or nothing that tells.

Beyond the outermost corners there is one more row of squares.  Where the pattern ends, the dark squares of that row end
at a depth of one square, and behind the light ones it stays light.  Where it goes on, it becomes dark there.  Something
that covers the board would have to be light and to end at that very depth, all along the side, to pass for a rim.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import map_coordinates

from .numbering import ENDS, GOES_ON, UNKNOWN

if TYPE_CHECKING:
    from numpy.typing import NDArray

_DEPTHS = np.arange(0.3, 1.31, 0.02)  # squares beyond the outermost corners
_ACROSS = 0.35, 0.5, 0.65  # of a square
_WITHIN, _BEHIND = (_DEPTHS > 0.4) & (_DEPTHS < 0.7), (_DEPTHS > 1.08) & (_DEPTHS < 1.19)  # a rim may be narrow
_ENDS_OF_ROW = [0, 1, 2], [-1, -2, -3]
LARGEST_OFFSET = 0.06  # squares, of the middle of all dark squares' ends from a depth of 1; three times that for each
FEWEST = 2  # squares of each colour
SMALLEST_SHARE = 0.7  # of the dark squares in the image end there
LIGHT = 0.5  # of the contrast above the mean level, or below


def beyond_sides(
    image: NDArray[np.uint8], grid: NDArray[np.float64], seen: NDArray[np.bool_], levels: NDArray[np.float64]
) -> tuple[str, str, str, str]:
    """What lies beyond the upper, right, lower and left side of a grid: ENDS, GOES_ON or UNKNOWN.

    Parameters
    ----------
    image : (height, width) uint8
    grid : (rows, columns, 2) ndarray
        px.
    seen : (rows, columns) bool ndarray
        Which corners are measured; the others' places are not used.
    levels : (rows, columns, 2) ndarray
        Of each corner: the mean grey value, and how much lighter than that the square on its lower right is.
    """
    found = []
    for _ in range(4):
        found.append(_beyond(image, grid, seen, levels))
        grid, seen, levels = np.rot90(grid), np.rot90(seen), np.rot90(levels) * (1, -1)
    return tuple(found)


def _beyond(image, grid, seen, levels):
    """What lies beyond the first row."""
    profiles, light = _profiles(image, grid, seen, levels)
    clear = profiles[:, _WITHIN].mean(axis=1) * np.where(light, 1, -1) > LIGHT
    offsets = _ends(profiles[~light & clear]) - 1
    close = np.abs(offsets) < 3 * LARGEST_OFFSET
    if close.sum() < max(FEWEST, SMALLEST_SHARE * np.sum(~light)) or abs(np.median(offsets)) > LARGEST_OFFSET:
        return UNKNOWN
    behind = profiles[light & clear][:, _BEHIND].mean(axis=1)
    lighter, darker = np.sum(behind > LIGHT), np.sum(behind < -LIGHT)
    if lighter >= FEWEST and not darker:
        return ENDS
    return GOES_ON if darker >= FEWEST and not lighter else UNKNOWN


def _profiles(image, grid, seen, levels):
    """Grey values (n, depths) outwards through the squares beyond the first row, and which squares are light (n,) bool.

    -1 where they are dark, 1 where they are light.  Of squares that are in the image and between corners that are seen;
    one more at each end of the row counts.
    """
    if len(grid) < 3 or grid.shape[1] < 3:
        return np.zeros((0, len(_DEPTHS))), np.zeros(0, bool)
    first, second, third = grid[:3]
    depth = _DEPTHS[:, None, None]
    ahead = first + depth * (first - second) + 0.5 * depth * (depth + 1) * (first - 2 * second + third)
    left, right = (3 * a - 3 * b + c for a, b, c in (np.moveaxis(ahead[:, side], 1, 0) for side in _ENDS_OF_ROW))
    ahead = np.concatenate([left[:, None], ahead, right[:, None]], axis=1)
    usable = seen[:3].all(axis=0)
    usable = np.concatenate([[usable[:3].all()], usable, [usable[-3:].all()]])
    mean, contrast = np.concatenate([levels[0, :1] * (1, -1), levels[0], levels[0, -1:] * (1, -1)]).T
    light = contrast[:-1] < 0  # the square on the upper right of a corner, opposite to that on its lower right
    places = np.stack([ahead[:, :-1] + across * (ahead[:, 1:] - ahead[:, :-1]) for across in _ACROSS])
    values = map_coordinates(image.astype(np.float32), np.moveaxis(places[..., ::-1], -1, 0), order=1, cval=np.nan)
    middle, half = (mean[1:] + mean[:-1]) / 2, (np.abs(contrast[1:]) + np.abs(contrast[:-1])) / 2
    profiles = ((values.mean(axis=0) - middle) / np.maximum(half, 1e-9)).T
    good = usable[1:] & usable[:-1] & np.isfinite(profiles).all(axis=1)
    return profiles[good], light[good]


def _ends(profiles):
    """The depth (n,) where each dark square becomes light, infinite if it does not."""
    later = (profiles[:, 1:] > 0) & (profiles[:, :-1] <= 0) & (_DEPTHS[1:] > 0.6)
    k = np.argmax(later, axis=1)
    low, high = (profiles[np.arange(len(k)), k + step] for step in (0, 1))
    depth = _DEPTHS[k] + (_DEPTHS[1] - _DEPTHS[0]) * low / np.where(later.any(axis=1), low - high, 1.0)
    return np.where(later.any(axis=1), depth, np.inf)
