"""Directed edges along outlines: where the grey values fall (or rise) across a disc's rim, whatever the contrast."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..checks import REMAP_LIMIT

N_RAYS = 48  # directions in which a disc's rim is looked at
SMOOTHING = 1.0  # px, Gaussian before the gradient
LEAST_GRADIENT = 1.0  # grey values per px: slower changes are shading
NOISE_GRADIENT = 0.6  # of the noise: three standard deviations of what it leaves in the smoothed gradient
WEAKER = 0.25  # of the usual strength of a rim's edges: weaker ones lose against stronger ones near by
WEAK_PART = 0.3  # of a rim: how strong it is counts without its weakest part
CLEAR = 0.6  # directedness of an edge: the gradient points across the rim, within 53 degrees
LEAST_REACH = 2.5  # px: edges are looked for so far away at least, where other edges show whether that is chance
TOLERANCE = (0.8, 0.015)  # px, and part of the radius: how near the edges of one ellipse lie to it

_TURN = np.arange(N_RAYS) * (2 * np.pi / N_RAYS)
RAYS = np.column_stack([np.cos(_TURN), np.sin(_TURN)])
SERIES = np.column_stack([np.ones(N_RAYS), RAYS, np.cos(2 * _TURN), np.sin(2 * _TURN)])


@dataclass(frozen=True, eq=False)
class _Field:
    """The gradient of a picture (height, width, 2), grey values per px, and what counts as weak."""

    gradient: np.ndarray
    weak: float


@dataclass(frozen=True, eq=False)
class _Outlines:
    """k closed curves: points, what a unit of offset moves them by, and outward normals, (k, N_RAYS, 2) each."""

    points: np.ndarray
    along: np.ndarray
    normals: np.ndarray

    @property
    def px(self):
        """Distance along the normal, px, for an offset of 1: (k, N_RAYS)."""
        return np.abs((self.along * self.normals).sum(axis=2))


@dataclass(frozen=True, eq=False)
class _Rims:
    """Edges found along outlines, (k, N_RAYS) each: offset (in the outline's unit), weight, 0 where there is none, and
    how strong each is, grey values per px."""

    offsets: np.ndarray
    weights: np.ndarray
    strengths: np.ndarray | None = None


def _field(image):
    """The gradient field of a grey picture."""
    return _Field(_gradient(image), _weak([image]))


def _field_near(image, centers, reaches):
    """The gradient field of a grey picture within `reaches` (k,) px of centres (k, 2), along x and y; 0 elsewhere."""
    gradient, parts = np.zeros((*image.shape, 2), np.float32), []
    for center, reach in zip(centers, reaches, strict=True):
        (left, top), (right, bottom) = (
            np.clip(np.rint(edge), 0, image.shape[::-1]).astype(int).tolist()
            for edge in (center - reach, center + reach)
        )
        if min(right - left, bottom - top) > 2:
            parts.append(image[top:bottom, left:right])
            gradient[top:bottom, left:right] = _gradient(parts[-1])
    return _Field(gradient, _weak(parts))


def _fields_beside(parts):
    """The gradient field of parts of a picture, side by side, and where (k, 2) each begins."""
    widths = np.array([part.shape[1] for part in parts])
    steps = np.column_stack([np.cumsum(widths) - widths, np.zeros(len(parts), int)])
    gradient = np.zeros((max(part.shape[0] for part in parts), widths.sum(), 2), np.float32)
    for part, (left, _) in zip(parts, steps.tolist(), strict=True):
        gradient[: part.shape[0], left : left + part.shape[1]] = _gradient(part)
    return _Field(gradient, _weak(parts)), steps


def _gradient(image):
    smooth = cv2.GaussianBlur(image.astype(np.float32), (0, 0), SMOOTHING)
    return cv2.merge([cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3, scale=1 / 8) for order in ((1, 0), (0, 1))])


def _weak(parts):
    """The gradient, grey values per px, that noise leaves in parts of a picture: by the median of its second differences."""
    kernel, counts = np.float32([[1, -2, 1], [-2, 4, -2], [1, -2, 1]]), np.zeros(256)
    for part in parts:
        sizes = cv2.convertScaleAbs(cv2.filter2D(part[::2], cv2.CV_16S, kernel))
        counts += cv2.calcHist([sizes], [0], None, [256], [0, 256]).ravel()
    total = counts.cumsum()
    middle = np.searchsorted(total, [total[-1] / 2, total[-1] / 2 + 0.5]).mean()
    return max(LEAST_GRADIENT, NOISE_GRADIENT * float(np.sqrt(np.pi / 2) / 6 * middle / 0.8453))


def _ellipses(centers, shapes):
    """Outlines of ellipses centre + shape @ (cos, sin); the unit of offset is the ellipse itself."""
    along = RAYS @ shapes.transpose(0, 2, 1)
    normals = RAYS @ np.linalg.inv(shapes)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return _Outlines(centers[:, None] + along, along, normals)


def _directed(field, outlines, offsets):
    """Gradient across the outlines at `offsets` (t,): strength and directedness (k, N_RAYS, t), inward positive."""
    points, along = outlines.points.astype(np.float32), outlines.along.astype(np.float32)
    k, offsets = len(points), offsets.astype(np.float32)
    places = np.empty((k, N_RAYS, len(offsets), 2), np.float32)
    np.multiply(along[:, :, None], offsets[:, None], out=places)
    places += points[:, :, None]
    rows, most = places.reshape(k * N_RAYS, -1, 2), REMAP_LIMIT - 1
    sampled = [
        cv2.remap(field.gradient, rows[first : first + most], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        for first in range(0, len(rows), most)
    ]
    gradient = (sampled[0] if len(sampled) == 1 else np.concatenate(sampled)).reshape(k, N_RAYS, -1, 2)
    x, y = gradient[..., 0], gradient[..., 1]
    normals = outlines.normals.astype(np.float32)
    strength = x * -normals[:, :, :1] - y * normals[:, :, 1:]
    return strength, strength / np.sqrt(x * x + y * y + np.float32(field.weak**2))


def _signed(strength, directed, signs, offsets, reach):
    """Both with the discs' polarity: +1 bright, -1 dark, 0 what the rim near the outline says."""
    if (signs == 0).any():
        near = np.exp(-0.5 * (offsets / reach) ** 2)
        lean = [(np.maximum(sign * directed, 0) * near).max(axis=2).sum(axis=1) for sign in (1, -1)]
        signs = np.where(signs == 0, np.where(lean[0] >= lean[1], 1, -1), signs)
    if (signs == 1).all():
        return strength, directed, signs
    factors = signs[:, None, None].astype(np.float32)
    return strength * factors, directed * factors, signs


def _rims(field, outlines, signs, reach, steps=None):
    """The directed edge nearest to each point of the outlines within `reach` (in the outline's unit).

    An edge is a maximum of the directed gradient; near ones count more than those far away (Gaussian, reach / 2).
    """
    longest = float(outlines.px.max(initial=1.0)) * reach
    steps = steps or int(np.clip(np.ceil(longest / 0.75), 4, 24))
    offsets = np.linspace(-reach, reach, 2 * steps + 1)
    strength, directed = _directed(field, outlines, offsets)
    strength, directed, signs = _signed(strength, directed, signs, offsets, reach / 2)
    inner = strength[:, :, 1:-1]
    peak = (inner > strength[:, :, :-2]) & (inner >= strength[:, :, 2:]) & (directed[:, :, 1:-1] > CLEAR)
    value = peak * directed[:, :, 1:-1] * np.exp(-0.5 * (offsets[1:-1] / (reach / 2)) ** 2)
    best_strength = (peak * inner).max(axis=2)
    usual = np.partition(best_strength, int(0.8 * N_RAYS), axis=1)[:, int(0.8 * N_RAYS), None, None]
    value *= inner / (np.maximum(inner, 0) + (WEAKER * usual + 1e-9))
    best = value.argmax(axis=2) + 1
    places = (np.arange(best.size) * len(offsets)).reshape(best.shape) + best
    weights = value.max(axis=2)
    before, here, after = (strength.ravel().take(places + step).astype(float) for step in (-1, 0, 1))
    bend = before - 2 * here + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1), 0)
    found = offsets[best] + np.clip(shift, -0.5, 0.5) * (offsets[1] - offsets[0])
    return _Rims(found, np.maximum(weights, 0), here), signs


def _visible(rims, residuals, tolerance):
    """The share of each outline with an edge within `tolerance`, residuals and tolerance in the same unit: (k,)."""
    return ((rims.weights > 0) & (np.abs(residuals) < tolerance)).mean(axis=1)


def _solve_series(rims, scale):
    """Ellipse steps a0 + a1 cos + a2 sin + a3 cos 2 + a4 sin 2 through the offsets of k rims, outliers weighed down.

    Returns the steps (k, 5) and residuals (k, N_RAYS); `scale` (k, 1) is Tukey's width in the unit of the offsets.
    """
    steps, weights = np.zeros((len(rims.offsets), 5)), rims.weights
    ridge = np.diag([1e-3, 1e-3, 1e-3, 1e-1, 1e-1])
    for widen in (3.0, 1.5, 1.0):
        rows = weights[:, :, None] * SERIES
        normal = rows.transpose(0, 2, 1) @ SERIES + ridge
        steps = np.linalg.solve(normal, rows.transpose(0, 2, 1) @ rims.offsets[:, :, None])[:, :, 0]
        residuals = rims.offsets - steps @ SERIES.T
        weights = rims.weights * np.maximum(1 - (residuals / (widen * scale)) ** 2, 0) ** 2
    return steps, residuals


def _refined(field, centers, shapes, signs, reaches=(0.35, 0.25, 0.15)):
    """Ellipses drawn to the edges around them: centres (k, 2), shapes (k, 2, 2), visible shares, strengths, polarities (k,)
    each."""
    for reach in reaches:
        outlines = _ellipses(centers, shapes)
        rims, found = _rims(field, outlines, signs, max(reach, LEAST_REACH / float(np.median(outlines.px))))
        steps, residuals = _solve_series(rims, 1.5 / outlines.px.mean(axis=1, keepdims=True) + 0.03)
        steps = np.clip(steps, -0.3, 0.3)
        grow = np.zeros(shapes.shape)
        grow[:, 0, 0], grow[:, 1, 1] = 1 + steps[:, 0] + steps[:, 3], 1 + steps[:, 0] - steps[:, 3]
        grow[:, 0, 1] = grow[:, 1, 0] = steps[:, 4]
        centers = centers + (shapes @ steps[:, 1:3, None])[:, :, 0]
        shapes = shapes @ grow
    tolerance = TOLERANCE[0] / outlines.px + TOLERANCE[1]
    strengths = np.sort(rims.strengths * (rims.weights > 0), axis=1)[:, int(WEAK_PART * N_RAYS)]
    return centers, shapes, _visible(rims, residuals, tolerance), strengths, found
