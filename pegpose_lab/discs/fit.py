"""Gauss-Newton over ellipse, edge width and levels of many discs at once: the simple model."""

from dataclasses import dataclass

import numpy as np

from .ellipse import _distance, _Ellipse, _inside, _limited, _movement
from .model import QUANTISATION, _ingredients
from .ring import CHUNK, RING, _ring_pixels, _ring_width

MAX_STEPS = 12
SMALL_STEP = 0.05  # px, a step after which none is needed
MAX_RINGS = 3
REFIT_SIGMAS = 5.0  # excess of the simple model's chi2, in standard deviations, that counts as significant
WIDE_CHI2 = 2.0  # of a wide edge
FAR = 3  # px apart, residuals of a smoothed or demosaiced image no longer err together


@dataclass
class _Solution:
    """Fits of the simple model, levels B and A, a row each; `normal` is for x, y, r, p, q, log s, B, A.

    `rough` is the noise of neighbouring pixels: smaller than `noise` where these err together.
    """

    ellipse: _Ellipse
    log_s: np.ndarray
    levels: np.ndarray
    normal: np.ndarray
    squares: np.ndarray
    count: np.ndarray
    noise: np.ndarray
    rough: np.ndarray
    converged: np.ndarray

    def update(self, rows, other):
        """Take over other solutions in some rows."""
        for name in self.__dataclass_fields__:
            getattr(self, name)[rows] = getattr(other, name)


def _settle(image, ellipses):
    """Fit, and fit again on a new ring where the ellipse moved by more than a pixel or the edge is wider than the ring.

    Returns a `_Solution` with a row for each, and the reasons why there is none.
    """
    n = len(ellipses.r)
    ellipse, log_s, reasons = ellipses[np.arange(n)], np.full(n, np.log(1.2)), np.full(n, "", object)
    reasons[~_inside(ellipse, image.shape)] = "leaves the image"
    solution = _Solution(ellipse, log_s, np.zeros((n, 2)), np.zeros((n, 8, 8)), *np.zeros((5, n)))
    todo = np.flatnonzero(reasons == "")
    for _ in range(MAX_RINGS if len(todo) else 0):
        widths = _ring_width(log_s[todo])
        found, singular = _least_squares(*_ring_pixels(image, ellipse[todo], widths), ellipse[todo], log_s[todo])
        moved = _distance(ellipse[todo], found.ellipse)
        solution.update(todo, found)
        reasons[todo[singular]] = "no edge"
        outside = ~singular & ~_inside(found.ellipse, image.shape)
        lost = outside & (_distance(ellipses[todo], found.ellipse) > RING)  # it ran away from where the disc is
        reasons[todo[outside]] = "leaves the image"
        reasons[todo[lost]], solution.converged[todo[lost]] = "does not converge", False
        todo = todo[
            ((moved >= 1) | (_is_wide(found) & (_ring_width(found.log_s) > widths + 1))) & (reasons[todo] == "")
        ]
        if len(todo) == 0:
            return solution, reasons
    solution.converged[todo] = False
    return solution, reasons


def _is_wide(solution):
    """Whether edges reach beyond the usual ring: what disturbs an edge makes it wide, too, but does not fit."""
    return (_ring_width(solution.log_s) > RING) & (_variance(solution) < WIDE_CHI2 * solution.noise**2)


def _least_squares(pixels, disc, ellipse, log_s):
    """Gauss-Newton over ellipse, log s and the levels; row k of the pixels belongs to disc[k].

    Returns a `_Solution` and where the equations are singular.
    """
    ends = np.searchsorted(disc, np.arange(len(log_s)), side="right")
    parts = [slice(*span) for span in zip([0, *(CHUNK * ends[:-1])], CHUNK * ends, strict=True)]
    solution, residuals, singular = _gauss_newton(pixels, disc, parts, ellipse, log_s)
    solution.levels[:, 0] += pixels.level[ends - 1]
    for i, (part, m) in enumerate(zip(parts, solution.count.astype(int).tolist(), strict=True)):
        rest = residuals[part][:m]
        solution.squares[i] = _sum_of_squares(rest)
        solution.rough[i] = _residual_noise(rest, 1)
        far = _residual_noise(rest, FAR)
        solution.noise[i] = far if _exceeds(far**2, solution.rough[i], m) else solution.rough[i]
    return solution, singular


def _gauss_newton(pixels, disc, parts, ellipse, log_s):
    """Gauss-Newton with halved steps, n discs at once; B and A are solved for in every step.

    A disc is done when the next step moves nothing by more than SMALL_STEP: it is taken (the rest of the way is of
    second order, no more than that squared), unless it was tried and does not improve the fit.  Returns also the
    residuals of the pixels, and where the equations are singular.
    """
    n, residuals = len(log_s), np.empty(pixels.x.size, np.float32)
    count = np.bincount(disc, pixels.used.sum(axis=1, dtype=float), n)
    best, step, fraction = None, np.zeros((n, 6)), np.ones(n)
    done, singular = np.zeros((2, n), bool)
    for _ in range(MAX_STEPS):
        tried = fraction[:, None] * step
        trial, trial_s = ellipse.moved(*tried[:, :5].T), np.clip(log_s + tried[:, 5], -1.5, 2.0)
        layers = _ingredients(pixels, trial[disc], trial_s[disc]).reshape(9, -1)
        moments = np.array([layers[:, part] @ layers[:, part].T for part in parts])
        found, combination, scale, new_step, gain, bad = _solve_rows(moments, trial, trial_s, count)
        if best is None:
            best, better = found, np.ones(n, bool)
        else:
            better = (found.squares <= best.squares) & ~done
            done |= ~better & (_movement(tried, ellipse) < SMALL_STEP)
            best.update(better, _rows(found, better))
        step[better], singular[better & bad] = new_step[better, :6], True
        fraction = np.where(better, np.minimum(1.0, 2 * fraction), 0.5 * fraction)
        ellipse, log_s = best.ellipse, best.log_s
        last = better & (_movement(step, ellipse) < SMALL_STEP)
        if last.any():
            best.update(last, _after_last_step(_rows(best, last), new_step[last], gain[last]))
        combination[last, :8] -= new_step[last] * scale[last]
        for i in np.flatnonzero(better):
            residuals[parts[i]] = combination[i] @ layers[:, parts[i]]
        done |= last | singular
        if done.all():
            break
        step = _limited(step, ellipse)
    best.converged[:] = done
    return best, residuals, singular


def _rows(solution, rows):
    """Some rows of a `_Solution`."""
    return _Solution(*(getattr(solution, name)[rows] for name in solution.__dataclass_fields__))


def _after_last_step(solution, step, gain):
    """Solutions after a step (n, 8) so small that the linear model says what it changes."""
    step = np.hstack([_limited(step[:, :6], solution.ellipse), step[:, 6:]])
    return _Solution(
        solution.ellipse.moved(*step[:, :5].T),
        np.clip(solution.log_s + step[:, 5], -1.5, 2.0),
        solution.levels + step[:, 6:],
        solution.normal,
        np.maximum(solution.squares - gain, 0),
        solution.count,
        solution.noise,
        solution.rough,
        solution.converged,
    )


def _solve_rows(moments, ellipse, log_s, count):
    """From the sums of products (n, 9, 9) of `_ingredients`: the solution; the residual as a linear combination (n, 9) of
    the ingredients; the next step (n, 8), how much it gains, and where it is undefined.
    """
    ones, mean, phi = moments[:, 6, 6], moments[:, 6, 7], moments[:, 7, 7]
    contrast = moments[:, 7, 8] - mean * moments[:, 6, 8] / ones
    contrast /= np.maximum(phi - mean**2 / ones, 1e-12)
    level = (moments[:, 6, 8] - contrast * mean) / ones
    combination = np.zeros((len(count), 9))
    combination[:, 6], combination[:, 7], combination[:, 8] = -level, -contrast, 1
    against = (moments @ combination[:, :, None])[:, :, 0]
    squares = np.maximum((combination * against).sum(axis=1), 0)
    scale = np.where(np.arange(8) < 6, contrast[:, None], 1.0)
    normal, gradient = moments[:, :8, :8] * (scale[:, :, None] * scale[:, None, :]), against[:, :8] * scale
    step, bad = _solve_scaled(normal, gradient)
    levels, unknown = np.stack([level, contrast], axis=1), np.zeros((3, len(count)))
    solution = _Solution(ellipse, log_s, levels, normal, squares, count, *unknown)
    return solution, combination, scale, step, (step * gradient).sum(axis=1), bad


def _sum_of_squares(residuals):
    return float(np.square(residuals, dtype=float).sum())


def _residual_noise(residuals, apart):
    """Standard deviation of the noise, from the differences of residuals (m,) of one disc that are some pixels apart.

    Differences larger than 3.5 standard deviations (first by their median) are left out: edges that the model
    does not describe.
    """
    difference = np.abs(residuals[apart:] - residuals[:-apart])
    middle = len(difference) // 2
    limit = 3.5 * max(1.4826 * float(np.partition(difference, middle)[middle]), 0.7)
    difference = difference[difference < limit]
    return np.sqrt(max(_sum_of_squares(difference) / max(2 * len(difference), 1), QUANTISATION))


def _variance(solution):
    """Residual variance (n,) of the simple model with its 8 unknowns."""
    return np.maximum(solution.squares / np.maximum(solution.count - 8, 1), QUANTISATION)


def _exceeds(variance, noise, count):
    """Whether variances (n,) of `count` residuals are significantly above that of the noise."""
    return variance > (1 + REFIT_SIGMAS / np.sqrt(np.maximum(count, 1))) * noise**2


def _solve_scaled(normal, gradient):
    """Solve n normal equations, scaled to a unit diagonal; the steps, 0 where singular, and where that is."""
    scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-18))
    unit = normal / (scale[:, :, None] * scale[:, None, :])
    bad = (scale < 1e-6).any(axis=1) | ~(np.linalg.det(unit) > 1e-14)
    unit[bad] = np.eye(normal.shape[1])
    step = np.linalg.solve(unit, (gradient / scale)[:, :, None])[:, :, 0] / scale
    step[bad] = 0
    return step, bad
