"""Sliders for JupyterLab: change a setting of a step and see its effect at once.

Each ``*_explorer`` returns an `Explorer`: sliders, one or two lines of text, and an image below them.  When a
slider moves, the step is computed again and the bytes of the image widget are replaced; no figure is built.  `show`
displays an explorer with its first image and text, which can be read without a kernel.  If a step raises a
`DetectionError`, `ValueError` or `CalibrationError`, its message is shown above the image.

A new slider is one function in a file for its step.
"""

from .circles import circle_explorer
from .corner_noise import corner_noise_explorer
from .eccentricity import eccentricity_explorer
from .equation6 import equation6_explorer
from .explorer import show
from .genetic import genetic_explorer
from .hub import hub_explorer
from .insertion import insertion_explorer
from .intervals import interval_explorer
from .principal_point import principal_point_explorer
from .threshold import threshold_explorer
from .upload import upload_box
from .views import views_explorer

__all__ = [
    "circle_explorer",
    "corner_noise_explorer",
    "eccentricity_explorer",
    "equation6_explorer",
    "genetic_explorer",
    "hub_explorer",
    "insertion_explorer",
    "interval_explorer",
    "principal_point_explorer",
    "show",
    "threshold_explorer",
    "upload_box",
    "views_explorer",
]
