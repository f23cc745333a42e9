"""The pixels of a ring around an ellipse."""

from dataclasses import dataclass

import numpy as np

RING = 6.0  # px on either side of the edge that take part in the fit, at least
RING_WIDTHS = 3.0  # edge widths s that do
CHUNK = 256  # pixels that are summed in float32: no sum depends on how far a disc's row is filled up


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
    rings = [_ring_indices(ellipses[i], image.shape, widths[i]) for i in range(len(ellipses.r))]
    origin, level = np.rint(np.stack([ellipses.x, ellipses.y], axis=1)), np.zeros(len(rings))
    disc = np.repeat(np.arange(len(rings)), [max(-(-len(ring[0]) // CHUNK), 1) for ring in rings])
    x, y, values, used = np.zeros((4, len(disc) * CHUNK), np.float32)
    x[:] = np.repeat(ellipses.r, np.bincount(disc, minlength=len(rings)) * CHUNK)
    firsts = np.searchsorted(disc, np.arange(len(rings))) * CHUNK
    for i, ((columns, rows), first) in enumerate(zip(rings, firsts.tolist(), strict=True)):
        part = slice(first, first + len(columns))
        x[part], y[part], used[part] = columns - origin[i, 0], rows - origin[i, 1], 1
        grey = image.ravel().take(rows * image.shape[1] + columns)
        level[i] = np.rint(grey.mean()) if len(grey) else 0
        values[part] = grey - np.float32(level[i])
    x, y, values, used = (part.reshape(-1, CHUNK) for part in (x, y, values, used))
    return _Pixels(origin[disc], x, y, values, used, level[disc]), disc


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
