"""Points of a plane, exact or measured on a real board: how flat they are, and the plane's own frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

if TYPE_CHECKING:
    from numpy.typing import NDArray

FLAT = 0.03
"""Points count as a plane if their relief (see `relief`) is at most this fraction of their width.  Up to about twice
this value, Tsai's method for a plane, corrected for the relief, has a smaller error of f than his method for points
that are not coplanar."""

UPRIGHT = 1e-6
"""A component of a unit normal that is smaller than this does not decide to which side the normal points."""


def relief(points: NDArray[np.float64]) -> float:
    """Rms distance of points (n, 3) from the plane through them, as a fraction of their rms half-width."""
    if _of_one_z(points):
        return 0.0
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(singular[2] / singular[1]) if len(singular) > 2 and singular[1] > 0 else 0.0


def is_planar(points: NDArray[np.float64]) -> bool:
    """Whether points (n, 3) lie on one plane, in any position, within `FLAT`."""
    return relief(points) <= FLAT


def plane_rotation(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smallest rotation (3, 3) of the object's frame after which the plane through points (n, 3) has constant z."""
    if _of_one_z(points):
        return np.eye(3)
    normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
    leading = next(part for part in normal[::-1] if abs(part) > UPRIGHT)
    normal = normal * np.sign(leading)
    across = np.array([normal[1], -normal[0], 0.0])  # normal x z: the axis of the smallest turn, times its sine
    sine = np.linalg.norm(across)
    turn = across * (np.arctan2(sine, normal[2]) / sine) if sine > 0 else np.zeros(3)
    return Rotation.from_rotvec(turn).as_matrix()


def plane_frame(points: NDArray[np.float64]) -> RigidTransform:
    """Return plane_from_object: in the plane's frame, points (n, 3) have z = 0 except for their relief.

    The object's frame is rotated as little as possible and then shifted along z only, so points that share one z keep
    their x and y to the last digit.
    """
    rotation = plane_rotation(points)
    height = points[0, 2] if _of_one_z(points) else rotation[2] @ points.mean(axis=0)
    return RigidTransform.from_components([0.0, 0.0, -height], Rotation.from_matrix(rotation))


def _of_one_z(points):
    return np.ptp(points[:, 2]) == 0
