"""Where the corners of a checkerboard are, to a pixel of a reduced image, in bounded time.

OpenCV's detectors find the grid.  Their time grows with the image, for one of them without bound where there is
no board, and they need only about six pixels per square.  So they are given the image at two fixed sizes and, if it
is larger still, finally the part of it with most saddle points, for a small board in a large image.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from .seeds import saddle_points

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

COARSE, MEDIUM, FINE = 0.25e6, 0.6e6, 4e6  # px, the sizes of image that are searched
LARGEST_ENLARGEMENT = 2.0
LARGEST_IRREGULARITY = 1.2  # of a step: 2 where OpenCV leaves out two lines (where one, the colours do not alternate)
SMALLEST_IMAGE = 14  # px along a side
_NORMALIZED = cv2.CALIB_CB_NORMALIZE_IMAGE


def candidate_grids(
    image: NDArray[np.uint8], columns: int, rows: int
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.uint8], float, NDArray[np.float64]]]:
    """Yield grids that may be a board of columns x rows inner corners, the cheapest search first.

    Parameters
    ----------
    image : (height, width) uint8
    columns, rows : int

    Yields
    ------
    corners : (rows, columns, 2) ndarray
        px of `view`, accurate to about a pixel, in any of the orders that fit the board; all within the view.
    view : (h, w) uint8
        The image that was searched: reduced, enlarged, or cut out.
    scale, offset : float, (2,) ndarray
        image px = (view px + 0.5) / scale - 0.5 + offset.
    """
    if min(image.shape) < SMALLEST_IMAGE:
        return
    for view, scale, offset, detectors in _views(image):
        for detect, flags in detectors:
            found, corners = detect(view, (columns, rows), flags=flags)
            if found:
                grid = np.asarray(corners, np.float64).reshape(rows, columns, 2)
                if _is_plausible(grid, view.shape):
                    yield grid, view, scale, offset


def views(image: NDArray[np.uint8]) -> Iterator[tuple[NDArray[np.uint8], float, NDArray[np.float64]]]:
    """Yield the images that are searched, with scale and offset as in `candidate_grids`."""
    if min(image.shape) >= SMALLEST_IMAGE:
        for view, scale, offset, _ in _views(image):
            yield view, scale, offset


def _views(image):
    """The images to be searched, their scales and offsets, and the detectors for each."""
    sectors = cv2.findChessboardCornersSB, _NORMALIZED
    exhaustive = cv2.findChessboardCornersSB, cv2.CALIB_CB_EXHAUSTIVE
    quads = cv2.CALIB_CB_ADAPTIVE_THRESH | _NORMALIZED | cv2.CALIB_CB_FAST_CHECK  # without: 0.5 s for a lens cap
    yield *_resized(image, COARSE), np.zeros(2), [sectors, (cv2.findChessboardCorners, quads), exhaustive]
    yield *_resized(image, MEDIUM), np.zeros(2), [sectors]
    if image.size > MEDIUM:
        fine, scale = _resized(image, FINE)
        x, y, width, height = _busiest_part(fine, COARSE)
        part = np.ascontiguousarray(fine[y : y + height, x : x + width])
        yield part, scale, np.array([x, y]) / scale, [sectors]


def _resized(image, size):
    """The image at about `size` px in all, enlarged at most LARGEST_ENLARGEMENT times, and its scale."""
    scale = min(np.sqrt(size / image.size), LARGEST_ENLARGEMENT)
    if image.size <= size <= 1.2 * image.size or (scale > 1 and size == FINE):
        return image, 1.0
    width, height = (max(1, round(side * scale)) for side in image.shape[::-1])
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return cv2.resize(image, (width, height), interpolation=kind), scale


def _busiest_part(image, size):
    """The part (x, y, width, height) of about `size` px that holds most saddle points of the grey values."""
    peaks = saddle_points(image)[0]
    share = min(1.0, np.sqrt(size / image.size))
    height, width = (max(1, round(side * share)) for side in image.shape)
    sums = np.pad(np.cumsum(np.cumsum(peaks, axis=0, dtype=np.int32), axis=1, dtype=np.int32), ((1, 0), (1, 0)))
    counts = sums[height:, width:] - sums[height:, :-width] - sums[:-height, width:] + sums[:-height, :-width]
    y, x = np.argwhere(counts == counts.max()).mean(axis=0).astype(int)  # the middle of the best places
    return x, y, width, height


def irregularity(grid: NDArray[np.float64]) -> float:
    """The largest change of a step from one corner of a grid to the next, over the smaller of both steps."""
    worst = 0.0
    for lines in (grid, grid.transpose(1, 0, 2)):
        steps = np.diff(lines, axis=0)
        change = np.linalg.norm(np.diff(steps, axis=0), axis=2)
        lengths = np.linalg.norm(steps, axis=2)
        worst = max(worst, np.max(change / np.maximum(np.minimum(lengths[1:], lengths[:-1]), 1e-9), initial=0.0))
    return worst


def _is_plausible(grid, shape):
    """Whether all corners lie within the image, all cells turn the same way, and no line of corners is left out."""
    if irregularity(grid) > LARGEST_IRREGULARITY:
        return False
    inside = (grid >= 0).all() and (grid <= np.array(shape[::-1]) - 1).all()
    along_row, along_column = np.diff(grid, axis=1), np.diff(grid, axis=0)
    turns = [
        along_row[r, :, 0] * along_column[:, c, 1] - along_row[r, :, 1] * along_column[:, c, 0]
        for r in (slice(None, -1), slice(1, None))
        for c in (slice(None, -1), slice(1, None))
    ]
    return bool(inside and (np.all(np.array(turns) > 0) or np.all(np.array(turns) < 0)))
