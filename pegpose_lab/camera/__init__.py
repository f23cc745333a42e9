"""Camera models: a ray of the scene to a pixel, and back.

A lens model is one file here, with the methods that `pinhole` lists.
"""

from .opencv import OpenCVCamera
from .pinhole import UNKNOWN_SIZE
from .radial import distort_radius, max_undistorted_radius
from .sensor import Sensor
from .tsai import TsaiCamera, as_sensor

__all__ = [
    "OpenCVCamera",
    "Sensor",
    "TsaiCamera",
    "UNKNOWN_SIZE",
    "as_sensor",
    "distort_radius",
    "max_undistorted_radius",
]
