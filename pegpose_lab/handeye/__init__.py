"""Hand-eye calibration: where the camera is on the robot, how sure that is, and the chain from the hub to the robot.

`pairs` has the equation of both set-ups, `start` its closed solution, `adjust` the least squares, `resample` what leaving
out poses says, `identify` what the poses cannot determine, `result` Eqs. 1 and 2 with covariances on `uncertain` poses.
"""

from .calibrate import calibrate_hand_eye
from .result import HandEye
from .uncertain import UncertainPose

__all__ = ["HandEye", "UncertainPose", "calibrate_hand_eye"]
