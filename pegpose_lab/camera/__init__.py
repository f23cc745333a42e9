"""Camera models: a ray of the scene to a pixel, and back.

A lens model is one file here, with the methods that `pinhole` lists.
"""

from .opencv import OpenCVCamera
from .pinhole import UNKNOWN_SIZE
from .radial import distort_radius, max_undistorted_radius
from .tsai import TsaiCamera, demand_tsai

__all__ = [
    "OpenCVCamera",
    "TsaiCamera",
    "UNKNOWN_SIZE",
    "demand_tsai",
    "distort_radius",
    "max_undistorted_radius",
]
