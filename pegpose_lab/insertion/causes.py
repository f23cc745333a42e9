"""What makes the wheel's pose against the hub uncertain: covariances by cause, in axes of the hub."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import CalibrationError, as_covariance, as_number
from ..pose import carried_motion

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..pose import HubPose
    from ..targets import Hub

# ISO 9283: RP is the mean distance from the mean attained position plus three standard deviations of that distance.  Of
# normal errors of sigma per axis, the distance has the mean sqrt(8/pi) sigma and the variance (3 - 8/pi) sigma^2.
RP_OF_SIGMA = float(np.sqrt(8 / np.pi) + 3 * np.sqrt(3 - 8 / np.pi))


def causes_of(
    pose: HubPose, hand_eye_covariance: ArrayLike | None, robot_repeatability: float
) -> dict[str, NDArray[np.float64]]:
    """Return the covariances (6, 6) by cause, of the hub's pose against where the wheel is brought, in axes of the hub.

    Parameters
    ----------
    pose : HubPose
    hand_eye_covariance, robot_repeatability
        As in `assembly_forecast`.

    Returns
    -------
    dict
        The causes of ``pose.budget`` ("pose" if it has none), "hand-eye" and "robot" if they are given.

    Raises
    ------
    ValueError
        If an argument is unusable.
    CalibrationError
        If the pose has no covariance.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from scipy.spatial.transform import RigidTransform
    >>> pose = SimpleNamespace(cam_from_hub=RigidTransform.identity(), covariance=np.eye(6), budget={})
    >>> causes = causes_of(pose, None, 0.05)
    >>> list(causes), float(np.sqrt(causes["robot"][0, 0]).round(4))  # mm of sigma
    (['pose', 'robot'], 0.0138)
    """
    if getattr(pose, "covariance", None) is None:
        raise CalibrationError("the pose has no covariance: estimate it from pegs that were measured with sigmas")
    causes = {cause: as_covariance(cov, cause) for cause, cov in (pose.budget or {"pose": pose.covariance}).items()}
    if hand_eye_covariance is not None:
        carried = carried_motion(pose.cam_from_hub.translation)
        causes["hand-eye"] = carried @ as_covariance(hand_eye_covariance, "hand_eye_covariance") @ carried.T
    to_hub = np.kron(np.eye(2), pose.cam_from_hub.rotation.as_matrix().T)
    causes = {cause: _turned(to_hub, cov) for cause, cov in causes.items()}
    sigma = as_number(robot_repeatability, "robot_repeatability", 0) / RP_OF_SIGMA
    if sigma:
        causes["robot"] = np.diag([sigma**2] * 3 + [0.0] * 3)
    return causes


def _turned(turn, covariance):
    """The covariance in other axes; an infinite one stays as it is."""
    return turn @ covariance @ turn.T if np.isfinite(covariance).all() else covariance


def root_of(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a square root (6, 6): the covariance is the root times its transpose, whatever its rank.

    Examples
    --------
    >>> root = root_of(np.diag([4.0, 1.0, 0.0, 0.0, 0.0, 1e-6]))
    >>> np.diag(root @ root.T).round(9).tolist()
    [4.0, 1.0, 0.0, 0.0, 0.0, 1e-06]
    """
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def offset_derivatives(hub: Hub, hub_from_wheel: RigidTransform | None) -> NDArray[np.float64]:
    """Return the derivatives (n, 2, 6) of the pegs' x and y in the wheel frame by the hub's pose, in axes of the hub.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> offset_derivatives(pl.Hub(pitch_circle_diameter=100.0), None)[0].tolist()  # a turn moves peg 1 along y
    [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 50.0]]
    """
    derivative = np.zeros((hub.n_pegs, 3, 6))
    derivative[:, :, :3] = np.eye(3)
    derivative[:, :, 3:] = np.cross(np.eye(3), hub.peg_centers[:, None, :]).transpose(0, 2, 1)  # e_j x center
    if hub_from_wheel is not None:
        derivative = hub_from_wheel.rotation.as_matrix().T @ derivative
    return derivative[:, :2] + 0.0
