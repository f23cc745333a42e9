"""The explorer for the Hough transforms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import ipywidgets
import numpy as np

from ...checks import DetectionError, as_image
from ...circles import DETECTION_METHODS, find_circles
from ...segmentation import segment
from ..style import COLORS
from .drawing import _canvas, _circle, _resized
from .explorer import Explorer, _look, _slider

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def circle_explorer(
    image: ArrayLike, *, radius_range: tuple[int, int] = (20, 60), polarity: str = "bright"
) -> Explorer:
    """Controls for `find_circles` (Sect. 3.1): radius range, sensitivity, method; it draws the circles in the image.

    The search uses the shown image, which is `SHOWN_WIDTH` px wide.  For bright discs it is limited to the parts that
    `segment` finds, if there are any.  All radii are in px of `image`.

    Parameters
    ----------
    image : (height, width) uint8
    radius_range : (int, int)
        Initial value of the radius slider, px.
    polarity : {"bright", "dark"}

    Returns
    -------
    Explorer
        Controls ``radius_range``, ``sensitivity``, ``method``.
    """
    image = as_image(image)
    canvas, scale = _canvas(image)
    small = _resized(image, scale)
    regions = _regions(small) if polarity == "bright" else None

    def draw(picture, radius_range, sensitivity, method):
        circles = find_circles(
            small,
            scale * np.array(radius_range),
            method=method,
            polarity=polarity,
            sensitivity=sensitivity,
            regions=regions,
        )
        for center, radius in zip(circles.centers, circles.radii, strict=False):
            _circle(picture, center, radius, 1.0, COLORS["genetic"])
        return _describe_circles(circles, scale)

    return Explorer(
        "circle explorer",
        lambda **_: canvas,
        draw,
        {
            "radius_range": _slider(
                ipywidgets.IntRangeSlider,
                "radius range (px)",
                radius_range,
                2,
                max(min(image.shape) // 4, radius_range[1]),
                live=False,
            ),
            "sensitivity": _slider(
                ipywidgets.FloatSlider, "sensitivity (0 to 1)", 0.85, 0.0, 1.0, step=0.01, live=False
            ),
            "method": ipywidgets.Dropdown(options=tuple(DETECTION_METHODS), description="method", **_look()),
        },
    )


# ---- segmentation and circles ----


def _regions(image):
    """Boxes of the image's bright parts, or None if there are none."""
    try:
        boxes = segment(image).boxes
    except DetectionError:
        return None
    return boxes if len(boxes) else None


def _describe_circles(circles, scale):
    number, radii = len(circles.radii), circles.radii / scale
    if number == 0:
        return "no circles: widen the radius range or raise the sensitivity"
    return (
        f"{number} circle{'s' * (number > 1)}; radii {radii.min():.1f} to {radii.max():.1f} px, "
        f"scores {circles.scores.min():.2f} to {circles.scores.max():.2f}"
    )
