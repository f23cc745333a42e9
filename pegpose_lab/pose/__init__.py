"""Pose estimation: the hub from its pegs (Sect. 3.2), and the chain from the camera to the robot (Sect. 2, Eqs. 1 and 2).

`discs` has discs in perspective, `observed` what was seen of them, `fit` the least squares, `two_poses` the choice between the
two poses of a plane, `hub` the pose, `chain` the paper's own formulas, `detection` a pose as a file for
ROS, `table` a sequence of them.  Another method of pose estimation is one file here.
"""

from .chain import (
    hub_from_end_effector,
    line_angle,
    line_angle_printed,
    misalignment,
    robot_from_end_effector,
    scale_coordinates,
)
from .detection import Detection, detection_of, read_detection, write_detection
from .discs import project_discs
from .hub import HubPose, estimate_pose
from .table import pose_table, read_pose_table, table_poses, write_pose_table
from .uncertainty import carried_motion

__all__ = [
    "Detection",
    "HubPose",
    "carried_motion",
    "detection_of",
    "estimate_pose",
    "hub_from_end_effector",
    "line_angle",
    "line_angle_printed",
    "misalignment",
    "pose_table",
    "project_discs",
    "read_detection",
    "read_pose_table",
    "robot_from_end_effector",
    "scale_coordinates",
    "table_poses",
    "write_detection",
    "write_pose_table",
]
