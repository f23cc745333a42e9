"""The second fit, by sectors, of discs of which parts are covered or unevenly lit."""

from dataclasses import dataclass

import numpy as np

from .ellipse import _choose, _distance, _Ellipse, _inside, _limited, _movement
from .fit import MAX_STEPS, SMALL_STEP, _solve_scaled
from .ring import RING
from .sectors import (
    _HELD,
    _common_levels,
    _common_normal,
    _own_levels,
    _own_sums,
    _radial_scores,
    _same_chi2,
    _sector_equations,
    _set_moments,
    _shift_moments,
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


def _refit(shape, sectors, log_s, contrast, noise):
    """Fit again, with levels and slopes of their own, inside and outside, in those sectors that need them.

    Side walls, highlights and clutter change the levels around a disc.  The common levels may change with the
    direction (see `_common_normal`).  A sector gets a level and a slope of its
    own on either side if they lower its sum of squares by more than OWN_EXCESS noise variances (with
    four more unknowns, 4 are expected), or its chi2 with the common levels is more than SECTOR_SIGMAS standard
    deviations above 1.  The own levels are eliminated from the normal equations.  Such a sector has the weight
    OWN_WEIGHT, because what changes the levels is seldom straight; (limit / chi2)^2 times that where its chi2 is
    high even so, and none if it has less than a quarter of the contrast.  In the first ALONE steps, or until
    one is small, all sectors have levels of their own.

    The pixels are looked at again when the edge has moved by SMALL_STEP; up to there Phi follows by its derivatives.
    """
    start, disc, count = sectors.ellipse, sectors.disc, sectors.count
    n, limit = len(noise), 1 + SECTOR_SIGMAS * np.sqrt(2 / np.maximum(sectors.count - 4, 1))
    result = _Refit(start[np.arange(n)], log_s.copy(), np.zeros((n, 5, 5)), np.zeros(n), np.full(n, "", object))
    held = (np.hypot(noise, TOLERATED * contrast) / (UNEVEN * np.maximum(np.abs(contrast), 1e-3)))[:, None] ** 2 * _HELD
    tolerated = (noise**2 / (noise**2 + (TOLERATED * contrast) ** 2))[disc]
    noise = np.hypot(noise, TOLERATED * contrast)
    moments, base, base_s, moved = np.empty((11, 11, len(disc))), result.ellipse, log_s, np.zeros((n, 6))
    levels, own, active, stale = np.zeros((n, 6)), np.ones(len(disc), bool), np.ones(n, bool), np.ones(n, bool)
    alone = np.full(n, ALONE)  # steps
    for number in range(MAX_STEPS):
        if stale.any():
            _set_moments(moments, sectors, result.ellipse, result.log_s, stale)
            base, base_s = _choose(stale, result.ellipse, base), np.where(stale, result.log_s, base_s)
            moved[stale] = 0
        free = _own_levels(moments, count, noise[disc])
        reset = number <= alone
        if reset.any():
            levels[reset, 0] = sectors.medians(free.level)[reset]
            levels[reset, 3] = sectors.medians(free.contrast)[reset]
        level, step_up = _common_levels(levels, sectors)
        shared = _same_chi2(moments, level, step_up, count, noise[disc])
        if number < FREEZE:
            needed = (shared * count - free.chi2 * (count - 4) > OWN_EXCESS) | (shared > limit)
            own = np.where((active & (number >= alone))[disc], needed, own)
        fits = _share_that_fits(free, limit, contrast[disc], sectors.medians(free.chi2)[disc])
        visible = np.bincount(disc, np.where(own, fits, 1), n) / np.bincount(disc, minlength=n)
        hidden = active & (visible < MIN_VISIBLE)
        weights = np.where(hidden[disc] | ~own, 1, OWN_WEIGHT * fits)
        normal, gradient, scores = _sector_equations(moments, levels, sectors, held, free, own, weights)
        step, bad = _solve_scaled(normal, gradient)
        result.reasons[active & bad], result.reasons[hidden] = "no edge", "edge hidden"
        size = ((normal @ step[:, :, None])[:, :, 0] * step).sum(axis=1)
        last = active & (size <= LAST_STEP * noise**2) & (number > alone)
        step[:, :6] = _limited(step[:, :6], result.ellipse)
        step[~active | bad | hidden] = 0
        moved += step[:, :6]
        result.ellipse = base.moved(*moved[:, :5].T)
        result.log_s, levels = np.clip(base_s + moved[:, 5], -1.5, 2.0), levels + step[:, 6:]
        result.reasons[active & (_distance(result.ellipse, start) > RING)] = "does not converge"
        if last.any():
            made_of = free, own, weights, shared, normal, scores
            _state(result, last & (result.reasons == ""), moments, levels, sectors, held, noise, tolerated, *made_of)
        active &= ~last & (result.reasons == "")
        if not active.any():
            break
        stale = active & (_movement(moved, base) > SMALL_STEP)
        alone = np.where(stale | (number >= alone), alone, number + 1)
        follow = active & ~stale
        if follow.any():
            _shift_moments(moments, np.where(follow[:, None], step[:, :6], 0)[disc])
    result.reasons[active] = "does not converge"
    result.reasons[(result.reasons == "") & ~_inside(result.ellipse, shape)] = "leaves the image"
    return result


def _state(result, rows, moments, levels, sectors, held, noise, tolerated, free, own, weights, shared, normal, scores):
    """Set covariance and variance of the discs whose last step this is, from what it was made of."""
    chi2, noise_of = np.where(own, free.chi2, shared), noise[sectors.disc]
    known = np.where(own, 0, np.maximum(chi2, tolerated))
    middle = _common_normal(moments, levels, sectors, known)[:, :12, :12] + held[:, :, None] * np.eye(12)
    own_noise = _own_sums((weights**2 * free.contrast**2 * chi2 * own)[None], free, sectors)[:, 0, :, :6]
    displaced, slopes = _radial_scores(moments, *_common_levels(levels, sectors), free, own, weights)
    information = slopes * np.where(own, weights**2 * chi2, known) * noise_of**2
    shares = np.maximum(weights * sectors.count, 1e-9)
    for i in np.flatnonzero(rows):
        part, variance = sectors.spans[i], noise[i] ** 2
        excess = _excess(displaced[None, part], information[None, part])[0]
        both = variance * middle[i], variance * own_noise[i]
        result.covariance[i] = _stated(normal[i], *both, scores[:, part], excess)
        result.variance[i] = variance * (chi2[part] @ shares[part]) / shares[part].sum()


def _stated(normal, shared_noise, own_noise, scores, excess):
    """The covariance (5, 5) of a disc.

    Sectors with the common levels contribute what noise explains, those with their own (`scores` (6, k)) what they show:
    what the model does not describe counts once for BLOCK neighbours, not for each pixel.  The other estimate takes
    what noise explains of both times the `excess` of the edge's displacements; the larger one is stated.
    """
    k = scores.shape[1]
    blocks = scores.reshape(6, k // BLOCK, BLOCK).sum(axis=2)
    bread = np.linalg.inv(normal)
    shown, white = shared_noise.copy(), shared_noise.copy()
    white[:6, :6] += own_noise
    displaced = (bread @ white @ bread)[:5, :5] * excess
    shown[:6, :6] += blocks @ blocks.T * ((k / BLOCK) / (k / BLOCK - 6))
    shown = (bread @ shown @ bread)[:5, :5]
    return shown * max((displaced[0, 0] + displaced[1, 1]) / (shown[0, 0] + shown[1, 1]), 1)


def _share_that_fits(free, limit, contrast, median):
    """1 for sectors that fit with levels of their own, less for those that do not, 0 where there is no edge; the disc's
    `contrast` and its sectors' `median` of chi2 are (K,)."""
    return np.minimum(1, (np.maximum(limit, median) / free.chi2) ** 2) * (free.contrast / contrast > 0.25)
