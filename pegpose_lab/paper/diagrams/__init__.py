"""The paper's drawn figures (1, 2, 4 and 5) and the rendered experiment's scene: ``draw_*(ax)`` fills given axes.

All are drawn from geometry.  Scenes are projected with the package's own camera, so that what looks like
perspective is perspective and what looks like distortion is Eq. 3.  Each function says the size in inches
that its text is set for; `plotting.figure` makes such axes and `plotting.save_figure` writes them.
A diagram is one file here; `space` has what they share.
"""

from .assembly import draw_assembly
from .camera_model import draw_camera_model
from .orientation import draw_orientation
from .overview import FRAME_STEPS, draw_overview
from .scene import draw_scene

__all__ = [
    "FRAME_STEPS",
    "draw_assembly",
    "draw_camera_model",
    "draw_orientation",
    "draw_overview",
    "draw_scene",
]
