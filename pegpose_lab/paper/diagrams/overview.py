"""Fig. 2: the steps of the method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import FancyBboxPatch

from ...lab.style import SERIES
from .space import MARKED, SMALL, _arrow, _bare

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Fig. 2 as (title, what happens, modules), from top to bottom.
CALIBRATION_STEPS = (
    ("Boards", "checkerboard, several orientations", "targets.py  render/"),
    ("Corners", "sub-pixel, row by row", "corners/"),
    ("Stage 1", "linear: $R$, $T_x$, $T_y$; first $f$, $T_z$", "calibration/two_stage/tsai.py"),
    ("Stage 2", "genetic: $f$, $T_z$; $k_1$ (Eqs. 4$-$10)", "calibration/two_stage/"),
    ("Camera", "a pixel to a ray, and back (Eq. 3)", "camera/"),
)
FRAME_STEPS = (
    ("Image", "hub with pegs, bore and screws", "targets.py  render/"),
    ("Mask", "Otsu's threshold, area filter", "segmentation.py"),
    ("Circles", "Hough transform, sub-pixel edges", "circles/  discs/"),
    ("Pegs", "labelled by the screws, tracked", "pegs/"),
    ("Pose", "$x$, $y$, $\\theta$; to the robot (Eqs. 1, 2, 11)", "pose/"),
)


def draw_overview(ax: Axes) -> None:
    """Fig. 2: the method as two columns of steps, calibration and frames, each with its module.

    Made for 7.0 x 4.4 inches.
    """
    width, height, gap, left, right = 3.2, 0.66, 0.24, 0.0, 3.7
    tops = -np.arange(len(FRAME_STEPS)) * (height + gap)
    columns = (
        (left, "Once: calibration", CALIBRATION_STEPS, SERIES[0]),
        (right, "Each frame: pose estimation", FRAME_STEPS, MARKED),
    )
    for x, heading, steps, color in columns:
        ax.text(x, 0.12, heading, color=color, weight="bold", fontsize=10, va="bottom")
        for top, step in zip(tops, steps, strict=False):
            _draw_step(ax, (x, top - height), (width, height), step, color)
        for top in tops[1:]:
            _arrow(ax, (x + width / 2, top + gap), (x + width / 2, top), color=color, shrinkB=1)
    middle = tops[-1] - height / 2
    _arrow(ax, (left + width, middle), (right, middle), shrinkB=1)
    _bare(ax, (left - 0.05, right + width + 0.05), (tops[-1] - height - 0.08, 0.45))


# ---- Fig. 2 ----


def _draw_step(ax, corner, size, step, color):
    """A box: title at the left, what happens below it, the modules at the right."""
    title, text, modules = step
    (x, y), (width, height) = corner, size
    style = {"boxstyle": "round,pad=0,rounding_size=0.07", "facecolor": "white", "linewidth": 1.2}
    ax.add_patch(FancyBboxPatch(corner, width, height, edgecolor=color, **style))
    ax.text(x + 0.12, y + 0.68 * height, title, weight="bold", fontsize=9.5, va="center")
    ax.text(
        x + width - 0.12,
        y + 0.68 * height,
        modules,
        fontsize=SMALL - 0.5,
        family="monospace",
        color=color,
        ha="right",
        va="center",
    )
    ax.text(x + 0.12, y + 0.28 * height, text, fontsize=SMALL + 0.5, va="center", color="0.25")
