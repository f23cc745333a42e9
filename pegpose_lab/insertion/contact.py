"""Forces between pegs and holes: where a wheel wedges, and which load jams it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linprog

from ..checks import as_number, as_points
from .wheel import Wheel, as_pair

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..targets import Hub

RAYS = 16  # of a pyramid in place of a friction cone: at worst it has cos(pi/16), 98 %, of the friction
BALANCED = 1e-7  # of a unit force, what may be left of a balance: the linear programme's own tolerance
HALVINGS = 20  # of the wedging depth: to 2e-5 mm of a peg of 20 mm


@dataclass(frozen=True, eq=False)
class Contacts:
    """Where pegs touch a wheel.

    Attributes
    ----------
    points : (m, 3) ndarray
        mm in the wheel frame.
    normals : (m, 3) ndarray
        Unit vectors of the force that a peg without friction exerts on the wheel: into the wheel's material.

    Examples
    --------
    >>> Contacts(np.array([[10.0, 0, -5], [-10, 0, -1]]), np.array([[1.0, 0, 0], [-1, 0, 0]])).wrenches(0.0).shape
    (6, 32)
    """

    points: np.ndarray
    normals: np.ndarray

    def wrenches(self, friction: float) -> NDArray[np.float64]:
        r"""Return the edges (6, m `RAYS`) of the cone of the wrenches that the contacts can exert on the wheel.

        A contact's force lies in its friction cone, of which `RAYS` edges stand for all: the normal plus
        :math:`\mu` times a tangent.  A wrench is a force, N, and its moment about the wheel frame's origin, N mm.
        """
        along = np.array([0.0, 0.0, 1.0]) - self.normals[:, 2:] * self.normals  # the direction of insertion is an edge
        flat = np.linalg.norm(along, axis=1) < 1e-9
        along[flat] = np.cross(self.normals[flat], [1.0, 0.0, 0.0])
        along /= np.linalg.norm(along, axis=1)[:, None]
        across = np.cross(self.normals, along)
        angles = 2 * np.pi * np.arange(RAYS)[:, None, None] / RAYS
        forces = self.normals + friction * (np.cos(angles) * along + np.sin(angles) * across)
        moments = np.cross(np.broadcast_to(self.points, forces.shape), forces)
        return np.concatenate([forces, moments], axis=2).reshape(-1, 6).T


def two_point_contacts(hub: Hub, wheel: Wheel, depth: float, direction: float = 0.0) -> Contacts:
    """Return the contacts of a wheel that is tilted until every peg touches its hole twice.

    Each peg touches with its top, on the side of `direction`, and at the mouth of the hole's straight part, on the other
    side.  The tilt, clearance over depth, is small: the normals are those of the upright hole.

    Parameters
    ----------
    hub, wheel : Hub, Wheel
    depth : float
        Of the wheel's face under the peg tops, mm: more than the chamfer, at most the hub's `peg_height`.
    direction : float
        Of the side where the tops touch, rad about z from the wheel's x axis.

    Raises
    ------
    ValueError
        If an argument is unusable, or the wheel does not belong to the hub.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> contacts = two_point_contacts(pl.Hub(), pl.Wheel(clearance=0.5, chamfer=1.0), 10.0)
    >>> len(contacts.points), contacts.points[[0, 4]].round(3).tolist()  # top and mouth at peg 1
    (8, [[59.125, 0.0, -10.0], [37.925, 0.0, -1.0]])
    """
    as_pair(hub, wheel)
    depth = as_number(depth, "depth", wheel.chamfer, hub.peg_height)
    direction = as_number(direction, "direction")
    side = np.array([np.cos(direction), np.sin(direction), 0.0])
    radius = hub.peg_radius + wheel.clearance
    axes = np.column_stack([wheel.hole_centers, np.zeros(wheel.n_holes)])
    tops = axes + radius * side - [0.0, 0.0, min(depth, wheel.thickness)]
    mouths = axes - radius * side - [0.0, 0.0, wheel.chamfer]
    return Contacts(np.vstack([tops, mouths]), np.repeat([side, -side], wheel.n_holes, axis=0))


def can_wedge(contacts: Contacts, friction: float) -> bool:
    r"""Whether contact forces can hold the wheel without any load: it stays stuck whatever pushes it.

    Forces f within the friction cones that balance themselves: of the linear programme

    .. math:: W f = 0, \quad \textstyle\sum f = 1, \quad f \ge 0

    only the feasibility is asked.  For one peg in the plane it is Whitney's rule, depth / diameter < :math:`\mu`.

    Parameters
    ----------
    contacts : Contacts
    friction : float
        Coefficient of friction.

    Returns
    -------
    bool

    Raises
    ------
    ValueError
        If an argument is unusable.

    References
    ----------
    D. E. Whitney, "Quasi-static assembly of compliantly supported rigid parts", Journal of Dynamic Systems, Measurement, and
    Control 104(1), 1982.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> hub, wheel = pl.Hub(), pl.Wheel()
    >>> [can_wedge(two_point_contacts(hub, wheel, depth), 0.1) for depth in (5.0, 15.0)]
    [True, False]
    """
    edges = _scaled(_checked(contacts).wrenches(as_number(friction, "friction", 0)), contacts)
    equations = np.vstack([edges, np.ones(edges.shape[1])])
    return _solved(np.zeros(edges.shape[1]), equations, np.append(np.zeros(6), 1.0)) is not None


def wedging_depth(hub: Hub, wheel: Wheel, friction: float, direction: float = 0.0) -> float:
    r"""Return the depth, mm, down to which two-point contact can wedge the wheel.

    Two contacts hold each other if the line between them lies in both friction cones.  The deeper, the steeper it is: one
    peg wedges down to :math:`\mu d` of its straight part.  Of several pegs, the top of one and the mouth of another, far
    from it, wedge down to :math:`\mu` times their distance.

    Parameters
    ----------
    hub, wheel : Hub, Wheel
    friction : float
        Coefficient of friction.
    direction : float
        As in `two_point_contacts`.

    Returns
    -------
    float
        As `depth` in `two_point_contacts`: the hub's `peg_height` if the wheel can wedge all the way.

    Raises
    ------
    ValueError
        If an argument is unusable, or the wheel does not belong to the hub.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> hub, wheel = pl.Hub(pitch_circle_diameter=100.0), pl.Wheel(pitch_circle_diameter=100.0, chamfer=1.0)
    >>> round(wedging_depth(hub, wheel, 0.1), 2)  # 1 + 0.1 (100 + 2 x 10.6)
    13.12
    """
    as_pair(hub, wheel)
    low, high = wheel.chamfer, hub.peg_height
    if can_wedge(two_point_contacts(hub, wheel, high, direction), friction):
        return high
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if can_wedge(two_point_contacts(hub, wheel, middle, direction), friction):
            low = middle
        else:
            high = middle
    return low


def jamming_load(contacts: Contacts, friction: float, wrench: ArrayLike, disturbance: ArrayLike) -> float:
    r"""Return how much of a disturbance, added to the load that inserts the wheel, makes it jam.

    A load jams if the contacts can balance it, so that nothing moves; the least multiple s that does is that of the linear
    programme

    .. math:: \min s \quad \text{with} \quad W f + w + s\,u = 0, \quad f \ge 0, \quad s \ge 0

    It gives the sides of Whitney's jamming diagram.

    Parameters
    ----------
    contacts : Contacts
    friction : float
        Coefficient of friction.
    wrench, disturbance : (6,) array_like
        w and u: force, N, and moment, N mm, about the origin of the wheel frame; insertion is a force along +z.

    Returns
    -------
    float
        0 if the load jams by itself, infinite if no multiple does.

    Raises
    ------
    ValueError
        If an argument is unusable.

    Examples
    --------
    >>> contacts = Contacts(np.array([[10.0, 0, -15], [-10, 0, -5]]), np.array([[1.0, 0, 0], [-1, 0, 0]]))
    >>> push, moment = [0, 0, 1.0, 0, 0, 0], [0, 0, 0, 0, 1.0, 0]
    >>> round(jamming_load(contacts, 0.2, push, moment), 6)  # N mm: depth / (2 mu), Whitney's lambda times the radius
    25.0
    """
    edges = _checked(contacts).wrenches(as_number(friction, "friction", 0))
    loads = [as_points([load], 6, name)[0] for load, name in ((wrench, "wrench"), (disturbance, "disturbance"))]
    edges, load, extra = (_scaled(part, contacts) for part in (edges, loads[0][:, None], loads[1][:, None]))
    if not np.any(load) or not np.any(extra):
        raise ValueError("wrench and disturbance are zero in part; expected two loads other than zero")
    unit, other = np.abs(load).max(), np.abs(extra).max()
    cost = np.append(np.zeros(edges.shape[1]), 1.0)
    found = _solved(cost, np.hstack([edges, extra / other]), -load[:, 0] / unit)
    return np.inf if found is None else max(float(found * unit / other), 0.0)


def _checked(contacts):
    """The contacts, if they are some."""
    points, normals = (
        as_points(contacts.points, 3, "contacts.points"),
        as_points(contacts.normals, 3, "contacts.normals"),
    )
    if points.shape != normals.shape or np.abs(np.linalg.norm(normals, axis=1) - 1).max() > 1e-6:
        raise ValueError(
            f"contacts.normals has shape {normals.shape}; expected one unit vector for each of {len(points)} points"
        )
    return Contacts(points, normals)


def _size(contacts):
    """The largest distance of a contact from the origin, mm, by which moments are made comparable with forces."""
    return float(np.linalg.norm(contacts.points, axis=1).max())


def _scaled(wrenches, contacts):
    """Wrenches (6, m) with their moments in units of the contacts' size."""
    return wrenches / np.repeat([1.0, max(_size(contacts), 1e-9)], 3)[:, None]


def _solved(cost, equations, values):
    """The least cost of unknowns >= 0 that fulfil the equations, or None if none do."""
    found = linprog(
        cost, A_eq=equations, b_eq=values, method="highs", options={"primal_feasibility_tolerance": BALANCED}
    )
    return found.fun if found.status == 0 else None
