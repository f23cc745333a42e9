"""Sliders for JupyterLab: change a setting of a step and see at once what it does.

Each ``*_explorer`` returns an `Explorer`: sliders above a picture with a line or two of text under it.  An
observer computes the step anew and sets the picture widget's bytes; no figure is built.  `show` displays an
explorer together with its first picture and text, which stay readable where no kernel runs.  What a
step refuses (a `DetectionError`, a `ValueError`, a `CalibrationError`) is written under the picture.
 A slider is one function here, in a file of its step.
"""

from .circles import circle_explorer
from .explorer import show
from .genetic import genetic_explorer
from .hub import hub_explorer
from .threshold import threshold_explorer

__all__ = [
    "circle_explorer",
    "genetic_explorer",
    "hub_explorer",
    "show",
    "threshold_explorer",
]
