"""Camera models: a ray of the scene to a pixel, and back.

A lens model is one file here, with the methods that `pinhole` lists.
"""

from .fisheye import FisheyeCamera, equidistant
from .opencv import OpenCVCamera
from .pinhole import UNKNOWN_SIZE
from .radial import distort_radius, max_undistorted_radius
from .sensitivity import by_direction, by_turn, lens_covariance, lens_derivative
from .sensor import Sensor
from .tsai import TsaiCamera, as_sensor

CAMERA_MODELS = (TsaiCamera, OpenCVCamera, FisheyeCamera)
"""The camera models; whatever takes a camera takes any of them."""

__all__ = [
    "CAMERA_MODELS",
    "FisheyeCamera",
    "OpenCVCamera",
    "Sensor",
    "TsaiCamera",
    "UNKNOWN_SIZE",
    "as_sensor",
    "by_direction",
    "by_turn",
    "distort_radius",
    "equidistant",
    "lens_covariance",
    "lens_derivative",
    "max_undistorted_radius",
]
