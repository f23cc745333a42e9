"""Covariance of the simple model where neighbouring pixels err together: smoothed, demosaiced, compressed images.

With noise of the autocorrelation rho, least squares has the covariance

    sigma^2 N^-1 (sum over pixels p, q of J_p rho(p - q) J_q^T) N^-1,   N = sum over p of J_p J_p^T,

J the derivatives of the model.  The autocorrelation comes from the ring's own residuals.  Errors that reach farther
than REACH show in the `spectrum` of the edge's displacements; the larger of the two is stated.
"""

import cv2
import numpy as np
from scipy.fft import irfft2, rfft2

from .model import _ingredients
from .ring import _ring_pixels, _ring_width
from .spectrum import PARTS, _excess, _parts

REACH = 6  # px, longest distance at which pixels are taken to err together
SIGNIFICANT = 2.0  # standard deviations of an autocorrelation's estimate below which it counts as 0


def _correlated_covariance(image, solution, i):
    """Covariance (5, 5) of x, y, r, p, q of disc i of a `_Solution`, from the residuals of its ring."""
    one = slice(i, i + 1)
    ellipse, level, contrast = solution.ellipse[one], *solution.levels[i]
    pixels, disc = _ring_pixels(image, ellipse, _ring_width(solution.log_s[one]))
    rows = _ingredients(pixels, ellipse[disc], solution.log_s[one][disc]).reshape(9, -1)
    used = pixels.used.ravel() > 0
    residuals = (rows[8] - (level - pixels.level[0]) * rows[6] - contrast * rows[7])[used]
    slopes = (rows[:8] * np.where(np.arange(8) < 6, contrast, 1.0)[:, None])[:, used]
    variance = residuals @ residuals / max(len(residuals) - 8, 1)
    places = [np.rint(axis.ravel()[used]).astype(int) for axis in (pixels.x, pixels.y)]
    grids = (_on_grid(places, values) for values in (residuals, slopes, np.ones(len(residuals))))
    normal, bread = slopes @ slopes.T, np.linalg.inv(solution.normal[i])
    middle = _at_least(_middle(*grids), normal) * variance
    white, correlated = ((bread @ matrix @ bread)[:5, :5] for matrix in (variance * normal, middle))
    part, radial = _parts(pixels, ellipse).ravel()[used], slopes[2]
    scores, information = (np.bincount(part, weights, PARTS)[None] for weights in (radial * residuals, radial**2))
    displaced = white * _excess(scores, information * variance)
    return max(correlated, displaced, key=lambda matrix: matrix[0, 0] + matrix[1, 1])


def _at_least(matrix, least):
    """The matrix where it exceeds `least` (symmetric, positive), and that elsewhere, direction by direction.

    An autocorrelation that is cut off at REACH is not that of any process: alone, it may state negative variances.
    """
    root = np.linalg.cholesky(least + 1e-9 * np.diag(np.diag(least)))
    whitened = np.linalg.solve(root, np.linalg.solve(root, matrix).T)
    values, vectors = np.linalg.eigh((whitened + whitened.T) / 2)
    vectors = root @ vectors
    return (vectors * np.maximum(values, 1)) @ vectors.T


def _on_grid(places, values):
    """An image (..., h, w) of the values (..., m) of the pixels at `places`, columns and rows, 0 elsewhere."""
    columns, rows = (axis - axis.min() for axis in places)
    grid = np.zeros((*values.shape[:-1], rows.max() + 1, columns.max() + 1), np.float32)
    grid[..., rows, columns] = values
    return grid


def _middle(residuals, slopes, there):
    """The sum over pairs of pixels of J_p rho(p - q) J_q^T (8, 8), from images of residuals, J and the ring.

    By frequencies: the spectrum of rho weighs the products of the spectra of J.
    """
    size = [cv2.getOptimalDFTSize(side + REACH) for side in residuals.shape]
    rho = np.zeros(size, np.float32)
    lags = np.arange(-REACH, REACH + 1)
    rho[np.ix_(lags, lags)] = _autocorrelation(residuals, there)
    spectra = rfft2(slopes, size).reshape(8, -1)
    weights = rfft2(rho).real
    weights[:, 1 : (size[1] + 1) // 2] *= 2  # for the frequencies that are left out, which mirror these
    parts = np.concatenate([spectra.real, spectra.imag], axis=1)
    weights = np.tile(weights.ravel(), 2) / (size[0] * size[1])
    return (parts * weights) @ parts.T


def _autocorrelation(residuals, there):
    """Autocorrelation (2 REACH + 1, 2 REACH + 1) of the residuals on the ring, 0 where it is not significant."""
    size = [cv2.getOptimalDFTSize(side + REACH) for side in residuals.shape]
    products, pairs = (irfft2(np.abs(rfft2(grid, size)) ** 2, size) for grid in (residuals, there))
    lags = np.arange(-REACH, REACH + 1)
    near = np.ix_(lags, lags)
    pairs = np.maximum(np.rint(pairs[near]), 1)
    rho = products[near] / pairs / (products[0, 0] / pairs[REACH, REACH])
    return np.where(np.abs(rho) > SIGNIFICANT / np.sqrt(pairs), rho, 0)
