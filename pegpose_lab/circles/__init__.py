"""Circle detection in an image by the Hough transform: `find_circles`.

A detector is one file here with a function ``find(window, request)``, and one line in the registry `request.DETECTION_METHODS`
(.github/CONTRIBUTING.md shows one).
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
