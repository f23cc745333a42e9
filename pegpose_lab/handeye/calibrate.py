"""Hand-eye calibration: checks, closed start, least squares, and what leaving out poses says of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import t as student

from ..checks import CalibrationError, as_number, as_points
from ..flags import Flag
from .adjust import adjust
from .identify import demand_in_front, demand_pairs, demand_turns, length_flags
from .pairs import Pairs, as_pose_list
from .resample import leave_out
from .result import HandEye
from .start import closed_rotations, closed_solution

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

FAR_POSE = 4.0
"""Distance of a pose left out over the median of all, from which it does not fit the others: errors of one size stay below
2.5 in 1000 sets of 10 poses, and errors that differ between poses by a factor of two are above it in one set of ten."""
CERTAIN = 0.9995
"""Quantile from which the target's size is said to be wrong: once in 1000 right targets."""


def calibrate_hand_eye(
    robot_from_end_effector: Sequence[RigidTransform],
    cam_from_target: Sequence[RigidTransform],
    *,
    setup: str = "eye-to-hand",
    working_point: ArrayLike = (0.0, 0.0, 0.0),
    translation_sigma: float | None = None,
    rotation_sigma: float | None = None,
    estimate_scale: bool = False,
) -> HandEye:
    r"""Find where a camera is on a robot, from poses of the robot and of a target that the camera sees.

    The rotations and translations of both unknown poses are least squares' together, after a closed start (Shah 2013):

    .. math:: {}^R T_{E,i} \, {}^E T_T = {}^R T_C \, {}^C T_{T,i} \quad\text{(eye-to-hand)}, \qquad
        {}^R T_{E,i} \, {}^E T_C \, {}^C T_{T,i} = {}^R T_T \quad\text{(eye-in-hand)}

    with residuals in the camera's frame, since most of the noise is the camera's.  Covariances come from leaving out whole
    poses, because those from residuals are about three times too optimistic on real poses.

    Parameters
    ----------
    robot_from_end_effector : sequence of n RigidTransform
        The end effector (flange) in the robot's base, mm, n >= 5; 10 to 20 with turns of 20 deg and more about two axes are
        good.
    cam_from_target : sequence of n RigidTransform
        The target at the same moments, mm (`board_pose`).
    setup : {"eye-to-hand", "eye-in-hand"}
        The camera is on a stand and the target on the end effector, or the camera on the end effector.
    working_point : (3,) array_like
        In the target's frame, mm: where positions are compared, best in the middle of the target.
    translation_sigma, rotation_sigma : float, optional
        Standard deviations per axis of `cam_from_target` at the working point, mm and rad, which weigh the residuals; both
        or neither.  They are estimated from the residuals otherwise.
    estimate_scale : bool
        The target's size is unknown: all translations of `cam_from_target` are too large by one factor.

    Returns
    -------
    HandEye

    Raises
    ------
    ValueError
        If the input is unusable, or the target lies behind the camera.
    CalibrationError
        If the turns are about parallel axes, or absent, or the poses do not fit each other: shuffled, inverted or
        transposed, or in other units; the message says which.

    References
    ----------
    M. Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker product", 2013 (start);
    K. H. Strobl, G. Hirzinger, "Optimal hand-eye calibration", 2006 (both errors together).

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> from pegpose_lab import calibrate_hand_eye
    >>> rng = np.random.default_rng(0)
    >>> robot_from_cam = RigidTransform.from_components([800, 0, 600], Rotation.from_euler("x", 180, degrees=True))
    >>> end_effector_from_target = RigidTransform.from_translation([-50, -40, 20])
    >>> turns = Rotation.from_rotvec(0.3 * rng.standard_normal((12, 3)))
    >>> seen = RigidTransform.from_components(rng.uniform([-100, -100, 450], [100, 100, 600], (12, 3)), turns)
    >>> robot = robot_from_cam * seen * end_effector_from_target.inv()
    >>> noise = RigidTransform.from_components(0.2 * rng.standard_normal((12, 3)), Rotation.identity())
    >>> found = calibrate_hand_eye(robot, noise * seen)
    >>> error = found.mount_from_cam.translation - robot_from_cam.translation
    >>> bool((np.abs(error) < found.half_widths[:3]).all()), round(found.left_out_error, 1)
    (True, 0.4)
    """
    robot = as_pose_list(robot_from_end_effector, "robot_from_end_effector")
    target = as_pose_list(cam_from_target, "cam_from_target")
    pairs = Pairs.of_poses(robot, target, setup)
    point = as_points([working_point], 3, "working_point")[0]
    given = _given(translation_sigma, rotation_sigma)
    if not isinstance(estimate_scale, bool):
        raise ValueError(f"estimate_scale is {estimate_scale!r}; expected True or False")
    demand_in_front(pairs, point)
    flags = demand_turns(pairs) + length_flags(pairs)
    demand_pairs(robot, target, setup)
    fit, resampled = _solved(pairs, point, given, estimate_scale)
    flags += _far_poses(resampled.distances)
    if not estimate_scale:
        flags += _scale_flags(pairs, point, given)
    solution, covariance = fit.solution, resampled.covariance
    return HandEye(
        setup=setup,
        mount_from_cam=_pose(solution.x_turn, solution.x_shift),
        covariance=covariance[:6, :6],
        degrees_of_freedom=resampled.degrees_of_freedom[:6],
        holder_from_target=_pose(solution.y_turn, solution.y_shift),
        holder_covariance=covariance[6:12, 6:12],
        target_scale=solution.scale,
        target_scale_sigma=float(np.sqrt(covariance[12, 12])) if estimate_scale else 0.0,
        translation_sigma=float(fit.sigmas[0]),
        rotation_sigma=float(fit.sigmas[3]),
        residuals=fit.residuals,
        left_out=resampled.left_out,
        working_point=point,
        flags=flags,
        joint_covariance=covariance,
    )


def _given(translation_sigma, rotation_sigma):
    """The sigmas (rotation, translation), or None if they are to be estimated."""
    if translation_sigma is None and rotation_sigma is None:
        return None
    if translation_sigma is None or rotation_sigma is None:
        raise ValueError("translation_sigma and rotation_sigma weigh each other; expected both, or neither")
    return tuple(
        as_number(value, name, 0, exclusive=True)
        for value, name in ((rotation_sigma, "rotation_sigma"), (translation_sigma, "translation_sigma"))
    )


def _solved(pairs, point, given, scaled):
    fit = adjust(pairs, closed_solution(pairs, *closed_rotations(pairs), scaled), point, scaled, given)
    return fit, leave_out(fit)


def _pose(turn, shift):
    return RigidTransform.from_components(shift, Rotation.from_matrix(turn))


def _far_poses(distances):
    """A flag on poses that the others do not predict."""
    middle = float(np.median(distances))
    far = np.flatnonzero(distances > FAR_POSE * middle)
    if not middle or not len(far):
        return []
    named = ", ".join(map(str, far))
    text = (
        f"Poses {named} (counted from 0) are off what the others predict by {distances.max() / middle:.0f} times the "
        "median: check that robot and picture are of one moment, and leave them out."
    )
    return [Flag("misfit-pose", text)]


def _scale_flags(pairs, point, given):
    """A flag if the robot's own motion says that the target has another size."""
    try:
        fit, resampled = _solved(pairs, point, given, True)
    except CalibrationError:  # the motion does not determine the size, and says nothing against it
        return []
    off, sigma = fit.solution.scale - 1, float(np.sqrt(resampled.covariance[12, 12]))
    if abs(off) < student.ppf(CERTAIN, resampled.degrees_of_freedom[12]) * sigma:
        return []
    text = (
        f"By the robot's motion the target is {1 + off:.4f} +- {sigma:.4f} times its stated size: check the size (or the "
        "camera's focal length), or estimate the scale."
    )
    return [Flag("target-scale", text)]
