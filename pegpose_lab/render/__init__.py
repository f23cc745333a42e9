"""Pictures of the targets through a camera, by casting rays, with exact truth.

A new target is one file here, drawn with what `raycast` offers.
"""

from .hub import HubLook, TrueDisc, disc_outline, expose, render_board, render_hub, true_disc

__all__ = [
    "HubLook",
    "TrueDisc",
    "disc_outline",
    "expose",
    "render_board",
    "render_hub",
    "true_disc",
]
