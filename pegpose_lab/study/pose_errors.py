"""Errors of estimated poses against the truth of the rendered experiment, in the plane of the peg tops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .assembly_trials import PLANE_VIEW

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..paper import Experiment
    from ..pose import HubPose

_FINE = np.array([1e3, 1e3, 1e3, *np.degrees([1e3] * 3)])  # mm to µm, rad to thousandths of a degree


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors of the poses of k frames.

    Attributes
    ----------
    in_plane : (k, 3) ndarray
        Of x, y (mm) and theta (deg), in the frame of the plane of the peg tops.
    pegs : (k, n, 3) ndarray
        Of the pegs' measured centres in the camera frame, mm.
    radii : (k, n) ndarray
        Of the pegs' measured radii, mm.

    Examples
    --------
    >>> import numpy as np
    >>> errors = PoseErrors(np.array([[3.0, 4.0, 0.1]]), np.full((1, 4, 3), 2.0), np.zeros((1, 4)))
    >>> errors.rms["peg centres (mm)"].round(3), errors.rms["depth (mm)"]
    (np.float64(3.464), np.float64(2.0))
    """

    in_plane: NDArray[np.float64]
    pegs: NDArray[np.float64]
    radii: NDArray[np.float64]

    @property
    def rms(self) -> dict[str, float]:
        """Root mean squares over frames and pegs: length and depth of the pegs' errors, x, y, theta, and radius."""
        length = np.sqrt(np.mean(np.sum(self.pegs**2, axis=-1)))
        x, y, theta = np.sqrt(np.mean(self.in_plane**2, axis=0))
        return {
            "peg centres (mm)": length,
            "depth (mm)": np.sqrt(np.mean(self.pegs[..., 2] ** 2)),
            "x (mm)": x,
            "y (mm)": y,
            "theta (deg)": theta,
            "peg radius (mm)": np.sqrt(np.mean(self.radii**2)),
        }


def pose_errors(poses: Sequence[HubPose], plane: RigidTransform, experiment: Experiment) -> PoseErrors:
    """Compare the poses of the experiment's first frames with its truth.

    Parameters
    ----------
    poses : sequence of HubPose
    plane : RigidTransform
        Estimated cam_from_board of the board that lies in the plane of the peg tops: the frame of x, y and theta.
    experiment : Experiment

    Returns
    -------
    PoseErrors

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from pegpose_lab.paper import paper_experiment
    >>> truth = paper_experiment()
    >>> place = truth.cam_from_hubs[0]
    >>> exact = SimpleNamespace(cam_from_hub=place, peg_centers=place.apply(truth.hub.peg_centers), peg_radii=10.1)
    >>> abs(pose_errors([exact], truth.cam_from_boards[4], truth).in_plane).max() < 1e-9
    np.True_
    """
    true_plane, hub = experiment.cam_from_boards[PLANE_VIEW], experiment.hub
    truths = experiment.cam_from_hubs[: len(poses)]
    pairs = [
        (plane.inv() * pose.cam_from_hub, true_plane.inv() * truth) for pose, truth in zip(poses, truths, strict=True)
    ]
    shifts = [found.translation[:2] - true.translation[:2] for found, true in pairs]
    turns = [np.degrees((true.rotation.inv() * found.rotation).as_rotvec()[2]) for found, true in pairs]
    return PoseErrors(
        in_plane=np.column_stack([np.array(shifts), turns]),
        pegs=np.array([pose.peg_centers - at.apply(hub.peg_centers) for pose, at in zip(poses, truths, strict=True)]),
        radii=np.array([pose.peg_radii for pose in poses]) - hub.peg_radius,
    )


def covariance_in_plane(covariance: ArrayLike, plane: RigidTransform) -> NDArray[np.float64]:
    """A covariance of `HubPose` (6, 6) in the axes of a plane: x, y, z in µm, then turns in thousandths of a degree.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.spatial.transform import RigidTransform
    >>> covariance = np.diag([0.001, 0.002, 0.003, 0, 0, 0]) ** 2  # mm
    >>> np.sqrt(np.diag(covariance_in_plane(covariance, RigidTransform.identity()))).round(6).tolist()
    [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]
    """
    turned = _FINE[:, None] * _to_plane(plane)
    return turned @ np.asarray(covariance) @ turned.T


def errors_in_plane(
    poses: Sequence[HubPose], truths: Sequence[RigidTransform], plane: RigidTransform
) -> NDArray[np.float64]:
    """Estimates less truths (k, 6) in the order and units of `covariance_in_plane`.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from scipy.spatial.transform import RigidTransform
    >>> found = SimpleNamespace(cam_from_hub=RigidTransform.from_translation([0.001, 0, 400]))
    >>> errors_in_plane([found], [RigidTransform.from_translation([0, 0, 400])], RigidTransform.identity()).round(6).tolist()
    [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]
    """
    rows = []
    for pose, truth in zip(poses, truths, strict=True):
        turn = (pose.cam_from_hub.rotation * truth.rotation.inv()).as_rotvec()
        rows.append(np.append(pose.cam_from_hub.translation - truth.translation, turn))
    return _FINE * (np.array(rows) @ _to_plane(plane).T)


def aligned_distances(points: ArrayLike, targets: ArrayLike) -> NDArray[np.float64]:
    """Distances of points in a plane from their targets after the best common shift and turn.

    Parameters
    ----------
    points, targets : (..., 2) array_like
        In one unit.  All points are shifted and turned together (least squares), and not scaled.

    Returns
    -------
    (...) ndarray

    Examples
    --------
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> aligned_distances(square + 5, square @ [[0, 1], [-1, 0]]).round(9).tolist()
    [0.0, 0.0, 0.0, 0.0]
    """
    ours, goal = (np.asarray(given, float) @ (1, 1j) for given in (points, targets))
    ours, goal = ours - ours.mean(), goal - goal.mean()
    return np.abs(ours * np.exp(1j * np.angle(np.vdot(ours, goal))) - goal)


def _to_plane(plane):
    """From axes of the camera to those of a plane (6, 6)."""
    return np.kron(np.eye(2), plane.rotation.as_matrix().T)
