"""Lens models for the bundle adjustment: their parameters, their camera, and the projection with its derivatives.

A new lens model is one file here and one line in `lens_model`.
"""

from .choose import COEFFICIENTS, EQUIDISTANT, LENSES, RATIONAL, lens_model
from .fisheye import FisheyeModel
from .lens import GivenFocalLength, Lens, derivative_by_point
from .opencv import OpenCVModel
from .tsai import TsaiModel

__all__ = [
    "COEFFICIENTS",
    "EQUIDISTANT",
    "FisheyeModel",
    "GivenFocalLength",
    "LENSES",
    "Lens",
    "OpenCVModel",
    "RATIONAL",
    "TsaiModel",
    "derivative_by_point",
    "lens_model",
]
