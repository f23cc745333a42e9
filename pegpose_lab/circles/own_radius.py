"""The radius that follows from a circle's edge itself, whatever the radius range of the Hough transform.

A transform with a radius range of 40 to 56 px also responds to a disc of 62 px: the votes then meet in a ring around
the centre, not at the centre, and the best radius within the range is one of its ends.  The edge shows the
difference: its points p and unit normals u towards the inside obey p = c - r u, which is linear in centre c and
radius r.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SECTORS = 24
ALIGNED = 0.8  # cosine of the largest angle between an edge's normal and the direction of the centre
SEEN, EMPTY = 0.5, 0.25  # least part of the sectors in which an edge whose radius counts is seen; where none is seen
BAND = 0.1  # part of the radius, at least 1.5 px, within which points are of one edge
WIDTH, STEPS = 0.15, 8  # part of the radius by which the weights fall off; steps of the fit
END_TOLERANCE, LEAST_END_TOLERANCE = 0.03, 0.5  # part of the radius, px: the error of a radius at a range's end


def end_tolerance(radii: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much radii (n,) may lie outside a range and still count as at its end, px."""
    return np.maximum(LEAST_END_TOLERANCE, END_TOLERANCE * np.asarray(radii))


def own_radius(
    points: NDArray[np.float64], gradients: NDArray[np.float64], circle: NDArray[np.float64], reach: float
) -> float:
    """The radius of the edge around a circle.

    The edge is searched at the circle itself first, so that no other edge around it counts.  An edge farther away
    counts if the circle touches it from inside or outside, where votes of a wrong radius meet, or has no edge itself.

    Parameters
    ----------
    points, gradients : (n, 2)
        Pixels at edges, px, and vectors towards the inside, as long as the edge is strong there.
    circle : (3,)
        x, y, radius, px; roughly known.
    reach : float
        Distance from the centre up to which edges count, px.

    Returns
    -------
    float
        NaN where less than half of an edge is seen.
    """
    center, radius = np.array(circle[:2], float), float(circle[2])
    near = np.hypot(*(points - center).T) <= reach
    points, strengths = points[near], np.hypot(*gradients[near].T)
    normals = gradients[near] / np.maximum(strengths, 1e-12)[:, None]
    empty = _edge_at(points, normals, center, radius)[1] < EMPTY
    for width in (WIDTH, np.inf):
        other_center, other = _edge_circle(points, normals, center, radius, width)
        of_edge, share = _edge_at(points, normals, other_center, other)
        touches = abs(np.hypot(*(other_center - center)) - abs(other - radius)) <= WIDTH * radius + 3
        if share >= SEEN and (width == WIDTH or touches or empty):
            return _median_distance(points[of_edge] - other_center, strengths[of_edge])
    return np.nan


def _edge_at(points, normals, center, radius):
    """Which points lie on a circle's edge, and the share of the sectors in which there are any."""
    towards = center - points
    distance = np.hypot(*towards.T)
    of_edge = np.sum(towards * normals, axis=1) > ALIGNED * distance
    of_edge &= np.abs(distance - radius) <= max(BAND * radius, 1.5)
    turns = np.arctan2(towards[of_edge, 1], towards[of_edge, 0]) / (2 * np.pi) + 0.5
    return of_edge, len(np.unique((turns * SECTORS).astype(int) % SECTORS)) / SECTORS


def _median_distance(offsets, strengths):
    """The median distance of an edge's points, each radius with the same weight."""
    distance = np.hypot(*offsets.T)
    order = np.argsort(distance, kind="stable")
    below = np.cumsum(strengths[order] / np.maximum(distance[order], 0.5))
    return float(distance[order][np.searchsorted(below, 0.5 * below[-1])])


def _edge_circle(points, normals, center, radius, width):
    """Centre and radius of the edge by weighted least squares; the weights of the first step fall off by `width`
    (part of the radius) from the given circle on, NaN where the edge is straight or not there."""
    for _ in range(STEPS):
        towards = center - points
        aligned = np.sum(towards * normals, axis=1) > ALIGNED * np.hypot(*towards.T)
        misfit = np.hypot(*(points + radius * normals - center).T) / max(width * abs(radius), 1.0)
        weights, width = aligned / (1 + misfit**2) ** 2, WIDTH
        if weights.sum() < 3:
            break
        p, u = np.average(points, axis=0, weights=weights), np.average(normals, axis=0, weights=weights)
        spread = weights @ np.sum((normals - u) ** 2, axis=1)
        if spread < 1e-3 * weights.sum():
            break
        radius = -(weights @ np.sum((points - p) * (normals - u), axis=1)) / spread
        center = p + radius * u
    else:
        return center, radius
    return np.full(2, np.nan), np.nan


def _of_own_radius(gradient, rows, request, wide):
    """The circles, rows x, y, r, score, whose radius according to their edge lies in the range.

    If too little of the edge is seen for that, the radius that the method gives is used.  The radius of
    "phase-code" is ambiguous at the ends of the range: there the edge decides which end it is.
    """
    if len(rows) == 0:
        return rows
    y, x = np.nonzero(gradient.magnitude > gradient.threshold(request))
    inwards = request.sign * np.stack([gradient.dx[y, x], gradient.dy[y, x]], axis=1).astype(float)
    points, reach = np.stack([x, y], axis=1).astype(float), 3 * wide.r_max
    own = np.array([own_radius(points, inwards, row[:3], reach) for row in rows])
    known, ratio = np.isfinite(own), wide.r_max / wide.r_min
    if request.method == "phase-code":
        others = rows[:, 2, None] * ratio ** np.array([0.0, -1.0, 1.0])
        nearest = np.abs(others - np.where(known, own, rows[:, 2])[:, None]).argmin(axis=1)
        rows[:, 2] = others[np.arange(len(rows)), nearest]
    radii = np.where(known, own, rows[:, 2])
    return rows[_in_range(radii, request)]


def _in_range(radii, request):
    """Which radii lie in the range, or closer to it than their possible error."""
    tolerance = end_tolerance(radii)
    return (radii >= request.r_min - tolerance) & (radii <= request.r_max + tolerance)
