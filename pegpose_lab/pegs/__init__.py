"""Labelled pegs of a hub in an image, and in one frame after another: `locate_pegs`, `track_pegs`.

The steps are `candidates`, `rings`, `labels` and `measure`; `locate` and `track` lead through them.  A new
rule for the labels belongs in `labels`.
"""

from .locate import locate_pegs
from .measure import PegObservation
from .track import track_pegs

__all__ = [
    "PegObservation",
    "locate_pegs",
    "track_pegs",
]
