"""A pattern in the form that the search for its ring uses."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np


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


@lru_cache(maxsize=16)
def _design(pattern):
    """The `_Design` of a `RingPattern`."""
    middle, scale = pattern.places.mean(axis=0), pattern.scale
    places = (pattern.places - middle) / scale
    signs, bore = np.full(len(places), SIGNS[pattern.polarity]), None
    if pattern.bore is not None:
        place = (np.array(pattern.bore.center) - middle) / scale
        bore = place, pattern.bore.radius / pattern.disc_radius, SIGNS[pattern.bore.polarity]
    return _Design(places, pattern.disc_radius / scale, pattern.turns, signs, middle, scale, bore)
