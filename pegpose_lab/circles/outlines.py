"""Ellipse fits to the edge points around candidates, and how much of their outline is seen."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import bdtrc

from .request import _least_score

LEAST_VOTES, LEAST_QUALITY = 0.25, 1.0  # of a candidate
ALIGNED = 0.8  # cosine of the largest angle between an edge's gradient and the direction of the centre
BAND = 0.2  # part of the radius by which an ellipse's edge may depart from a circle
SECTORS = 24
FALSE_ALARMS = 1.0  # circles expected in an image of nothing but such edges: a candidate that is no rarer is dropped


# ----------------------------------------------------------------------------------------------- multiscale


@dataclass(frozen=True)
class _Near:
    """Edge points within `reach` of peaks: index of the peak, place relative to it, distance; peaks (n, 2), and the
    number of `places` where one could be."""

    peaks: np.ndarray
    index: np.ndarray
    x: np.ndarray
    y: np.ndarray
    distance: np.ndarray
    reach: float
    places: int


def _edges_near(edges, peaks, reach):
    """The edge points within `reach` of each peak whose gradient points to it within ALIGNED."""
    size = int(reach) + 2
    number = np.full((edges.mask.shape[0] + 2 * size, edges.mask.shape[1] + 2 * size), -1, np.int32)
    number[edges.y + size, edges.x + size] = np.arange(len(edges.x))
    corners = np.rint(peaks).astype(int)
    patches = np.lib.stride_tricks.sliding_window_view(number, (2 * size + 1, 2 * size + 1))
    patches = patches[corners[:, 1], corners[:, 0]].reshape(len(peaks), -1)
    index, place = np.nonzero(patches >= 0)
    point = patches[index, place]
    x, y = edges.x[point] - peaks[index, 0], edges.y[point] - peaks[index, 1]
    distance = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    keep = (x * edges.ux[point] + y * edges.uy[point] < -ALIGNED * distance) & (distance <= reach)
    return _Near(peaks, index[keep], x[keep], y[keep], distance[keep], reach, edges.mask.size)


def _best_radii(near, radii):
    """Peaks and radii at which the edge around a peak is most complete: two arrays (m,)."""
    n_bins = int(2 * radii[1] * (1 + BAND)) + 6
    sector = _sector(near.x, near.y)
    cells = (near.index * n_bins + (2 * near.distance + 0.5).astype(int).clip(0, n_bins - 1)) * SECTORS + sector
    counts = np.bincount(cells, minlength=len(near.peaks) * n_bins * SECTORS)
    below = np.zeros((len(near.peaks), n_bins + 1, SECTORS), int)
    np.cumsum(counts.reshape(-1, n_bins, SECTORS), axis=1, out=below[:, 1:])
    tried = np.arange(max(int(2 * radii[0]), 1), int(np.ceil(2 * radii[1])) + 1)
    quality = np.zeros((len(near.peaks), len(tried)), np.float32)
    for band in (0, 0.5 * BAND, BAND):
        half = np.maximum(np.rint(band * tried).astype(int), 1)
        low, high = np.maximum(tried - half, 0), np.minimum(tried + half + 1, n_bins)
        quality += ((below[:, high] - below[:, low]) > 0).mean(axis=2, dtype=np.float32)
    highest = cv2.dilate(quality, np.ones((1, 5), np.uint8)) if quality.size else quality
    peak, radius = np.nonzero((quality == highest) & (quality > LEAST_QUALITY))
    return peak, tried[radius] / 2


def _sector(x, y):
    """Number of the angular sector of points around the origin."""
    return ((np.arctan2(y, x) / (2 * np.pi) + 0.5) * SECTORS).astype(int).clip(0, SECTORS - 1)


def _fit_outlines(near, peak, radius, request):
    """Rows x, y, r, score of ellipses through the edge points around each candidate.

    To first order an ellipse is distance(t) = r + x cos t + y sin t + p cos 2t + q sin 2t.  The score is the part
    of the sectors that have an edge point within 10 % of the radius (at least 1 px) of it.
    """
    if len(peak) == 0:
        return np.empty((0, 4))
    point, used = _points_of(near, peak)
    distance, wanted = np.where(used, near.distance[point], np.inf), radius[:, None]
    cos, sin = near.x[point] / near.distance[point], near.y[point] / near.distance[point]
    design = np.stack([np.ones_like(cos), cos, sin, cos * cos - sin * sin, 2 * cos * sin], axis=2)
    solution = np.zeros((len(peak), 5, 1))
    solution[:, 0, 0] = radius
    for tolerance in (BAND, 0.6 * BAND, 0.4 * BAND):
        residual = distance - (design @ solution)[:, :, 0]
        inside = np.abs(residual) <= np.maximum(tolerance * wanted, 1)
        weighted = (design * inside[:, :, None]).transpose(0, 2, 1)
        residual = np.where(inside, residual, 0)[:, :, None]
        solution += np.linalg.solve(weighted @ design + _HOLD, weighted @ residual)
    residual = np.abs(distance - (design @ solution)[:, :, 0])
    candidate, place = np.nonzero(residual <= np.maximum(0.1 * wanted, 1))
    sectors = candidate * SECTORS + _sector(cos[candidate, place], sin[candidate, place])
    score = (np.bincount(sectors, minlength=len(peak) * SECTORS).reshape(-1, SECTORS) > 0).sum(axis=1) / SECTORS
    r, x, y, p, q = solution[:, :, 0].T
    band = np.maximum(0.1 * radius, 1)
    chance = _by_chance(score, used.sum(axis=1), np.bincount(candidate, minlength=len(peak)), radius, band, near.reach)
    good = chance * near.places * radius <= FALSE_ALARMS
    good &= (np.hypot(x, y) < 0.5 * radius + 2) & (np.hypot(p, q) < 0.3 * radius)
    good &= (np.abs(r - radius) < BAND * radius + 1) & (score >= _least_score(request))
    return np.stack([near.peaks[peak, 0] + x, near.peaks[peak, 1] + y, r, score], axis=1)[good]


def _by_chance(score, points, inside, radius, band, reach):
    """Probability (n,) that as many sectors of an outline have an edge point if these lay anywhere around it.

    How dense they lie follows from those off the outline, so that on texture many sectors are needed.
    """
    along = 4 * np.pi * radius * band  # px^2 of the outline
    density = (points - inside + 1) / np.maximum(np.pi * reach**2 - along, 1)
    occupied = -np.expm1(-density * along / SECTORS)
    return bdtrc(np.rint(score * SECTORS) - 1, SECTORS, occupied)


_HOLD = np.diag([1e-3, 0.5, 0.5, 1.0, 1.0])  # keeps centre and shape fixed where there are few points


def _points_of(near, peak):
    """For each candidate the indices of the edge points around its peak, in rows (n, m), and which count."""
    starts = np.searchsorted(near.index, np.arange(len(near.peaks) + 1))
    counts = np.diff(starts)[peak]
    place = np.arange(counts.max())
    used = place < counts[:, None]
    return np.where(used, starts[peak][:, None] + place, 0), used
