"""How far the sections of tilted pegs reach from the axes of their holes: the exact geometry of a straight insertion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..targets import Hub
    from .wheel import Wheel

STEPS = 60  # of a bracketed Newton iteration, which halves its bracket at worst: 2^-60 of a right angle
SETTLED = 1e-8  # of a squared radius, what the last step gained: what is left is much less
INSIDE = 1e-9  # rad, from the ends of the quadrant, where the derivative may vanish at a minimum
STEEPEST = 0.05  # cosine of the steepest tilt, 87 degrees: beyond, the section of a peg has no end


def farthest(offsets: NDArray[np.float64], across: float, along: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Return the largest distance of an ellipse's points from the origin.

    An ellipse lies in a circle about the origin if this is at most the circle's radius.  With the ellipse
    :math:`(o_x + a \cos \varphi, o_y + b \sin \varphi)`, its axes along x and y, the farthest point is in the quadrant of
    :math:`(|o_x|, |o_y|)`, where the derivative of the squared distance has one root:

    .. math:: -a |o_x| \sin \varphi + b |o_y| \cos \varphi + (b^2 - a^2) \sin \varphi \cos \varphi = 0

    (divided by :math:`\sin \varphi \cos \varphi` it decreases).

    Parameters
    ----------
    offsets : (..., 2) ndarray
        The ellipses' centres, mm.
    across, along : float, (...) ndarray
        Their semi-axes a along x and b along y, mm.

    Returns
    -------
    (...) ndarray
        mm.

    Examples
    --------
    >>> farthest(np.array([[3.0, 4.0], [0.0, 0.0]]), 1.0, np.array([1.0, 2.0])).round(6).tolist()
    [6.0, 2.0]
    """
    x, y = np.abs(offsets[..., 0]), np.abs(offsets[..., 1])
    ax, by, bend = across * x, along * y, along**2 - across**2
    angle = np.clip(np.arctan2(y, x), INSIDE, np.pi / 2 - INSIDE)
    low, high = 0.0, np.pi / 2
    for _ in range(STEPS):
        sine, cosine = np.sin(angle), np.cos(angle)
        slope = by * cosine - ax * sine + bend * sine * cosine
        curvature = ax * cosine + by * sine - bend * (cosine**2 - sine**2)
        low, high = np.where(slope > 0, angle, low), np.where(slope > 0, high, angle)
        trial = angle + slope / np.where(curvature > 0, curvature, np.inf)
        trial = np.where((trial >= low) & (trial <= high) & (curvature > 0), trial, (low + high) / 2)
        # near a minimum the slope says nothing; as the offset is small there, what the axes differ by is to be gained
        gained = np.max(np.abs(np.where(curvature > 0, slope * (trial - angle), bend)), initial=0.0)
        angle = trial
        if gained < SETTLED * across**2:
            break
    return np.hypot(x + across * np.cos(angle), y + along * np.sin(angle))


def reaches(
    tops: NDArray[np.float64], axes: NDArray[np.float64], holes: NDArray[np.float64], hub: Hub, wheel: Wheel
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Return how far pegs reach from their holes' axes, at their tops and at the mouths of the seated wheel.

    The wheel moves along its own z axis, which leaves the pegs' x and y in the wheel frame as they are.  A peg of radius
    r at a tilt :math:`\tau` against its hole has two sections that matter, both ellipses seen along the hole: its top,
    of semi-axes r and :math:`r \cos \tau` (along the tilt), and its section by the plane where the hole's straight part
    begins, of semi-axes r and :math:`r / \cos \tau`.  What of the peg is in the straight part is the convex hull of the
    two: it lies in the hole, a convex body, if both do.

    Parameters
    ----------
    tops : (..., n, 3) ndarray
        Centres of the pegs' tops, mm in the wheel frame, when the wheel's face is at the tops of the hub.
    axes : (..., 3) ndarray
        Unit vector along the pegs, from their tops on, in the wheel frame.
    holes : (..., n, 2) ndarray
        Centres of the holes, mm in the wheel frame.
    hub, wheel : Hub, Wheel

    Returns
    -------
    top, mouth : (..., n) ndarray
        Distances from the axis of the hole, mm: of the farthest point of a peg's top, and of its section.
    """
    top, direction, slope, cosine = in_tilt_axes(tops, axes, holes)
    length = np.maximum(hub.peg_height - wheel.chamfer - tops[..., 2], 0.0) / cosine  # of a peg in the straight part
    mouth = top + (length * slope)[..., None] * np.array([0.0, 1.0])
    radius = hub.peg_radius
    along = np.broadcast_to(cosine, length.shape)
    return farthest(top, radius, radius * along), farthest(mouth, radius, radius / along)


def in_tilt_axes(
    tops: NDArray[np.float64], axes: NDArray[np.float64], holes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the tops' offsets from the holes (..., n, 2) across and along the tilt, and the tilt.

    The arguments are those of `reaches`; the tilt comes as its direction in the wheel's plane (..., 2), and its sine and
    cosine (..., 1).
    """
    slope = np.hypot(axes[..., 0], axes[..., 1])
    upright = slope < 1e-300  # no direction: any will do
    steep = np.where(upright, 1.0, slope)
    direction = np.stack([axes[..., 0] / steep, np.where(upright, 1.0, axes[..., 1] / steep)], axis=-1)
    offsets = tops[..., :2] - holes
    tx, ty = direction[..., None, 0], direction[..., None, 1]
    across = offsets[..., 0] * ty - offsets[..., 1] * tx
    along = offsets[..., 0] * tx + offsets[..., 1] * ty
    cosine = np.maximum(axes[..., 2], STEEPEST)
    return np.stack([across, along], axis=-1), direction, slope[..., None], cosine[..., None]
