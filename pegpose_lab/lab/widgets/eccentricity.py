"""The explorer for the bias of an ellipse's centre: the image of a disc's centre is not the centre of its image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import ipywidgets
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...pose import project_discs
from ..style import COLORS
from .drawing import _bgr
from .explorer import FONT, SHOWN_WIDTH, Explorer, _slider

if TYPE_CHECKING:
    from ...paper import Experiment

HEIGHT = 420  # px
ENLARGED = 20  # the shift is drawn at most so many times longer


def eccentricity_explorer(experiment: Experiment) -> Explorer:
    """Sliders for tilt, radius and depth of a disc: its image, the image of its centre, and the centre of its image.

    Parameters
    ----------
    experiment : Experiment
        Gives the camera.  The disc is on its optical axis, where there is hardly any distortion: the shift is that of
        perspective.

    Returns
    -------
    Explorer
        Controls ``tilt`` (deg), ``radius`` (mm), ``depth`` (mm).
    """
    camera = experiment.camera
    pixels = camera.focal_length / camera.pixel_pitch[0]

    def draw(picture, tilt, radius, depth):
        pose = RigidTransform.from_components([0.0, 0.0, depth], Rotation.from_rotvec([np.deg2rad(tilt), 0.0, 0.0]))
        (seen,), (image_radius,) = project_discs(camera, pose, np.zeros((1, 3)), [radius])
        shift = seen - camera.project([[0.0, 0.0, 0.0]], pose)[0]
        turns = np.linspace(0, 2 * np.pi, 90)
        rim = radius * np.column_stack([np.cos(turns), np.sin(turns), np.zeros(90)])
        outline = camera.project(rim, pose) - seen
        scale = 0.42 * HEIGHT / max(np.abs(outline).max(), 1e-9)
        middle = np.array([SHOWN_WIDTH / 2, HEIGHT / 2])
        cv2.polylines(
            picture,
            [np.rint(middle + scale * outline).astype(np.int32)],
            True,
            _bgr(COLORS["measured"]),
            2,
            cv2.LINE_AA,
        )
        length = float(np.hypot(*shift))
        drawn = min(ENLARGED * scale * length, 0.15 * HEIGHT)  # px: it stays inside the ellipse
        start, end = middle - drawn * shift / max(length, 1e-9), middle
        for place, name, color in ((end, "centre of the ellipse", "joint"), (start, "image of the centre", "truth")):
            x, y = (int(value) for value in np.rint(place))
            cv2.circle(picture, (x, y), 6, _bgr(COLORS[color]), -1, cv2.LINE_AA)
            cv2.putText(picture, name, (x + 12, y + 6), FONT, 0.6, _bgr(COLORS[color]), 1, cv2.LINE_AA)
        return (
            f"the centre of the ellipse lies {length:.3f} px from the image of the disc's centre (drawn longer);\n"
            f"the radius of the disc's image is {image_radius:.1f} px; "
            f"at this depth the shift is {1000 * length * depth / pixels:.1f} µm on the part"
        )

    controls = {
        "tilt": _slider(ipywidgets.IntSlider, "tilt (deg)", 12, 0, 60),
        "radius": _slider(ipywidgets.FloatSlider, "radius of the disc (mm)", 10.1, 2.0, 40.0, step=0.1),
        "depth": _slider(ipywidgets.IntSlider, "depth (mm)", 270, 200, 1000, step=10),
    }
    blank = np.full((HEIGHT, SHOWN_WIDTH, 3), 255, np.uint8)
    return Explorer("eccentricity explorer", lambda **_: blank, draw, controls)
