"""The pixels of a ring around an ellipse."""

from dataclasses import dataclass

import numpy as np

RING = 6.0  # px on either side of the edge that take part in the fit, at least
RING_WIDTHS = 3.0  # edge widths s that do
CHUNK = 256  # pixels that are summed in float32: no sum depends on how far a disc's row is filled up


@dataclass
class _Pixels:
    """The pixels of n rings in rows, filled up to a multiple of CHUNK where `used` is 0, float32.

    Places x, y are told from `origin` (n, 2), grey values from `level` (n,), both whole numbers.
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
    """The pixels within about `widths` (n,) px of the ellipses."""
    rings = [_ring_indices(ellipses[i], image.shape, widths[i]) for i in range(len(ellipses.r))]
    origin, level = np.rint(np.stack([ellipses.x, ellipses.y], axis=1)), np.zeros(len(rings))
    longest = max(max(len(ring[0]) for ring in rings), 1)
    x, y, values, used = np.zeros((4, len(rings), -(-longest // CHUNK) * CHUNK), np.float32)
    for i, (columns, rows) in enumerate(rings):
        m = len(columns)
        x[i, :m], y[i, :m], x[i, m:], used[i, :m] = columns, rows, origin[i, 0] + ellipses.r[i], 1
        grey = image.ravel().take(rows * image.shape[1] + columns)
        level[i] = np.rint(grey.mean()) if m else 0
        values[i, :m] = grey - np.float32(level[i])
    x -= origin[:, :1].astype(np.float32)
    y -= origin[:, 1:].astype(np.float32)
    return _Pixels(origin, x, y, values, used, level)


def _ring_indices(ellipse, shape, width=RING):
    """Columns and rows of the pixels between the ellipses with semi-axes longer and shorter by `width` px."""
    (a, b), cos, sin = ellipse.axes, np.cos(ellipse.angle), np.sin(ellipse.angle)
    half = np.hypot((a + width) * sin, (b + width) * cos)
    rows = np.arange(max(int(np.ceil(ellipse.y - half)), 0), min(int(ellipse.y + half), shape[0] - 1) + 1)
    outer, inner = ((max(a + d, 0.1), max(b + d, 0.1)) for d in (width, -width))
    middle, reach = _spans(rows - ellipse.y, *outer, cos, sin)
    first = np.maximum(np.ceil(ellipse.x + middle - reach), 0)
    end = np.minimum(np.floor(ellipse.x + middle + reach) + 1, shape[1])
    middle, reach = _spans(rows - ellipse.y, *inner, cos, sin)
    left = np.where(reach > 0, np.ceil(ellipse.x + middle - reach), end).clip(first, end)
    right = np.where(reach > 0, np.floor(ellipse.x + middle + reach) + 1, end).clip(left, end)
    first, counts = np.array([first, right]).ravel(), np.array([left - first, end - right]).ravel()
    counts = np.maximum(counts, 0).astype(np.intp)
    shift = first.astype(np.intp) - np.cumsum(counts) + counts
    return np.arange(counts.sum()) + np.repeat(shift, counts), np.repeat(np.concatenate([rows, rows]), counts)


def _spans(dy, a, b, cos, sin):
    """Middle and half width of an ellipse in the rows at dy from its centre; half width 0 where they miss it."""
    form = (cos / a) ** 2 + (sin / b) ** 2
    middle = dy * (-cos * sin * (1 / a**2 - 1 / b**2) / form)
    return middle, np.sqrt(np.maximum(form - (dy / (a * b)) ** 2, 0)) / form
