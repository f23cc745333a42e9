"""Maxima of a two-dimensional accumulator, and the circles at them."""

from dataclasses import replace

import cv2
import numpy as np

from .edges import _Gradient
from .own_radius import _of_own_radius
from .votes import _vote

LEAST_WIDTH = 16.0  # px, of the range in which votes are cast, whatever range was asked for
SMOOTHING = 2.0  # px, sigma of the Gaussian over the 2-D accumulator


# ---------------------------------------------------------------------------------------------------- peaks


def _find_by_votes(window, request, radius):
    """Rows x, y, r, score: peaks of the votes along the gradient, the radius of each by `radius`."""
    gradient = _Gradient(window)
    if not gradient.magnitude.any():
        return np.empty((0, 4))
    wide = _widened(request)
    votes = _vote(gradient, wide)
    smooth = cv2.GaussianBlur(np.abs(votes), (0, 0), SMOOTHING, borderType=cv2.BORDER_CONSTANT)
    peaks = _regional_peaks(smooth, max(1 - request.sensitivity, 1e-6))
    # rounded, so that last digits, which differ between processors, do not decide the order of equally good circles
    rows = [(x, y, radius(votes, gradient, x, y, wide), round(score, 6)) for x, y, score in peaks]
    return _of_own_radius(gradient, np.array(rows).reshape(-1, 4), request, wide)


def _widened(request):
    """The request with a range of at least LEAST_WIDTH px, so that all of a blurred edge can vote."""
    more = max(0.5 * (LEAST_WIDTH - (request.r_max - request.r_min)), 0)
    return replace(request, r_min=max(request.r_min - more, 0.5 * request.r_min), r_max=request.r_max + more)


def _regional_peaks(surface, h):
    """Centroid x, y and peak value of each regional maximum of the h-maxima transform, if the peak is >= h.

    A maximum of value v survives the transform when the 8-connected part of {surface >= v - h} around it
    has no higher point; that part is then its region.  Going down from the highest, everything flooded so far
    belongs to higher points, so touching it is the whole test.
    """
    surface = np.ascontiguousarray(surface, np.float32)
    is_maximum = (surface >= h) & (surface == cv2.dilate(surface, np.ones((3, 3), np.uint8)))
    rows, columns = np.nonzero(is_maximum)
    order = np.lexsort((columns, rows, -surface[rows, columns]))
    flooded = np.zeros((surface.shape[0] + 2, surface.shape[1] + 2), np.uint8)
    peaks = []
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if not flooded[row + 1, column + 1]:
            region = _flood(surface, flooded, row, column, h)
            if region is not None:
                peaks.append((*region, float(surface[row, column])))
    return peaks


_FLOODED = 3  # mark in the mask; floodFill itself writes 1 along the mask's border


def _flood(surface, flooded, row, column, h):
    """Flood the region around a maximum; its weighted centroid x, y, or None where it touches a higher one."""
    flags = 8 | (2 << 8) | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY
    depth = min(h, float(surface[row, column]) * (1 - 1e-6))
    *_, (x, y, width, height) = cv2.floodFill(surface, flooded, (column, row), 0, depth, 1e9, flags)
    around = flooded[y : y + height + 2, x : x + width + 2]
    new = (around == 2).astype(np.uint8)
    touches = (cv2.dilate(new, np.ones((3, 3), np.uint8)) & (around == _FLOODED)).any()
    around[new > 0] = _FLOODED
    if touches:
        return None
    weights = surface[y : y + height, x : x + width] * new[1:-1, 1:-1]
    total = weights.sum(dtype=float)
    cx = weights.sum(axis=0, dtype=float) @ np.arange(x, x + width) / total
    cy = weights.sum(axis=1, dtype=float) @ np.arange(y, y + height) / total
    return cx, cy
