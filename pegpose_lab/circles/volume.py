"""Maxima of the classic three-dimensional accumulator, held three planes at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from .edges import _Gradient, _thin_edges
from .own_radius import _in_range
from .votes import _draw_circles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .request import _Request


def find(window: NDArray[np.uint8], request: _Request) -> NDArray[np.float64]:
    """Rows x, y, r, score: maxima of the 3-D accumulator, held three planes at a time."""
    gradient = _Gradient(window)
    if not gradient.magnitude.any():
        return np.empty((0, 4))
    edges, least = _thin_edges(gradient, request), 1 - request.sensitivity / 2
    empty = np.zeros(edges.shape, np.float32)
    first, last = max(int(np.floor(request.r_min)) - 1, 1), int(np.ceil(request.r_max)) + 1
    below = _draw_circles(edges, first - 1) if first > 1 else empty
    here, rows = _draw_circles(edges, first), []
    for radius in range(first, last + 1):  # planes beyond the range tell which circles belong there
        above = _draw_circles(edges, radius + 1)
        rows.extend(_plane_maxima(below, here, above, radius, least))
        below, here = here, above
    rows = [row for row in rows if _has_polarity(gradient, row, request.sign)]
    rows = np.array(rows, float).reshape(-1, 4)
    return rows[_in_range(rows[:, 2], request)]


def _plane_maxima(below, here, above, radius, least):
    """Maxima of the middle plane over 3 x 3 x 3 neighbours, refined by a parabola along each axis."""
    cube = np.ones((3, 3), np.uint8)
    highest = cv2.dilate(cv2.max(cv2.max(below, above), here), cube)
    for y, x in np.argwhere((here >= least) & (here == highest)).tolist():
        dx = _parabola(*_neighbours(here, x, y, 1, 0))
        dy = _parabola(*_neighbours(here, x, y, 0, 1))
        dr = _parabola(below[y, x], here[y, x], above[y, x])
        yield x + dx, y + dy, radius + dr, here[y, x]


def _neighbours(plane, x, y, dx, dy):
    """A value between its two neighbours; outside the image the value itself is repeated."""
    height, width = plane.shape
    before = plane[max(y - dy, 0), max(x - dx, 0)]
    return before, plane[y, x], plane[min(y + dy, height - 1), min(x + dx, width - 1)]


def _parabola(before, here, after):
    """Place of the vertex through three equally spaced values, the middle one not the smallest: |x| <= 0.5."""
    bend = float(before) - 2 * float(here) + float(after)
    return 0.5 * (float(before) - float(after)) / bend if bend < 0 else 0.0


def _has_polarity(gradient, row, sign):
    """Whether the gradient along a circle points, on the whole, to its centre (sign 1) or away (-1)."""
    x, y, radius, _ = row
    t = np.arange(0, 2 * np.pi, 1 / radius)
    columns = np.rint(x + radius * np.cos(t)).astype(int)
    rows = np.rint(y + radius * np.sin(t)).astype(int)
    height, width = gradient.magnitude.shape
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    dx, dy = gradient.dx[rows[inside], columns[inside]], gradient.dy[rows[inside], columns[inside]]
    return sign * (dx @ np.cos(t[inside]) + dy @ np.sin(t[inside])) < 0
