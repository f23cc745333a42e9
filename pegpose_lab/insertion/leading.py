"""Pegs that lead others: one in its chamfer pushes the wheel sideways before the next comes to the face."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .sections import STEEPEST

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..targets import Hub
    from .wheel import Wheel

SWEEPS = 12  # over the pegs, of Hildreth's method
SETTLED = 1e-4  # mm, of the displacement in a sweep
CUTS = 3  # straight ones for the round limits


def led_in(
    tops: NDArray[np.float64],
    axes: NDArray[np.float64],
    holes: NDArray[np.float64],
    reach: NDArray[np.float64],
    hub: Hub,
    wheel: Wheel,
) -> NDArray[np.bool_]:
    r"""Return whether every peg passes the face of a wheel that gives way sideways, but keeps its tilt.

    A tilted wheel meets one peg after the other.  When peg k comes to the face, those before it are in their chamfers or
    deeper, and have moved the wheel by the least shift and turn q (the turn as motion along the pitch circle) that this
    takes:

    .. math:: \min |q|^2 \quad \text{with} \quad |o_j + J_j q| + e_j \le R + \max(w - (z_k - z_j), 0)

    for the pegs j with :math:`z_j < z_k`, of offset o and reach :math:`|o| + e`, radius R and chamfer w.  Peg k passes if
    it is in the mouth then.  There is no friction.  The least q is found by Hildreth's method.

    Parameters
    ----------
    tops, axes, holes : (m, n, 3), (m, 3), (m or 1, n, 2) ndarray
        As in `sections.reaches`.
    reach : (m, n) ndarray
        Of the tops, as it returns them.
    hub, wheel : Hub, Wheel

    Returns
    -------
    (m,) bool ndarray

    References
    ----------
    C. Hildreth, "A quadratic programming procedure", Naval Research Logistics Quarterly 4(1), 1957.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> hub, wheel = pl.Hub(), pl.Wheel(clearance=0.3, chamfer=1.0)
    >>> holes, upright = wheel.hole_centers[None], np.array([[0.0, 0.0, 1.0]])
    >>> offsets = np.array([[[1.2, 0], [1.2, 0], [1.4, 0], [1.2, 0]]])  # peg 3 is 0.1 mm out of the mouth of its hole
    >>> for ahead in (0.0, -0.5):  # peg 1 comes 0.5 mm earlier, and has to be 0.4 mm further in by then
    ...     tops = np.concatenate([holes + offsets, np.array([[[ahead], [0], [0], [0]]])], axis=2)
    ...     print(led_in(tops, upright, holes, hub.peg_radius + offsets[..., 0], hub, wheel).item())
    False
    True
    """
    offsets = tops[..., :2] - holes
    length = np.linalg.norm(offsets, axis=2)
    excess = reach - length
    # a tilted top is met at its rim, on the side of the offset
    outwards = offsets / np.maximum(length, 1e-12)[..., None]
    slopes = axes[:, :2] / np.maximum(axes[:, 2:], STEEPEST)
    heights = tops[..., 2] - hub.peg_radius * np.einsum("mni,mi->mn", outwards, slopes)
    place = wheel.hole_centers / (wheel.pitch_circle_diameter / 2)
    turn = np.stack([-place[:, 1], place[:, 0]], axis=1)  # of a peg, by the wheel's turn
    straight, mouth = hub.peg_radius + wheel.clearance, hub.peg_radius + wheel.clearance + wheel.chamfer - excess
    ahead = heights[:, :, None] - heights[:, None, :]  # of peg k (first) by peg j, mm
    room = straight + np.maximum(wheel.chamfer - ahead, 0.0) - excess[:, None, :]
    room = np.where(ahead > 0, room, np.inf)
    led = np.any(length[:, None, :] > room, axis=2)
    passed = ~np.any((length > mouth) & ~led, axis=1)
    for k in range(tops.shape[1]):
        asked = np.flatnonzero(passed & led[:, k])
        moved = offsets[asked, k] + _displacement(offsets[asked], room[asked, k], turn)[:, k]
        passed[asked] = np.linalg.norm(moved, axis=1) <= mouth[asked, k]
    return passed


def _displacement(offsets, room, turn):
    """The least displacement of the pegs (m, n, 2) that brings their `offsets` to lengths of at most `room` (m, n)."""
    moved = np.zeros_like(offsets)
    rows, limits = np.zeros((len(offsets), 0, 3)), np.zeros((len(offsets), 0))
    for _ in range(CUTS):  # tangents of the round limits, all of which are kept
        normals = offsets + moved
        normals = normals / np.maximum(np.linalg.norm(normals, axis=2), 1e-12)[..., None]
        rows = np.concatenate(
            [rows, np.concatenate([normals, np.sum(normals * turn, axis=2)[..., None]], axis=2)], axis=1
        )
        limits = np.concatenate([limits, room - np.sum(normals * offsets, axis=2)], axis=1)
        shift = _least(rows, limits)
        moved = shift[:, None, :2] + shift[:, 2, None, None] * turn
    return moved


def _least(rows, limits):
    """The least vectors q (m, 3) with `rows` (m, k, 3) times q at most `limits` (m, k), by Hildreth's method."""
    rows, limits = (
        np.ascontiguousarray(rows.transpose(1, 2, 0)),
        np.ascontiguousarray(limits.T),
    )  # one limit after the other
    sizes = np.maximum((rows**2).sum(axis=1), 1e-12)
    forces, shift = np.zeros(limits.shape), np.zeros((3, rows.shape[2]))
    for _ in range(SWEEPS):
        before = shift.copy()
        for row, limit, size, force in zip(rows, limits, sizes, forces, strict=True):
            excess = row[0] * shift[0] + row[1] * shift[1] + row[2] * shift[2] - limit
            change = np.maximum(force + excess / size, 0.0) - force
            shift -= change * row
            force += change
        if np.max(np.abs(shift - before), initial=0.0) < SETTLED:
            break
    return shift.T
