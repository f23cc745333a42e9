"""Fig. 1: camera, robot, hub and wheel, with Eqs. 1 and 2 as arrows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...lab.style import COLORS
from ...targets import Hub
from .space import BODY, EDGE, INK, MARKED, SHADE, SMALL, _arrow, _ring, _View, look_at

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

# What the diagrams name: Eqs. 1 and 2 as {(frame a, frame b): project's name of a_from_b}.
TRANSFORMS = {
    ("R", "C"): "robot_from_cam",
    ("C", "P"): "cam_from_hub",
    ("P", "E"): "hub_from_end_effector",
    ("C", "E"): "cam_from_end_effector",
    ("R", "E"): "robot_from_end_effector",
}


def draw_assembly(ax: Axes) -> dict[str, NDArray[np.float64]]:
    """Fig. 1: a fixed camera sees the hub on its shaft, a robot brings the wheel; frames and Eqs. 1 and 2.

    An arrow from frame a to frame b stands for the transform ``a_from_b``, which takes coordinates in b to coordinates
    in a; the labels write it as the paper does.  Made for 7.0 x 4.6 inches.

    Returns
    -------
    dict
        {frame letter: (2,) position of its origin in the axes}, what the arrows connect.
    """
    view = _View(ax, eye=(62.0, -640.0, 215.0), target=(62.0, 0.0, 45.0))
    poses = _assembly_poses()
    _draw_table(view)
    _draw_hub_on_shaft(view, poses["P"])
    _draw_fixed_camera(view, poses["C"], poses["P"])
    _draw_robot(view, poses["E"])
    for name, pose in poses.items():
        names = ("$x$", "$y$", "$z$") if name == "R" else None
        view.triad(pose, 11.0, zorder=30, names=names, offsets=((5, 0), (-9, 0), (0, 6)))
    origins = {name: view.at(pose.translation) for name, pose in poses.items()}
    for letter, title, offset in (
        ("R", "robot base", (80, -12)),
        ("E", "end-effector\nwith the wheel", (-58, 38)),
        ("C", "fixed camera", (-62, 26)),
        ("P", "hub with pegs", (-75, -17)),
    ):
        view.label(poses[letter].translation, f"$\\mathbf{{{letter}}}$  {title}", offset)
    for (start, end), (bend, share) in zip(TRANSFORMS, _ARROW_SHAPES, strict=False):
        _transform_arrow(ax, start, end, origins, bend, share)
    view.label(_SHAFT_END, "shaft, turns about $z$", (-12, 0), ha="right")
    view.finish(
        "Eq. 1:  ${}^{R}T_{E} = {}^{R}T_{C}\\;{}^{C}T_{P}\\;{}^{P}T_{E}$        "
        "Eq. 2:  ${}^{P}T_{E} = ({}^{C}T_{P})^{-1}\\;{}^{C}T_{E}$\n"
        "The arrow $a \\to b$ is ${}^{a}T_{b}$: it takes coordinates in $b$ to coordinates in $a$ (a_from_b in the code)."
    )
    return origins


# ---- Fig. 1; lengths in cm, z up, the robot's base in the origin ----


_HUB_CENTER = np.array([104.0, 0.0, 26.0])
_SHAFT_END = np.array([104.0, 0.0, 4.0])
_WHEEL_CENTER = np.array([58.0, 0.0, 56.0])
_CAMERA_CENTER = np.array([114.0, 0.0, 96.0])
_ARROW_SHAPES = ((0.18, 0.24), (-0.14, 0.5), (0.17, 0.27), (0.12, 0.5), (-0.14, 0.5))  # bend, place of the names
_ENLARGED = 0.24  # cm per mm: the hub is drawn 2.4 times its size beside the robot


def _assembly_poses():
    """World poses of the frames R, E, C, P; E's and P's z axes point into the table, away from the camera."""
    downwards = Rotation.from_euler("x", np.pi)
    turned = downwards * Rotation.from_rotvec([0, 0, np.deg2rad(20.0)])
    return {
        "R": RigidTransform.identity(),
        "E": RigidTransform.from_components(_WHEEL_CENTER, turned),
        "C": look_at(_CAMERA_CENTER, _HUB_CENTER, (0.0, 1.0, 0.0)).inv(),
        "P": RigidTransform.from_components(_HUB_CENTER, turned),
    }


def _draw_table(view):
    corners = [(-24, -34, 0), (150, -34, 0), (150, 34, 0), (-24, 34, 0)]
    view.face(np.array(corners, float), facecolor="0.97", edgecolor="0.75", zorder=0)


def _draw_hub_on_shaft(view, world_from_hub):
    """Shaft, base, pegs from the back to the front, and the arrow of rotation."""
    hub = Hub()
    scale = _ENLARGED
    base, lower = (world_from_hub.apply([0, 0, scale * z]) for z in (hub.peg_height, hub.peg_height + 14))
    view.cylinder([*_SHAFT_END[:2], 0.0], lower, 3.0, zorder=2)
    view.cylinder(lower, base, scale * hub.radius, zorder=4)
    view.face(_ring(base, (0, 0, 1), scale * hub.bore_radius), facecolor=SHADE, zorder=4.3)
    feet = world_from_hub.apply(scale * (hub.peg_centers + [0, 0, hub.peg_height]))
    tops = world_from_hub.apply(scale * hub.peg_centers)
    for order, index in enumerate(np.argsort(-tops[:, 1])):
        view.cylinder(feet[index], tops[index], scale * hub.peg_radius, zorder=5 + order)
    arc = _ring([*_SHAFT_END[:2], 9.0], (0, 0, 1), 6.5)[np.arange(8, 44)]
    view.line(arc, color=INK, zorder=3)
    view.arrow(arc[-2], arc[-1], zorder=3)


def _draw_fixed_camera(view, world_from_cam, world_from_hub):
    """Body and lens along the camera's z axis, a bracket to a post, and the cone of view on the hub."""
    rim = _ring(world_from_hub.translation, (0, 0, 1), 1.18 * _ENLARGED * Hub().radius)
    view.solid(
        np.vstack([rim, world_from_cam.translation]),
        facecolor=COLORS["measured"],
        alpha=0.13,
        edgecolor="none",
        zorder=1,
    )
    corners = np.array(np.meshgrid((-5, 5), (-5, 5), (-18, -4))).reshape(3, -1).T
    post = np.array([(142.0, 10.0, 0.0), (142.0, 10.0, 112.0), (114.0, 4.0, 112.0)])
    view.line(post, color=EDGE, linewidth=4.5, zorder=1.5, solid_joinstyle="round")
    view.line(post, color=BODY, linewidth=3.0, zorder=1.6, solid_joinstyle="round")
    view.solid(world_from_cam.apply(corners.astype(float)), facecolor=SHADE, zorder=12)
    view.cylinder(*world_from_cam.apply([[0.0, 0, -5], [0.0, 0, 0]]), 3.5, zorder=11)


def _draw_robot(view, world_from_effector):
    """Base, two links, wrist, and the wheel with its four holes."""
    hub = Hub()
    center = world_from_effector.translation
    shoulder, elbow, wrist = np.array([0.0, 0, 26]), np.array([14.0, 0, 88]), center + [0, 0, 34]
    view.cylinder((0, 0, 0), (0, 0, 12), 12.0, zorder=3)
    view.cylinder((0, 0, 12), shoulder, 7.0, zorder=4)
    view.capsule(shoulder, elbow, 5.0, zorder=6)
    view.capsule(elbow, wrist, 4.2, zorder=8)
    view.cylinder(center + [0, 0, 4], wrist, 2.6, zorder=7.5)
    lower, upper = center, center + [0, 0, 5.0]
    view.cylinder(lower, upper, 1.25 * _ENLARGED * hub.radius, zorder=5)
    holes = world_from_effector.apply(_ENLARGED * hub.peg_centers) + [0, 0, 5.0]
    for hole in holes:
        view.face(_ring(hole, (0, 0, 1), 1.15 * _ENLARGED * hub.peg_radius), facecolor="white", zorder=5.5)


def _transform_arrow(ax, start, end, places, bend, share):
    """An arrow from frame to frame, its names at `share` of its way; the sought one in colour."""
    color = MARKED if (start, end) == ("C", "P") else INK
    first, last = places[start], places[end]
    _arrow(ax, first, last, connectionstyle=f"arc3,rad={bend}", shrinkA=5, shrinkB=5, color=color, zorder=25)
    dx, dy = last - first
    control = (first + last) / 2 + bend * np.array([-dy, dx])  # of arc3's quadratic curve, in axes with y down
    middle = (1 - share) ** 2 * first + 2 * share * (1 - share) * control + share**2 * last
    name = TRANSFORMS[start, end].replace("_from_end", "_from_\nend")
    text = f"${{}}^{{{start}}}T_{{{end}}}$\n{name}"
    ax.annotate(
        text,
        middle,
        ha="center",
        va="center",
        fontsize=SMALL,
        color=color,
        zorder=35,
        linespacing=1.1,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"},
    )
