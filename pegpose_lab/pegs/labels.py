"""Which peg is number 1: the screws, and the labels of the frame before."""

from dataclasses import dataclass

import numpy as np

from ..checks import DetectionError
from ..circles import find_circles
from ..discs import fit_discs
from .candidates import _as_circles
from .rings import RADIUS_TOLERANCE, RING_TOLERANCE

EQUALLY_LEFT = 0.01  # px: a smaller difference may come from last digits, which differ between processors
CLEAR_TURN = 0.8  # the best of several labellings must move the pegs less than this part of the next one


# ---- labels ----


@dataclass(frozen=True, eq=False)
class _Labelling:
    """The pegs' indices in label order, and the screws' circles (n_screws, 3) in label order."""

    pegs: np.ndarray
    screws: np.ndarray


def _labellings(image, circles, ring, hub):
    """All labellings of a ring with a circle at each screw's place.

    Circles of whole parts are tried first; hidden or merged screws are searched only if those allow no labelling.
    """
    for search in (_known_screws, _hidden_screws):
        found = [search(image, circles, ring, shift, hub) for shift in range(hub.n_pegs)]
        shifts = [shift for shift in range(hub.n_pegs) if found[shift] is not None]
        if shifts:
            _check_one_pattern(shifts, hub)
            return [_Labelling(np.roll(ring.pegs, -shift), found[shift]) for shift in shifts]
    return []


def _screw_places(circles, ring, shift, hub):
    """Where the screws should be (n_screws, 2), px, if the ring's peg `shift` is peg 1, and their radius, px."""
    pitch_radius = hub.pitch_circle_diameter / 2
    base = circles.radii[ring.bore] / hub.bore_radius / (ring.scale / pitch_radius)
    angles = np.asarray(hub.screw_angles)
    spots = ring.place(angles, 2 * np.pi * shift / hub.n_pegs) * base
    spots *= hub.screw_circle_diameter / hub.pitch_circle_diameter
    radius = circles.radii[ring.bore] * hub.screw_radius / hub.bore_radius
    return circles.centers[ring.bore] + np.column_stack([spots.real, spots.imag]), radius


def _known_screws(image, circles, ring, shift, hub):
    """The circles nearest to the screws' places, (n_screws, 3), or None if one is missing."""
    places, radius = _screw_places(circles, ring, shift, hub)
    return _nearest(places, radius, circles, ring)


def _hidden_screws(image, circles, ring, shift, hub):
    """The same by a Hough transform of the image at the screws' places, for screws that touch other parts."""
    places, radius = _screw_places(circles, ring, shift, hub)
    reach = radius + RING_TOLERANCE * ring.scale
    boxes = np.column_stack([places - reach, np.full((len(places), 2), 2 * reach)])
    boxes = _clip_boxes(boxes, image.shape)
    if boxes is None:
        return None
    limits = (1 - RADIUS_TOLERANCE) * radius, (1 + RADIUS_TOLERANCE) * radius
    discs = fit_discs(image, find_circles(image, limits, regions=boxes))
    measured = _as_circles(np.column_stack([discs.centers, discs.radii])[discs.accepted])
    return _nearest(places, radius, measured, ring)


def _clip_boxes(boxes, shape):
    """Boxes x, y, width, height cut to the image and to whole pixels; None if one lies outside."""
    low = np.maximum(np.floor(boxes[:, :2]), 0)
    high = np.minimum(np.ceil(boxes[:, :2] + boxes[:, 2:]), shape[::-1])
    if (high - low < 3).any():
        return None
    return np.column_stack([low, high - low]).astype(int)


def _nearest(places, radius, circles, ring):
    """The circle of about that radius nearest to each place, (n, 3), or None if there is none near one."""
    rows = []
    fits = np.abs(circles.radii / radius - 1) < RADIUS_TOLERANCE
    for place in places:
        distance = np.where(fits, np.linalg.norm(circles.centers - place, axis=1), np.inf)
        if distance.size == 0 or distance.min() > RING_TOLERANCE * ring.scale:
            return None
        best = int(np.argmin(distance))
        rows.append([*circles.centers[best], circles.radii[best]])
    return np.array(rows)


def _check_one_pattern(shifts, hub):
    """Raise unless all labellings are the same pattern of screws, turned."""
    symmetric = {shift for shift in range(hub.n_pegs) if _screws_look_alike(shift, hub)}
    if {(shift - shifts[0]) % hub.n_pegs for shift in shifts} - symmetric:
        raise DetectionError(
            "discs lie like screws in several gaps, so pegs cannot be labelled; clear the hub of swarf"
        )


def _screws_look_alike(shift, hub):
    """Whether the screws lie where they did after a turn by `shift` pegs."""
    angles = np.asarray(hub.screw_angles)
    difference = angles[:, None] + 2 * np.pi * shift / hub.n_pegs - angles
    return bool(np.all(np.min(np.abs(np.exp(1j * difference) - 1), axis=1) < 1e-6))


def _choose(labellings, circles, previous):
    """The labelling that `locate_pegs` promises."""
    if previous is None or len(labellings) == 1:
        return labellings[_leftmost([labelling.screws[0] for labelling in labellings])]
    return labellings[
        _least_move([circles.centers[labelling.pegs] for labelling in labellings], previous, "hub", "pegs")
    ]


def _leftmost(points):
    """Which of the points is farthest left in the image, of two equally far left the upper one."""
    points = np.asarray(points)
    left = np.flatnonzero(points[:, 0] <= points[:, 0].min() + EQUALLY_LEFT)
    return left[np.argmin(points[left, 1])]


def _least_move(labelled, previous, part, places):
    """In which of the labelled arrays of centres the places moved least since the frame before, relative to their middle."""
    before = previous.peg_centers - previous.peg_centers.mean(axis=0)
    moves = [np.linalg.norm(now - now.mean(axis=0) - before) for now in labelled]
    best, second = np.argsort(moves, kind="stable")[:2]
    if moves[best] > CLEAR_TURN * moves[second]:
        raise DetectionError(
            f"the {part} turned too far since the previous frame: two labellings move the {places} about equally far; "
            "take frames more often, or drop previous and label anew"
        )
    return best
