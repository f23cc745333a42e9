"""Drawing into an image at the size in which it is shown."""

import cv2
import numpy as np
from matplotlib.colors import to_rgb

from .. import plotting
from ..image_plots import white_level
from .explorer import FONT, SHOWN_WIDTH

DPI = plotting.STYLE["figure.dpi"]


def _chart(height):
    """Figure and axes of an explorer's size with fixed margins: fitting them to the text takes most of the drawing's time."""
    fig, ax = plotting.figure(SHOWN_WIDTH / DPI, height / DPI, layout="none")
    fig.subplots_adjust(left=0.09, right=0.98, bottom=50 / height, top=1 - 50 / height)
    return fig, ax


def _charted(fig, height):
    """The finished figure as a picture in OpenCV's order of colours; it is closed, or a notebook would show it again."""
    fig.canvas.draw()
    picture = np.ascontiguousarray(np.asarray(fig.canvas.buffer_rgba())[:height, :SHOWN_WIDTH, 2::-1])
    plotting.plt.close(fig)
    return picture


# ---- x px in the full image is scale * (x + 0.5) - 0.5 px in the shown one; the same holds for y ----


def _bgr(color):
    """A colour of `COLORS` in OpenCV's order (blue, green, red)."""
    return tuple(round(255 * part) for part in reversed(to_rgb(color)))


def _canvas(image):
    """A colour image `SHOWN_WIDTH` px wide, and its scale.

    Dark images are shown brighter.  Grey values are rounded to multiples of 8, because noise would make the PNG files
    several times larger.
    """
    scale = SHOWN_WIDTH / image.shape[1]
    bright = cv2.convertScaleAbs(_resized(image, scale), alpha=255 / white_level(image))
    return cv2.cvtColor(cv2.add(bright, 4) & 0xF8, cv2.COLOR_GRAY2BGR), scale


def _resized(image, scale):
    size = round(scale * image.shape[1]), max(1, round(scale * image.shape[0]))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)


def _place(point, scale, bits=4):
    """Position in the shown image, in units of 1/16 px as for cv2's drawing functions."""
    x, y = np.rint((scale * (np.asarray(point) + 0.5) - 0.5) * (1 << bits)).astype(int).tolist()
    return x, y


def _outline(picture, points, scale, color, label):
    """Draw a closed outline (n, 2), px, with its middle and a label next to it."""
    places = np.array([_place(point, scale) for point in points])
    cv2.polylines(picture, [places], True, _bgr(color), 2, cv2.LINE_AA, 4)
    _mark(picture, points.mean(axis=0), np.ptp(points, axis=0).mean() / 2, scale, color, label)


def _circle(picture, center, radius, scale, color, label=None):
    """Draw a circle with its centre and, if given, a label next to it."""
    place = _place(center, scale)
    cv2.circle(picture, place, round(16 * scale * radius), _bgr(color), 2, cv2.LINE_AA, 4)
    _mark(picture, center, radius, scale, color, label)


def _mark(picture, center, radius, scale, color, label):
    """Draw a dot at a centre, and the label, if given, at the rim."""
    place = _place(center, scale)
    cv2.circle(picture, place, 16 * 2, _bgr(color), -1, cv2.LINE_AA, 4)
    if label is not None:
        corner = np.add(np.floor_divide(place, 16), round(0.75 * scale * radius) * np.array([1, -1])).tolist()
        cv2.putText(picture, label, corner, FONT, 0.7, _bgr(color), 2, cv2.LINE_AA)
