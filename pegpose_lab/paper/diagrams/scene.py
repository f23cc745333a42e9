"""The rendered experiment to scale: the camera, the boards it is calibrated with, the hub, and the wheel before it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ...lab.style import COLORS
from .space import EDGE, SHADE, _ring, _View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from .. import Experiment

WHEEL_BEFORE = 55.0  # mm between wheel and pegs, as drawn
WHEEL_THICKNESS = 15.0  # mm
SEEN_TO = 400.0  # mm, depth to which the cone of view is drawn


def draw_scene(
    ax: Axes, experiment: Experiment, *, frame: int = 0, boards: Sequence[int] = (0, 1, 2), wheel: bool = True
) -> None:
    """Draw the experiment to scale, in the camera's frame: view cone, boards, hub in one of its frames, wheel.

    Parameters
    ----------
    ax : Axes
        Made for 7.0 x 4.6 inches.
    experiment : Experiment
    frame : int
        Of the hub, 0 to 44.
    boards : sequence of int
        Which of the five boards; the fifth lies in the plane of the hub.
    wheel : bool
        Whether the wheel is drawn, between camera and hub.
    """
    view = _View(ax, eye=(900.0, -520.0, -420.0), target=(20.0, 10.0, 190.0), up=(0.0, -1.0, 0.0))
    _draw_cone(view, experiment.camera)
    for order, index in enumerate(boards):
        _draw_board(view, experiment.board, experiment.cam_from_boards[index], zorder=2 + 0.1 * order)
    cam_from_hub = experiment.cam_from_hubs[frame]
    _draw_hub(view, experiment.hub, cam_from_hub)
    if wheel:
        _draw_wheel(view, experiment.hub, cam_from_hub)
    view.label([0.0, 0.0, 0.0], "camera", (-8, 26))
    view.label(experiment.cam_from_boards[boards[0]].apply(experiment.board.object_points[-1]), "boards", (12, -14))
    view.finish(None)


def _draw_cone(view, camera):
    """The camera's body, and the pyramid that its image sees."""
    width, height = camera.image_size
    corners = camera.rays([(0, 0), (width, 0), (width, height), (0, height)])
    ends = SEEN_TO * corners
    view.solid(
        np.vstack([np.zeros((1, 3)), ends]), facecolor=COLORS["measured"], alpha=0.08, edgecolor="none", zorder=0
    )
    view.face(ends, facecolor="none", edgecolor=COLORS["measured"], linewidth=0.6, zorder=0.5)
    body = np.array(np.meshgrid((-22, 22), (-16, 16), (-70, -22))).reshape(3, -1).T
    view.solid(body.astype(float), facecolor=SHADE, zorder=20)
    view.cylinder((0, 0, -22), (0, 0, 0), 13.0, zorder=21)
    view.triad(
        RigidTransform.identity(), 60.0, zorder=22, names=("$x$", "$y$", "$z$"), offsets=((6, 2), (0, -8), (6, 2))
    )


def _draw_board(view, board, pose: RigidTransform, zorder):
    """A board with the dark squares between its corners."""
    pitch, columns, rows = board.square, board.columns, board.rows
    low, high = -pitch, np.array([columns, rows]) * pitch
    outline = [(low, low, 0), (high[0], low, 0), (high[0], high[1], 0), (low, high[1], 0)]
    view.face(pose.apply(np.array(outline, float)), facecolor="white", edgecolor=EDGE, alpha=0.9, zorder=zorder)
    for column in range(columns - 1):
        for row in range(rows - 1):
            if (column + row) % 2 == 0:
                x, y = column * pitch, row * pitch
                square = [(x, y, 0), (x + pitch, y, 0), (x + pitch, y + pitch, 0), (x, y + pitch, 0)]
                style = {"facecolor": "0.35", "edgecolor": "none", "alpha": 0.55}
                view.face(pose.apply(np.array(square, float)), zorder=zorder + 0.01, **style)


def _draw_hub(view, hub, pose):
    """Base with bore and screws, and the pegs from the back to the front."""
    axis = pose.rotation.apply([0, 0, 1.0])
    base, back = pose.apply([0, 0, hub.peg_height]), pose.apply([0, 0, hub.peg_height + 12.0])
    view.cylinder(back, base, hub.radius, zorder=6)
    view.face(_ring(base, axis, hub.bore_radius), facecolor="0.55", zorder=6.3)
    for screw in hub.screw_centers:
        view.face(_ring(pose.apply(screw), axis, hub.screw_radius), facecolor="0.55", zorder=6.3)
    tops = pose.apply(hub.peg_centers)
    feet = pose.apply(hub.peg_centers + [0, 0, hub.peg_height])
    away = np.linalg.norm(tops - view.cam_from_world.inv().translation, axis=1)
    for order, index in enumerate(np.argsort(-away)):
        view.cylinder(feet[index], tops[index], hub.peg_radius, zorder=7 + 0.1 * order, cap=COLORS["joint"])
    view.label(back, "hub with four pegs", (40, 46))


def _draw_wheel(view, hub, pose):
    """The wheel before the pegs, with a hole for each, and the way in."""
    axis = pose.rotation.apply([0, 0, 1.0])
    front, rear = (pose.apply([0, 0, -WHEEL_BEFORE - depth]) for depth in (0.0, WHEEL_THICKNESS))
    view.cylinder(front, rear, 1.1 * hub.radius, zorder=9)
    for peg in hub.peg_centers:
        view.face(_ring(rear + pose.rotation.apply(peg), axis, 1.1 * hub.peg_radius), facecolor="white", zorder=9.3)
    view.arrow(pose.apply([0, 0, -WHEEL_BEFORE + 2]), pose.apply([0, 0, -18.0]), zorder=9.5, color=COLORS["genetic"])
    view.label(rear, "wheel", (-30, 34))
