"""Vision-based pose of a wheel-hub with several pegs: the paper's method, its audit, and better.

The package follows the paper "Vision Based Pose Estimation of Multiple Peg-in-Hole for Robotic
Assembly" step by step.  Data flow one way::

    image  -> mask -> circles -> discs -> labelled pegs -> pose
    boards -> corners -> stage 1 (Tsai) -> stage 2 (genetic) -> camera

Conventions, the same everywhere
--------------------------------
Units
    millimetres, radians, pixels.  The distortion coefficient ``kappa1`` is in mm^-2 on the sensor.
Image frame
    x to the right, y down; the centre of the first pixel is (0, 0).
Camera frame
    x to the right, y down, z forward along the optical axis; origin in the centre of projection.
Board frame
    origin in the first corner, x along a row, y along a column, the corners in the plane z = 0.
Hub frame
    origin in the hub's centre in the plane of the peg tops, x towards peg 1, z away from the camera
    (into the hub).  Peg k stands at 2 pi (k - 1)/n about z: clockwise on the screen.  With four pegs
    the screws stand at -pi/4 and 3 pi/4 from peg 1.
Poses
    ``a_from_b`` is a `scipy.spatial.transform.RigidTransform` that takes coordinates in frame b to
    coordinates in frame a: ``cam_from_board.apply(points)``.
Points
    rows of (n, 2) or (n, 3) float64 arrays.
Images
    (height, width) uint8 arrays.
Distortion
    `TsaiCamera` *undistorts*, x_u = x_d (1 + kappa1 r_d^2) (Eq. 3); OpenCV *distorts*,
    x_d = x_u (1 + k1 r_u^2 + ...).  The signs are opposite: k1 is about -kappa1 f^2.
    `FisheyeCamera` distorts the angle to the axis.
Residuals
    projected minus measured, px, (n, 2).
Randomness
    an argument ``rng``, passed to `numpy.random.default_rng`; no function draws from a global state.

Glossary
--------
=================  ======================================================  ==============================
name               paper                                                   unit, shape
=================  ======================================================  ==============================
object_points      x_w, y_w, z_w                                           mm, (n, 3)
image_points       x_f, y_f (projected), x_i, y_i (measured)               px, (n, 2)
focal_length       f                                                       mm
pixel_pitch        d_x, d_y                                                mm/px, pair
principal_point    centre of the frame                                     px, pair
scale_x            uncertainty scaling factor                              1
kappa1             k_1 (Eq. 3)                                             mm^-2, undistorting
camera_matrix      -                                                       OpenCV's, px, (3, 3)
dist_coeffs        -                                                       OpenCV's, distorting, (5,)
mean_distance      E_rms (Eq. 7, in truth a mean of distances)             px
rms                -                                                       px, sqrt of the mean squared 2-D
                                                                           distance (OpenCV's)
axis_std           -                                                       px, (2,), standard deviation per
                                                                           axis (the MATLAB toolbox's)
=================  ======================================================  ==============================

Unusable input raises `ValueError` that names the argument; `DetectionError` says that a picture does
not show what was looked for; `CalibrationError` that the data do not determine the answer.

Importing ``pegpose_lab`` itself imports nothing beyond the standard library, so that
``python3 -m pegpose_lab`` starts on a bare Python; the names below are loaded on first use.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # for tools; a name is loaded on its first use
    from .calibration import Calibration as Calibration
    from .calibration import board_pose as board_pose
    from .calibration import board_poses as board_poses
    from .calibration import calibrate_dlt as calibrate_dlt
    from .calibration import calibrate_genetic as calibrate_genetic
    from .calibration import calibrate_joint as calibrate_joint
    from .calibration import calibrate_tsai as calibrate_tsai
    from .calibration import calibrate_zhang as calibrate_zhang
    from .calibration import difference as difference
    from .calibration import edge_intervals as edge_intervals
    from .calibration import optimum_in_box as optimum_in_box
    from .calibration import profile_focal_length as profile_focal_length
    from .calibration import projection_uncertainty as projection_uncertainty
    from .calibration import split_halves as split_halves
    from .calibration import weakest_direction as weakest_direction
    from .camera import FisheyeCamera as FisheyeCamera
    from .camera import OpenCVCamera as OpenCVCamera
    from .camera import Sensor as Sensor
    from .camera import TsaiCamera as TsaiCamera
    from .checks import CalibrationError as CalibrationError
    from .checks import DetectionError as DetectionError
    from .circles import Circles as Circles
    from .circles import find_circles as find_circles
    from .corners import BoardCorners as BoardCorners
    from .corners import find_corners as find_corners
    from .corners import locate_board as locate_board
    from .discs import Discs as Discs
    from .discs import fit_discs as fit_discs
    from .flags import Flag as Flag
    from .handeye import HandEye as HandEye
    from .handeye import UncertainPose as UncertainPose
    from .handeye import calibrate_hand_eye as calibrate_hand_eye
    from .insertion import AssemblyForecast as AssemblyForecast
    from .insertion import Entry as Entry
    from .insertion import Wheel as Wheel
    from .insertion import assembly_forecast as assembly_forecast
    from .insertion import peg_entry as peg_entry
    from .patterns import RingMark as RingMark
    from .patterns import RingPattern as RingPattern
    from .pegs import LostFrame as LostFrame
    from .pegs import PegObservation as PegObservation
    from .pegs import locate_pegs as locate_pegs
    from .pegs import track_pegs as track_pegs
    from .pose import Detection as Detection
    from .pose import HubPose as HubPose
    from .pose import estimate_pose as estimate_pose
    from .pose import read_detection as read_detection
    from .pose import read_pose_table as read_pose_table
    from .pose import write_detection as write_detection
    from .pose import write_pose_table as write_pose_table
    from .render import render_board as render_board
    from .render import render_hub as render_hub
    from .segmentation import Segmentation as Segmentation
    from .segmentation import segment as segment
    from .servo import ServoRun as ServoRun
    from .servo import visual_servo as visual_servo
    from .targets import Checkerboard as Checkerboard
    from .targets import Hub as Hub

__version__ = "0.2.0"

_HOME = {
    "DetectionError": "checks",
    "CalibrationError": "checks",
    "Flag": "flags",
    "Sensor": "camera",
    "TsaiCamera": "camera",
    "OpenCVCamera": "camera",
    "FisheyeCamera": "camera",
    "Checkerboard": "targets",
    "Hub": "targets",
    "RingMark": "patterns",
    "RingPattern": "patterns",
    "render_board": "render",
    "render_hub": "render",
    "Segmentation": "segmentation",
    "segment": "segmentation",
    "Circles": "circles",
    "find_circles": "circles",
    "Discs": "discs",
    "fit_discs": "discs",
    "BoardCorners": "corners",
    "find_corners": "corners",
    "locate_board": "corners",
    "LostFrame": "pegs",
    "PegObservation": "pegs",
    "locate_pegs": "pegs",
    "track_pegs": "pegs",
    "Calibration": "calibration",
    "calibrate_tsai": "calibration",
    "calibrate_genetic": "calibration",
    "edge_intervals": "calibration",
    "optimum_in_box": "calibration",
    "calibrate_zhang": "calibration",
    "calibrate_joint": "calibration",
    "calibrate_dlt": "calibration",
    "profile_focal_length": "calibration",
    "projection_uncertainty": "calibration",
    "difference": "calibration",
    "split_halves": "calibration",
    "weakest_direction": "calibration",
    "board_pose": "calibration",
    "board_poses": "calibration",
    "Detection": "pose",
    "HubPose": "pose",
    "estimate_pose": "pose",
    "read_detection": "pose",
    "read_pose_table": "pose",
    "write_detection": "pose",
    "write_pose_table": "pose",
    "AssemblyForecast": "insertion",
    "Entry": "insertion",
    "HandEye": "handeye",
    "UncertainPose": "handeye",
    "Wheel": "insertion",
    "assembly_forecast": "insertion",
    "calibrate_hand_eye": "handeye",
    "peg_entry": "insertion",
    "ServoRun": "servo",
    "visual_servo": "servo",
}

__all__ = sorted(_HOME)


def __getattr__(name):
    if name in _HOME:
        return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted([*globals(), *_HOME])
