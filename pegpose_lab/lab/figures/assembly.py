"""The figures of notebook 12: the hub as the camera sees it, with its pegs and the axes of its frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..plotting import COLORS, SERIES, plot_circles, plot_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ...camera import TsaiCamera
    from ...pegs import PegObservation
    from ...pose import HubPose

AXIS = 40.0
"""mm, length of a drawn axis."""

HALF = 330.0
"""px, half the side of the part of the image that is shown."""


def plot_located_hub(
    ax: Axes, frame: NDArray[np.uint8], observation: PegObservation, camera: TsaiCamera, pose: HubPose
) -> None:
    """Draw the part of an image round the hub, its numbered pegs, and the x and y axes of the hub's estimated frame."""
    left, top = np.maximum(observation.hub_center - HALF, 0)
    right, bottom = observation.hub_center + HALF
    bright = np.clip(1.5 * frame.astype(float) - 25, 0, 255).astype(np.uint8)
    plot_image(ax, bright, limits=(left, right, top, bottom))
    plot_circles(ax, observation.peg_centers, observation.peg_radii, color=COLORS["joint"])
    for number, center in enumerate(observation.peg_centers, 1):
        ax.annotate(str(number), center, (7, 7), textcoords="offset points", color=COLORS["joint"], weight="bold")
    origin, *ends = camera.project(np.vstack([np.zeros(3), AXIS * np.eye(3)[:2]]), pose.cam_from_hub)
    for end, color in zip(ends, SERIES[1:3], strict=True):
        ax.annotate("", end, origin, arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 2})
    ax.set(xlabel=None, ylabel=None, xticks=[], yticks=[])
