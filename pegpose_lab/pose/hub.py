"""Pose estimation of the hub from its pegs (Sect. 3.2): in a known plane, or with all six degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from ..checks import CalibrationError, as_points, as_pose
from .discs import _as_radii, back_project_discs, project_discs

if TYPE_CHECKING:
    from ..camera import OpenCVCamera, TsaiCamera
    from ..pegs import PegObservation
    from ..targets import Hub

_POLISH_ROUNDS = 5


# ---- the hub ----


@dataclass(frozen=True, eq=False)
class HubPose:
    """The pose of the hub in the camera frame.

    Attributes
    ----------
    cam_from_hub : RigidTransform
        The paper's C_T_P.
    x, y : float
        Hub centre, mm in the frame of the plane of the peg tops; without such a plane in the camera frame.
    theta : float
        Turn about that frame's z axis, rad in (-pi, pi]: direction from the hub centre to peg 1 (Eq. 11).
    peg_centers : (n, 3) ndarray
        Each peg's measured centre in the plane of the peg tops, mm in the camera frame.
    peg_radii : (n,) ndarray
        Each peg's measured radius, mm.
    residuals : (n, 2) ndarray
        Reprojection errors: projected minus measured centres of the pegs' images, px.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    >>> image = pl.render_hub(camera, cam_from_hub, hub, rng=0)
    >>> pose = pl.estimate_pose(pl.locate_pegs(image, hub), camera, hub)  # all six numbers
    >>> pose.cam_from_hub.translation.round().tolist(), bool(pose.rms < 0.1)
    ([2.0, -1.0, 400.0], True)
    """

    cam_from_hub: RigidTransform
    x: float
    y: float
    theta: float
    peg_centers: np.ndarray
    peg_radii: np.ndarray
    residuals: np.ndarray

    @property
    def rms(self) -> float:
        """Rms reprojection error: root of the mean squared length of the residuals, px."""
        return float(np.sqrt(np.mean(np.sum(self.residuals**2, axis=1))))


def estimate_pose(
    observation: PegObservation,
    camera: TsaiCamera | OpenCVCamera,
    hub: Hub,
    *,
    plane: RigidTransform | None = None,
) -> HubPose:
    """Estimate the pose of the hub (its extrinsics) from its pegs in one image.

    Parameters
    ----------
    observation : PegObservation
        `peg_centers` and `peg_radii` in px, in label order.  Without `plane` also `screw_centers` and
        `bore_center`, which tell the two mirror solutions of a planar pose apart.
    camera : TsaiCamera or OpenCVCamera
    hub : Hub
    plane : RigidTransform, optional
        cam_from_plane of the plane of the peg tops, its z axis away from the camera.  With it the pose has the
        paper's three degrees of freedom x, y and theta; without it all six.

    Returns
    -------
    HubPose

    Raises
    ------
    ValueError
        If an argument is unusable, the plane is seen from below, or it is missed by a peg's ray.
    CalibrationError
        If the pegs do not determine a pose.

    References
    ----------
    D. Oberkampf, D. F. DeMenthon and L. S. Davis, "Iterative pose estimation using coplanar feature points", Computer Vision
    and Image Understanding 63(3), 1996 (the two poses of a plane).

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    >>> image = pl.render_hub(camera, cam_from_hub, hub, rng=0)
    >>> plane = RigidTransform.from_translation([0.0, 0.0, 400.0])  # of the peg tops
    >>> pose = pl.estimate_pose(pl.locate_pegs(image, hub), camera, hub, plane=plane)
    >>> round(pose.x, 1), round(pose.y, 1)
    (2.0, -1.0)
    >>> round(pose.theta, 2)  # half a turn from 0.3: in one image, opposite screws leave both
    -2.84
    """
    centers = as_points(observation.peg_centers, 2, "observation.peg_centers")
    if len(centers) != hub.n_pegs:
        raise ValueError(f"observation.peg_centers has {len(centers)} rows; expected one for each peg: {hub.n_pegs}")
    radii = _as_radii(observation.peg_radii, hub.n_pegs, "observation.peg_radii")
    if plane is None:
        frame, cam_from_hub = RigidTransform.identity(), _fit_six_degrees(observation, centers, camera, hub)
    else:
        frame = _as_plane(plane)
        seen = back_project_discs(centers, radii, camera, plane)[0]
        cam_from_hub = plane * _fit_in_plane(hub.peg_centers[:, :2], seen[:, :2])
    frame_from_hub = frame.inv() * cam_from_hub
    tops, tops_radii = back_project_discs(centers, radii, camera, cam_from_hub)
    return HubPose(
        cam_from_hub=cam_from_hub,
        x=float(frame_from_hub.translation[0]),
        y=float(frame_from_hub.translation[1]),
        theta=_turn(frame_from_hub.rotation),
        peg_centers=cam_from_hub.apply(tops),
        peg_radii=tops_radii,
        residuals=_pegs(centers, hub).residuals(cam_from_hub, camera),
    )


def _fit_in_plane(points, measured):
    """Rigid motion (x, y, theta) of the plane that takes points (n, 2) to measured ones, by least squares."""
    from_middle, to_middle = points.mean(axis=0), measured.mean(axis=0)
    a, b = points - from_middle, measured - to_middle
    dot, cross = np.sum(a * b), np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    if np.hypot(dot, cross) < 0.1 * np.sum(a**2):  # the ratio is about 1 for the hub's own ring
        raise CalibrationError("the pegs are not an image of the hub's ring; check that they are labelled clockwise")
    theta = np.arctan2(cross, dot)
    rotation = Rotation.from_rotvec([0, 0, theta])
    x, y = to_middle - rotation.as_matrix()[:2, :2] @ from_middle
    return RigidTransform.from_components([x, y, 0], rotation)


def _fit_six_degrees(observation, centers, camera, hub):
    """Least squares over the pegs' images, started from where pegs, bore and screws agree.

    From far away a plane and its mirror image, tilted the other way, look the same (weak perspective); three
    pegs alone even allow up to four poses.  Bore and screws lie at another height and tell these poses apart.
    """
    start = _parallel_pose(camera.to_normalized(centers), hub)
    near = _polish(start, _all_parts(observation, centers, hub), camera)
    return _polish(near, _pegs(centers, hub), camera)


@dataclass(frozen=True, eq=False)
class _Discs:
    """Discs of the hub: centres (n, 3) and radii (n,), mm, and measured centres of their images (n, 2), px."""

    centers: np.ndarray
    radii: np.ndarray
    measured: np.ndarray

    def residuals(self, cam_from_hub, camera):
        """Projected minus measured centres of the images (n, 2), px."""
        return project_discs(camera, cam_from_hub, self.centers, self.radii)[0] - self.measured


def _pegs(centers, hub):
    return _Discs(hub.peg_centers, np.full(hub.n_pegs, hub.peg_radius), centers)


def _all_parts(observation, centers, hub):
    """Pegs, screws and bore."""
    screws = as_points(observation.screw_centers, 2, "observation.screw_centers")
    if len(screws) != len(hub.screw_centers):
        raise ValueError(f"observation.screw_centers has {len(screws)} rows; expected {len(hub.screw_centers)}")
    bore = as_points([observation.bore_center], 2, "observation.bore_center")
    radii = [hub.peg_radius] * hub.n_pegs + [hub.screw_radius] * len(screws) + [hub.bore_radius]
    discs = np.vstack([hub.peg_centers, hub.screw_centers, hub.bore_center])
    return _Discs(discs, np.array(radii), np.vstack([centers, screws, bore]))


def _parallel_pose(normalized, hub):
    """The pose parallel to the image that fits the pegs' directions (n, 2) best."""
    pegs = hub.peg_centers[:, :2]
    size = np.linalg.norm(normalized - normalized.mean(axis=0))
    if size == 0:
        raise CalibrationError("all pegs were measured in one place; check the observation")
    depth = np.linalg.norm(pegs - pegs.mean(axis=0)) / size
    flat = _fit_in_plane(pegs, normalized * depth)
    return RigidTransform.from_components([*flat.translation[:2], depth], flat.rotation)


def _polish(pose, discs, camera):
    """Least squares over six degrees of freedom; the shift of the images' centres is updated between the fits."""
    try:
        for _ in range(_POLISH_ROUNDS):
            shift = discs.residuals(pose, camera) + discs.measured - camera.project(discs.centers, pose)
            pose = _fit_directions(pose, discs.centers, camera.to_normalized(discs.measured - shift))
        discs.residuals(pose, camera)
    except ValueError as error:
        raise CalibrationError(
            "no pose puts the hub in front of the camera; check that its pegs are labelled clockwise on the screen"
        ) from error
    return pose


def _left_jacobian(rotation_vector):
    """J with exp(v + dv) = exp(J dv) exp(v) for rotation vectors v."""
    angle = np.linalg.norm(rotation_vector)
    cross = np.cross(np.eye(3), rotation_vector)  # [v]_x, antisymmetric
    if angle < 1e-4:
        return np.eye(3) + cross / 2 + cross @ cross / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * cross + (angle - np.sin(angle)) / angle**3 * cross @ cross


def _fit_directions(start, points, normalized):
    """Levenberg-Marquardt on x/z and y/z; steps turn about the origin and shift it by parts of its size."""
    size = np.linalg.norm(points, axis=1).max()
    turned = start.rotation.apply(points)

    def moved(step):
        shift = start.translation + size * step[3:]
        return RigidTransform.from_components(shift, Rotation.from_rotvec(step[:3]) * start.rotation)

    def residuals(step):
        seen = Rotation.from_rotvec(step[:3]).apply(turned) + start.translation + size * step[3:]
        return (seen[:, :2] / seen[:, 2:] - normalized).ravel()

    def jacobian(step):
        moved_by_turn = Rotation.from_rotvec(step[:3]).apply(turned)
        seen = moved_by_turn + start.translation + size * step[3:]
        by_turn = np.cross(_left_jacobian(step[:3]).T, moved_by_turn[:, None])  # (n, 3 parameters, 3 coordinates)
        by_step = np.concatenate([by_turn, np.broadcast_to(size * np.eye(3), by_turn.shape)], axis=1)
        over_depth = by_step[..., :2] - by_step[..., 2:] * (seen[:, :2] / seen[:, 2:])[:, None]
        return (over_depth / seen[:, 2:, None]).swapaxes(1, 2).reshape(-1, 6)

    limits = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14}
    return moved(least_squares(residuals, np.zeros(6), jacobian, method="lm", **limits).x)


def _turn(rotation):
    """Direction of a frame's x axis in the xy plane, rad in (-pi, pi]."""
    matrix = rotation.as_matrix()
    return float(np.arctan2(matrix[1, 0], matrix[0, 0]))


# ---- input ----


def _as_plane(plane):
    """Return `plane` if its z axis points away from the camera."""
    if as_pose(plane, "plane").inv().translation[2] >= 0:
        raise ValueError("plane is seen from below: its z axis has to point away from the camera")
    return plane
