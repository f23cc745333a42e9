"""The explorer for the segmentation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import ipywidgets
import numpy as np

from ...checks import as_image
from ...segmentation import segment
from ..style import COLORS
from .drawing import _bgr, _canvas, _place
from .explorer import FONT, Explorer, _look, _slider

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def threshold_explorer(image: ArrayLike) -> Explorer:
    """Sliders for `segment` (Sect. 3.1): threshold and minimum area; it colours the parts in the image.

    Parameters
    ----------
    image : (height, width) uint8

    Returns
    -------
    Explorer
        Controls ``automatic`` (Otsu's threshold, with the fallback of `segment`), ``threshold``, ``min_area``.
    """
    image = as_image(image)
    canvas, scale = _canvas(image)

    def draw(picture, automatic, threshold, min_area):
        found = segment(image, min_area=min_area, threshold=None if automatic else threshold)
        _paint_parts(picture, scale, found)
        return _describe_parts(found, min_area)

    automatic = ipywidgets.Checkbox(True, description="automatic (Otsu)", indent=True, **_look())
    threshold = _slider(ipywidgets.IntSlider, "threshold (grey value)", int(_otsu(image)), 0, 255)
    ipywidgets.dlink((automatic, "value"), (threshold, "disabled"))  # it does nothing then
    least, most = max(4, image.size // 10_000), max(5, image.size // 500)
    min_area = _slider(ipywidgets.IntSlider, "minimum area (px)", least, 1, most)
    controls = {"automatic": automatic, "threshold": threshold, "min_area": min_area}
    return Explorer("threshold explorer", lambda **_: canvas, draw, controls)


# ---- segmentation and circles ----


def _otsu(image):
    return cv2.threshold(image, 0, 255, cv2.THRESH_OTSU)[0]


def _paint_parts(picture, scale, found):
    """Tint each part with one of the project's colours and number it."""
    palette = np.array([_bgr(color) for name, color in COLORS.items() if name not in ("paper", "truth")], np.uint8)
    labels = cv2.resize(found.labels, picture.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    white = labels > 0
    picture[white] = picture[white] // 2 + palette[labels[white] % len(palette)] // 2
    for number, centroid in enumerate(found.centroids[:99], 1):
        x, y = _place(centroid, scale, 0)
        cv2.putText(picture, str(number), (x - 6, y + 6), FONT, 0.6, (255, 255, 255), 2, cv2.LINE_AA)


def _describe_parts(found, min_area):
    areas = f"; areas {found.areas.min()} to {found.areas.max()} px" if len(found.areas) else ""
    return f"threshold {found.threshold:.0f}: {len(found.areas)} parts of {min_area} px or more{areas}"
