"""Camera models: a ray of the scene to a pixel, and back.

A lens model is one file here, with the methods that `pinhole` lists.
"""

from .tsai import UNKNOWN_SIZE, OpenCVCamera, TsaiCamera, demand_tsai, distort_radius, max_undistorted_radius

__all__ = [
    "OpenCVCamera",
    "TsaiCamera",
    "UNKNOWN_SIZE",
    "demand_tsai",
    "distort_radius",
    "max_undistorted_radius",
]
