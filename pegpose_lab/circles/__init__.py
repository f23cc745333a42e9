"""Circles in a picture by Hough transforms: `find_circles`.

A detector is one file here with a function ``find(window, request)``, and one line in the registry `request.METHODS`
(.github/CONTRIBUTING.md shows one).
"""

from .find import find_circles
from .request import METHODS
from .select import Circles
from .votes import circle_accumulator

__all__ = [
    "Circles",
    "METHODS",
    "circle_accumulator",
    "find_circles",
]
