"""The discs of a labelled ring, measured, and checked against one plane's perspective."""

from dataclasses import dataclass
from itertools import combinations
from types import SimpleNamespace

import cv2
import numpy as np

from ..checks import DetectionError, as_image
from ..circles import find_circles
from ..discs import fit_discs
from ..segmentation import segment
from ..targets import MOST_PEGS

SENSITIVITY = 0.95  # of the Hough transform: the pattern sorts out false circles
LARGEST_TILT_RATIO = 0.3  # |F_-1 / F_1| = (1 - cos tilt) / (1 + cos tilt): 57 degrees
RING_TOLERANCE = 0.1  # of the pitch radius: what perspective and measuring may add to the affine image
RADIUS_TOLERANCE = 0.25  # of a disc's radius
SHAPE_TOLERANCE = 0.03  # of a peg's semi-axes, against what the other pegs' places make of it
BASE_SCALE = (0.7, 1.1)  # scale of the base's picture over that of the pegs' tops
OBLIQUENESS = 0.7  # tangent of the angle between line of sight and hub axis
MOST_NEIGHBOURS = MOST_PEGS  # circles tried as pegs of one bore: the sets of n_pegs among them are all tried
MOST_RINGS = 20
EQUALLY_LEFT = 0.01  # px: what last digits, which differ between processors, must not decide
CLEAR_TURN = 0.8  # the best of several labellings must move the pegs less than this part of the next one


@dataclass(frozen=True, eq=False)
class PegObservation:
    """The parts of a hub in one picture; rows in label order.

    Attributes
    ----------
    peg_centers : (n_pegs, 2) ndarray
        Centres of the pegs' images (of the ellipses; see `pose` for what that is not), px.
    peg_radii : (n_pegs,) ndarray
        Radii of the circles of equal area, px.
    peg_sigmas : (n_pegs, 2) ndarray
        Standard deviations of `peg_centers`, px.
    hub_center : (2,) ndarray
        Image of the hub's centre in the plane of the peg tops, from the pegs' homography, px.
    screw_centers, screw_radii, screw_sigmas : (n_screws, 2), (n_screws,) and (n_screws, 2) ndarray
        px.
    bore_center, bore_radius, bore_sigma : (2,) ndarray, float and (2,) ndarray
        px.
    flags : tuple of str
        What is wrong with parts that were found but not measured, "screw 2: edge hidden".  Their values are those
        of the Hough transform (to a pixel or two) and their sigmas infinite.  Pegs are always measured.
    """

    peg_centers: np.ndarray
    peg_radii: np.ndarray
    peg_sigmas: np.ndarray
    hub_center: np.ndarray
    screw_centers: np.ndarray
    screw_radii: np.ndarray
    screw_sigmas: np.ndarray
    bore_center: np.ndarray
    bore_radius: float
    bore_sigma: np.ndarray
    flags: tuple = ()


def locate_pegs(image, hub, *, previous=None, min_area=None, threshold=None):
    """Find a hub's pegs, bore and screws (bright discs) and label them.

    Labels run clockwise on the screen (about the hub's z axis, away from the camera) from the gap with the
    first screw, as in Table 2; the paper's "anticlockwise" holds with y up.  Where the screws leave several
    labellings (with four pegs and opposite screws the picture is the same after half a turn), `previous`
    decides: the pegs move as little as possible about their middle.  Without it the first screw is the one
    further left in the picture, of two equally far left the upper one.

    Parameters
    ----------
    image : (height, width) uint8
    hub : Hub
    previous : PegObservation, optional
        The same hub in the frame before.
    min_area, threshold : float, optional
        As for `segment`; `min_area` has to be below the area of a screw (px).

    Returns
    -------
    PegObservation

    Raises
    ------
    ValueError
        If an argument is unusable.
    DetectionError
        If a part is missing or a peg's edge cannot be measured, screws fit more than one labelling, or the
        hub turned so far since `previous` that the labels cannot be carried over.
    """
    image = as_image(image)
    if previous is not None and np.shape(getattr(previous, "peg_centers", None)) != (hub.n_pegs, 2):
        raise ValueError(f"previous is no PegObservation of {hub.n_pegs} pegs")
    segmentation = segment(image, min_area=min_area, threshold=threshold)
    try:
        return _locate(image, segmentation, hub, previous)
    except DetectionError:
        if len(segmentation.levels) == 1:
            raise
        # Bright swarf on a bore can make two grey levels of it; one threshold for all leaves it whole.
        try:
            whole = segment(image, min_area=min_area, threshold=segmentation.threshold)
            return _locate(image, whole, hub, previous)
        except DetectionError:
            pass
        raise


def _locate(image, segmentation, hub, previous):
    """`locate_pegs` on one segmentation."""
    circles = _part_circles(image, segmentation)
    rings = _find_rings(circles, hub)
    if not rings:
        raise DetectionError(_missing_pegs(circles, hub))
    for ring in rings:
        labellings = _labellings(image, circles, ring, hub)
        if labellings:
            return _measure(image, circles, ring, _choose(labellings, circles, previous), hub)
    raise DetectionError(_missing_screws(circles, rings[0], hub))


def track_pegs(frames, hub, *, previous=None, min_area=None, threshold=None):
    """Locate the pegs in frame after frame, the labels carried over.

    Parameters
    ----------
    frames : iterable of (height, width) uint8
    hub, previous, min_area, threshold
        As for `locate_pegs`; `previous` is for the first frame.

    Yields
    ------
    PegObservation

    Raises
    ------
    ValueError, DetectionError
        As `locate_pegs` does; the message names the frame, counted from 1.  To go on after it, call
        `locate_pegs` on the next frame with the last observation.
    """
    for number, frame in enumerate(frames, 1):
        try:
            previous = locate_pegs(frame, hub, previous=previous, min_area=min_area, threshold=threshold)
        except DetectionError as error:
            raise DetectionError(f"frame {number}: {error}") from error
        yield previous


# ---- circles ----


def _part_circles(image, segmentation):
    """The best circles of each part: `centers` (k, 2) and `radii` (k,), px.

    A part is a disc, or holds one with something attached or hidden: the disc is about as wide as the
    part's shorter side, or smaller.
    """
    found = [np.empty((0, 3))]
    for area, box in zip(segmentation.areas, segmentation.boxes):
        largest = 1.25 * box[2:].min() / 2
        smallest = max(0.5 * np.sqrt(area / np.pi), largest / 3)
        if largest > smallest + 1:
            circles = find_circles(
                image, (smallest, largest), regions=box[None], max_circles=2, sensitivity=SENSITIVITY
            )
            found.append(np.column_stack([circles.centers, circles.radii]))
    return _as_circles(np.vstack(found))


def _as_circles(rows):
    return SimpleNamespace(centers=rows[:, :2], radii=rows[:, 2])


# ---- the ring of pegs ----


@dataclass(frozen=True, eq=False)
class _Ring:
    """Indices of a bore and of pegs in clockwise order, and the pegs' Fourier coefficients F_0, F_1, F_-1."""

    bore: int
    pegs: np.ndarray
    center: complex
    turn: complex
    tilt: complex
    cost: float

    def place(self, angles, shift=0.0):
        """Images x + i y, relative to the centre, of points on the pitch circle at angles from peg `shift`."""
        spin = np.exp(1j * (np.asarray(angles) + shift))
        return self.turn * spin + self.tilt / spin

    @property
    def scale(self):
        """Root of the area on the screen over that on the hub, for a pitch circle of radius 1."""
        return np.sqrt(abs(self.turn) ** 2 - abs(self.tilt) ** 2)


def _find_rings(circles, hub):
    """All sets of circles that look like a bore with a ring of pegs, the best first."""
    rings = []
    for bore in range(len(circles.radii)):
        near = _neighbours(circles, bore, hub)
        if len(near) >= hub.n_pegs:
            rings += _rings_around(circles, bore, np.array(list(combinations(near, hub.n_pegs))), hub)
    return sorted(rings, key=lambda ring: ring.cost)[:MOST_RINGS]


def _neighbours(circles, bore, hub):
    """Indices of circles that may be pegs around a bore by their size and distance."""
    scale = circles.radii[bore] / hub.bore_radius
    size = np.abs(np.log(circles.radii / (scale * hub.peg_radius)))
    distance = np.linalg.norm(circles.centers - circles.centers[bore], axis=1)
    distance /= scale * hub.pitch_circle_diameter / 2
    near = np.flatnonzero((size < np.log(1.6)) & (distance > 0.4) & (distance < 2.2))
    return np.sort(near[np.argsort(size[near], kind="stable")][:MOST_NEIGHBOURS])


def _rings_around(circles, bore, sets, hub):
    """Those of `sets` (m, n_pegs) that are a ring of equal discs around a bore, as `_Ring`s."""
    n, pitch_radius = hub.n_pegs, hub.pitch_circle_diameter / 2
    z = circles.centers[sets] @ (1, 1j)
    order = np.argsort(np.angle(z - z.mean(axis=1, keepdims=True)), axis=1, kind="stable")
    sets, z = np.take_along_axis(sets, order, axis=1), np.take_along_axis(z, order, axis=1)
    series = np.fft.fft(z, axis=1) / n
    turn, tilt = np.abs(series[:, 1]), np.abs(series[:, -1])
    rest = np.sqrt(np.sum(np.abs(series[:, 2:-1]) ** 2, axis=1)) / np.maximum(turn, 1e-9)
    scale = np.sqrt(np.maximum(turn**2 - tilt**2, 1e-9)) / pitch_radius
    size = np.max(np.abs(circles.radii[sets] / (scale[:, None] * hub.peg_radius) - 1), axis=1)
    base = circles.radii[bore] / (scale * hub.bore_radius)
    reach = OBLIQUENESS * hub.peg_height / pitch_radius + RING_TOLERANCE
    shift = np.abs(circles.centers[bore] @ (1, 1j) - series[:, 0]) / (scale * pitch_radius)
    good = (tilt < LARGEST_TILT_RATIO * turn) & (rest < RING_TOLERANCE) & (shift < reach)
    good &= (size < RADIUS_TOLERANCE) & (base > BASE_SCALE[0]) & (base < BASE_SCALE[1])
    cost = rest / RING_TOLERANCE + size / RADIUS_TOLERANCE + shift / reach
    return [_Ring(bore, sets[k], *series[k, [0, 1, -1]], float(cost[k])) for k in np.flatnonzero(good)]


# ---- labels ----


@dataclass(frozen=True, eq=False)
class _Labelling:
    """The pegs' indices in label order, and the screws' circles (n_screws, 3) in label order."""

    pegs: np.ndarray
    screws: np.ndarray


def _labellings(image, circles, ring, hub):
    """All labellings of a ring with a circle at each screw's place.

    Circles of whole parts count first; only if they allow no labelling, hidden or merged screws are searched.
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
    """The same by a Hough transform of the picture at the screws' places, for those that touch other parts."""
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
    """Boxes x, y, width, height cut to the picture and to whole pixels; None if one lies outside."""
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
        farthest = min(labelling.screws[0, 0] for labelling in labellings) + EQUALLY_LEFT
        return min((one for one in labellings if one.screws[0, 0] <= farthest), key=lambda one: one.screws[0, 1])
    before = previous.peg_centers - previous.peg_centers.mean(axis=0)
    moves = []
    for labelling in labellings:
        now = circles.centers[labelling.pegs]
        moves.append(np.linalg.norm(now - now.mean(axis=0) - before))
    best, second = np.argsort(moves, kind="stable")[:2]
    if moves[best] > CLEAR_TURN * moves[second]:
        raise DetectionError(
            "the hub turned too far since the previous frame: two labellings move the pegs about equally far; "
            "take frames more often, or drop previous and label anew"
        )
    return labellings[best]


# ---- measuring ----


def _measure(image, circles, ring, labelling, hub):
    """Fit discs to what was chosen."""
    n, n_screws = hub.n_pegs, len(labelling.screws)
    index = np.append(labelling.pegs, ring.bore)
    located = np.vstack([np.column_stack([circles.centers[index], circles.radii[index]]), labelling.screws])
    names = [f"peg {k + 1}" for k in range(n)] + ["bore"] + [f"screw {k + 1}" for k in range(n_screws)]
    parts, sigmas, reasons, shapes = _fit_parts(image, located)
    _check_fits(reasons, names, n)
    _check_shapes(parts[:n, :2], shapes[:n], hub)
    return PegObservation(
        peg_centers=parts[:n, :2],
        peg_radii=parts[:n, 2],
        peg_sigmas=sigmas[:n],
        hub_center=_image_of_center(parts[:n, :2], hub),
        screw_centers=parts[n + 1 :, :2],
        screw_radii=parts[n + 1 :, 2],
        screw_sigmas=sigmas[n + 1 :],
        bore_center=parts[n, :2],
        bore_radius=float(parts[n, 2]),
        bore_sigma=sigmas[n],
        flags=tuple(f"{name}: {reason}" for name, reason in zip(names, reasons) if reason),
    )


def _fit_parts(image, located):
    """Measure the circles `located` (k, 3).

    Returns x, y, radius (k, 3), sigmas of x and y (k, 2), why a part could not be measured, "" where it was, and
    the shapes (k, 2, 2): matrices with the squares of the semi-axes as eigenvalues.  What cannot be
    measured stays where it was located, with infinite sigmas.
    """
    discs = fit_discs(image, _as_circles(located))
    moved = np.linalg.norm(discs.centers - located[:, :2], axis=1)
    strayed = np.maximum(moved, np.abs(discs.radii - located[:, 2])) > RADIUS_TOLERANCE * located[:, 2]
    measured = discs.accepted & ~strayed
    fitted = np.column_stack([discs.centers, discs.radii])
    reasons = np.where(measured, "", np.where(discs.accepted, "no disc there", discs.reasons))
    cos, sin = np.cos(discs.angles), np.sin(discs.angles)
    axes = np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1) * discs.semi_axes[:, None, :]
    return (
        np.where(measured[:, None], fitted, located),
        np.where(measured[:, None], discs.sigmas[:, :2], np.inf),
        [str(reason) for reason in reasons],
        axes @ axes.transpose(0, 2, 1),
    )


def _check_fits(reasons, names, n_pegs):
    """Raise if a peg could not be measured, or no screw."""
    failed = [f"{name} ({reason})" for name, reason in zip(names, reasons) if reason]
    if any(reasons[:n_pegs]) or all(reasons[n_pegs + 1 :]):
        raise DetectionError(
            f"{', '.join(failed)}: found, but the edge cannot be measured; clear the view of all pegs and of "
            "a screw, soften the light, show the whole part"
        )


def _check_shapes(centers, shapes, hub):
    """Raise if a peg's ellipse is not what the pegs' common homography makes of a peg.

    A peg that is cut off by something straight can look like a smaller ellipse; its neighbours know better.
    """
    homography = _homography(centers, hub)
    ratios = []
    for peg, shape in zip(hub.peg_centers, shapes, strict=True):
        top, weight = homography[:2] @ (peg[0], peg[1], 1), homography[2] @ (peg[0], peg[1], 1)
        jacobian = (homography[:2, :2] - np.outer(top / weight, homography[2, :2])) / weight * hub.peg_radius
        ratios.append(np.sqrt(np.linalg.eigvals(np.linalg.solve(jacobian @ jacobian.T, shape)).real))
    misfits = np.max(np.abs(np.array(ratios) - 1), axis=1)
    worst = int(np.argmax(misfits))
    if misfits[worst] > (SHAPE_TOLERANCE if hub.n_pegs > 3 else RADIUS_TOLERANCE):
        raise DetectionError(
            f"peg {worst + 1} is {misfits[worst]:.0%} off the size or shape that it has to have among the others: "
            "something may hide part of it; clear the view, or check the hub's measures"
        )


def _homography(peg_centers, hub):
    """The matrix (3, 3) that takes the plane of the peg tops to the picture; for three pegs an affine one."""
    if hub.n_pegs == 3:
        plane = np.column_stack([hub.peg_centers[:, :2], np.ones(3)])
        return np.vstack([np.linalg.solve(plane, peg_centers).T, [0, 0, 1]])
    middle = peg_centers.mean(axis=0)
    shift = np.array([[1, 0, middle[0]], [0, 1, middle[1]], [0, 0, 1]])
    return shift @ cv2.findHomography(hub.peg_centers[:, :2], peg_centers - middle)[0]


def _image_of_center(peg_centers, hub):
    """Image of the hub frame's origin."""
    homography = _homography(peg_centers, hub)
    return homography[:2, 2] / homography[2, 2]


# ---- what to say when something is missing ----


def _missing_pegs(circles, hub):
    """The message for a picture without a ring."""
    counts = [min(len(_neighbours(circles, bore, hub)), hub.n_pegs) for bore in range(len(circles.radii))]
    best = max(counts, default=0)
    seen = f"found {len(circles.radii)} discs, among them at most {best} of {hub.n_pegs} pegs around a bore"
    if best == hub.n_pegs:
        seen += ", but not in a ring"
    return (
        f"{seen}; show the whole hub with bright pegs and bore, light it evenly, or give threshold and min_area; "
        "check the hub's measures"
    )


def _missing_screws(circles, ring, hub):
    """The message for a ring whose screws are not seen."""
    counts = []
    for shift in range(hub.n_pegs):
        places, radius = _screw_places(circles, ring, shift, hub)
        counts.append(sum(_nearest(place[None], radius, circles, ring) is not None for place in places))
    return (
        f"found {hub.n_pegs} of {hub.n_pegs} pegs and the bore, but {max(counts)} of {len(hub.screw_angles)} "
        "screws: the pegs cannot be labelled; clear the screws, or lower min_area below their area"
    )
