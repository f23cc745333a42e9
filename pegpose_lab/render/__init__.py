"""Pictures of the targets through a camera, by casting rays, with exact truth.

A new target is one file here, drawn with what `raycast` offers.
"""

from .board import render_board
from .discs import TrueDisc, disc_outline, disc_outlines, true_disc
from .hub import HubLook, render_hub
from .raycast import expose

__all__ = [
    "HubLook",
    "TrueDisc",
    "disc_outline",
    "disc_outlines",
    "expose",
    "render_board",
    "render_hub",
    "true_disc",
]
