"""Rings in angular sectors, each with levels of its own where it does not fit the common ones."""

from dataclasses import dataclass

import numpy as np

from .ellipse import _Ellipse
from .model import QUANTISATION, _ingredients
from .ring import _Pixels, _ring_indices

N_SECTORS = np.array([24, 36, 48, 60, 78, 96])  # sectors of a refit, multiples of BLOCK
SECTOR_ROW, LONGER_ROW = 72, 12  # pixels to which the rows of sectors are filled up, and further where there are more
SECTOR_LENGTH = 5.0  # px along the edge, about
LEAST_RADIUS = 9.5  # px, of a disc that is fitted by sectors: the fewest there are have 2.5 px of its edge each


# -------------------------------------------------------------------------------------------------- sectors


@dataclass
class _Sectors:
    """The pixels of n rings in k angular sectors each, a row for a sector, and the ellipses they lie around."""

    ellipse: _Ellipse
    pixels: _Pixels
    k: int


def _sectors(image, ellipses):
    """Indices of the ellipses, and the `_Sectors` of their rings, of those that can be fitted together.

    The number of sectors and the length of their rows follow from the disc itself, and those of one number and
    length are fitted together: so no result depends on other discs.
    """
    rings = [_ring_by_sectors(image, ellipses[i]) for i in range(len(ellipses.r))]
    kinds = {}
    for i, (counts, _) in enumerate(rings):
        length = max(-(-int(counts.max()) // LONGER_ROW) * LONGER_ROW, SECTOR_ROW)
        kinds.setdefault((len(counts), length), []).append(i)
    for (k, length), part in kinds.items():
        filled = np.zeros((4, len(part) * k, length), np.float32)
        filled[0] = np.repeat(ellipses.r[part], k)[:, None]
        used = np.arange(length) < np.concatenate([rings[i][0] for i in part])[:, None]
        filled[:3, used] = np.concatenate([rings[i][1] for i in part], axis=1)
        filled[3] = used
        origin = np.repeat(np.stack([ellipses.x[part], ellipses.y[part]], axis=1), k, axis=0)
        yield np.array(part), _Sectors(ellipses[part], _Pixels(origin, *filled, np.zeros(len(origin))), k)


def _ring_by_sectors(image, ellipse):
    """The number of pixels (k,) in each angular sector of a ring; x, y, value (3, m) of the pixels, sector by sector.

    Places are told from the ellipse's centre, values from their mean.  A sector is about SECTOR_LENGTH px long.
    """
    number = int(N_SECTORS[np.abs(np.log(N_SECTORS * SECTOR_LENGTH / (2 * np.pi * ellipse.r))).argmin()])
    columns, rows = _ring_indices(ellipse, image.shape)
    x, y = columns - ellipse.x, rows - ellipse.y
    sector = np.minimum(((np.arctan2(y, x) / (2 * np.pi) + 0.5) * number).astype(np.int16), number - 1)
    values = image.ravel().take(rows * image.shape[1] + columns).astype(float)
    order = np.argsort(sector, kind="stable")
    pixels = np.stack([x, y, values - values.mean()])[:, order]
    return np.bincount(sector, minlength=number), pixels.astype(np.float32)


def _sector_equations(moments, levels, around, held, free, own, weights):
    """Normal equations of x, y, r, p, q, log s and the six levels: matrices (n, 12, 12), gradients (n, 12), and the
    part (n, k, 6) of these that each sector with levels of its own contributes."""
    alone = np.where(own, weights, 0)
    scores = (alone * free.contrast)[:, :, None] * free.left[:, :, :6, 6]
    normal = _common_normal(moments, levels, around, np.where(own, 0, 1.0)) + 1e-9 * np.eye(13)
    normal[:, range(12), range(12)] += held
    normal[:, 6:12, 12] -= held[:, 6:] * levels
    normal[:, :6, :6] += _weighted_sum(alone * free.contrast**2, free.left)[:, :6, :6]
    normal[:, :6, 12] += scores.sum(axis=1)
    return normal[:, :12, :12], normal[:, :12, 12], scores


def _radial_scores(moments, levels, around, free, own, weights):
    """Each sector's derivative (n, k) of half the sum of squares by the radius, and its square's expectation (n, k) for
    unit noise and weight."""
    level, contrast = ((part[:, None] @ around)[:, 0] for part in (levels[:, :3], levels[:, 3:]))
    common = contrast * (moments[:, :, 2, 8] - level * moments[:, :, 2, 6] - contrast * moments[:, :, 2, 7])
    scores = np.where(own, weights * free.contrast * free.left[:, :, 2, 6], common)
    return scores, np.where(own, free.contrast**2 * free.left[:, :, 2, 2], contrast**2 * moments[:, :, 2, 2])


@dataclass
class _SectorFit:
    """Sectors (n, k) with levels of their own: chi2, contrast, level outside, and what is `left` (n, k, 7, 7) of
    the sums of products of Phi's derivatives and of the grey values when these are eliminated."""

    chi2: np.ndarray
    contrast: np.ndarray
    level: np.ndarray
    left: np.ndarray


def _weighted_sum(weights, matrices):
    """Sums over the sectors of matrices (n, k, i, j) with weights (n, k)."""
    n, k, *shape = matrices.shape
    return (weights[:, None] @ matrices.reshape(n, k, -1))[:, 0].reshape(n, *shape)


def _directions(k):
    """1, cos t and sin t (3, k) of the directions t in which k sectors lie."""
    t = (np.arange(k) + 0.5) * (2 * np.pi / k) - np.pi
    return np.stack([np.ones(k), np.cos(t), np.sin(t)])


_HELD = np.array([0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 1, 1])  # the levels' changes with the direction are held near 0


def _common_normal(moments, levels, around, weights):
    """Sums (n, 13, 13) of products of the derivatives and the residual, with common levels.

    Levels (n, 6) are B and A, each as a + b cos t + c sin t in the direction t: the ground is seldom the same on
    both sides of a disc, and a difference of 1 % of the contrast between them would move the centre by 0.01 px.
    """
    pairs = (around[:, None] * around).reshape(9, -1)
    sums = (weights[:, None] * pairs) @ moments.reshape(*moments.shape[:2], -1)
    sums = sums.reshape(-1, 3, 3, 11, 11)[..., :9, :9].swapaxes(2, 3).reshape(-1, 27, 27)
    change, harmonics = np.zeros((len(levels), 13, 3, 9)), np.arange(3)
    for derivative in range(6):
        change[:, derivative, :, derivative] = levels[:, 3:]
    change[:, 6 + harmonics, harmonics, 6] = change[:, 9 + harmonics, harmonics, 7] = change[:, 12, 0, 8] = 1
    change[:, 12, :, 6], change[:, 12, :, 7] = -levels[:, :3], -levels[:, 3:]
    change = change.reshape(-1, 13, 27)
    return change @ sums @ change.swapaxes(1, 2)


def _sector_moments(pixels, ellipse, log_s, k):
    """Sums of products (n, k, 11, 11) of the rows of `_ingredients`, the distance and the distance times Phi."""
    many = _Ellipse(*(np.repeat(getattr(ellipse, name), k) for name in ("x", "y", "r", "m", "angle")))
    rows = _ingredients(pixels, many, np.repeat(log_s, k), extra=2)
    return (rows @ rows.transpose(0, 2, 1)).reshape(-1, k, 11, 11)


def _own_levels(moments, count, noise):
    """Each sector with a level and a slope of its own on either side."""
    inner = moments[:, :, _OWN[:, None], _OWN] + np.diag([1e-6, 1e-6, 1e-3, 1e-3])
    mixed = moments[:, :, _OWN[:, None], _REST]
    solved = np.linalg.solve(inner, mixed)
    left = moments[:, :, _REST[:, None], _REST] - mixed.swapaxes(2, 3) @ solved
    chi2 = np.maximum(left[:, :, 6, 6] / np.maximum(count - 4, 1), QUANTISATION) / noise[:, None] ** 2
    return _SectorFit(chi2, solved[:, :, 1, 6], solved[:, :, 0, 6], left)


_OWN, _REST = np.array([6, 7, 9, 10]), np.array([0, 1, 2, 3, 4, 5, 8])


def _same_chi2(moments, levels, around, count, noise):
    """Chi2 (n, k) of sectors with their disc's common levels."""
    level, contrast = ((part[:, None] @ around)[:, 0] for part in (levels[:, :3], levels[:, 3:]))
    combination = np.stack([-level, -contrast, np.ones_like(level)], axis=2)
    squares = ((moments[:, :, 6:9, 6:9] @ combination[..., None])[..., 0] * combination).sum(axis=2)
    return np.maximum(squares / np.maximum(count, 1), QUANTISATION) / noise[:, None] ** 2
