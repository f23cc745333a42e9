"""From a few corners of a checkerboard to all that are seen: the grid grows corner by corner.

The next corner of a line is where a parabola through the last three (a straight line through the last two) puts it.
It is taken if a fit there finds a clear crossing of two edges near that place, between four squares of the right colours.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .fit import edge_crossing, fit_corners
from .measure import LARGEST_MISFIT, LARGEST_MOVE, LARGEST_SIGMA, SMALLEST_PITCH, normals_of, window_radii, windows

if TYPE_CHECKING:
    from numpy.typing import NDArray

FAINT = 0.25  # of the median contrast of the grid's corners
LARGEST_RESIDUAL = 2.5  # times the median of the others: beyond, the edge of what covers the board is in the window
SMALLEST_MISFIT = 0.03  # of the contrast; without noise, corners may differ more from one to the next
LARGEST_TURN = 0.2  # rad, of the edges against the lines of the grid; along a knight's move they differ by 0.46
SQUARE_CONTRAST = (
    0.4,
    1.8,
)  # each square's distance from the mean level over the model's; a corner of the rim has -1 and 3
_SMALLEST_SQUARE = 3.0  # px of a square in the window; at the border of the image there are fewer
_SHIFTS = (1, 0), (-1, 0), (0, 1), (0, -1)


def grow_grid(
    image: NDArray[np.uint8], grid: NDArray[np.float64], most: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """All corners that can be reached from those of a grid.

    Parameters
    ----------
    image : (height, width) uint8
    grid : (rows, columns, 2) ndarray
        px, accurate to a fifth of the pitch.
    most : int
        The grid grows to two lines more than this, at most.

    Returns
    -------
    grid : (r, c, 2) ndarray
        px, the smallest rectangle with all corners; where none is seen, its likely place.
    seen : (r, c) bool ndarray
        All False if no corner of the grid is clear.
    """
    rows, columns = grid.shape[:2]
    margin = max(most + 2 - min(rows, columns), 1) + 3  # beyond what is ever filled, so that a roll brings in NaN only
    places = np.full((rows + 2 * margin, columns + 2 * margin, 2), np.nan)
    places[margin : margin + rows, margin : margin + columns] = grid
    known = _clear(image, np.full((*places.shape[:2], 4), np.nan), places)
    seen = np.isfinite(known[..., 0])
    if not seen.any():
        return grid, np.zeros((rows, columns), bool)
    tried = np.zeros(seen.shape, int)
    for _ in range(2 * most):
        ahead = _ahead(known[..., :2])
        ahead[seen | (tried >= 3)] = np.nan  # a better prediction may come with more neighbours
        tried += np.isfinite(ahead[..., 0])
        found = _clear(image, known, ahead)
        new = np.isfinite(found[..., 0])
        known[new] = found[new]
        seen |= new
        if not new.any() or max(np.ptp(np.argwhere(seen), axis=0)) > most:
            break
    used = tuple(slice(lines.min(), lines.max() + 1) for lines in np.nonzero(seen))
    return _filled(known[used][..., :2]), seen[used]


def _ahead(places):
    """Where the neighbours put each corner (rows, columns, 2); NaN where there are none."""
    guesses = []
    for shift in _SHIFTS:
        one, two, three = (np.roll(places, np.multiply(shift, k), axis=(0, 1)) for k in (1, 2, 3))
        straight = 2 * one - two
        bent = straight + one - 2 * two + three
        guesses.append(np.where(np.isnan(bent), straight, bent))
    return _mean(guesses)


def _mean(arrays):
    """The mean of the finite values, NaN where there are none."""
    stack = np.stack(arrays)
    count = np.isfinite(stack).sum(axis=0)
    return np.where(count, np.nansum(stack, axis=0), np.nan) / np.maximum(count, 1)


def _filled(grid):
    """The grid with a place for each corner that is not seen."""
    padded = np.pad(grid, ((3, 3), (3, 3), (0, 0)), constant_values=np.nan)
    inside = (slice(3, -3),) * 2
    while np.isnan(padded[inside]).any():
        ahead = _ahead(padded)
        known = np.isfinite(padded)
        padded[inside] = np.where(known, padded, ahead)[inside]
        if (np.isfinite(padded) == known).all():  # a lone corner: one step like its neighbour's
            padded[inside] = np.where(known, padded, _mean([np.roll(padded, s, axis=(0, 1)) for s in _SHIFTS]))[inside]
    return padded[inside]


def _steps(places):
    """The steps (rows, columns, 2) to the next corner along the row and along the column, from the neighbours if need be."""
    steps = []
    for shift in ((0, 1), (1, 0)):
        behind = places - np.roll(places, shift, axis=(0, 1))
        step = _mean([behind, np.roll(behind, np.negative(shift), axis=(0, 1))])
        near = _mean([np.roll(step, s, axis=(0, 1)) for s in _SHIFTS])
        steps.append(np.where(np.isnan(step), near, step))
    return steps


def _clear(image, known, ahead):
    """The clear corners at `ahead` (rows, columns, 2): x, y, contrast and residual (rows, columns, 4), else NaN.

    The contrast is that of the first corner of the grid, whose colours alternate; the residual is that of the fit, in
    grey values.  `known` are such corners that are clear already, all NaN at first.
    """
    clear = np.full_like(known, np.nan)
    along_row, along_column = _steps(np.where(np.isnan(ahead), known[..., :2], ahead))
    height, width = image.shape
    inside = ((ahead >= 1) & (ahead <= (width - 2, height - 2))).all(axis=2)  # False for NaN
    nodes = inside & np.isfinite(along_row[..., 0]) & np.isfinite(along_column[..., 0])
    start, pitch = normals_of(along_row[nodes], along_column[nodes])
    nodes[nodes] = large = pitch >= SMALLEST_PITCH
    start, pitch, guess = start[large], pitch[large], ahead[nodes]
    if not len(guess):
        return clear
    pixels = np.rint(guess)
    values, weights, lattice = windows(image, pixels.astype(int), guess - pixels, window_radii(pitch))
    fits = fit_corners(values, weights, lattice, np.column_stack([guess - pixels, start]), rough=True)
    found = pixels + fits.parameters[:, :2]
    contrast = fits.parameters[:, 6] * (1 - 2 * (np.argwhere(nodes).sum(axis=1) % 2))
    residual = fits.misfit * np.abs(contrast)
    usual, noise = np.median(np.column_stack([contrast, residual]), axis=0)
    if np.isfinite(known).any():
        usual, noise = np.nanmedian(known[..., 2:], axis=(0, 1))
    good = (contrast * np.sign(usual) > FAINT * abs(usual)) & (fits.sigma < LARGEST_SIGMA)
    good &= np.linalg.norm(found - guess, axis=1) < LARGEST_MOVE * pitch
    good &= (fits.misfit < LARGEST_MISFIT) & ((residual < LARGEST_RESIDUAL * noise) | (fits.misfit < SMALLEST_MISFIT))
    good &= (np.abs(fits.parameters[:, 2:4] - start) < LARGEST_TURN).all(axis=1)
    good &= _four_squares(fits.parameters, values, weights, lattice)
    nodes[nodes] = good
    clear[nodes] = np.column_stack([found, contrast, residual])[good]
    return clear


def _four_squares(parameters, values, weights, lattice):
    """Whether all four squares around each corner (n,) are seen, with their own colours."""
    product = edge_crossing(parameters, lattice)[1][:, :, 6]
    dx, dy = lattice[:, None] - parameters.T[:2, :, None]
    ahead = [np.cos(angle)[:, None] * dx + np.sin(angle)[:, None] * dy > 0 for angle in parameters.T[2:4]]
    levels, contrasts = values - parameters[:, 5:6], parameters[:, 6:7] * product
    good = np.ones(len(values), bool)
    for one in (ahead[0], ~ahead[0]):
        for two in (ahead[1], ~ahead[1]):
            weight = weights * (one & two)
            ratio = np.sum(weight * levels, axis=1) / (np.sum(weight * contrasts, axis=1) + 1e-12)
            good &= (
                (weight.sum(axis=1) >= _SMALLEST_SQUARE) & (ratio > SQUARE_CONTRAST[0]) & (ratio < SQUARE_CONTRAST[1])
            )
    return good
