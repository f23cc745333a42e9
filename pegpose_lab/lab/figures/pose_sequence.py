"""Pictures of an animation: frames of the hub with the estimated poses drawn in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..style import COLORS, SERIES
from .peg_pose import plot_hub_pose

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from ...camera import TsaiCamera
    from ...pose import HubPose
    from ...targets import Hub

WIDTH, READOUT = 480, 28  # px: of a picture, and height of the strip with the numbers
DARK, BRIGHT = 15, 200  # grey values that are drawn black and white
SMOOTHING = (7, 20.0, 2.0)  # px, grey values, px: noise goes, edges stay; a third of the bytes
LINE_COLORS = (COLORS["genetic"], SERIES[4])


def readouts(poses: Sequence[HubPose], origin: tuple[float, float] = (0.0, 0.0)) -> list[str]:
    """A line for each pose: frame, x and y from the origin (mm), theta (deg)."""
    lines = []
    for number, pose in enumerate(poses, 1):
        x, y = (round(value - zero, 2) + 0.0 for value, zero in zip((pose.x, pose.y), origin, strict=True))
        line = f"frame {number:2d}   x {x:6.2f} mm   y {y:5.2f} mm   θ {np.degrees(pose.theta):7.2f}°"
        lines.append(line.replace("-", "\u2212"))
    return lines


def draw_poses(
    images: Iterable[NDArray[np.uint8]],
    poses: Sequence[HubPose],
    texts: Sequence[str],
    camera: TsaiCamera,
    hub: Hub,
    *,
    limits: tuple[int, int, int, int],
) -> Iterator[NDArray[np.uint8]]:
    """Yield each image with its pose drawn in, and its text below, as (height, 480, 3) uint8.

    Parameters
    ----------
    images : iterable of (height, width) uint8 array
    poses : sequence of HubPose
    texts : sequence of str
    camera : TsaiCamera
    hub : Hub
    limits : (left, right, top, bottom)
        The part that is shown, px; right and bottom are not included.  It is drawn `WIDTH` pixels wide.
    """
    left, right, top, bottom = limits
    height = round(WIDTH * (bottom - top) / (right - left))
    for image, pose, text in zip(images, poses, texts, strict=True):
        fig = Figure((WIDTH / 100, (height + READOUT) / 100), dpi=100, facecolor="black")
        fig.set_layout_engine("none")
        canvas = FigureCanvasAgg(fig)
        ax = fig.add_axes((0, READOUT / (height + READOUT), 1, height / (height + READOUT)))
        shown, extent = _smaller(image, left, right, top, bottom), (left - 0.5, right - 0.5, bottom - 0.5, top - 0.5)
        ax.imshow(shown, extent=extent, vmin=DARK, vmax=BRIGHT, cmap="gray", interpolation="nearest", aspect="auto")
        ax.set_axis_off()
        plot_hub_pose(ax, camera, pose.cam_from_hub, hub, size=9)
        style: dict[str, Any] = {"ha": "center", "va": "center", "family": "DejaVu Sans Mono", "fontsize": 8.5}
        fig.text(0.5, 0.5 * READOUT / (height + READOUT), text, color="white", **style)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _smaller(image, left, right, top, bottom):
    """The part within limits without its noise, as means of squares: one value is one drawn pixel where sizes allow it."""
    step = max((right - left) // WIDTH, 1)
    part = cv2.bilateralFilter(np.ascontiguousarray(image[top:bottom, left:right]), *SMOOTHING)
    rows, columns = part.shape[0] // step, part.shape[1] // step
    squares = part[: rows * step, : columns * step].reshape(rows, step, columns, step)
    return np.rint(squares.mean(axis=(1, 3))).astype(np.uint8)
