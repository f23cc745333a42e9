"""Rings in angular sectors, each with levels of its own where it does not fit the common ones.

The sectors of all discs stand in one row (K,), disc by disc, so that their number may differ from disc to disc.
Sums of products of the layers of `_ingredients` (11, 11, K) are in the order of `_ORDER`: Phi's derivatives by x, y, r, p, q,
log s, the grey values, 1, Phi, the distance and the distance times Phi.
"""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from .ellipse import _Ellipse
from .model import QUANTISATION, _ingredients
from .ring import RING, _Pixels, _ring_indices

N_SECTORS = np.array([24, 36, 48, 60, 78, 96])  # sectors of a refit, multiples of BLOCK
SECTOR_ROW, LONGER_ROW = 72, 12  # pixels to which the rows of sectors are filled up, and further where there are more
SECTOR_LENGTH = 5.0  # px along the edge, about
LEAST_RADIUS = 9.5  # px, of a disc that is fitted by sectors: the fewest there are have 2.5 px of its edge each


# -------------------------------------------------------------------------------------------------- sectors


@dataclass
class _Sectors:
    """The pixels of n rings in K angular sectors: the ellipses they lie around, the disc (K,) of each sector, its number of
    pixels (K,), 1, cos t and sin t (3, K) of its direction t, which sectors each disc has (slices), and the pixels of
    those (rows) that are equally long."""

    ellipse: _Ellipse
    disc: np.ndarray
    count: np.ndarray
    around: np.ndarray
    spans: list
    parts: list

    def medians(self, values):
        """The median (n,) of each disc's sectors of values (K,): their number is even."""
        ranked = values[np.lexsort((values, self.disc))]
        middle = [(span.start + span.stop) // 2 for span in self.spans]
        return (ranked[middle] + ranked[[i - 1 for i in middle]]) / 2


def _sectors(image, ellipses):
    """The `_Sectors` of rings around ellipses.

    The number of a ring's sectors and the length of their rows follow from the disc itself: so no result depends on
    other discs.
    """
    n = len(ellipses.r)
    numbers = N_SECTORS[np.abs(np.log(N_SECTORS * SECTOR_LENGTH / (2 * np.pi * ellipses.r[:, None]))).argmin(axis=1)]
    firsts = np.cumsum(numbers) - numbers
    sector, *pixels = _ring(image, ellipses, numbers, firsts)
    short = sector.astype(np.uint16) if numbers.sum() < 2**16 else sector  # sorted by their digits, which is faster
    order = np.argsort(short, kind="stable")
    disc, count = np.repeat(np.arange(n), numbers), np.bincount(sector, minlength=numbers.sum())
    around = np.concatenate([_directions(number) for number in numbers.tolist()], axis=1)
    spans = [slice(first, first + number) for first, number in zip(firsts.tolist(), numbers.tolist(), strict=True)]
    return _Sectors(ellipses, disc, count, around, spans, _rows_of(ellipses, disc, count, sector, order, pixels))


def _ring(image, ellipses, numbers, firsts):
    """The sectors (m,) of the pixels of rings, each ring's counted from `firsts` (n,) and `numbers` (n,) in all; their x and
    y from their ellipse's centre, and their values from their ring's mean, float32."""
    columns, rows, sizes = _ring_indices(ellipses, image.shape, np.full(len(numbers), RING))
    owner = np.repeat(np.arange(len(numbers)), sizes)
    x, y = (columns - ellipses.x[owner]).astype(np.float32), (rows - ellipses.y[owner]).astype(np.float32)
    count = numbers.astype(np.float32)[owner]
    turn = cv2.phase(x, y).ravel() * np.float32(1 / (2 * np.pi))
    turn += np.where(turn < 0.5, np.float32(0.5), np.float32(-0.5))  # from the direction -x
    sector = np.minimum((turn * count).astype(np.int32), (numbers - 1).astype(np.int32)[owner])
    grey = image.ravel().take(rows * image.shape[1] + columns)
    mean = np.bincount(owner, grey, len(numbers)) / np.maximum(sizes, 1)
    return sector + firsts.astype(np.int32)[owner], x, y, (grey - mean[owner]).astype(np.float32)


def _rows_of(ellipses, disc, count, sector, order, pixels):
    """The pixels in rows, a row for a sector, filled up to one length; and which sectors those of each length are."""
    longest = np.zeros(len(ellipses.r), int)
    np.maximum.at(longest, disc, count)
    lengths = np.maximum(-(-longest // LONGER_ROW) * LONGER_ROW, SECTOR_ROW)[disc]
    sector = sector[order]
    place = np.arange(len(sector)) - np.repeat(np.cumsum(count) - count, count)
    parts = []
    for length in np.unique(lengths):
        rows = np.flatnonzero(lengths == length)
        there, where = slice(None), place + sector * length
        if len(rows) < len(lengths):
            there = lengths[sector] == length
            where = place[there] + (np.cumsum(lengths == length) - 1)[sector[there]] * length
        filled = np.zeros((4, len(rows) * length), np.float32)
        filled[0] = np.repeat(ellipses.r[disc[rows]], length)
        for to, values in zip(filled, pixels, strict=False):
            to[where] = values[order[there]]
        filled[3, where] = 1
        origin = np.stack([ellipses.x, ellipses.y], axis=1)[disc[rows]]
        parts.append((rows, _Pixels(origin, *filled.reshape(4, len(rows), length), np.zeros(len(rows)))))
    return parts


@lru_cache(maxsize=len(N_SECTORS))
def _directions(k):
    """1, cos t and sin t (3, k) of the directions t in which k sectors lie."""
    t = (np.arange(k) + 0.5) * (2 * np.pi / k) - np.pi
    return np.stack([np.ones(k), np.cos(t), np.sin(t)])


_ORDER = np.array([0, 1, 2, 3, 4, 5, 8, 6, 7, 9, 10])
_PAIRS = (11 * _ORDER[:, None] + _ORDER).ravel()
_GREY, _ONE, _PHI = 6, 7, 8


def _set_moments(moments, sectors, ellipse, log_s, discs):
    """Set the sums of products (11, 11, K) of the sectors of some discs (n,)."""
    for rows, pixels in sectors.parts:
        some = discs[sectors.disc[rows]]
        if not some.any():
            continue
        if not some.all():
            rows, pixels = rows[some], pixels.some(some)
        disc = sectors.disc[rows]
        layers = _ingredients(pixels, ellipse[disc], log_s[disc], extra=2).transpose(1, 0, 2)
        sums = (layers @ layers.transpose(0, 2, 1)).reshape(len(rows), -1)
        moments.reshape(121, -1)[:, rows] = sums.T[_PAIRS]


def _shift_moments(moments, steps):
    """Let Phi follow small steps (K, 6) in the sums of products, by its derivatives."""
    moments[_PHI] += (steps.T[:, None] * moments[:6]).sum(axis=0)
    moments[:, _PHI] += (steps.T * moments[:, :6]).sum(axis=1)


# -------------------------------------------------------------------------------------------------- equations


@dataclass
class _SectorFit:
    """Sectors (K,) with levels of their own: chi2, contrast, level outside, and what is `left` (7, 7, K) of
    the sums of products of Phi's derivatives and of the grey values when these are eliminated."""

    chi2: np.ndarray
    contrast: np.ndarray
    level: np.ndarray
    left: np.ndarray


def _own_levels(moments, count, noise):
    """Each sector with a level and a slope of its own on either side; `noise` (K,)."""
    left, factors, work = moments, [], np.empty((10, 10, len(count)))
    for ridge in (1e-3, 1e-3, 1e-6, 1e-6):  # the distance times Phi, the distance, Phi, 1
        factors.append(left[-1, :-1] / (left[-1, -1] + ridge))
        product = work[: len(left) - 1, : len(left) - 1]
        np.multiply(left[:-1, -1:], factors[-1], out=product)
        left = np.subtract(left[:-1, :-1], product, out=None if left is moments else left[:-1, :-1])
    level = factors[3][_GREY]
    contrast = factors[2][_GREY] - factors[2][_ONE] * level
    chi2 = np.maximum(left[_GREY, _GREY] / np.maximum(count - 4, 1), QUANTISATION) / noise**2
    return _SectorFit(chi2, contrast, level, left)


def _same_chi2(moments, level, contrast, count, noise):
    """Chi2 (K,) of sectors with their disc's common levels, (K,) each."""
    squares = moments[_GREY, _GREY] - 2 * (level * moments[_ONE, _GREY] + contrast * moments[_PHI, _GREY])
    squares += level**2 * moments[_ONE, _ONE] + 2 * level * contrast * moments[_ONE, _PHI]
    squares += contrast**2 * moments[_PHI, _PHI]
    return np.maximum(squares / np.maximum(count, 1), QUANTISATION) / noise**2


def _common_levels(levels, sectors):
    """Level and contrast (K,) in the direction of each sector, from levels (n, 6)."""
    values = levels[sectors.disc]
    return (values[:, :3] * sectors.around.T).sum(axis=1), (values[:, 3:] * sectors.around.T).sum(axis=1)


_HELD = np.array([0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 1, 1])  # the levels' changes with the direction are held near 0


def _sums(values, weights, spans):
    """Sums (n, w, v) over each disc's sectors of values (v, K) with weights (w, K)."""
    return np.array([weights[:, span] @ values[:, span].T for span in spans])


def _common_normal(moments, levels, sectors, weights):
    """Sums (n, 13, 13) of products of the derivatives and the residual, with common levels.

    Levels (n, 6) are B and A, each as a + b cos t + c sin t in the direction t: the ground is seldom the same on
    both sides of a disc, and a difference of 1 % of the contrast between them would move the centre by 0.01 px.
    """
    around, k = sectors.around, len(weights)
    pairs = (around[:, None] * around).reshape(9, k) * weights
    sums = _sums(moments[:9, :9].reshape(81, k), pairs, sectors.spans)
    sums = sums.reshape(-1, 3, 3, 9, 9).swapaxes(2, 3).reshape(-1, 27, 27)
    change = np.repeat(_BY_SUMS, len(levels), axis=0)
    change[:, _SIX, :, _SIX] = levels[:, 3:]
    change[:, 12, :, _ONE], change[:, 12, :, _PHI] = -levels[:, :3], -levels[:, 3:]
    change = change.reshape(-1, 13, 27)
    return change @ sums @ change.swapaxes(1, 2)


_SIX = np.arange(6)
_BY_SUMS = np.zeros((1, 13, 3, 9))  # the derivatives by the levels, and the grey values
_BY_SUMS[:, 6 + np.arange(3), np.arange(3), _ONE] = _BY_SUMS[:, 9 + np.arange(3), np.arange(3), _PHI] = 1
_BY_SUMS[:, 12, 0, _GREY] = 1


def _sector_equations(moments, levels, sectors, held, free, own, weights):
    """Normal equations of x, y, r, p, q, log s and the six levels: matrices (n, 12, 12), gradients (n, 12), and the
    part (6, K) of these that each sector with levels of its own contributes."""
    alone = np.where(own, weights, 0) * free.contrast
    normal = _common_normal(moments, levels, sectors, np.where(own, 0, 1.0)) + 1e-9 * np.eye(13)
    normal[:, range(12), range(12)] += held
    normal[:, 6:12, 12] -= held[:, 6:] * levels
    sums = _own_sums(np.stack([alone * free.contrast, alone]), free, sectors)
    normal[:, :6, :6] += sums[:, 0, :, :6]
    normal[:, :6, 12] += sums[:, 1, :, _GREY]
    return normal[:, :12, :12], normal[:, :12, 12], alone * free.left[:6, _GREY]


def _own_sums(weights, free, sectors):
    """Sums (n, w, 6, 7) over each disc's sectors of what is left of the derivatives' products, with weights (w, K)."""
    return _sums(free.left[:6].reshape(42, -1), weights, sectors.spans).reshape(len(sectors.spans), -1, 6, 7)


def _radial_scores(moments, level, contrast, free, own, weights):
    """Each sector's derivative (K,) of half the sum of squares by the radius, and its square's expectation (K,) for
    unit noise and weight; with the common level and contrast (K,)."""
    common = contrast * (moments[2, _GREY] - level * moments[2, _ONE] - contrast * moments[2, _PHI])
    scores = np.where(own, weights * free.contrast * free.left[2, _GREY], common)
    return scores, np.where(own, free.contrast**2 * free.left[2, 2], contrast**2 * moments[2, 2])
