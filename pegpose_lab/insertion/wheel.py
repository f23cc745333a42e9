"""The part that goes onto the hub: a wheel with a chamfered hole for every peg."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_count, as_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..targets import Hub


@dataclass(frozen=True)
class Wheel:
    """A wheel: straight through holes on a pitch circle, with a chamfer of 45 degrees on the side of the hub.

    The wheel frame has its origin in the centre of the pitch circle in the face that meets the hub, x towards hole 1
    and z out of that face, the direction of insertion: the wheel fills -thickness <= z <= 0.  Hole k belongs to peg k.
    On the hub, the two frames differ by a shift along z alone.

    Parameters
    ----------
    n_holes : int
        At least 3.
    pitch_circle_diameter : float
        mm.
    clearance : float
        Radius of a hole minus that of a peg, mm.
    chamfer : float
        Width of the chamfer, mm, which is its depth, too.  A chamfer on the pegs' edges catches the same offsets: give
        the sum of both widths.
    thickness : float
        mm, more than the chamfer.
    position_tolerance : float
        Diameter, mm, of the zone about its nominal place in which a hole's axis lies (ISO 1101).

    Raises
    ------
    ValueError
        If a number is not usable.

    Examples
    --------
    >>> wheel = Wheel(n_holes=4, pitch_circle_diameter=100.0)
    >>> (wheel.hole_centers.round(3) + 0.0).tolist()
    [[50.0, 0.0], [0.0, 50.0], [-50.0, 0.0], [0.0, -50.0]]
    """

    n_holes: int = 4
    pitch_circle_diameter: float = 97.05
    clearance: float = 0.5
    chamfer: float = 1.0
    thickness: float = 15.0
    position_tolerance: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "n_holes", as_count(self.n_holes, "n_holes", 3))
        as_number(self.pitch_circle_diameter, "pitch_circle_diameter", 0, exclusive=True)
        as_number(self.clearance, "clearance", 0, exclusive=True)
        as_number(self.chamfer, "chamfer", 0)
        as_number(self.position_tolerance, "position_tolerance", 0)
        as_number(self.thickness, "thickness", self.chamfer, exclusive=True)

    @property
    def hole_centers(self) -> NDArray[np.float64]:
        """Nominal centres of the holes (n_holes, 2), mm in the wheel frame."""
        angles = 2 * np.pi * np.arange(self.n_holes) / self.n_holes
        return self.pitch_circle_diameter / 2 * np.column_stack([np.cos(angles), np.sin(angles)])


def as_pair(hub: Hub, wheel: Wheel) -> None:
    """Check that `wheel` is made for `hub`.

    Raises
    ------
    ValueError
        If the numbers of pegs and holes differ, the pegs have no height, or the holes overlap.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> as_pair(pl.Hub(n_pegs=4), Wheel(n_holes=4))
    """
    if wheel.n_holes != hub.n_pegs:
        raise ValueError(f"wheel has {wheel.n_holes} holes and hub {hub.n_pegs} pegs; expected as many")
    if hub.peg_height <= wheel.chamfer:
        raise ValueError(
            f"hub has pegs of peg_height {hub.peg_height:g} mm and wheel a chamfer of {wheel.chamfer:g} mm; expected pegs "
            "that reach beyond the chamfer"
        )
    mouth = hub.peg_radius + wheel.clearance + wheel.chamfer
    room = wheel.pitch_circle_diameter / 2 * np.sin(np.pi / wheel.n_holes)
    if mouth >= room:
        raise ValueError(f"wheel has holes of radius {mouth:g} mm with their chamfers; expected less than {room:g} mm")
