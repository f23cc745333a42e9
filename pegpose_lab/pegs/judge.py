"""How well a ring in the plane of a picture agrees with what the picture shows at its places."""

from dataclasses import dataclass

import numpy as np

from .edges import _refined, _Rims, _visible
from .plane import PROPORTION_SIGMA, _Plane

TOLERANCE = (1.0, 0.03)  # px, and part of the radius: how near an edge lies to the outline that it belongs to
SEEN = (0.3, 0.65)  # visible share of an outline with which a place counts as empty, and as full
OWN_REACHES = (0.3, 0.15)  # of the radius: where a place's own ellipse is looked for
HELD_REACH = 0.35  # of the radius: distance of a place's own ellipse from where the ring has it
HELD_SIZE = 1.5  # ratio of their radii
HELD_WORTH = 0.7  # of a place that has an ellipse of its own, but not the one of the plane
WORTH = 0.5  # value of a place, or of a bore, that is surely there
OCCUPIED = 0.75, 0.25  # visible share, and nearness, of an ellipse that fills a place
EMPTY = 0.35  # value of a place below which it counts as empty


@dataclass(frozen=True, eq=False)
class _Own:
    """The places' own ellipses near those of a ring: centres, shapes, visible shares, and how near they are, 0 to 1."""

    centers: np.ndarray
    shapes: np.ndarray
    shares: np.ndarray
    near: np.ndarray

    @property
    def held(self):
        return self.near * self.shares

    def __getitem__(self, rows):
        return _Own(self.centers[rows], self.shapes[rows], self.shares[rows], self.near[rows])


@dataclass(frozen=True, eq=False)
class _Ring:
    """A ring in the picture: its plane, for each place the rim, its residuals (px), how much of it is there, and its own
    ellipse; how clear the bore is."""

    plane: _Plane
    rims: _Rims
    residuals: np.ndarray
    signs: np.ndarray
    shares: np.ndarray
    own: _Own
    bore: float
    off: float

    @property
    def values(self):
        """How much each place is there, 0 to 1."""
        shares = self.shares * self.off
        seen = np.clip((shares - SEEN[0]) / (SEEN[1] - SEEN[0]), 0, 1) * (0.7 + 0.3 * shares)
        return np.maximum(seen, HELD_WORTH * self.own.held * self.off)

    @property
    def empty(self):
        """Which places (n,) are empty: one with a clear ellipse near by is not, even if the ring has it elsewhere."""
        occupied = (self.own.shares > OCCUPIED[0]) & (self.own.near > OCCUPIED[1])
        return (self.values < EMPTY) & ~occupied

    def excess(self, max_missing):
        """How many places are empty beyond those that may be."""
        return max(int(self.empty.sum()) - max_missing, 0)

    @property
    def score(self):
        return float(self.values.sum() + self.bore)

    def rank(self, max_missing):
        """By which rings are sorted: the score, less one for each place that must not be empty."""
        return round(self.score - self.excess(max_missing), 4)


def _judged(field, seeds, design, plane, rims, residuals, signs):
    """The ring of a fit."""
    n = len(design.places)
    shares = _visible(rims, residuals, _tolerance(plane, design))
    off = float(np.exp(-0.5 * (np.log(plane.radius / design.radius) / (2 * PROPORTION_SIGMA)) ** 2))
    own = _own(field, seeds, plane, *design.with_bore())
    return _Ring(plane, rims, residuals, signs, shares, own[:n], float(own[n:].held.sum()), off)


def _tolerance(plane, design):
    """How near an edge lies to the outline that it belongs to, px: (n, N_RAYS)."""
    return np.maximum(TOLERANCE[0], TOLERANCE[1] * plane.outlines(design.places).px)


def _own(field, seeds, plane, places, ratios, signs):
    """The ellipses at places: drawn to the edges from where the ring has them, or the nearest seeds if those agree better."""
    centers, shapes = plane.ellipses(places, plane.radius * ratios)
    drawn = _refined(field, centers, shapes, signs, OWN_REACHES)[:3]
    own = _Own(*drawn, _agreement(centers, shapes, *drawn[:2]))
    if len(seeds) == 0:
        return own
    near = np.linalg.norm(seeds.centers[:, None] - centers, axis=2).argmin(axis=0)
    agreement = _agreement(centers, shapes, seeds.centers[near], seeds.shapes[near])
    agreement *= (signs == 0) | (signs == seeds.signs[near])
    better = agreement * seeds.shares[near] > own.held + 1e-6
    return _Own(
        np.where(better[:, None], seeds.centers[near], own.centers),
        np.where(better[:, None, None], seeds.shapes[near], own.shapes),
        np.where(better, seeds.shares[near], own.shares),
        np.where(better, agreement, own.near),
    )


def _agreement(centers, shapes, own_centers, own_shapes, reach=HELD_REACH):
    """How near (n,) ellipses are to those of the plane, 1 to 0: by their centres and areas."""
    steps = np.linalg.solve(shapes, (own_centers - centers)[:, :, None])[:, :, 0]
    apart = np.linalg.norm(steps, axis=1) / reach
    ratio = np.abs(np.linalg.det(own_shapes)) / np.linalg.det(shapes)
    size = 0.5 * np.log(np.maximum(ratio, 1e-9)) / np.log(HELD_SIZE)
    return np.maximum(1 - apart**2, 0) * np.maximum(1 - size**2, 0)
