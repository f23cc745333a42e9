"""The pixels of a ring around an ellipse."""

from dataclasses import dataclass

import numpy as np

RING = 6.0  # px on either side of the edge that take part in the fit, at least
RING_WIDTHS = 3.0  # edge widths s that do
CHUNK = 256  # pixels in a row: rings of all sizes stand in one array


@dataclass
class _Pixels:
    """Pixels in rows, filled up where `used` is 0, float32.

    Places x, y are told from `origin` (n, 2), grey values from `level` (n,).
    """

    origin: np.ndarray
    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    used: np.ndarray
    level: np.ndarray

    def some(self, rows):
        """The pixels of some rows."""
        return _Pixels(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def _ring_width(log_s):
    """How far (px) from an edge of width s the ring reaches on either side."""
    return np.maximum(RING, RING_WIDTHS * np.exp(log_s))


def _ring_pixels(image, ellipses, widths):
    """The pixels within about `widths` (n,) px of the ellipses, in rows of CHUNK, and which ellipse each row belongs to.

    An ellipse's rows follow each other; origins and levels are whole numbers.
    """
    columns, rows, sizes = _ring_indices(ellipses, image.shape, widths)
    n, chunks = len(sizes), np.maximum(-(-sizes // CHUNK), 1)
    disc, owner = np.repeat(np.arange(n), chunks), np.repeat(np.arange(n), sizes)
    origin = np.rint(np.stack([ellipses.x, ellipses.y], axis=1))
    grey = image.ravel().take(rows * image.shape[1] + columns)
    level = np.rint(np.bincount(owner, grey, n) / np.maximum(sizes, 1))
    steps = CHUNK * (np.cumsum(chunks) - chunks) - (np.cumsum(sizes) - sizes)
    places = np.arange(len(owner)) + np.repeat(steps, sizes)
    x, y, values, used = np.zeros((4, len(disc) * CHUNK), np.float32)
    x[:] = np.repeat(ellipses.r, chunks * CHUNK)
    x[places], y[places], used[places] = columns - origin[owner, 0], rows - origin[owner, 1], 1
    values[places] = grey - level[owner]
    x, y, values, used = (part.reshape(-1, CHUNK) for part in (x, y, values, used))
    return _Pixels(origin[disc], x, y, values, used, level[disc]), disc


def _ring_indices(ellipses, shape, widths):
    """Columns and rows (m,) of the pixels between the ellipses with semi-axes longer and shorter by `widths` (n,) px, and how
    many (n,) of them are each ellipse's, one after another: row by row those on the left, then those on the right."""
    (a, b), cos, sin = ellipses.axes, np.cos(ellipses.angle), np.sin(ellipses.angle)
    half = np.hypot((a + widths) * sin, (b + widths) * cos)
    top = np.maximum(np.ceil(ellipses.y - half), 0).astype(np.intp)
    heights = np.maximum(np.minimum(ellipses.y + half, shape[0] - 1).astype(np.intp) + 1 - top, 0)
    owner = np.repeat(np.arange(len(a)), 2 * heights)
    place = np.arange(len(owner)) - np.repeat(2 * (np.cumsum(heights) - heights), 2 * heights)
    on_right = place >= heights[owner]
    rows = top[owner] + np.where(on_right, place - heights[owner], place)
    dy, x, cos, sin = rows - ellipses.y[owner], ellipses.x[owner], cos[owner], sin[owner]
    outer, inner = ((np.maximum(a + d, 0.1)[owner], np.maximum(b + d, 0.1)[owner]) for d in (widths, -widths))
    middle, reach = _spans(dy, *outer, cos, sin)
    first = np.maximum(np.ceil(x + middle - reach), 0)
    end = np.minimum(np.floor(x + middle + reach) + 1, shape[1])
    middle, reach = _spans(dy, *inner, cos, sin)
    left = np.where(reach > 0, np.ceil(x + middle - reach), end).clip(first, end)
    right = np.where(reach > 0, np.floor(x + middle + reach) + 1, end).clip(left, end)
    first = np.where(on_right, right, first).astype(np.intp)
    counts = np.maximum(np.where(on_right, end, left).astype(np.intp) - first, 0)
    columns = np.arange(counts.sum()) + np.repeat(first - np.cumsum(counts) + counts, counts)
    sizes = np.bincount(owner, counts, len(a)).astype(np.intp)
    return columns, np.repeat(rows, counts), sizes


def _spans(dy, a, b, cos, sin):
    """Middle and half width of an ellipse in the rows at dy from its centre; half width 0 where they miss it."""
    form = (cos / a) ** 2 + (sin / b) ** 2
    middle = dy * (-cos * sin * (1 / a**2 - 1 / b**2) / form)
    return middle, np.sqrt(np.maximum(form - (dy / (a * b)) ** 2, 0)) / form
