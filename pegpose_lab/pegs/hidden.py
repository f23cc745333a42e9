"""A hub one of whose pegs is hidden: where it has to be, by the other pegs."""

from itertools import combinations

import numpy as np

from ..checks import DetectionError
from .candidates import _as_circles
from .plane import _fit_to_ellipses, _images, _Plane
from .rings import MOST_RINGS, RADIUS_TOLERANCE, _neighbours, _rings_around

LEAST_MEASURED = 3  # pegs: with their sizes and shapes they determine the image of the plane
SHAPE_TOLERANCE = 0.03  # of a peg's semi-axes, against what the other pegs make of it


# ---- searching ----


def _rings_with_a_gap(circles, hub):
    """Circles with those added that would complete a ring, and the rings with one of them, the best first.

    A ring's image is F_0 + F_1 w^k + F_-1 w^-k for peg k = 0 .. n - 1 with w = exp(2 pi i / n): n - 1 pegs in clockwise
    order determine it, if the gap comes after the last.
    """
    n = hub.n_pegs
    spins = np.exp(2j * np.pi * np.arange(n) / n)
    design = np.column_stack([np.ones(n), spins, 1 / spins])
    last = design[-1] @ np.linalg.pinv(design[:-1])  # of the n - 1 pegs seen
    rows, rings = [np.column_stack([circles.centers, circles.radii])], []
    for bore in range(len(circles.radii)):
        near = _neighbours(circles, bore, hub)
        if len(near) < n - 1:
            continue
        sets = np.array(list(combinations(near, n - 1)))
        z = circles.centers[sets] @ (1, 1j)
        order = np.argsort(np.angle(z - circles.centers[bore] @ (1, 1j)), axis=1, kind="stable")
        sets = np.take_along_axis(sets, order, axis=1)
        sets = np.concatenate([np.roll(sets, -shift, axis=1) for shift in range(n - 1)])
        gaps = (circles.centers[sets] @ (1, 1j)) @ last
        start = sum(map(len, rows))
        rows.append(np.column_stack([gaps.real, gaps.imag, circles.radii[sets].mean(axis=1)]))
        both = _as_circles(np.vstack(rows))
        rings += _rings_around(both, bore, np.column_stack([sets, start + np.arange(len(sets))]), hub)
    rings = [ring for ring in rings if ring.pegs.max() >= len(circles.radii)]
    return _as_circles(np.vstack(rows)), sorted(rings, key=lambda ring: ring.cost)[:MOST_RINGS]


# ---- measuring ----


def _misfits(homography, shapes, hub):
    """How far (n,) the semi-axes of the pegs' ellipses are off, relatively, what a homography makes of pegs."""
    jacobians = hub.peg_radius * _images(homography, hub.peg_centers[:, :2])[1]
    squares = np.linalg.solve(jacobians @ jacobians.transpose(0, 2, 1), shapes)
    return np.max(np.abs(np.sqrt(np.linalg.eigvals(squares).real) - 1), axis=1)


def _seen_pegs(homography, parts, shapes, reasons, hub):
    """The homography of the pegs' plane, and the reasons for which pegs do not count: of a hub of four or more, one may not.

    A peg that is cut off along a straight line can look like a smaller ellipse: that it is not one, the others show.
    `homography` is that of all centres.

    Raises
    ------
    DetectionError
        If the pegs' shapes contradict one another, and leaving one out does not help.
    """
    n = hub.n_pegs
    misfits = _misfits(homography, shapes, hub)
    worst, whole = int(np.argmax(misfits)), not any(reasons)
    if whole and misfits[worst] <= (SHAPE_TOLERANCE if n > LEAST_MEASURED else RADIUS_TOLERANCE):
        return homography, reasons
    words = f"{misfits[worst]:.0%} off the size or shape that follows from the other pegs"
    left_out = [] if n == LEAST_MEASURED else range(n) if whole else [k for k in range(n) if reasons[k]]
    planes = {k: _without(k, homography, parts, shapes, hub) for k in left_out}
    planes = {k: plane for k, plane in planes.items() if plane is not None}
    if len(planes) != 1:
        raise DetectionError(
            f"peg {worst + 1} is {words}: something may hide part of it; clear the view, or check the hub's measures"
        )
    ((k, plane),) = planes.items()
    return plane, [reasons[i] or (words if i == k else "") for i in range(n)]


def _without(left_out, homography, parts, shapes, hub):
    """The homography by the other pegs' ellipses; None if they are no images of equal pegs."""
    kept = np.arange(hub.n_pegs) != left_out
    unit = np.diag([hub.pitch_circle_diameter / 2] * 2 + [1.0])
    places, radius = hub.peg_centers[kept, :2] / unit[0, 0], hub.peg_radius / unit[0, 0]
    plane, ones = _Plane(homography @ unit, radius), np.ones(kept.sum())
    values, vectors = np.linalg.eigh(shapes[kept])
    roots = vectors * np.sqrt(values)[:, None] @ vectors.transpose(0, 2, 1)
    plane = _fit_to_ellipses(plane, places, parts[kept, :2], roots, ones, radius)
    if plane is None:
        return None
    fitted = plane.homography @ np.linalg.inv(unit)
    return fitted if _misfits(fitted, shapes, hub)[kept].max() <= SHAPE_TOLERANCE else None


def _peg_image(homography, peg, hub):
    """Centre (2,), radius and shape (2, 2) of the image of a peg."""
    unit = _Plane(homography, hub.peg_radius)
    centers, roots = unit.ellipses(hub.peg_centers[peg : peg + 1, :2])
    return centers[0], float(np.sqrt(np.linalg.det(roots[0]))), roots[0] @ roots[0].T
