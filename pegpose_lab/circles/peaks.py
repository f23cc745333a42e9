"""Maxima of a two-dimensional accumulator, and the radius of the circle at each."""

import cv2
import numpy as np

SMOOTHING = 2.0  # px, sigma of the Gaussian over the 2-D accumulator


# ---------------------------------------------------------------------------------------------------- peaks


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


def _radius_by_phase(votes, _gradient, x, y, request):
    """Radius from the phase of the votes around a centre (weighted by the smoothing's Gaussian)."""
    reach = int(3 * SMOOTHING)
    row, column = int(round(y)), int(round(x))
    rows = np.arange(max(row - reach, 0), min(row + reach + 1, votes.shape[0]))
    columns = np.arange(max(column - reach, 0), min(column + reach + 1, votes.shape[1]))
    down = np.exp(-0.5 * ((rows - y) / SMOOTHING) ** 2)
    across = np.exp(-0.5 * ((columns - x) / SMOOTHING) ** 2)
    peak = down @ votes[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] @ across
    phase = np.angle(peak) % (2 * np.pi)
    return request.r_min * (request.r_max / request.r_min) ** (phase / (2 * np.pi))


def _radius_by_histogram(_votes, gradient, x, y, request):
    """The whole radius at which the mean gradient in a ring of one pixel's width is largest."""
    reach = int(np.ceil(request.r_max)) + 1
    row, column = int(round(y)), int(round(x))
    rows = np.arange(max(row - reach, 0), min(row + reach + 1, gradient.magnitude.shape[0]))
    columns = np.arange(max(column - reach, 0), min(column + reach + 1, gradient.magnitude.shape[1]))
    patch = gradient.magnitude[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    bins = np.rint(np.hypot(columns - x, (rows - y)[:, None])).astype(int).ravel()
    total, count = np.bincount(bins, patch.ravel()), np.bincount(bins)
    low, high = int(np.ceil(request.r_min)), int(np.floor(request.r_max))
    mean = total[low : high + 1] / np.maximum(count[low : high + 1], 1)
    return float(low + mean.argmax()) if len(mean) else 0.5 * (request.r_min + request.r_max)
