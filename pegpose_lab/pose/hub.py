"""Pose estimation of the hub from its pegs (Sect. 3.2): in a known plane, or with all six degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..checks import CalibrationError, as_points, as_pose
from .discs import Pose, _as_radii, back_project_discs, place_discs, pose_of
from .fit import NEAR, Discs, Fit, approach, descend, fit_pose

if TYPE_CHECKING:
    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from ..pegs import PegObservation
    from ..targets import Hub

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
    covariance : (6, 6) ndarray or None
        Of the pose in the order (x, y, z, rotation vector), mm and rad: of a left perturbation in the frame that has the
        axes of the camera and its origin at the hub's.  The first three are those of ``cam_from_hub.translation``.  It
        follows from the pegs' sigmas alone, the camera being exact, and the plane too if there is one (rank 3 then).
        None if the observation has no sigmas; infinite on the diagonal where they do not determine the pose.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    >>> image = pl.render_hub(camera, cam_from_hub, hub, rng=0)
    >>> pose = pl.estimate_pose(pl.locate_pegs(image, hub), camera, hub)  # all six numbers
    >>> pose.cam_from_hub.translation.round().tolist(), bool(pose.rms < 0.1)
    ([2.0, -1.0, 400.0], True)
    >>> bool((np.sqrt(np.diag(pose.covariance))[:3] < [0.02, 0.02, 0.2]).all())  # sigmas of x, y and z, mm
    True
    """

    cam_from_hub: RigidTransform
    x: float
    y: float
    theta: float
    peg_centers: np.ndarray
    peg_radii: np.ndarray
    residuals: np.ndarray
    covariance: np.ndarray | None = None

    @property
    def rms(self) -> float:
        """Rms reprojection error: root of the mean squared length of the residuals, px."""
        return float(np.sqrt(np.mean(np.sum(self.residuals**2, axis=1))))


def estimate_pose(
    observation: PegObservation,
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera,
    hub: Hub,
    *,
    plane: RigidTransform | None = None,
) -> HubPose:
    """Estimate the pose of the hub (its extrinsics) from its pegs in one image.

    Parameters
    ----------
    observation : PegObservation
        `peg_centers` and `peg_radii` in px, in label order, and for the covariance `peg_covariances` (n, 2, 2), px^2, or
        `peg_sigmas` (n, 2), px.  Without `plane` also `screw_centers` and
        `bore_center`, which tell the two mirror solutions of a planar pose apart.
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera
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
    noise = _noise(observation, hub.n_pegs)
    if plane is None:
        frame, fit = Pose(np.eye(3), np.zeros(3)), _fit_six_degrees(observation, centers, camera, hub)
    else:
        frame = pose_of(_as_plane(plane))
        seen = back_project_discs(centers, radii, camera, plane)[0]
        fit = _fit_in_plane(frame, seen[:, :2], _pegs(centers, hub), camera)
    rotation, translation = fit.pose
    tops, tops_radii = _tops(centers, radii, camera, fit, hub)
    x, y, _ = frame.rotation.T @ (translation - frame.translation)
    cos, sin, _ = frame.rotation.T @ rotation[:, 0]
    return HubPose(
        cam_from_hub=_transform(fit.pose),
        x=float(x),
        y=float(y),
        theta=float(np.arctan2(sin, cos)),
        peg_centers=tops @ rotation.T + translation,
        peg_radii=tops_radii,
        residuals=fit.residuals,
        covariance=None if noise is None else fit.covariance(noise),
    )


def _tops(centers, radii, camera, fit, hub):
    """Where the pegs are in the plane of their tops, and their radii, mm in the hub's frame."""
    if (np.abs(fit.residuals).max(axis=1) > fit.images.radii).any():  # too far off for Newton's method from there
        return back_project_discs(centers, radii, camera, _transform(fit.pose))
    return place_discs(
        centers, radii, camera, fit.pose, hub.peg_centers, np.full(hub.n_pegs, hub.peg_radius), fit.images
    )


def _transform(pose):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose
    return RigidTransform(matrix, normalize=False)


def _fit_in_plane(frame, seen, pegs, camera):
    """x, y and theta by least squares in the plane; `seen` (n, 2) is where the pegs are in it, mm."""
    flat = _fit_flat(pegs.centers[:, :2], seen)
    pose = Pose(frame.rotation @ flat.rotation, frame.rotation @ flat.translation + frame.translation)
    images = pegs.images(pose, camera)
    by_pose = images.by_pose()
    in_frame = np.zeros((6, 3))  # x, y and theta as a motion in axes of the camera
    in_frame[:3, :2], in_frame[3:, 2] = frame.rotation[:, :2], frame.rotation[:, 2]
    by_pixel = np.linalg.inv(by_pose[:, :, :3] @ frame.rotation[:, :2])  # where the plane's points were seen
    arms = pegs.centers @ flat.rotation.T
    jacobian = np.zeros((len(arms), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -arms[:, 1], arms[:, 0]
    gain = np.linalg.pinv(jacobian.reshape(-1, 3)).reshape(3, -1, 2)
    gain = np.einsum("ikp,kpq->ikq", gain, by_pixel).reshape(3, -1)
    return Fit(pose, images, images.centers - pegs.measured, in_frame @ gain)


def _fit_flat(points, measured):
    """Rigid motion (x, y, theta) of the plane that takes points (n, 2) to measured ones, by least squares."""
    from_middle, to_middle = points.mean(axis=0), measured.mean(axis=0)
    a, b = points - from_middle, measured - to_middle
    dot, cross = np.sum(a * b), np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    if np.hypot(dot, cross) < 0.1 * np.sum(a**2):  # the ratio is about 1 for the hub's own ring
        raise CalibrationError("the pegs are not an image of the hub's ring; check that they are labelled clockwise")
    theta = np.arctan2(cross, dot)
    cos, sin = np.cos(theta), np.sin(theta)
    rotation = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return Pose(rotation, np.array([*(to_middle - rotation[:2, :2] @ from_middle), 0.0]))


def _fit_six_degrees(observation, centers, camera, hub):
    """Least squares over the pegs' images, started from where pegs, bore and screws agree.

    From far away a plane and its mirror image, tilted the other way, look the same (weak perspective); three
    pegs alone even allow up to four poses.  Bore and screws lie at another height and tell these poses apart.
    """
    pegs, parts = _pegs(centers, hub), _all_parts(observation, centers, hub)
    parallel = _parallel_pose(camera.to_normalized(centers), hub)
    near = descend(parallel, parts.centers, camera.to_normalized(parts.measured), NEAR)
    try:
        return fit_pose(approach(near, parts, camera, NEAR)[0], pegs, camera)
    except ValueError as error:
        raise CalibrationError(
            "no pose puts the hub in front of the camera; check that its pegs are labelled clockwise on the screen"
        ) from error


def _pegs(centers, hub):
    return Discs(hub.peg_centers, np.full(hub.n_pegs, hub.peg_radius), centers)


def _all_parts(observation, centers, hub):
    """Pegs, screws and bore."""
    screws = as_points(observation.screw_centers, 2, "observation.screw_centers")
    if len(screws) != len(hub.screw_centers):
        raise ValueError(f"observation.screw_centers has {len(screws)} rows; expected {len(hub.screw_centers)}")
    bore = as_points([observation.bore_center], 2, "observation.bore_center")
    radii = [hub.peg_radius] * hub.n_pegs + [hub.screw_radius] * len(screws) + [hub.bore_radius]
    discs = np.vstack([hub.peg_centers, hub.screw_centers, hub.bore_center])
    return Discs(discs, np.array(radii), np.vstack([centers, screws, bore]))


def _parallel_pose(normalized, hub):
    """The pose parallel to the image that fits the pegs' directions (n, 2) best."""
    pegs = hub.peg_centers[:, :2]
    size = np.linalg.norm(normalized - normalized.mean(axis=0))
    if size == 0:
        raise CalibrationError("all pegs were measured in one place; check the observation")
    depth = np.linalg.norm(pegs - pegs.mean(axis=0)) / size
    flat = _fit_flat(pegs, normalized * depth)
    return Pose(flat.rotation, np.array([*flat.translation[:2], depth]))


# ---- input ----


def _as_plane(plane):
    """Return `plane` if its z axis points away from the camera."""
    if as_pose(plane, "plane").inv().translation[2] >= 0:
        raise ValueError("plane is seen from below: its z axis has to point away from the camera")
    return plane


def _noise(observation, count):
    """Covariances (n, 2, 2) of the pegs' centres, px^2, or None where the observation tells none; infinite is allowed."""
    for name, shape in (("peg_covariances", (count, 2, 2)), ("peg_sigmas", (count, 2))):
        if getattr(observation, name, None) is not None:
            stated = np.asarray(getattr(observation, name), np.float64)
            if stated.shape != shape or np.isnan(stated).any():
                raise ValueError(f"observation.{name} has shape {stated.shape}; expected {shape}, without NaN")
            return stated if stated.ndim == 3 else np.where(np.eye(2, dtype=bool), stated[..., None] ** 2, 0.0)
    return None
