"""A ring of equal discs in one plane, described in words and numbers: `RingPattern`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .checks import as_choice, as_count, as_number, as_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

MOST_PLACES = 24  # of a ring: with more, neighbours lie nearer than what tilt and perspective move them
POLARITIES = ("bright", "dark", "either")
SAME_PLACE = 1e-6  # of the pitch radius: places nearer to each other are one


@dataclass(frozen=True)
class RingMark:
    """A disc that is not one of the ring's places: a screw, a notch, a hole of another size, or the bore.

    Parameters
    ----------
    center : (x, y)
        In the pattern's frame and unit.
    radius : float
    polarity : {"bright", "dark", "either"}

    Raises
    ------
    ValueError
        If a value is not usable.

    Examples
    --------
    >>> RingMark((30, 0), 4.5, "dark")
    RingMark(center=(30.0, 0.0), radius=4.5, polarity='dark')
    """

    center: tuple[float, float]
    radius: float
    polarity: str = "bright"

    def __post_init__(self) -> None:
        point = as_points([self.center], 2, "center")[0]
        object.__setattr__(self, "center", (float(point[0]), float(point[1])))
        object.__setattr__(self, "radius", as_number(self.radius, "radius", 0, exclusive=True))
        as_choice(self.polarity, "polarity", POLARITIES)


@dataclass(frozen=True)
class RingPattern:
    """A ring of equal discs in one plane, as it should be: the places, the bore, the marks.

    The frame has its origin in the ring's centre; x leads to place 1 of n equal places and y to the
    right of it, clockwise on the screen, as for `Hub`.  Lengths are in mm, or in any one unit.

    Parameters
    ----------
    n : int, optional
        1. places at equal angles, the first at angle 0: 3 to 24.
    angles : (n,) rad, optional
        2. places at these angles, clockwise: 10 of 14 places of a dial, for example.
    centers : (n, 2), optional
        3. places anywhere: a rectangle, two radii.  Exactly one of the three is given.
    pitch_radius : float or (n,), optional
        Distance of the places from the ring's centre; not used with `centers`, where it can only be checked.
    disc_radius : float
        Radius of the discs; 25 % off is no hindrance, since the picture tells it.
    polarity : {"bright", "dark", "either"}
        Whether the discs are brighter or darker than what surrounds them; "either" also allows a mixture.
    bore : float, (radius, polarity) or RingMark, optional
        A disc round the origin; a number has the places' polarity.
    marks : sequence of RingMark
        What tells the places apart.  Without marks the labels of a symmetric ring cannot be told.
    max_missing : int
        Places that may be empty; with more the ring counts as not found.

    Raises
    ------
    ValueError
        If a value is not usable, or discs overlap.

    Examples
    --------
    >>> RingPattern(4, pitch_radius=50.0, disc_radius=10.0, bore=(18.0, "dark")).places.round(3).tolist()
    [[50.0, 0.0], [0.0, 50.0], [-50.0, 0.0], [-0.0, -50.0]]
    >>> rectangle = RingPattern(centers=[[-60, -50], [60, -50], [60, 50], [-60, 50]], disc_radius=8.0)
    >>> rectangle.n_places, [turn.tolist() for turn in rectangle.turns]
    (4, [[0, 1, 2, 3], [2, 3, 0, 1]])
    """

    n: int | None = None
    angles: Sequence[float] | None = None
    centers: ArrayLike | None = None
    pitch_radius: float | Sequence[float] | None = None
    disc_radius: float = 0.0
    polarity: str = "bright"
    bore: RingMark | None = None
    marks: tuple[RingMark, ...] = ()
    max_missing: int = 0

    def __init__(
        self,
        n: int | None = None,
        *,
        angles: Sequence[float] | None = None,
        centers: ArrayLike | None = None,
        pitch_radius: float | Sequence[float] | None = None,
        disc_radius: float,
        polarity: str = "bright",
        bore: float | tuple[float, str] | RingMark | None = None,
        marks: Sequence[RingMark] = (),
        max_missing: int = 0,
    ) -> None:
        polarity = as_choice(polarity, "polarity", POLARITIES)
        values = {
            **_as_places(n, angles, centers, pitch_radius),
            "disc_radius": as_number(disc_radius, "disc_radius", 0, exclusive=True),
            "polarity": polarity,
            "bore": _as_bore(bore, polarity),
            "marks": _as_marks(marks),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "max_missing", as_count(max_missing, "max_missing", 0, self.n_places - 1))
        _check_overlap(self)

    @property
    def places(self) -> NDArray[np.float64]:
        """Centres of the places (n_places, 2), in label order."""
        if self.centers is not None:
            return np.array(self.centers)
        angles = np.arange(self.n) * (2 * np.pi / self.n) if self.angles is None else np.array(self.angles)
        return np.column_stack([np.cos(angles), np.sin(angles)]) * np.reshape(self.pitch_radius, (-1, 1))

    @property
    def n_places(self) -> int:
        """Number of places."""
        if self.n is not None:
            return self.n
        return len(self.angles if self.centers is None else self.centers)

    @property
    def scale(self) -> float:
        """Mean distance of the places from the middle of the places."""
        return float(np.linalg.norm(self.places - self.places.mean(axis=0), axis=1).mean())

    @property
    def turns(self) -> list[NDArray[np.intp]]:
        """The turns that leave places and bore as they are: arrays (n_places,) of the place to which each place comes.

        The first changes nothing.  Marks are not looked at: they decide between these turns.
        """
        middle = self.places.mean(axis=0)
        places = (self.places - middle) @ (1, 1j)
        far = int(np.argmax(np.abs(places)))
        still = self.bore is None or np.linalg.norm(middle - self.bore.center) < SAME_PLACE * self.scale
        found = []
        for other in places if still else places[far : far + 1]:
            if abs(abs(other) - abs(places[far])) > SAME_PLACE * self.scale:
                continue
            apart = np.abs(places[:, None] * (other / places[far]) - places)
            if (apart.min(axis=1) < SAME_PLACE * self.scale).all():
                found.append(apart.argmin(axis=1))
        return sorted(found, key=lambda turn: turn.tolist())


def _as_places(n, angles, centers, pitch_radius):
    """The checked places, as fields."""
    if sum(given is not None for given in (n, angles, centers)) != 1:
        raise ValueError("expected exactly one of n, angles and centers")
    if centers is not None:
        centers = as_points(centers, 2, "centers", 3)
        count = len(centers)
        reach = np.linalg.norm(centers, axis=1)
        if pitch_radius is not None and not 0.99 * reach.min() <= np.mean(pitch_radius) <= 1.01 * reach.max():
            raise ValueError(f"pitch_radius is {pitch_radius!r}; centers give {reach.min():g} to {reach.max():g}")
        centers = tuple(map(tuple, centers.tolist()))
    else:
        if n is not None:
            count = n = as_count(n, "n", 3, MOST_PLACES)
        else:
            angles = tuple(as_number(angle, f"angles[{k}]") for k, angle in enumerate(np.ravel(angles)))
            count = len(angles)
        pitch_radius = _as_pitch_radius(pitch_radius, count)
    if not 3 <= count <= MOST_PLACES:
        raise ValueError(f"there are {count} places; expected 3 to {MOST_PLACES}")
    return {"n": n, "angles": angles, "centers": centers, "pitch_radius": pitch_radius}


def _as_pitch_radius(pitch_radius, count):
    """A number, or a tuple with one for each place."""
    if np.ndim(pitch_radius) == 0:
        return as_number(pitch_radius, "pitch_radius", 0, exclusive=True)
    if np.shape(pitch_radius) != (count,):
        raise ValueError(f"pitch_radius has shape {np.shape(pitch_radius)}; expected a number or ({count},)")
    return tuple(as_number(value, f"pitch_radius[{k}]", 0, exclusive=True) for k, value in enumerate(pitch_radius))


def _as_bore(bore, polarity):
    """The bore as a mark round the origin."""
    if bore is None or isinstance(bore, RingMark):
        return bore
    if np.ndim(bore) == 0 and not isinstance(bore, str):
        return RingMark((0.0, 0.0), bore, polarity)
    if isinstance(bore, str) or len(bore) != 2:
        raise ValueError(f"bore is {bore!r}; expected a radius, a pair (radius, polarity) or a RingMark")
    return RingMark((0.0, 0.0), *bore)


def _as_marks(marks):
    """A tuple of marks."""
    if isinstance(marks, RingMark):
        return (marks,)
    marks = tuple(marks)
    for k, mark in enumerate(marks):
        if not isinstance(mark, RingMark):
            raise ValueError(f"marks[{k}] is {mark!r}; expected a RingMark")
    return marks


def _check_overlap(pattern):
    """Raise if places overlap or coincide."""
    places, rows = pattern.places, np.arange(pattern.n_places)
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.where(rows[:, None] == rows, np.inf, 0)
    if apart.min() < 2 * pattern.disc_radius * (1 - SAME_PLACE):
        raise ValueError(
            f"disc_radius is {pattern.disc_radius:g}, but places are only {apart.min():g} apart: their discs overlap"
        )
