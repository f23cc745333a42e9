r"""Pairs of poses, and the one equation that both set-ups of hand-eye calibration lead to.

With the camera on a stand and the target on the robot's end effector (eye-to-hand), or the camera on the end effector
and the target on a stand (eye-in-hand), in turn

.. math:: {}^R T_{E,i} \, {}^E T_T = {}^R T_C \, {}^C T_{T,i}, \qquad
    ({}^R T_{E,i})^{-1} \, {}^R T_T = {}^E T_C \, {}^C T_{T,i}.

Both read :math:`A_i Y = X B_i`: X is the camera in the frame of its mount, Y the target in the frame of its holder, and
A_i the holder in the frame of the mount.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..checks import as_choice

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

SETUPS = ("eye-to-hand", "eye-in-hand")
LEAST_POSES = 5
"""Three poses determine X and Y, and each must be left out once; with four, the two sigmas cannot be told from the rest."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Poses A_i (mount from holder) and B_i (camera from target): turns (n, 3, 3) and shifts (n, 3), mm."""

    a_turns: NDArray[np.float64]
    a_shifts: NDArray[np.float64]
    b_turns: NDArray[np.float64]
    b_shifts: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.a_turns)

    @classmethod
    def of_poses(
        cls, robot_from_end_effector: Sequence[RigidTransform], cam_from_target: Sequence[RigidTransform], setup: str
    ) -> Pairs:
        """Checked pairs; ValueError if the poses are not two lists of equal length, or the set-up is unknown."""
        robot = as_pose_list(robot_from_end_effector, "robot_from_end_effector")
        target = as_pose_list(cam_from_target, "cam_from_target")
        if len(robot) != len(target):
            raise ValueError(
                f"robot_from_end_effector has {len(robot)} poses and cam_from_target {len(target)}; expected as many"
            )
        if len(robot) < LEAST_POSES:
            raise ValueError(
                f"robot_from_end_effector and cam_from_target have {len(robot)} poses; expected at least {LEAST_POSES}, "
                "better 10 to 20, with turns of the end effector about different axes"
            )
        return cls.stacked(robot, target, as_choice(setup, "setup", SETUPS))

    @classmethod
    def stacked(cls, robot: RigidTransform, target: RigidTransform, setup: str) -> Pairs:
        """The pairs of two stacks of poses that are checked already."""
        a = robot if setup == "eye-to-hand" else robot.inv()
        return cls(a.rotation.as_matrix(), a.translation, target.rotation.as_matrix(), target.translation)


def as_pose_list(poses: Sequence[RigidTransform], name: str) -> RigidTransform:
    """Return several poses as one stacked `RigidTransform`; ValueError if they are not a sequence of poses."""
    if isinstance(poses, RigidTransform) and not poses.single:
        stacked = poses
    else:
        try:
            stacked = RigidTransform.concatenate(list(poses))
        except (TypeError, ValueError, IndexError) as error:  # IndexError: of none
            raise ValueError(
                f"{name} is {type(poses).__name__}; expected a sequence of scipy RigidTransforms, one for each pose"
            ) from error
    if not np.isfinite(stacked.as_matrix()).all():
        raise ValueError(f"{name} of {len(stacked)} poses has NaN or infinite values; expected finite poses")
    return stacked
