"""Pose estimation: the hub from its pegs (Sect. 3.2), and the chain from the camera to the robot (Sect. 2, Eqs. 1 and 2).

`discs` has discs in perspective, `observed` what was seen of them, `fit` the least squares, `two_poses` the choice between the
two poses of a plane, `hub` the pose, `chain` the paper's own formulas.  Another
method of pose estimation is one file here.
"""

from .chain import (
    hub_from_end_effector,
    line_angle,
    line_angle_printed,
    misalignment,
    robot_from_end_effector,
    scale_coordinates,
)
from .discs import project_discs
from .hub import HubPose, estimate_pose
from .uncertainty import carried_motion

__all__ = [
    "HubPose",
    "carried_motion",
    "estimate_pose",
    "hub_from_end_effector",
    "line_angle",
    "line_angle_printed",
    "misalignment",
    "project_discs",
    "robot_from_end_effector",
    "scale_coordinates",
]
