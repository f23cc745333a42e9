"""Where the fit starts: ellipses through the strongest steps along rays from the centres."""

import cv2
import numpy as np

from ..checks import REMAP_LIMIT
from .ellipse import _Ellipse

N_RAYS, RAY_POINTS = 64, 49


def _start(image, circles, sign):
    """Ellipses through the strongest steps along rays from the centres, outliers weighed down, and which are good.

    The directed step is looked for within 25 % of the radius (at least 4 px).  To first order in the
    departure from the circle, radius(t) = r + x cos t + y sin t + r p cos 2t + r q sin 2t.
    """
    n, reach = len(circles.r), np.maximum(4.0, 0.25 * circles.r)
    low = np.maximum(circles.r - reach, 0.5)
    rho = low[:, None] + (circles.r + reach - low)[:, None] * np.linspace(0, 1, RAY_POINTS)
    x = (circles.x[:, None, None] + _RAYS[:, 1, None] * rho[:, None]).reshape(-1, RAY_POINTS)
    y = (circles.y[:, None, None] + _RAYS[:, 2, None] * rho[:, None]).reshape(-1, RAY_POINTS)
    profiles, border = _interpolated(image, x, y), cv2.BORDER_REPLICATE
    steps = cv2.sepFilter2D(profiles, cv2.CV_32F, _STEP, np.ones(1, np.float32), borderType=border)
    steps = steps.reshape(n, len(_RAYS), RAY_POINTS)
    profile = steps.mean(axis=1)
    steps *= sign or np.sign(np.take_along_axis(profile, np.abs(profile).argmax(axis=1)[:, None], axis=1))[:, None]
    best = steps.argmax(axis=2)
    weights = np.maximum(np.take_along_axis(steps, best[:, :, None], axis=2)[:, :, 0], 0).astype(float)
    r, dx, dy, p, q = _robust_solve(_RAYS, np.take_along_axis(rho, best, axis=1), weights).T
    good = (r > 1) & (np.hypot(p, q) <= 0.5 * r) & (np.hypot(dx, dy) <= 2 * reach)
    safe = np.where(good, r, circles.r)
    shape = [np.where(good, step, 0) for step in (dx, dy, p / safe, q / safe)]
    return _Ellipse(circles.x, circles.y, safe, circles.m, circles.angle).moved(*shape[:2], 0, *shape[2:]), good


def _interpolated(image, x, y):
    """Grey values (m, k) at the places x, y (m, k), px; `cv2.remap` in parts that it takes.

    Of a picture that is too large only the part around each disc is looked at, and of a disc that is too large every
    so-many-th pixel.
    """
    rows, values = N_RAYS if max(image.shape) > REMAP_LIMIT else REMAP_LIMIT, []
    for first in range(0, len(x), rows):
        part_x, part_y, part = x[first : first + rows], y[first : first + rows], image
        if max(image.shape) > REMAP_LIMIT:
            left, right = np.clip([part_x.min(), part_x.max() + 2], 0, image.shape[1]).astype(int)
            top, bottom = np.clip([part_y.min(), part_y.max() + 2], 0, image.shape[0]).astype(int)
            step = max(right - left, bottom - top) // REMAP_LIMIT + 1
            part = np.ascontiguousarray(image[top:bottom:step, left:right:step])
            part_x, part_y = (part_x - left) / step, (part_y - top) / step
        places = part_x.astype(np.float32), part_y.astype(np.float32)
        values.append(cv2.remap(part, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
    return np.concatenate(values)


_STEP = np.array([1, 1, 1, 0, -1, -1, -1], np.float32)  # inside minus outside
_TURN = np.arange(N_RAYS) * (2 * np.pi / N_RAYS)
_RAYS = np.stack([np.ones(N_RAYS), np.cos(_TURN), np.sin(_TURN), np.cos(2 * _TURN), np.sin(2 * _TURN)], axis=1)


def _robust_solve(design, values, weights):
    """Least squares of n rows with Cauchy weights that start from the median; the scale follows the residuals."""
    residuals = values - _median(values)
    weights = weights + 1e-6
    for _ in range(4):
        scale = np.maximum(2 * _median(np.abs(residuals)), 0.25)
        w = (weights / (1 + (residuals / scale) ** 2))[:, None] * design.T
        solution = np.linalg.solve(w @ design, w @ values[:, :, None])[:, :, 0]
        residuals = values - (design @ solution[:, :, None])[:, :, 0]
    return solution


def _median(rows):
    """The upper median of each row (n, 1)."""
    middle = rows.shape[1] // 2
    return np.partition(rows, middle, axis=1)[:, middle : middle + 1]
