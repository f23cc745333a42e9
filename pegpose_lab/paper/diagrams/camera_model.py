"""Fig. 4: the camera model with radial distortion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...camera import TsaiCamera
from ...lab.style import COLORS, SERIES
from .space import AXIS_COLORS, EDGE, INK, MARKED, SMALL, _View

if TYPE_CHECKING:
    from typing import Any

    from matplotlib.axes import Axes


def draw_camera_model(ax: Axes) -> dict[str, Any]:
    r"""Fig. 4: camera model with radial distortion, Eq. 3: :math:`x_u = x_d (1 + k_1 r^2)`, in perspective.

    A point P goes along a straight ray to (x_u, y_u) in the image plane; the lens moves it to
    (x_d, y_d), towards the principal point O_i.  The grid in the image plane is a square grid as this
    lens shows it.  The distortion is exaggerated and the drawing says by how much it moves P's image.
    Made for 7.0 x 4.2 inches.

    Returns
    -------
    dict
        ``camera`` (TsaiCamera, mm), ``point`` (3,) P in the camera frame, ``undistorted`` and ``distorted``
        (2,) mm on the sensor, ``view`` (maps (n, 3) scene points to (n, 2) positions in the axes).
    """
    camera = TsaiCamera(100.0, kappa1=6e-5)
    point = np.array([-118.0, -96.0, 235.0])
    undistorted = camera.focal_length * point[:2] / point[2]
    distorted = camera.distort(undistorted)
    view = _View(ax, eye=(640.0, -290.0, -270.0), target=(0.0, 0.0, 130.0), up=(0.0, -1.0, 0.0))
    _draw_image_plane(view, camera)
    _draw_camera_frames(view, camera)
    _draw_ray(view, camera, point, undistorted, distorted)
    moved = 1 - np.hypot(*distorted) / np.hypot(*undistorted)
    view.finish(
        "$x_u = x_d\\,(1 + k_1 r^2)$,   $r^2 = x_d^2 + y_d^2$   (Eq. 3)\n"
        f"barrel distortion, exaggerated: it moves this image point {moved:.0%} inwards"
    )
    return {"camera": camera, "point": point, "undistorted": undistorted, "distorted": distorted, "view": view}


# ---- Fig. 4; lengths in mm, in the camera frame ----


_HALO = {"boxstyle": "round,pad=0.05", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
_PLANE = np.array([80.0, 60.0])  # half width and height of the image plane


def _draw_image_plane(view, camera):
    """The plane z = f with a square grid as the lens distorts it."""
    f = camera.focal_length
    corners = _PLANE * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    view.face(_lift(corners, f), facecolor=COLORS["measured"], alpha=0.12, edgecolor="none", zorder=2)
    view.face(_lift(corners, f), fill=False, edgecolor=EDGE, zorder=2.1)
    along = np.linspace(-1, 1, 61)
    for level in np.linspace(-1, 1, 9):
        for line in (np.column_stack([along, np.full(61, level)]), np.column_stack([np.full(61, level), along])):
            view.line(_lift(_PLANE * line, f), color="0.8", linewidth=0.5, zorder=2.2)
            view.line(_lift(camera.distort(_PLANE * line), f), color=COLORS["measured"], linewidth=0.8, zorder=2.3)
    view.label((*(_PLANE * (1, -1)), f), "image plane", (30, 6), color=EDGE)


def _draw_camera_frames(view, camera):
    """Camera frame, optical axis with f, image frame and world frame."""
    f = camera.focal_length
    camera_pose, image_pose = RigidTransform.identity(), RigidTransform.from_translation([0, 0, f])
    turned = Rotation.from_euler("yx", [-25.0, 15.0], degrees=True)
    world = RigidTransform.from_components([30.0, 60.0, 330.0], turned)
    view.line([(0, 0, 0), (0, 0, 300.0)], color=EDGE, linestyle=(0, (6, 2, 1, 2)), linewidth=0.9, zorder=1)
    view.triad(camera_pose, 40.0, zorder=10, names=("$X_c$", "$Y_c$", "$Z_c$"), offsets=((8, -4), (-9, 2), (0, 8)))
    view.triad(world, 48.0, zorder=10, names=("$X_w$", "$Y_w$", "$Z_w$"), offsets=((0, 8), (0, -8), (0, 8)))
    for end, name, color in zip(image_pose.apply(36.0 * np.eye(3)), ("$X_i$", "$Y_i$"), AXIS_COLORS, strict=False):
        view.arrow(image_pose.translation, end, color=color, zorder=9)
        view.label(end, name, (0, -8), color=color, bbox=_HALO)
    view.label((0, 0, 0), "$O_c$", (-12, 0))
    view.label((0, 0, f), "$O_i$", (-10, -9), bbox=_HALO)
    view.arrow((0, 0, 0), world.translation, color="0.5", linestyle=(0, (3, 2)), zorder=1)
    view.label(0.7 * world.translation, "$R$, $T$: cam_from_world", (0, 8), color="0.4")
    _draw_focal_length(view, f)


def _draw_focal_length(view, f):
    """Dimension line of f, below the optical axis."""
    start, end = np.array([(0, 62.0, 0), (0, 62.0, f)])
    for end_point in (start, end):
        view.line([end_point * (1, 0, 1), end_point], color="0.6", linewidth=0.6, zorder=3)
    view.arrow(start, end, arrowstyle="<|-|>", linewidth=0.8, zorder=8)
    view.label((start + end) / 2, "$f$", (0, -7), fontsize=SMALL + 2)


def _draw_ray(view, camera, point, undistorted, distorted):
    """P, its straight ray, and the place where lens distortion puts its image."""
    f = camera.focal_length
    seen, shown = _lift([undistorted, distorted], f)
    view.line([(0, 0, 0), seen, point], color=MARKED, zorder=6)
    view.line([(0, 0, f), seen], color=INK, linewidth=0.8, linestyle=":", zorder=6)
    for place, color in ((point, INK), (seen, SERIES[0]), (shown, MARKED)):
        view.ax.plot(*view.at(place), "o", color=color, markersize=5, zorder=12)
    view.label(point, "$P\\,(x_w, y_w, z_w)$", (0, 10))
    view.label(seen, "$(x_u, y_u)$", (-25, 3), color=SERIES[0])
    view.label(shown, "$(x_d, y_d)$", (24, -9), color=MARKED, bbox=_HALO)


def _lift(points, z):
    """Points (n, 2) of a plane z = const as (n, 3)."""
    points = np.atleast_2d(points)
    return np.column_stack([points, np.full(len(points), z)])
