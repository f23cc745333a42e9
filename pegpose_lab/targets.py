"""Geometry of the targets that the camera sees: a checkerboard, and a wheel hub with pegs (Sect. 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .checks import as_count, as_number
from .patterns import RingMark, RingPattern

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_PEGS = 14  # the largest number of pegs around a bore that `locate_pegs` can handle


@dataclass(frozen=True)
class Checkerboard:
    """A checkerboard of columns x rows inner corners.

    The board frame has its origin in the first corner, x along a row and y along a column.

    Parameters
    ----------
    columns, rows : int
        Inner corners along x and y, at least 2 each.
    square : float
        Pitch of the corners, mm.

    Raises
    ------
    ValueError
        If a number is not usable.

    Examples
    --------
    >>> board = Checkerboard(columns=3, rows=2, square=10.0)
    >>> board.object_points.tolist()[:4]
    [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 10.0, 0.0]]
    >>> board.center.tolist()
    [10.0, 5.0, 0.0]
    """

    columns: int = 8
    rows: int = 6
    square: float = 29.0

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            object.__setattr__(self, name, as_count(getattr(self, name), name, 2))
        as_number(self.square, "square", 0, exclusive=True)

    @property
    def object_points(self) -> NDArray[np.float64]:
        """(rows * columns, 3) mm, row by row, in the plane z = 0."""
        y, x = np.mgrid[: self.rows, : self.columns] * float(self.square)
        return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])

    @property
    def center(self) -> NDArray[np.float64]:
        """Middle of the corners (3,), mm in the board frame."""
        return self.object_points.mean(axis=0)


@dataclass(frozen=True)
class Hub:
    """A wheel hub: pegs on a pitch circle, a bore in the middle, two screws in the gaps between pegs.

    The hub frame has its origin in the hub's centre in the plane of the peg tops, x towards peg 1 and z
    away from the camera; the base, with bore and screws, lies at z = `peg_height`.  Table 2 gives the
    pitch circle (its four pegs, at 0.207 mm/px) and Table 3 the radius of a peg; the rest is not printed.

    Parameters
    ----------
    n_pegs : int
        3 to 14; hubs with more pegs cannot be located.
    pitch_circle_diameter, peg_radius, peg_height, bore_radius, screw_radius, screw_circle_diameter, radius : float
        mm; `radius` is the base's outer radius.
    screw_angles : tuple of float
        rad about z from peg 1; at least one, because the pegs cannot be labelled without a screw.  The first one lies in
        the gap before peg 1.  By default the screws lie in the middle of that gap and of the gap opposite to it.

    Raises
    ------
    ValueError
        If a number is not usable, or parts overlap.

    Examples
    --------
    >>> hub = Hub(n_pegs=4, pitch_circle_diameter=100.0, peg_radius=10.0)
    >>> (hub.peg_centers.round(3) + 0.0).tolist()
    [[50.0, 0.0, 0.0], [0.0, 50.0, 0.0], [-50.0, 0.0, 0.0], [0.0, -50.0, 0.0]]
    """

    n_pegs: int = 4
    pitch_circle_diameter: float = 97.05
    peg_radius: float = 10.1
    bore_radius: float = 18.0
    screw_radius: float = 4.5
    peg_height: float = 20.0
    screw_circle_diameter: float = 80.0
    radius: float = 68.0
    screw_angles: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "n_pegs", as_count(self.n_pegs, "n_pegs", 3, MOST_PEGS))
        for name in ("pitch_circle_diameter", "peg_radius", "bore_radius", "screw_radius", "screw_circle_diameter"):
            as_number(getattr(self, name), name, 0, exclusive=True)
        as_number(self.peg_height, "peg_height", 0)
        as_number(self.radius, "radius", self.pitch_circle_diameter / 2)
        if self.screw_angles is None:
            gap = 2 * np.pi / self.n_pegs
            object.__setattr__(self, "screw_angles", (-gap / 2, gap * (self.n_pegs // 2) - gap / 2))
        if np.ndim(self.screw_angles) != 1 or len(self.screw_angles) == 0:
            raise ValueError(f"screw_angles is {self.screw_angles!r}; expected at least one angle, rad")
        angles = [as_number(angle, f"screw_angles[{k}]") for k, angle in enumerate(self.screw_angles)]
        object.__setattr__(self, "screw_angles", tuple(angles))
        if self.peg_radius >= self.pitch_circle_diameter / 2 * np.sin(np.pi / self.n_pegs):
            raise ValueError(
                f"peg_radius is {self.peg_radius:g} mm; {self.n_pegs} such pegs overlap on the pitch circle"
            )

    @property
    def peg_angles(self) -> NDArray[np.float64]:
        """(n_pegs,) rad about z: 2 pi (k - 1)/n for peg k."""
        return 2 * np.pi * np.arange(self.n_pegs) / self.n_pegs

    @property
    def peg_centers(self) -> NDArray[np.float64]:
        """Centres of the peg tops (n_pegs, 3), mm in the hub frame, z = 0."""
        return _on_circle(self.pitch_circle_diameter / 2, self.peg_angles, 0.0)

    @property
    def screw_centers(self) -> NDArray[np.float64]:
        """Centres of the screws (n_screws, 3), mm in the hub frame, z = peg_height."""
        return _on_circle(self.screw_circle_diameter / 2, np.asarray(self.screw_angles), self.peg_height)

    @property
    def bore_center(self) -> NDArray[np.float64]:
        """Centre of the bore (3,), mm in the hub frame."""
        return np.array([0.0, 0.0, self.peg_height])

    @property
    def pattern(self) -> RingPattern:
        """The pegs as a `RingPattern`, mm; bore and screws are marks in the plane of the peg tops, as seen from above."""
        screws = [RingMark(tuple(screw[:2].tolist()), self.screw_radius) for screw in self.screw_centers]
        return RingPattern(
            self.n_pegs,
            pitch_radius=self.pitch_circle_diameter / 2,
            disc_radius=self.peg_radius,
            bore=self.bore_radius,
            marks=screws,
        )


def _on_circle(radius, angles, z):
    """Points (n, 3) at `angles` on a circle about the z axis."""
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(len(angles), z)])
