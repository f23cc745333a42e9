"""Circles in a picture by Hough transforms: `find_circles`.

A detector is one file here and one line in its registry: `request.DETECTION_METHODS` names it, `find` calls it.
"""

from .find import find_circles
from .request import DETECTION_METHODS
from .select import Circles
from .votes import circle_accumulator

__all__ = [
    "Circles",
    "DETECTION_METHODS",
    "circle_accumulator",
    "find_circles",
]
