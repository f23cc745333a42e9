"""The Hough transform for circles of any size: an octave of radii at a time, on reduced images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from .edges import _sobel
from .outlines import BAND, LEAST_VOTES, _best_radii, _edges_near, _fit_outlines
from .own_radius import _in_range

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .request import _Request

OCTAVE = 5.0  # px, smallest radius that is searched on a reduced image; the largest is twice that, or 2.4 times
NOISE_FACTOR, LEAST_GRADIENT = (
    4.0,
    16.0,
)  # least Sobel gradient of an edge: in sigmas of noise, and at all (rounding's is 4)


# ----------------------------------------------------------------------------------------------- multiscale


def find(image: NDArray[np.uint8], request: _Request) -> NDArray[np.float64]:
    """Rows x, y, r, score: each octave of radii is searched on a image of its own (see `find_circles`)."""
    reduction, rows = 1, [np.empty((0, 4))]
    largest = min(request.r_max, min(image.shape))  # larger circles show less than half their edge
    while True:
        low, high = request.r_min / reduction, largest / reduction
        last = high <= 2.4 * OCTAVE
        if low < 2 * OCTAVE or last:
            low = max(low, OCTAVE if reduction > 1 else 0)
            found = _find_octave(image, (low, high if last else 2 * OCTAVE), request) if low <= high else rows[0]
            found = found * [reduction, reduction, reduction, 1] + 0.5 * (reduction - 1) * _IS_PLACE
            rows.append(found[_in_range(found[:, 2], request)])
        if last:
            return np.concatenate(rows)
        image, reduction = _halved(image), 2 * reduction


_IS_PLACE = np.array([1, 1, 0, 0])


def _halved(image):
    """The image at half the size, each pixel the mean of four."""
    height, width = image.shape[0] // 2, image.shape[1] // 2
    return cv2.resize(image[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA)


def _find_octave(image, radii, request):
    """Rows x, y, r, score of the circles with `radii` (smallest, largest), at most an octave."""
    edges = _EdgePoints.of(image, request)
    if len(edges.x) == 0:
        return np.empty((0, 4))
    more = max(0.5 * (1 - (radii[1] - radii[0])), 0)  # an edge is at least that wide
    radii = max(radii[0] - more, 0.5 * radii[0]), radii[1] + more
    peaks = _octave_peaks(edges, radii, image.shape)
    if len(peaks) == 0:
        return np.empty((0, 4))
    near = _edges_near(edges, peaks, radii[1] * (1 + BAND) + 2)
    return _fit_outlines(near, *_best_radii(near, radii), request)


@dataclass(frozen=True)
class _EdgePoints:
    """Thin edge points: x, y (n,) px, and unit vectors (n,) towards the inside of a disc."""

    mask: np.ndarray
    x: np.ndarray
    y: np.ndarray
    ux: np.ndarray
    uy: np.ndarray

    @classmethod
    def of(cls, image, request):
        """Canny's edge points, with a threshold that noise does not reach."""
        dx, dy = _sobel(image)
        threshold = _noise_threshold(dx, dy, request)
        mask = cv2.Canny(dx, dy, threshold, threshold, L2gradient=True)
        points = cv2.findNonZero(mask)
        x, y = np.empty((2, 0), np.intp) if points is None else points.reshape(-1, 2).T.astype(np.intp)
        ux, uy = dx[y, x].astype(np.float32), dy[y, x].astype(np.float32)
        length = np.float32(request.sign) * np.maximum(np.sqrt(ux * ux + uy * uy), 1)
        return cls(mask, x, y, ux / length, uy / length)


def _noise_threshold(dx, dy, request):
    """Smallest gradient of an edge: NOISE_FACTOR times that of the noise, estimated by quartiles (slopes do not count)."""
    if request.edge_threshold is not None:
        return request.edge_threshold * float(np.hypot(dx.astype(np.float32), dy).max())
    some = (dx[::4].clip(-127, 127) + 128).astype(np.uint8)
    below = np.cumsum(cv2.calcHist([some], [0], None, [256], [0, 256]).ravel())
    quartiles = np.searchsorted(below, [0.25 * below[-1], 0.75 * below[-1]])
    return max(NOISE_FACTOR / 1.349 * (float(quartiles[1] - quartiles[0]) + 1), LEAST_GRADIENT)


def _octave_peaks(edges, radii, shape):
    """Centres (n, 2), px, of the cells of 2 x 2 px where votes along the gradient meet."""
    height, width = shape[0] // 2 + 1, shape[1] // 2 + 1
    distances = np.arange(radii[0], radii[1] + 0.49, 0.5, dtype=np.float32)[:, None]
    columns = ((edges.x + 0.5 + distances * edges.ux) * 0.5).astype(np.int32)
    rows = ((edges.y + 0.5 + distances * edges.uy) * 0.5).astype(np.int32)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    weights = np.broadcast_to(1 / (2 * np.pi * distances), inside.shape)
    votes = np.bincount((rows * width + columns)[inside], weights[inside], height * width)
    votes = cv2.GaussianBlur(votes.reshape(height, width).astype(np.float32), (3, 3), 0)
    highest = cv2.dilate(votes, np.ones((3, 3), np.uint8))
    peaks = cv2.findNonZero(cv2.compare(votes, highest, cv2.CMP_EQ) & cv2.compare(votes, LEAST_VOTES, cv2.CMP_GT))
    if peaks is None:
        return np.empty((0, 2))
    peaks = peaks.reshape(-1, 2)
    around = cv2.copyMakeBorder(votes, 1, 1, 1, 1, cv2.BORDER_CONSTANT)
    around = around[peaks[:, 1, None] + _ROWS, peaks[:, 0, None] + _COLUMNS]
    total = around.sum(axis=1)
    shift = np.stack([around @ (_COLUMNS - 1), around @ (_ROWS - 1)], axis=1) / total[:, None]
    return np.clip(2 * (peaks + shift) + 0.5, 0, [shape[1] - 1, shape[0] - 1])


_ROWS, _COLUMNS = np.indices((3, 3)).reshape(2, 9)
