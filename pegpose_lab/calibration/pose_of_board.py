"""Pose of one object in a known camera (PnP): least squares over its image points, and a plane's second solution.

A plane that is small or far away has little perspective.  Then two tilts, which mirror each other in the line of sight,
explain its image about equally well: the sum of squares has two minima, and noise can make the wrong one the lower.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import CAMERA_MODELS, TsaiCamera
from ..checks import CalibrationError, as_views, undetermined_if_singular
from .joint.bundle import descend
from .joint.models import Lens, TsaiModel, derivative_by_point
from .joint.starts import demand_order, pnp
from .joint.views import State, Views, evaluate
from .planes import is_planar, plane_rotation

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..camera import FisheyeCamera, OpenCVCamera

SAME_POSE = 1e-3
"""rad: two minima whose rotations differ by less than this are the same."""


@dataclass(frozen=True, eq=False)
class BoardPose:
    """A pose at a local minimum of the reprojection error.

    Attributes
    ----------
    cam_from_object : RigidTransform
    rms : float
        Rms distance between projected and measured points, px.
    """

    cam_from_object: RigidTransform
    rms: float


def board_pose(
    object_points: ArrayLike, image_points: ArrayLike, camera: TsaiCamera | OpenCVCamera | FisheyeCamera
) -> RigidTransform:
    """Pose of one object in a known camera: least squares over the image points.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 4; they may lie on a plane.
    image_points : (n, 2) array_like
        px.
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera

    Returns
    -------
    RigidTransform
        cam_from_object; if there are two solutions, the better one (`board_poses` gives both).

    Raises
    ------
    ValueError
        If the input is unusable, or the points lie on a line, about which the object could turn freely.
    CalibrationError
        If no pose has all points in front of the camera, or a plane's points are not in the order of the image points.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, board_pose
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> board_pose(board, image, sensor.camera(8.0, kappa1=0.001)).translation.round(2).tolist()
    [-90.0, -70.0, 500.0]
    """
    return board_poses(object_points, image_points, camera)[0].cam_from_object


@undetermined_if_singular()
def board_poses(
    object_points: ArrayLike, image_points: ArrayLike, camera: TsaiCamera | OpenCVCamera | FisheyeCamera
) -> list[BoardPose]:
    """The one or two poses of an object in a known camera that are minima of the least squares, best first.

    A plane with weak perspective has two.  With noise of s px per axis, the second is about as likely as the first if
    n times the difference of their squared rms is not much above 2 s^2.

    Parameters
    ----------
    object_points, image_points, camera
        As for `board_pose`.

    Returns
    -------
    list of BoardPose

    Raises
    ------
    ValueError, CalibrationError
        As for `board_pose`.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, board_poses
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> found = board_poses(board, image, sensor.camera(8.0, kappa1=0.001))
    >>> round(found[0].rms, 3), found[0].cam_from_object.translation.round(2).tolist()
    (0.0, [-90.0, -70.0, 500.0])
    """
    (object_points,), (image_points,) = as_views([object_points], [image_points], 4)
    if not isinstance(camera, CAMERA_MODELS):
        expected = ", ".join(model.__name__ for model in CAMERA_MODELS)
        raise ValueError(f"camera is {type(camera).__name__}; expected one of {expected}")
    demand_order([object_points], [image_points])
    views = Views.stack([object_points], [image_points])
    start = pnp(object_points, camera.to_normalized(image_points), np.eye(3))
    state = State(np.zeros(0), start.rotation.as_matrix()[None], start.apply(views.centroids))
    found = [minimum for minimum in [_minimum(camera, views, state)] if minimum]
    if is_planar(object_points):
        mirrored = _mirrored(found[0][1] if found else state, plane_rotation(object_points))
        back = (lambda state: _turn_between(found[0][1], state) < SAME_POSE) if found else None
        other = _minimum(camera, views, mirrored, back)
        if other and not (found and back(other[1])):
            found.append(other)
    if not found:
        raise CalibrationError("no pose sees all points in front of the camera; check that both lists are in one order")
    found.sort(key=lambda minimum: minimum[0])
    return [BoardPose(state.poses(views)[0], float(np.sqrt(cost / len(object_points)))) for cost, state in found]


def _minimum(camera, views, state, leave=None):
    """The sum of squares and the state at the minimum reached from a start; None if a point has no image.

    The search ends early at a state for which `leave`, if given, is true.
    """
    model = TsaiModel.known(camera) if isinstance(camera, TsaiCamera) else _KnownCamera(camera)
    if evaluate(model, views, state) is None:
        return None
    state, equations, _ = descend(model, views, state, views.used, leave)
    return equations.cost, state


def _mirrored(state, plane):
    """The state with the plane's normal mirrored in the line of sight to the points' centroid."""
    sight = state.positions[0] / np.linalg.norm(state.positions[0])
    normal = state.rotations[0] @ plane[2]
    cross = np.cross(normal, sight)
    sine = np.linalg.norm(cross)
    angle = 2 * np.arctan2(sine, normal @ sight)  # the mirrored normal is equally far on the other side
    turn = Rotation.from_rotvec(cross * (angle / sine if sine > 0 else 0.0))
    return State(state.shared, turn.as_matrix() @ state.rotations, state.positions)


def _turn_between(first, second):
    """Angle between two states' rotations, rad."""
    return Rotation.from_matrix(first.rotations[0].T @ second.rotations[0]).magnitude()


class _KnownCamera(Lens):
    """A camera as a lens model without free parameters."""

    names: list[str] = []

    def __init__(self, camera):
        self.camera = camera

    def project(self, shared, points):
        """As `TsaiModel.project`."""
        if points[:, 2].min() <= 0:
            return None
        normalized = points[:, :2] / points[:, 2:]
        try:
            image, by_normalized = self.camera.image_and_derivative(normalized)
        except ValueError:  # beyond the widest angle of a fisheye lens
            return None
        return image, np.zeros((len(points), 2, 0)), derivative_by_point(by_normalized, normalized, 1.0, points)
