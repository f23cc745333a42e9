"""The explorer for the hub's pose."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import ipywidgets
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...pegs import locate_pegs
from ...pose import estimate_pose
from ...render import render_hub
from ..image_plots import peg_rims
from ..style import COLORS
from .drawing import _bgr, _canvas, _circle, _outline, _place
from .explorer import SHOWN_WIDTH, Explorer, _slider

if TYPE_CHECKING:
    from ...camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from ...targets import Hub

RENDERED_WIDTH = 600  # px, width of the hub's image before it is enlarged
SHIFTS = -10.0, 70.0  # mm, ends of the slider
MARGIN = 1.08  # of the hub's radius, so that a rim of the background is seen


def hub_explorer(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera,
    hub: Hub,
    cam_from_plane: RigidTransform,
    *,
    angle: float = -140.0,
    shift: float = 0.0,
    blur: float = 0.9,
    noise: float = 2.0,
) -> Explorer:
    """Sliders for the hub's angle and shift (Sect. 3.2): renders the hub, locates the pegs and estimates the pose.

    Only the part of the image that the hub can reach is rendered, `RENDERED_WIDTH` px wide, for speed.  The two screws
    leave an ambiguity of half a turn, so labels are carried over from the previous image, as between frames.  In the
    first image, screw 1 is the left one.  A jump by too large an angle is refused.

    Parameters
    ----------
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera
    hub : Hub
    cam_from_plane : RigidTransform
        The plane of the peg tops.
    angle, shift : float
        Initial values of the sliders, deg and mm.
    blur, noise : float
        px and grey values, of the rendered image.

    Returns
    -------
    Explorer
        Controls ``angle`` (deg about z), ``shift`` (mm along x).
    """
    camera = _smaller(_of_the_path(camera, hub, cam_from_plane), RENDERED_WIDTH)
    previous = None

    @lru_cache(maxsize=2)
    def render(angle, shift):
        turn = Rotation.from_rotvec([0, 0, np.deg2rad(angle)])
        truth = cam_from_plane * RigidTransform.from_components([shift, 0, 0], turn)
        return render_hub(camera, truth, hub, blur=blur, noise=noise, rng=0)

    def backdrop(angle, shift):
        return _canvas(render(angle, shift))[0]

    def draw(picture, angle, shift):
        nonlocal previous
        previous = locate_pegs(render(angle, shift), hub, previous=previous)
        pose = estimate_pose(previous, camera, hub, plane=cam_from_plane)
        _paint_pegs(picture, SHOWN_WIDTH / camera.image_size[0], previous)
        return _compare_poses(angle, shift, pose)

    return Explorer(
        "hub explorer",
        backdrop,
        draw,
        {
            "angle": _slider(ipywidgets.FloatSlider, "hub angle (deg)", angle, -180.0, 180.0, step=1.0),
            "shift": _slider(ipywidgets.FloatSlider, "shift (mm)", shift, *SHIFTS, step=0.5),
        },
    )


# ---- the hub ----


def _of_the_path(camera, hub, cam_from_plane):
    """The camera of the part of its image in which the hub is seen for any value of the sliders."""
    turn = np.linspace(0, 2 * np.pi, 73)
    rim = MARGIN * hub.radius * np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.concatenate(
        [np.column_stack([rim + (shift, 0), np.full(len(rim), hub.peg_height)]) for shift in SHIFTS]
    )
    seen = camera.project(points, cam_from_plane)
    low = np.clip(np.floor(seen.min(axis=0)), 0, np.array(camera.image_size) - 1).astype(int).tolist()
    high = np.clip(np.ceil(seen.max(axis=0)), 1, camera.image_size).astype(int).tolist()
    return camera.cropped(*low, high[0] - low[0], high[1] - low[1])


def _smaller(camera, width):
    """The same camera with pixels so large that its image is at most `width` px wide."""
    return camera.scaled(min(1.0, width / camera.image_size[0]))


def _paint_pegs(picture, scale, seen):
    """Draw labelled pegs and screws, and line 1 of Fig. 5 from the hub's centre to peg 1."""
    ends = (_place(point, scale) for point in (seen.hub_center, seen.peg_centers[0]))
    cv2.line(picture, *ends, _bgr(COLORS["genetic"]), 2, cv2.LINE_AA, 4)
    for number, rim in enumerate(peg_rims(seen), 1):
        _outline(picture, rim, scale, COLORS["genetic"], str(number))
    for number, center in enumerate(seen.screw_centers, 1):
        _circle(picture, center, 6.0 / scale, scale, COLORS["linear"], f"s{number}")


def _compare_poses(angle, shift, pose):
    """Text with truth, estimate and its error, or a remark if the labels are wrong by half a turn, as the screws allow."""
    found = np.rad2deg(pose.theta)
    error = (found - angle + 180) % 360 - 180
    half_turn_off = abs(error) > 90
    theta = found if half_turn_off else angle + error
    lines = [
        f"truth: theta = {angle:.2f} deg, x = {shift:.2f} mm, y = 0.00 mm",
        f"estimate: theta = {theta:.2f} deg, x = {pose.x:.2f} mm, y = {pose.y:.2f} mm",
    ]
    if half_turn_off:
        lines.append("The labels are a half turn off: the hub looks the same after a half turn.")
    else:
        x, y = 1000 * (pose.x - shift), 1000 * pose.y
        lines.append(f"error: theta = {1000 * error:.1f} mdeg, x = {x:.1f} µm, y = {y:.1f} µm")
    return "\n".join(lines).replace("-0.00", "0.00")
