"""Calibration: finds the camera and its poses, with their uncertainty, from the corners of one or several views.

`two_stage` is the paper's method, `joint` is bundle adjustment of all views and `zhang` is the baseline.  All of
them return a `result.Calibration`.  `uncertainty` says how well a calibration projects, `differencing` how far two
differ over the image, and `halves` whether halves of the views agree.  A calibration method is one file here and one
line in the table `methods.CALIBRATION_METHODS`, which `study` and the notebooks read (.github/CONTRIBUTING.md shows an
example).
"""

from .board import BoardShape
from .differencing import CalibrationDifference, difference
from .halves import Halves, split_halves
from .image_map import ImageMap, image_grid
from .joint.calibrate import calibrate_joint
from .joint.dlt import calibrate_dlt
from .joint.profile import profile_focal_length, weakest_direction
from .methods import CALIBRATION_METHODS
from .pose_of_board import board_pose, board_poses
from .result import Calibration
from .two_stage.flags import edge_intervals
from .two_stage.genes import BOX
from .two_stage.genetic import minimize_genetic
from .two_stage.objective import PENALTY, TwoStageObjective
from .two_stage.operators import blend_crossover, power_mutation
from .two_stage.oracle import optimum_in_box
from .two_stage.ratios import solve_images
from .two_stage.stages import calibrate_genetic, calibrate_tsai, calibration_at, repeat_calibration
from .two_stage.tsai import solve_coplanar
from .uncertainty import ProjectionUncertainty, projection_uncertainty
from .zhang import calibrate_zhang

__all__ = [
    "BOX",
    "BoardShape",
    "Calibration",
    "CALIBRATION_METHODS",
    "CalibrationDifference",
    "Halves",
    "ImageMap",
    "PENALTY",
    "ProjectionUncertainty",
    "TwoStageObjective",
    "blend_crossover",
    "board_pose",
    "board_poses",
    "calibrate_dlt",
    "calibrate_genetic",
    "calibrate_joint",
    "calibrate_tsai",
    "calibrate_zhang",
    "calibration_at",
    "difference",
    "edge_intervals",
    "image_grid",
    "minimize_genetic",
    "optimum_in_box",
    "power_mutation",
    "profile_focal_length",
    "projection_uncertainty",
    "repeat_calibration",
    "solve_coplanar",
    "solve_images",
    "split_halves",
    "weakest_direction",
]
