"""Fig. 5: the hub's angle theta."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Circle
from scipy.spatial.transform import Rotation

from ...checks import as_number
from ...lab.style import SERIES
from .space import _CENTERED, BODY, EDGE, INK, MARKED, SHADE, SMALL, _arrow, _bare

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from ...targets import Hub


def draw_orientation(ax: Axes, hub: Hub, theta: float) -> tuple[Line2D, Line2D]:
    r"""Fig. 5: theta, the angle from the horizontal (line 2) to the line from the hub's centre to peg 1 (line 1).

    Drawn as the screen shows it, y down, so that theta counts positive clockwise, from x towards y, and the
    pegs are numbered clockwise; the arc's arrow runs the way of theta's sign.  Eq. 11's tangent is the same
    for theta and theta + pi; the project uses
    :math:`\theta = \operatorname{atan2}(y_1 - y_0, x_1 - x_0)`.  Made for 5.0 x 4.9 inches.

    Parameters
    ----------
    ax : Axes
    hub : Hub
    theta : float
        rad, about the hub's z axis.

    Returns
    -------
    (Line2D, Line2D)
        Line 1 and line 2, each from the hub's centre outwards.

    Raises
    ------
    ValueError
        If theta is not a finite number.
    """
    theta = as_number(theta, "theta")
    turn = Rotation.from_rotvec([0, 0, theta])
    pegs, screws = (turn.apply(points)[:, :2] for points in (hub.peg_centers, hub.screw_centers))
    reach = 1.28 * hub.radius
    _draw_hub_face(ax, hub, pegs, screws)
    (line1,) = ax.plot(*np.array([(0, 0), pegs[0]]).T, color=MARKED, linewidth=2.0, zorder=5)
    (line2,) = ax.plot([0, reach], [0, 0], color=SERIES[0], linewidth=2.0, linestyle=(0, (5, 2)), zorder=4)
    ax.plot(*np.array([(0, 0), pegs[0]]).T, "o", color=INK, markersize=4, zorder=6)
    _draw_theta(ax, theta, _arc_radius(hub))
    _label_orientation(ax, hub, pegs, screws, theta, reach)
    _draw_screen_axes(ax, hub)
    way = "clockwise" if theta >= 0 else "anticlockwise"
    _bare(
        ax,
        (-1.35 * hub.radius, 1.75 * hub.radius),
        (1.42 * hub.radius, -1.2 * hub.radius),
        "As on the screen, $y$ down: $\\theta$ counts positive clockwise, from $x$ towards $y$.\n"
        f"Drawn: $\\theta = {np.rad2deg(theta):.1f}$°, {way}. Pegs are numbered clockwise.",
    )
    return line1, line2


# ---- Fig. 5; lengths in mm, x to the right, y down ----


def _draw_hub_face(ax, hub, pegs, screws):
    """Base, pitch circle, bore, screws and pegs as the camera sees them."""

    def disc(center, radius, face, **style):
        defaults = {"facecolor": face, "edgecolor": EDGE, "linewidth": 1.0, "zorder": 2}
        ax.add_patch(Circle(center, radius, **(defaults | style)))

    disc((0, 0), hub.radius, BODY, zorder=1)
    disc((0, 0), hub.pitch_circle_diameter / 2, "none", linestyle=(0, (4, 3)), linewidth=0.8, zorder=1.5)
    disc((0, 0), hub.bore_radius, "white")
    for center in screws:
        disc(center, hub.screw_radius, SHADE)
    for index, center in enumerate(pegs):
        disc(center, hub.peg_radius, "white", edgecolor=MARKED if index == 0 else INK, linewidth=1.5)


def _draw_theta(ax, theta, radius):
    """The arc from line 2 to line 1, with its arrow in the direction of the sign."""
    angles = np.linspace(0, theta, 80)
    path = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    ax.plot(*path[:-3].T, color=INK, linewidth=1.2, zorder=6)
    _arrow(ax, path[-4], path[-1], zorder=6)


def _label_orientation(ax, hub, pegs, screws, theta, reach):
    """Labels of pegs, screws, lines and the angle, each beside its object."""
    pitch_radius = hub.pitch_circle_diameter / 2
    for number, center in enumerate(pegs, 1):
        ax.text(
            *center * (1.13 * hub.radius / pitch_radius),
            f"peg {number}",
            **_CENTERED,
            fontsize=9.5,
            color=MARKED if number == 1 else INK,
        )
    for number, center in enumerate(screws, 1):
        place = center / np.hypot(*center) * (pitch_radius + hub.radius) / 2
        ax.text(*place, f"screw {number}", **_CENTERED, fontsize=SMALL)
    along = np.array([np.cos(theta), np.sin(theta)])
    away = (1.0 if theta >= 0 else -1.0) * np.array([-along[1], along[0]])  # the side of line 1 without the arc
    slope = (-np.rad2deg(theta) + 90) % 180 - 90
    ax.text(
        *(0.58 * pitch_radius * along + 4.5 * away), "line 1", rotation=slope, **_CENTERED, fontsize=9, color=MARKED
    )
    ax.text(reach, 0, " line 2,\n horizontal", ha="left", va="center", fontsize=9, color=SERIES[0])
    radius = _arc_radius(hub) + 5.0
    ax.text(radius * np.cos(theta / 2), radius * np.sin(theta / 2), "$\\theta$", **_CENTERED, fontsize=13)


def _arc_radius(hub):
    """Of theta's arc: half-way between the bore and the pegs."""
    return (hub.bore_radius + hub.pitch_circle_diameter / 2 - hub.peg_radius) / 2


def _draw_screen_axes(ax, hub):
    """Directions of the image axes, in the corner."""
    corner = hub.radius * np.array([-1.25, 1.0])
    for step, name in (((0.3, 0.0), "x"), ((0.0, 0.3), "y")):
        end = corner + hub.radius * np.array(step)
        _arrow(ax, corner, end)
        ax.text(*(end + 0.2 * (end - corner)), f"${name}$", fontsize=10, **_CENTERED)
