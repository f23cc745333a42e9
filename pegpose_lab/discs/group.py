"""Fits of some discs of about one size: the simple model, a refit by sectors where it fails, and the judgement."""

from dataclasses import dataclass

import numpy as np

from .correlation import _correlated_covariance
from .ellipse import _choose, _distance, _Ellipse
from .fit import _exceeds, _is_wide, _settle, _variance
from .ground import _use_ground
from .refit import NEAR, NEAR_CHI2, _refit
from .result import _Fit, _to_axes
from .sectors import LEAST_RADIUS, _sectors

UNCERTAIN = 0.25  # px, sigma of a centre above which nothing was measured to a part of a pixel
TEXTURED = 3.0  # times the noise that neighbouring pixels share: a disc of less contrast may be a part of a texture
COARSE = 0.3  # part of the contrast: a disc whose simple model misfits by more is not even measured in part


@dataclass
class _Best:
    """The best fit of each disc so far: arrays with a row each; `partly` where only a simple model is left."""

    ellipse: _Ellipse
    covariance: np.ndarray
    variance: np.ndarray
    s: np.ndarray
    reasons: np.ndarray
    fitted: np.ndarray
    partly: np.ndarray


def _fit_group(image, circles, starts, sign, max_chi2, max_misfit):
    """A list of `_Fit` of some circles; `sign` is +1 for bright discs, -1 for dark ones, 0 for either."""
    solution, reasons = _settle(image, starts)
    contrast, noise = solution.levels[:, 1], np.maximum(solution.noise, 1e-3)
    best, again = _simple(image, solution, reasons, np.abs(contrast) > noise)
    _refit_by_sectors(image, starts, solution, best, again)
    textured = (solution.noise > solution.rough) & (np.abs(contrast) < TEXTURED * noise)
    _judge(best, contrast, noise, textured, sign, max_chi2, max_misfit)
    fits = [_Fit(circles[i], best.reasons[i]) for i in range(len(reasons))]
    for i in np.flatnonzero(best.fitted):
        covariance, chi2 = _to_axes(best.ellipse[i], best.covariance[i]), float(best.variance[i] / noise[i] ** 2)
        values = float(contrast[i]), float(best.s[i]), float(noise[i])
        fits[i] = _Fit(best.ellipse[i], best.reasons[i], bool(best.partly[i]), covariance, chi2, *values)
    return fits


def _simple(image, solution, reasons, seen):
    """The simple model's fits, and the indices of the discs that need a refit: the model fails, or the ground is uneven."""
    fitted = reasons == ""
    in_the_ring = _variance(solution)
    fails = _exceeds(in_the_ring, np.maximum(solution.noise, 1e-3), solution.count)
    simple = fitted & solution.converged.astype(bool) & ~(fails & seen)
    white = ~_exceeds(in_the_ring, solution.rough, solution.count)
    simple[_use_ground(image, solution, np.flatnonzero(simple & ~fails & white))] = False
    variance, covariance = _variance(solution), np.zeros((len(reasons), 5, 5))  # the ground counts, too
    covariance[fitted] = np.linalg.inv(solution.normal[fitted])[:, :5, :5] * variance[fitted, None, None]
    # Small discs have too few pixels for sectors, wide edges leave their ring: there, misfit widens the sigmas and no more.
    whole = (solution.ellipse.r < LEAST_RADIUS) | _is_wide(solution)
    simple |= fitted & whole & solution.converged.astype(bool)
    partly = np.zeros(len(reasons), bool)
    _widen(image, solution, covariance, np.flatnonzero(simple))
    best = _Best(solution.ellipse, covariance, variance, np.exp(solution.log_s), reasons, fitted, partly)
    return best, np.flatnonzero(fitted & ~simple)


def _widen(image, solution, covariance, rows):
    """Set the covariances of those rows whose residuals are larger than neighbouring pixels tell."""
    for i in rows[_exceeds(_variance(solution)[rows], solution.rough[rows], solution.count[rows])]:
        covariance[i] = _correlated_covariance(image, solution, i)


def _refit_by_sectors(image, starts, solution, best, again):
    """Fit some discs again by sectors; where that fails, a settled simple model stays as a part of a measurement."""
    if len(again) == 0:
        return
    noise, contrast = np.maximum(solution.rough[again], 1e-3), solution.levels[again, 1]
    settled = solution.converged[again].astype(bool)
    near = settled & (best.variance[again] < NEAR_CHI2 * noise**2)
    near &= _distance(best.ellipse[again], starts[again]) < NEAR
    sectors = _sectors(image, _choose(near, best.ellipse[again], starts[again]))
    log_s = np.where(near, solution.log_s[again], np.log(1.2))
    refit = _refit(image.shape, sectors, log_s, contrast, noise)
    done = refit.reasons == ""
    best.reasons[again], best.partly[again] = refit.reasons, ~done & settled
    rows = again[done]
    best.ellipse[rows], best.covariance[rows] = refit.ellipse[done], refit.covariance[done]
    best.variance[rows], best.s[rows] = refit.variance[done], np.exp(refit.log_s[done])
    _widen(image, solution, best.covariance, np.flatnonzero(best.partly))


def _judge(best, contrast, noise, textured, sign, max_chi2, max_misfit):
    """Set the reasons, and which of the discs with a reason are measured in part."""
    vanished = best.fitted & ~(best.ellipse.r > 1)
    best.reasons[vanished], best.fitted = "does not converge", best.fitted & ~vanished
    misfit = np.sqrt(np.maximum(best.variance - noise**2, 0))
    best.reasons[(best.reasons == "") & (np.abs(contrast) <= noise)] = "contrast below noise"
    best.reasons[(best.reasons == "") & (contrast * sign < 0)] = "other polarity"
    unlike = (best.variance > max_chi2 * noise**2) & (misfit > max_misfit * np.abs(contrast))
    unsure = np.sqrt(np.trace(best.covariance[:, :2, :2], axis1=1, axis2=2) / 2) > UNCERTAIN
    reasons = ("chi2", unlike), ("texture", textured), ("uncertain", unsure)
    for reason, where in reasons:
        where = where & (best.reasons == "")
        best.reasons[where], best.partly[where] = reason, True
    best.partly &= best.fitted & (misfit <= COARSE * np.abs(contrast)) & (contrast * sign >= 0)
