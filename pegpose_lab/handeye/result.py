"""The result of a hand-eye calibration, and the chain from the hub to the robot that it closes (Eqs. 1 and 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import t as student

from ..checks import as_pose
from .adjust import evaluate
from .pairs import Pairs, as_pose_list
from .start import Solution
from .uncertain import UncertainPose

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.spatial.transform import RigidTransform

    from ..flags import Flag


@dataclass(frozen=True, eq=False)
class HandEye:
    """Where the camera is on the robot (`calibrate_hand_eye`).

    The mount holds the camera, the holder the target: with ``setup="eye-to-hand"`` the robot's base and the end effector,
    with ``"eye-in-hand"`` the end effector and the robot's base.

    Attributes
    ----------
    setup : str
        "eye-to-hand" or "eye-in-hand".
    mount_from_cam : RigidTransform
        robot_from_cam (eye-to-hand) or end_effector_from_cam (eye-in-hand), mm.
    covariance : (6, 6) ndarray
        Of `mount_from_cam` in the order (x, y, z, rotation vector), mm and rad: of a left perturbation in the axes of the
        mount, from leaving out whole poses.
    degrees_of_freedom : (6,) ndarray
        Of Student's intervals with these variances.
    holder_from_target : RigidTransform
        end_effector_from_target (eye-to-hand) or robot_from_target (eye-in-hand), mm.
    holder_covariance : (6, 6) ndarray
        Of `holder_from_target`, in the axes of the holder.
    target_scale : float
        Size of the target over its stated size; 1 unless it was estimated.
    target_scale_sigma : float
        0 unless it was estimated.
    translation_sigma, rotation_sigma : float
        Standard deviations per axis of a measured pose, at the working point, mm, and rad: estimated, or as given.
    residuals : (n, 6) ndarray
        Measured minus predicted, in the camera's axes: working point, mm, and rotation vector, rad.
    left_out : (n, 6) ndarray
        The same, where the prediction is from the other poses: what the calibration errs by at a new pose.
    working_point : (3,) ndarray
        In the target's frame, mm.
    flags : list of Flag
    joint_covariance : (k, k) ndarray
        Of mount_from_cam, holder_from_target, and the scale if it was estimated.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> from pegpose_lab import UncertainPose, calibrate_hand_eye
    >>> rng = np.random.default_rng(0)
    >>> turns = Rotation.from_rotvec(0.3 * rng.standard_normal((8, 3)))
    >>> seen = RigidTransform.from_components(rng.uniform(400, 600, (8, 3)), turns)
    >>> base = RigidTransform.from_translation([1000.0, 0.0, 0.0])
    >>> found = calibrate_hand_eye(base * seen, seen)  # the target's frame is the end effector's
    >>> hub = UncertainPose.exact(RigidTransform.from_translation([10.0, 20.0, 400.0]))
    >>> found.robot_from_hub(hub).pose.translation.round(3).tolist()
    [1010.0, 20.0, 400.0]
    """

    setup: str
    mount_from_cam: RigidTransform
    covariance: NDArray[np.float64]
    degrees_of_freedom: NDArray[np.float64]
    holder_from_target: RigidTransform
    holder_covariance: NDArray[np.float64]
    target_scale: float
    target_scale_sigma: float
    translation_sigma: float
    rotation_sigma: float
    residuals: NDArray[np.float64]
    left_out: NDArray[np.float64]
    working_point: NDArray[np.float64]
    flags: list[Flag]
    joint_covariance: NDArray[np.float64]

    @property
    def half_widths(self) -> NDArray[np.float64]:
        """Half the 95 % intervals (6,) of `mount_from_cam`: mm, and rad about the mount's axes."""
        return student.ppf(0.975, self.degrees_of_freedom) * np.sqrt(np.diag(self.covariance))

    @property
    def left_out_error(self) -> float:
        """Rms distance at the working point between a pose's measurement and what the other poses predict, mm."""
        return float(np.sqrt(np.mean(np.sum(self.left_out[:, :3] ** 2, axis=1))))

    @property
    def left_out_turn(self) -> float:
        """Rms angle between a pose's measurement and what the other poses predict, rad."""
        return float(np.sqrt(np.mean(np.sum(self.left_out[:, 3:] ** 2, axis=1))))

    def cam_from_target(self, robot_from_end_effector: RigidTransform) -> UncertainPose:
        """Predict the pose of the calibration's target for a pose of the robot.

        Parameters
        ----------
        robot_from_end_effector : RigidTransform
            mm.

        Returns
        -------
        UncertainPose
            cam_from_target, in true mm; its covariance is that of the calibration, without the noise of a measurement.

        Raises
        ------
        ValueError
            If it is not one pose.
        """
        predicted, design = self._prediction(robot_from_end_effector, np.zeros(3))
        return UncertainPose(predicted, design @ self.joint_covariance[:12, :12] @ design.T)

    def new_pose_half_widths(self, robot_from_end_effector: RigidTransform) -> NDArray[np.float64]:
        """Half the 95 % intervals of measured less predicted at a new pose of the robot, of calibration and measurement.

        Parameters
        ----------
        robot_from_end_effector : RigidTransform
            mm.

        Returns
        -------
        (6,) ndarray
            In the camera's axes: of the working point, mm, and of the rotation vector, rad.

        Raises
        ------
        ValueError
            If it is not one pose.
        """
        _, design = self._prediction(robot_from_end_effector, self.working_point)
        calibration = np.diag(design @ self.joint_covariance[:12, :12] @ design.T)
        noise = np.repeat([self.translation_sigma, self.rotation_sigma], 3) ** 2
        freedom = (self.residuals.size - len(self.joint_covariance)) / 2  # of each of the two sigmas
        both = calibration + noise  # the degrees of freedom of a sum are Welch and Satterthwaite's
        degrees = both**2 / (calibration**2 / self.degrees_of_freedom.mean() + noise**2 / freedom)
        return student.ppf(0.975, degrees) * np.sqrt(both)

    def _prediction(self, robot_from_end_effector, point):
        """cam_from_target, and its derivatives (6, 12) at a point of the target by the calibration's poses."""
        robot = as_pose_list([as_pose(robot_from_end_effector, "robot_from_end_effector")], "robot_from_end_effector")
        a, x, y = robot if self.setup == "eye-to-hand" else robot.inv(), self.mount_from_cam, self.holder_from_target
        predicted = x.inv() * a * y
        pairs = Pairs(a.rotation.as_matrix(), a.translation, predicted.rotation.as_matrix(), predicted.translation)
        solution = Solution(x.rotation.as_matrix(), x.translation, y.rotation.as_matrix(), y.translation, 1.0)
        return predicted[0], evaluate(pairs, solution, point, False)[1][0]

    def robot_from_hub(
        self, cam_from_hub: UncertainPose, robot_from_end_effector: UncertainPose | None = None
    ) -> UncertainPose:
        r"""The hub in the robot's base, to which Eq. 1 sends the end effector, with its covariance.

        .. math:: {}^R T_P = {}^R T_C \, {}^C T_P \qquad\text{or}\qquad {}^R T_P = {}^R T_E \, {}^E T_C \, {}^C T_P

        Parameters
        ----------
        cam_from_hub : UncertainPose
            ``UncertainPose.checked(found.cam_from_hub, found.covariance)`` of a `HubPose`.
        robot_from_end_effector : UncertainPose, optional
            Where the picture was taken; needed if the camera is on the end effector.

        Returns
        -------
        UncertainPose
            Times ``UncertainPose.exact(hub_from_end_effector)`` it is Eq. 1's pose of the end effector.

        Raises
        ------
        ValueError
            If the pose of the end effector is needed and missing, or an argument is not an `UncertainPose`.
        """
        mount_from_hub = self._mount_from_hub(cam_from_hub)
        if self.setup == "eye-to-hand":
            return mount_from_hub
        return _uncertain(robot_from_end_effector, "robot_from_end_effector") * mount_from_hub

    def hub_from_end_effector(
        self, cam_from_hub: UncertainPose, robot_from_end_effector: UncertainPose | None = None
    ) -> UncertainPose:
        r"""Eq. 2 with its covariance: the end effector in the hub's frame.

        .. math:: {}^P T_E = [{}^C T_P]^{-1} \, {}^C T_E

        Parameters
        ----------
        cam_from_hub : UncertainPose
        robot_from_end_effector : UncertainPose, optional
            Needed if the camera is on a stand.

        Returns
        -------
        UncertainPose

        Raises
        ------
        ValueError
            As for `robot_from_hub`.
        """
        hub_from_mount = self._mount_from_hub(cam_from_hub).inv()
        if self.setup == "eye-in-hand":
            return hub_from_mount
        return hub_from_mount * _uncertain(robot_from_end_effector, "robot_from_end_effector")

    def _mount_from_hub(self, cam_from_hub):
        mount = UncertainPose(self.mount_from_cam, self.covariance)
        return mount * _uncertain(cam_from_hub, "cam_from_hub")


def _uncertain(pose, name):
    """The pose; ValueError if it is not an `UncertainPose`."""
    if not isinstance(pose, UncertainPose):
        raise ValueError(
            f"{name} is {type(pose).__name__}; expected an UncertainPose (UncertainPose.exact without errors)"
        )
    return pose
