"""Figures of notebook 13: a board with its corners, and where in the image all corners lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...own_images import read_picture
from .. import plotting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from ...own_images import BoardImage


def plot_board(ax: Axes, board: BoardImage) -> None:
    """Draw an image of a board with its corners."""
    plotting.plot_image(ax, read_picture(board.path).image, f"{board.path.name}: {board.fate}")
    ax.plot(*board.corners.T, "o", color=plotting.COLORS["joint"], markersize=5, fillstyle="none")


def plot_coverage(ax: Axes, boards: Sequence[BoardImage]) -> None:
    """Draw the corners of all used images in the frame of the image."""
    used = [board for board in boards if board.used]
    for board in used:
        ax.plot(*board.corners.T, ".", color=plotting.COLORS["joint"], markersize=4, alpha=0.7)
    width, height = used[0].size
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal", xlabel="x (px)")
    ax.set_title(f"{sum(len(board.corners) for board in used)} corners of {len(used)} images")
