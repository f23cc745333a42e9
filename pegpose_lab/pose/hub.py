"""Pose estimation of the hub from its pegs (Sect. 3.2): in a known plane, or with all six degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..checks import CalibrationError, as_pose
from .discs import Pose, back_project_discs, place_discs, pose_of
from .fit import NEAR, approach, descend, fit_in_plane, fit_pose
from .misfit import misfit_flags
from .observed import observed_discs, other_parts
from .two_poses import choose, flags_of, mirrored_fit
from .uncertainty import Causes, budget_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..calibration import Calibration
    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from ..flags import Flag
    from ..patterns import RingPattern
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
    used : (n,) bool ndarray
        The pegs that were measured, in part or whole; for the others `residuals` compare two predictions.
    chi2 : float
        Sum of the squared residuals of centres and radii over their variances; in px^2 if the observation has none.
    alternative : RigidTransform or None
        The other pose of a plane, tilted the other way, where there is one that explains the pegs, too.
    log_likelihood_ratio : float
        ln of the likelihood of this pose over that of the `alternative`: infinite without one.
    flags : tuple of Flag
        "two-poses" if the alternative is not clearly less likely, "misfit-pegs" if the pegs do not fit the pose.
    covariance : (6, 6) ndarray or None
        Of the pose in the order (x, y, z, rotation vector), mm and rad: of a left perturbation in the frame that has the
        axes of the camera and its origin at the hub's.  The first three are those of ``cam_from_hub.translation``.  It
        is the sum of the `budget`.  None if the observation has no sigmas; infinite on the diagonal where they do not
        determine the pose.
    budget : dict of (6, 6) ndarray
        The covariance by cause: "discs" (with an exact camera, and an exact plane if there is one: rank 3 then), "part",
        "calibration" and "plane", as far as `estimate_pose` was told of them.

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
    used: np.ndarray
    chi2: float
    covariance: np.ndarray | None = None
    budget: dict[str, np.ndarray] = field(default_factory=dict)
    alternative: RigidTransform | None = None
    log_likelihood_ratio: float = np.inf
    flags: tuple[Flag, ...] = ()

    @property
    def rms(self) -> float:
        """Rms reprojection error of the pegs that were used: root of the mean squared length of the residuals, px."""
        return float(np.sqrt(np.mean(np.sum(self.residuals[self.used] ** 2, axis=1))))


def estimate_pose(
    observation: PegObservation,
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera | Calibration,
    hub: Hub | RingPattern,
    *,
    plane: RigidTransform | None = None,
    plane_view: int | None = None,
    plane_covariance: ArrayLike | None = None,
    part_sigma: float = 0.0,
) -> HubPose:
    r"""Estimate the pose of the hub, or of a ring, (its extrinsics) from its pegs in one image.

    It minimises, over the pose p,

    .. math:: \chi^2 = \sum_k (m_k(p) - m_k)^T C_k^{-1} (m_k(p) - m_k)

    where :math:`m_k` are centre and radius of the image of peg k, and :math:`C_k` their covariance: a peg of which
    only a part is seen counts less, one that is not seen does not count.  Three pegs are enough.

    Parameters
    ----------
    observation : PegObservation
        `peg_centers` and `peg_radii` in px, in label order; `peg_covariances` (n, 2, 2), px^2, or `peg_sigmas` (n, 2),
        px, of the centres, infinite for a peg that was not seen (without them all pegs count alike, and there is no
        covariance); `peg_radius_sigmas` (n,), px, without which the radii are not used.  Of a `Hub` without `plane` also
        `screw_centers` and `bore_center`: they lie at another height and tell the two poses of a plane apart.
    camera : camera or Calibration
        A `Calibration` also gives the uncertainty of the camera's parameters.
    hub : Hub or RingPattern
        A ring's lengths must be in mm.
    plane : RigidTransform, optional
        cam_from_plane of the plane of the peg tops, its z axis away from the camera.  With it the pose has the
        paper's three degrees of freedom x, y and theta; without it all six.
    plane_view : int, optional
        The view of the calibration whose pose the plane shares: a board that lies in it, or at a known height.  The errors
        of this pose and of the camera's parameters go together.
    plane_covariance : (6, 6) array_like, optional
        Of the plane's pose if it is known from elsewhere, in the order and the frame of `HubPose.covariance`, at the
        plane's own origin.
    part_sigma : float
        Standard deviation, mm, of a peg's place on the part, per axis, and of its radius.

    Returns
    -------
    HubPose

    Raises
    ------
    ValueError
        If an argument is unusable, the plane is seen from below, or it is missed by a peg's ray.
    CalibrationError
        If the pegs do not determine a pose, or fewer than three are seen.

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
    causes = Causes.checked(camera, plane, plane_view, plane_covariance, part_sigma)
    camera = getattr(camera, "camera", camera)
    discs, seen, used, known = observed_discs(observation, hub)
    if plane is None:
        frame = Pose(np.eye(3), np.zeros(3))
        fit, other, ratio = choose(*_fit_six_degrees(observation, discs, camera, hub))
    else:
        frame, other, ratio = pose_of(_as_plane(plane)), None, np.inf
        in_plane = camera.back_project(discs.measured, plane)
        flat = _fit_flat(discs.centers[:, :2], in_plane[:, :2])
        start = Pose(frame.rotation @ flat.rotation, frame.rotation @ flat.translation + frame.translation)
        fit = fit_in_plane(start, discs, camera, frame.rotation)
    rotation, translation = fit.pose
    images = fit.images if used.all() else seen.images(fit.pose, camera)
    residuals = images.centers - seen.measured
    tops, tops_radii = _tops(seen, camera, fit.pose, images, residuals)
    budget = budget_of(fit, discs, np.linalg.pinv(discs.information), causes) if known else {}
    x, y, _ = frame.rotation.T @ (translation - frame.translation)
    cos, sin, _ = frame.rotation.T @ rotation[:, 0]
    return HubPose(
        cam_from_hub=_transform(fit.pose),
        x=float(x),
        y=float(y),
        theta=float(np.arctan2(sin, cos)),
        peg_centers=tops @ rotation.T + translation,
        peg_radii=tops_radii,
        residuals=residuals,
        used=used,
        chi2=fit.cost,
        covariance=sum(budget.values()) if known else None,
        budget=budget,
        alternative=None if other is None else _transform(other.pose),
        log_likelihood_ratio=ratio,
        flags=(*flags_of(ratio), *misfit_flags(fit, discs, 6 if plane is None else 3, known)),
    )


def _tops(seen, camera, pose, images, residuals):
    """Where the pegs are in the plane of their tops, and their radii, mm in the hub's frame."""
    measured = seen.measured, seen.measured_radii
    if (np.abs(residuals).max(axis=1) > images.radii).any():  # too far off for Newton's method from there
        return back_project_discs(*measured, camera, _transform(pose))
    return place_discs(*measured, camera, pose, seen.centers, seen.radii, images)


def _transform(pose):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose
    return RigidTransform(matrix, normalize=False)


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


def _fit_six_degrees(observation, discs, camera, hub):
    """The fits of a plane's two poses (the second is None if it is the first again), and the costs of the other parts.

    From far away a plane and its mirror image, tilted the other way, look the same (weak perspective); three
    pegs alone even allow up to four poses.  Bore and screws lie at another height and tell these poses apart.
    """
    others = other_parts(observation, hub)
    parts = discs if others is None else discs.joined(others)
    near = descend(
        _parallel_pose(camera.to_normalized(discs.measured), discs.centers),
        parts.centers,
        camera.to_normalized(parts.measured),
        NEAR,
    )
    try:
        first = fit_pose(approach(near, parts, camera, NEAR)[0], discs, camera)
    except ValueError as error:
        raise CalibrationError(
            "no pose puts the hub in front of the camera; check that its pegs are labelled clockwise on the screen"
        ) from error
    second = mirrored_fit(first, discs, camera)
    if others is None or second is None:
        return [first, second], [0.0, 0.0]
    return [first, second], [others.cost(others.images(fit.pose, camera)) for fit in (first, second)]


def _parallel_pose(normalized, pegs):
    """The pose parallel to the image that fits the directions (n, 2) to the pegs (n, 3) best."""
    pegs = pegs[:, :2]
    size = np.linalg.norm(normalized - normalized.mean(axis=0))
    if size == 0:
        raise CalibrationError("all pegs were measured in one place; check the observation")
    depth = np.linalg.norm(pegs - pegs.mean(axis=0)) / size
    flat = _fit_flat(pegs, normalized * depth)
    return Pose(flat.rotation, np.array([*flat.translation[:2], depth]))


def _as_plane(plane):
    """Return `plane` if its z axis points away from the camera."""
    if as_pose(plane, "plane").inv().translation[2] >= 0:
        raise ValueError("plane is seen from below: its z axis has to point away from the camera")
    return plane
