"""The lens model for the options of a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....checks import as_choice
from .fisheye import FisheyeModel
from .opencv import OpenCVModel
from .tsai import TsaiModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ....camera import Sensor

COEFFICIENTS = OpenCVModel.every[:5]
"""OpenCV's polynomial distortion coefficients in OpenCV's order."""

RATIONAL = OpenCVModel.every
"""All of OpenCV's coefficients here: k4, k5 and k6 make the radial part a ratio of two polynomials."""

EQUIDISTANT = FisheyeModel.every
"""The coefficients of the equidistant fisheye lens."""

LENSES = ("perspective", "equidistant")
"""How a lens without distortion projects: a point at the angle t to the axis is at f tan(t), or at f t."""


def lens_model(
    sensor: Sensor,
    free_center: bool,
    two_focal_lengths: bool,
    coefficients: Sequence[str] | None,
    lens: str = "perspective",
) -> TsaiModel | OpenCVModel | FisheyeModel:
    """The model for these options of `calibrate_joint`; ValueError if a coefficient is unknown or repeated."""
    known = EQUIDISTANT if as_choice(lens, "lens", LENSES) == "equidistant" else RATIONAL
    if coefficients is None:
        if lens == "perspective":
            return TsaiModel(sensor, free_center, two_focal_lengths)
        coefficients = EQUIDISTANT
    names = tuple(map(str, coefficients)) if np.iterable(coefficients) else ()
    if not np.iterable(coefficients) or set(names) - set(known) or len(set(names)) < len(names):
        raise ValueError(f"coefficients is {coefficients!r}; expected each once, of {', '.join(known)}")
    model = FisheyeModel if lens == "equidistant" else OpenCVModel
    return model(sensor, free_center, two_focal_lengths, names)
