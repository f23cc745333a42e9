"""Figures of notebook 13: a board with its corners, where all corners lie, and the part with its rims and numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...own_images import read_picture
from ..image_plots import peg_rims
from ..plotting import COLORS, plot_image

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ...own_images import BoardImage
    from ...pegs import PegObservation

AROUND = 1.4
"""Half the side of the part that is shown, over the largest distance of a rim from the middle of the ring."""


def plot_board(ax: Axes, board: BoardImage) -> None:
    """Draw an image of a board with its corners."""
    plot_image(ax, read_picture(board.path).image, f"{board.path.name}: {board.fate}")
    ax.plot(*board.corners.T, "o", color=COLORS["joint"], markersize=5, fillstyle="none")


def plot_coverage(ax: Axes, boards: Sequence[BoardImage]) -> None:
    """Draw the corners of all used images in the frame of the image."""
    used = [board for board in boards if board.used]
    for board in used:
        ax.plot(*board.corners.T, ".", color=COLORS["joint"], markersize=4, alpha=0.7)
    width, height = used[0].size
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal", xlabel="x (px)")
    ax.set_title(f"{sum(len(board.corners) for board in used)} corners of {len(used)} images")


def plot_found(ax: Axes, image: NDArray[np.uint8], observation: PegObservation, title: str | None = None) -> None:
    """Draw the image round a hub or a ring, the rims of its pegs as they look in their plane's perspective, and numbers."""
    rims = peg_rims(observation)
    middle = observation.peg_centers.mean(axis=0)
    half = AROUND * np.linalg.norm(rims - middle, axis=-1).max()
    left, top = np.maximum(middle - half, 0)
    right, bottom = np.minimum(middle + half, np.array(image.shape[1::-1]) - 1)
    plot_image(ax, image, title, limits=(left, right, top, bottom))
    for number, (rim, center) in enumerate(zip(rims, observation.peg_centers, strict=True), 1):
        ax.plot(*rim.T, color=COLORS["joint"], linewidth=2)
        ax.plot(*center, "+", color=COLORS["joint"], markersize=8)
        below = (center[0], rim[:, 1].max())
        ax.annotate(str(number), below, (0, -4), textcoords="offset points", color="white", ha="center", va="top",
                    weight="bold", fontsize=11)  # fmt: skip
