"""The rings of a picture: hypotheses of the seeds, drawn to the edges and judged by them."""

from dataclasses import dataclass

import numpy as np

from .consensus import _hypotheses, _images
from .edges import _refined, _Rims, _rims, _visible
from .plane import PROPORTION_SIGMA, _fit_plane, _fit_to_ellipses, _is_sane, _Plane, _starts
from .seeds import _Seeds

TOLERANCE = (1.0, 0.03)  # px, and part of the radius: how near an edge lies to the outline that it belongs to
SEEN = (0.3, 0.65)  # visible share of an outline with which a place counts as empty, and as full
OWN_REACHES = (0.3, 0.15)  # of the radius: where a place's own ellipse is looked for
HELD_REACH = 0.35  # of the radius: distance of a place's own ellipse from where the ring has it
HELD_SIZE = 1.5  # ratio of their radii
HELD_WORTH = 0.7  # of a place that has an ellipse of its own, but not the one of the plane
CLEAR = 0.85  # value of a ring, and share of all its rims, that leaves little to look for
HOPELESS = 0.6  # of the best votes: after a clear ring, others with less are no rivals
FOLLOWED_REACHES = (0.8, 0.5, 0.3, 0.15, 0.08)  # of the radius: a frame moves a disc less than that, or is searched
MOST_FITTED = 8  # hypotheses that are drawn to the edges
WORTH = 0.5  # value of a place that is surely there
EMPTY = 0.35  # value of a place below which it counts as empty
SAME_RING = 0.5  # of the discs' radius: rings whose places are nearer are one


@dataclass(frozen=True, eq=False)
class _Ring:
    """A ring in the picture: its plane, and for each place the rim, its residuals (px), and how much of it is there."""

    plane: _Plane
    rims: _Rims
    residuals: np.ndarray
    signs: np.ndarray
    shares: np.ndarray
    held: np.ndarray
    bore: float

    @property
    def values(self):
        """How much each place is there, 0 to 1."""
        seen = np.clip((self.shares - SEEN[0]) / (SEEN[1] - SEEN[0]), 0, 1) * (0.7 + 0.3 * self.shares)
        return np.maximum(seen, HELD_WORTH * self.held)

    def excess(self, max_missing):
        """How many places are empty beyond those that may be."""
        return max(int((self.values < EMPTY).sum()) - max_missing, 0)

    @property
    def score(self):
        return float(self.values.sum() + self.bore)


@dataclass(frozen=True, eq=False)
class _Design:
    """A pattern for the search: places (n, 2) round their middle with mean distance 1, the radius, turns, polarity."""

    places: np.ndarray
    radius: float
    turns: list
    signs: np.ndarray
    middle: np.ndarray
    scale: float
    bore: tuple | None = None

    def with_bore(self):
        """Places, radii (of 1 for a place) and polarities of places and bore together."""
        if self.bore is None:
            return self.places, np.ones(len(self.places)), self.signs
        place, ratio, sign = self.bore
        return np.vstack([self.places, place]), np.append(np.ones(len(self.places)), ratio), np.append(self.signs, sign)

    @property
    def normal_from_pattern(self):
        """The matrix (3, 3) from the pattern's frame to that of `places`."""
        return np.array([[1, 0, -self.middle[0]], [0, 1, -self.middle[1]], [0, 0, self.scale]]) / self.scale


SIGNS = {"bright": 1, "dark": -1, "either": 0}


def _design(pattern):
    """The `_Design` of a `RingPattern`."""
    middle, scale = pattern.places.mean(axis=0), pattern.scale
    places = (pattern.places - middle) / scale
    signs, bore = np.full(len(places), SIGNS[pattern.polarity]), None
    if pattern.bore is not None:
        place = (np.array(pattern.bore.center) - middle) / scale
        bore = place, pattern.bore.radius / pattern.disc_radius, SIGNS[pattern.bore.polarity]
    return _Design(places, pattern.disc_radius / scale, pattern.turns, signs, middle, scale, bore)


def _rings(field, seeds, design, max_missing):
    """The rings of a picture, the best first, each once."""
    maps, votes = _hypotheses(seeds, design.places, design.radius, design.turns)
    found = []
    for homography, vote in zip(maps[:MOST_FITTED], votes[:MOST_FITTED], strict=True):
        if found and vote < HOPELESS * votes[0] and max(ring.values.mean() for ring in found) > CLEAR:
            break
        found += _versions(field, seeds, design, homography)
    found.sort(key=lambda ring: -round(ring.score - ring.excess(max_missing), 4))
    return _without_twins(found, design)


def _versions(field, seeds, design, homography):
    """A hypothesis drawn to the edges from up to three radii, and as the seeds have it."""
    plane = _Plane(homography, design.radius)
    found = []
    for start in _starts(field, plane, design.places, design.signs):
        fit = _fit_plane(field, start, design.places, design.signs, design.radius)
        if fit is not None:
            found.append(_judged(field, seeds, design, *fit))
            if found[-1].shares.min() > CLEAR:
                return found
    if _is_sane(plane, plane.outlines(design.places)):
        found.append(_as_ellipses_say(field, seeds, design, plane))
    return [ring for ring in found if ring is not None]


def _as_ellipses_say(field, seeds, design, plane):
    """The ring of a hypothesis drawn to the ellipses at its places, whatever their edges; None if they say nothing."""
    centers, shapes = plane.ellipses(design.places)
    near = np.linalg.norm(seeds.centers[:, None] - centers, axis=2).argmin(axis=0)
    held = _agreement(centers, shapes, seeds.centers[near], seeds.shapes[near]) * seeds.shares[near]
    if held.sum() < 2 * WORTH:
        return None
    own = _refined(field, centers, shapes, design.signs, OWN_REACHES)
    others = _agreement(centers, shapes, *own[:2]) * own[2]
    by_seed = held >= others
    centers = np.where(by_seed[:, None], seeds.centers[near], own[0])
    shapes = np.where(by_seed[:, None, None], seeds.shapes[near], own[1])
    plane = _fit_to_ellipses(plane, design.places, centers, shapes, np.maximum(held, others), design.radius)
    if plane is None:
        return None
    outlines = plane.outlines(design.places)
    rims, signs = _rims(field, outlines, design.signs, 0.15)
    return _judged(field, seeds, design, plane, rims, rims.offsets * outlines.px, signs)


def _judged(field, seeds, design, plane, rims, residuals, signs):
    """The ring of a fit."""
    px, n = plane.outlines(design.places).px, len(design.places)
    shares = _visible(rims, residuals, np.maximum(TOLERANCE[0], TOLERANCE[1] * px))
    off = np.exp(-0.5 * (np.log(plane.radius / design.radius) / (2 * PROPORTION_SIGMA)) ** 2)
    places, ratios, all_signs = design.with_bore()
    centers, shapes = plane.ellipses(places, plane.radius * ratios)
    own = _refined(field, centers, shapes, all_signs, OWN_REACHES)
    held = _agreement(centers, shapes, *own[:2]) * own[2]
    best = held[:n]
    if len(seeds):
        near = np.linalg.norm(seeds.centers[:, None] - centers[:n], axis=2).argmin(axis=0)
        by_seeds = _agreement(centers[:n], shapes[:n], seeds.centers[near], seeds.shapes[near]) * seeds.shares[near]
        best = np.maximum(best, by_seeds)
    return _Ring(plane, rims, residuals, signs, shares * off, best * off, float(sum(held[n:])))


def _agreement(centers, shapes, own_centers, own_shapes):
    """How near (n,) ellipses are to those of the plane, 1 to 0: by their centres and areas."""
    steps = np.linalg.solve(shapes, (own_centers - centers)[:, :, None])[:, :, 0]
    apart = np.linalg.norm(steps, axis=1) / HELD_REACH
    ratio = np.abs(np.linalg.det(own_shapes)) / np.linalg.det(shapes)
    size = 0.5 * np.log(np.maximum(ratio, 1e-9)) / np.log(HELD_SIZE)
    return np.maximum(1 - apart**2, 0) * np.maximum(1 - size**2, 0)


def _without_twins(rings, design):
    """The rings without those whose places are those of a better one, turned or not."""
    kept, seen = [], []
    for ring in rings:
        spots, jacobians = _images(ring.plane.homography[None], design.places)
        reach = SAME_RING * ring.plane.radius * np.sqrt(np.linalg.det(jacobians).mean())
        if all(np.abs(spots[0] - other).max() > reach for other in seen):
            kept.append(ring)
            seen += [spots[0][turn] for turn in design.turns]
    return kept


def _followed(field, design, previous):
    """The ring of the frame before where it moved little: all rims clear at once; None elsewhere."""
    homography = previous.homography @ np.linalg.inv(design.normal_from_pattern)
    plane = _Plane(homography / homography[2, 2], design.radius)
    radii = np.asarray(previous.peg_radii)[[state == "measured" for state in previous.states]]
    if len(radii) == 0 or not _is_sane(plane, plane.outlines(design.places)):
        return None
    size = np.sqrt(np.linalg.det(plane.ellipses(design.places)[1]))
    plane = _Plane(plane.homography, plane.radius * float(np.median(radii) / np.median(size)))
    fit = _fit_plane(field, plane, design.places, design.signs, plane.radius, FOLLOWED_REACHES)
    if fit is None:
        return None
    ring = _judged(field, _no_seeds(), design, *fit)
    return ring if ring.shares.min() > CLEAR and abs(np.log(fit[0].radius / plane.radius)) < 0.1 else None


def _no_seeds():
    return _Seeds(np.empty((0, 2)), np.empty((0, 2, 2)), np.empty(0), np.empty(0))
