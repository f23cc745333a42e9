"""What each peg of a hub meets when a wheel is put on from a given pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_points, as_pose
from .leading import led_in
from .sections import farthest, in_tilt_axes, reaches
from .wheel import Wheel, as_pair

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..targets import Hub

MEETINGS = ("free", "wall", "chamfer", "blocked")  # in the order of what a wheel with several of them counts as
HALVINGS = 50  # of the depth at which a peg meets the wall: to 1e-14 mm of a peg of 20 mm


@dataclass(frozen=True, eq=False)
class Entry:
    """What the pegs meet on a straight insertion along the wheel's axis.

    Attributes
    ----------
    meetings : tuple of str
        What each peg meets first on this path: "free" (nothing, down to its full height), "wall" (the wall of the hole at
        `depths`, because of the tilt), "chamfer" (which leads it into the hole if the wheel can give way) or "blocked" (the
        face).
    tops, mouths : (n,) ndarray
        Room, mm, between the peg and the straight part of its hole, at its top when it enters and at the mouth of the
        seated wheel.  Negative without room: -0.3 at a top is 0.3 mm up the chamfer.
    depths : (n,) ndarray
        Depth of the wheel's face under the plane of the peg tops, mm along the wheel's axis, that each peg leaves free:
        the hub's `peg_height` if it meets nothing.  A chamfer or the face is met at the peg's own top.
    outcome : str
        What the wheel meets: the last of "free", "wall", "chamfer" and "blocked" that a peg meets; but "chamfer" in place of
        "blocked" if other pegs, whose chamfers are met earlier, move the wheel in time (see `leading.led_in`).

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> tilted = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0.05, 0]))
    >>> entry = pl.peg_entry(tilted, pl.Hub(), pl.Wheel(clearance=0.5))
    >>> entry.outcome, entry.enters, entry.depths.round(1).tolist()
    ('wall', True, [12.0, 10.7, 9.5, 10.7])
    """

    meetings: tuple[str, ...]
    tops: np.ndarray
    mouths: np.ndarray
    depths: np.ndarray
    outcome: str

    @property
    def enters(self) -> bool:
        """Whether every peg comes into its hole, by itself or led by the chamfers."""
        return self.outcome != "blocked"


def peg_entry(hub_from_wheel: RigidTransform, hub: Hub, wheel: Wheel, hole_offsets: ArrayLike | None = None) -> Entry:
    """Return what each peg meets when the wheel moves from a pose along its own axis.

    On the straight path the geometry is exact for rigid parts, at any tilt: see `sections.reaches`.  Whether the wheel enters
    holds for a hand that gives way sideways and to a turn about the wheel's axis, but not to a tilt: see `leading.led_in`.

    Parameters
    ----------
    hub_from_wheel : RigidTransform
        Of the wheel with its face at the plane of the peg tops: the identity is the ideal.
    hub, wheel : Hub, Wheel
    hole_offsets : (n, 2) array_like, optional
        Of the holes' axes from their nominal places, mm in the wheel frame.

    Returns
    -------
    Entry

    Raises
    ------
    ValueError
        If an argument is unusable, the wheel does not belong to the hub, or its axis points away from it.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> import pegpose_lab as pl
    >>> hub, wheel = pl.Hub(), pl.Wheel(clearance=0.5, chamfer=1.0)
    >>> for shift in (0.3, 1.2, 1.8):
    ...     print(peg_entry(RigidTransform.from_translation([shift, 0, 0]), hub, wheel).outcome)
    free
    chamfer
    blocked
    """
    pose = as_pose(hub_from_wheel, "hub_from_wheel")
    as_pair(hub, wheel)
    holes = wheel.hole_centers
    if hole_offsets is not None:
        offsets = as_points(hole_offsets, 2, "hole_offsets")
        if offsets.shape != holes.shape:
            raise ValueError(f"hole_offsets has shape {offsets.shape}; expected {holes.shape}, one for each hole")
        holes = holes + offsets
    inverse = pose.inv()
    axis = inverse.rotation.apply([0.0, 0.0, 1.0])
    if axis[2] < 0.5:
        raise ValueError("hub_from_wheel tilts the wheel by more than 60 degrees; expected z axes that nearly agree")
    tops = inverse.apply(hub.peg_centers)
    top, mouth = reaches(tops, axis, holes, hub, wheel)
    radius = hub.peg_radius + wheel.clearance
    numbers = meeting_numbers(radius - top, radius - mouth, wheel.chamfer)
    led = led_in(tops[None], axis[None], holes[None], top[None], hub, wheel)[0]
    outcome = MEETINGS[min(numbers.max(), 2 if led else 3)]
    depths = _depths(tops, axis, holes, hub, wheel)
    # a chamfer or the face is met at the peg's top, as far as the wheel has to come to it
    depths = np.where(top > radius, np.clip(tops[:, 2], 0.0, hub.peg_height), depths)
    return Entry(tuple(MEETINGS[k] for k in numbers), radius - top, radius - mouth, depths, outcome)


def meeting_numbers(tops: NDArray[np.float64], mouths: NDArray[np.float64], chamfer: float) -> NDArray[np.int64]:
    """Return the places in `MEETINGS` of what pegs meet, from their room (..., n) at tops and mouths, mm.

    Examples
    --------
    >>> meeting_numbers(np.array([0.1, 0.1, -0.1, -2.0]), np.array([0.1, -0.1, 0.1, 0.1]), 1.0).tolist()
    [0, 1, 2, 3]
    """
    return np.select([tops < -chamfer, tops < 0, mouths < 0], [3, 2, 1], 0)


def _depths(tops, axis, holes, hub, wheel):
    """The depths (n,), mm, at which the mouths' sections touch the walls: by halving, since their room is concave."""
    top, _, slope, cosine = in_tilt_axes(tops, axis, holes)
    radius, lift = hub.peg_radius, wheel.chamfer + tops[:, 2]
    low, high = np.clip(lift, 0.0, hub.peg_height), np.full(len(tops), hub.peg_height)

    def room(depth):
        mouth = top + (np.maximum(depth - lift, 0.0) * slope / cosine)[:, None] * np.array([0.0, 1.0])
        return radius + wheel.clearance - farthest(mouth, radius, radius / cosine)

    whole = room(high) >= 0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        free = room(middle) >= 0
        low, high = np.where(free, middle, low), np.where(free, high, middle)
    return np.where(whole, hub.peg_height, low)
