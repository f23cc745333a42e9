"""The second fit, by sectors, of discs of which parts are covered or unevenly lit."""

from dataclasses import dataclass

import numpy as np

from .ellipse import _distance, _Ellipse, _inside, _limited
from .fit import MAX_STEPS, _solve_scaled
from .ring import RING
from .sectors import (
    _HELD,
    _common_normal,
    _directions,
    _own_levels,
    _radial_scores,
    _same_chi2,
    _sector_equations,
    _sector_moments,
    _weighted_sum,
)
from .spectrum import _excess

NEAR, NEAR_CHI2 = 0.7, 5.0  # a refit starts from the simple fit if that is so near (px) and so good
SECTOR_SIGMAS, OWN_EXCESS = 4.0, 14.0  # when a sector gets levels of its own, see `_refit`
OWN_WEIGHT = 0.3  # of such a sector
ALONE, FREEZE = 2, 8  # steps in which all sectors have levels of their own; after which none changes sides
LAST_STEP = 0.1  # squared length, in sigmas, of a refit's step after which none is needed
UNEVEN = 0.1  # part of the contrast by which the common levels are expected to vary around the disc
TOLERATED = 0.01  # part of the contrast by which any sector may depart from the model
MIN_VISIBLE = 0.4  # least part of the edge that has to fit
BLOCK = 3  # neighbouring sectors that err together


# -------------------------------------------------------------------------------------------------- sectors


@dataclass
class _Refit:
    """Ellipses, log s, covariance of x, y, r, p, q, variance, and the reasons why there is no fit."""

    ellipse: _Ellipse
    log_s: np.ndarray
    covariance: np.ndarray
    variance: np.ndarray
    reasons: np.ndarray


def _refit(shape, sectors, contrast, noise):
    """Fit again, with levels and slopes of their own, inside and outside, in those sectors that need them.

    Side walls, highlights and clutter change the levels around a disc.  The common levels may change with the
    direction (see `_common_normal`).  A sector gets a level and a slope of its
    own on either side if they lower its sum of squares by more than OWN_EXCESS noise variances (with
    four more unknowns, 4 are expected), or its chi2 with the common levels is more than SECTOR_SIGMAS standard
    deviations above 1.  The own levels are eliminated from the normal equations.  Such a sector has the weight
    OWN_WEIGHT, because what changes the levels is seldom straight; (limit / chi2)^2 times that where its chi2 is
    high even so, and none if it has less than a quarter of the contrast.  In the first ALONE steps all sectors
    have levels of their own.
    """
    start, pixels, k = sectors.ellipse, sectors.pixels, sectors.k
    n, count = len(noise), pixels.used.sum(axis=1, dtype=float).reshape(-1, k)
    limit = 1 + SECTOR_SIGMAS * np.sqrt(2 / np.maximum(count - 4, 1))
    result = _Refit(start[np.arange(n)], np.full(n, np.log(1.2)), np.zeros((n, 5, 5)), np.zeros(n), None)
    result.reasons = np.full(n, "", object)
    noise, tolerated = np.hypot(noise, TOLERATED * contrast), noise**2 / (noise**2 + (TOLERATED * contrast) ** 2)
    around, held = _directions(k), (noise / (UNEVEN * np.maximum(np.abs(contrast), 1e-3)))[:, None] ** 2 * _HELD
    levels, own, active = np.zeros((n, 6)), np.ones((n, k), bool), np.ones(n, bool)
    for number in range(MAX_STEPS):
        if active.all():
            moments = _sector_moments(pixels, result.ellipse, result.log_s, k)
        else:  # what is done keeps its moments
            moments[active] = _sector_moments(
                pixels.some(np.repeat(active, k)), result.ellipse[active], result.log_s[active], k
            )
        free = _own_levels(moments, count, noise)
        if number <= ALONE:
            levels[:, 0], levels[:, 3] = np.median(free.level, axis=1), np.median(free.contrast, axis=1)
        shared = _same_chi2(moments, levels, around, count, noise)
        if ALONE <= number < FREEZE:
            own = (shared * count - free.chi2 * (count - 4) > OWN_EXCESS) | (shared > limit)
        fits = _share_that_fits(free, limit, contrast)
        visible = np.where(own, fits, 1).mean(axis=1)
        hidden = active & (visible < MIN_VISIBLE)
        weights = np.where(hidden[:, None] | ~own, 1, OWN_WEIGHT * fits)
        normal, gradient, scores = _sector_equations(moments, levels, around, held, free, own, weights)
        step, bad = _solve_scaled(normal, gradient)
        result.reasons[active & bad], result.reasons[hidden] = "no edge", "edge hidden"
        last = active & (np.einsum("ni,nij,nj->n", step, normal, step) <= LAST_STEP * noise**2) & (number > ALONE)
        step[:, :6] = _limited(step[:, :6], result.ellipse)
        step[~active | bad | hidden] = 0
        result.ellipse = result.ellipse.moved(*step[:, :5].T)
        result.log_s, levels = np.clip(result.log_s + step[:, 5], -1.5, 2.0), levels + step[:, 6:]
        result.reasons[active & (_distance(result.ellipse, start) > RING)] = "does not converge"
        if last.any():
            chi2 = np.where(own, free.chi2, shared)
            known = np.where(own, 0, np.maximum(chi2, tolerated[:, None]))
            middle = _common_normal(moments, levels, around, known)[:, :12, :12] + held[:, :, None] * np.eye(12)
            alone = weights**2 * free.contrast**2 * chi2 * own
            shared_noise = middle * noise[:, None, None] ** 2
            own_noise = _weighted_sum(alone, free.left)[:, :6, :6] * noise[:, None, None] ** 2
            displaced, slopes = _radial_scores(moments, levels, around, free, own, weights)
            information = slopes * np.where(own, weights**2 * chi2, known) * noise[:, None] ** 2
            excess = _excess(displaced, information)
            _state(result, last, normal, shared_noise, own_noise, scores, excess)
            usual = np.average(chi2, axis=1, weights=np.maximum(weights * count, 1e-9))
            result.variance[last] = (noise**2 * usual)[last]
        active &= ~last & (result.reasons == "")
        if not active.any():
            break
    result.reasons[active] = "does not converge"
    result.reasons[(result.reasons == "") & ~_inside(result.ellipse, shape)] = "leaves the image"
    return result


def _state(result, rows, normal, shared_noise, own_noise, scores, excess):
    """Set the covariance in some rows.

    Sectors with the common levels contribute what noise explains, those with their own (`scores`) what they show:
    what the model does not describe counts once for BLOCK neighbours, not for each pixel.  The other estimate takes
    what noise explains of both times the `excess` of the edge's displacements; the larger one is stated.
    """
    k = scores.shape[1]
    blocks = scores[rows, : k // BLOCK * BLOCK].reshape(-1, k // BLOCK, BLOCK, 6).sum(axis=2)
    bread = np.linalg.inv(normal[rows])
    shown, white = shared_noise[rows], shared_noise[rows]
    white[:, :6, :6] += own_noise[rows]
    displaced = (bread @ white @ bread)[:, :5, :5] * excess[rows, None, None]
    shown[:, :6, :6] += blocks.swapaxes(1, 2) @ blocks * ((k / BLOCK) / (k / BLOCK - 6))
    shown = (bread @ shown @ bread)[:, :5, :5]
    ratio = np.trace(displaced[:, :2, :2], axis1=1, axis2=2) / np.trace(shown[:, :2, :2], axis1=1, axis2=2)
    result.covariance[rows] = shown * np.maximum(ratio, 1)[:, None, None]


def _share_that_fits(free, limit, contrast):
    """1 for sectors that fit with levels of their own, less for those that do not, 0 where there is no edge."""
    usual = np.maximum(limit, np.median(free.chi2, axis=1, keepdims=True))
    return np.minimum(1, (usual / free.chi2) ** 2) * (free.contrast / contrast[:, None] > 0.25)
