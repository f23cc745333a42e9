"""Rings of equal discs around a bore."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..targets import MOST_PEGS

LARGEST_TILT_RATIO = 0.3  # |F_-1 / F_1| = (1 - cos tilt) / (1 + cos tilt): 57 degrees
RING_TOLERANCE = 0.1  # of the pitch radius: what perspective and measuring may add to the affine image
RADIUS_TOLERANCE = 0.25  # of a disc's radius
BASE_SCALE = (0.7, 1.1)  # scale of the image of the base over that of the pegs' tops
OBLIQUENESS = 0.7  # tangent of the angle between line of sight and hub axis
MOST_NEIGHBOURS = MOST_PEGS  # circles tried as pegs of one bore: the sets of n_pegs among them are all tried
MOST_RINGS = 20


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
    """Indices of the circles whose size and distance allow them to be pegs around a bore."""
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
