"""How unsure an edge is that is rough, textured or sharpened: the spectrum of its displacements around the disc.

White noise displaces the edge by equal amounts at all angular frequencies.  What cameras and real surfaces do (demosaicing,
compression, sharpening, texture, a rough rim, a second edge nearby) displaces it more at low ones, and the lowest, 0 to
2, are what centre, radius and shape are read from.  The fit takes those out of the residuals, so their size is
extrapolated from the next ones, 3 to `HIGHEST`: by a weighted mean that favours the lowest, and, since such spectra keep
rising towards low frequencies, to the power RISE.
"""

import numpy as np

HIGHEST = 8  # angular frequency: higher ones say little about 0 to 2
FALL = 1.5  # exponent of the weights (frequency - 2)^-FALL: 1 would trust white noise more, 2 has half the independent terms
RISE = 1.3  # exponent that takes an excess at 3 and higher to the one at 1
PARTS = 48  # of a ring: enough for the highest frequency


def _excess(scores, information):
    """Variance of low displacements over what the `information` (n, k) of the parts of an edge lets expect, (n,).

    Parameters
    ----------
    scores : (n, k)
        Derivative of half the sum of squares by the radius, of k equal parts of each edge.
    information : (n, k)
        The variance of the scores that the stated noise explains.
    """
    k, frequencies = scores.shape[1], np.arange(3, HIGHEST + 1)
    weights = (frequencies - 2.0) ** -FALL
    phases = 2 * np.pi / k * np.outer(np.arange(k), frequencies)
    power = (scores @ np.cos(phases)) ** 2 + (scores @ np.sin(phases)) ** 2
    excess = power @ (weights / weights.sum()) / np.maximum(information.sum(axis=1), 1e-12)
    return np.where(excess > 1, excess**RISE, excess)


def _parts(pixels, ellipse):
    """In which of PARTS equal parts of the eccentric anomaly the pixels (n, m) lie."""
    x = pixels.x + (pixels.origin[:, 0] - ellipse.x)[:, None]
    y = pixels.y + (pixels.origin[:, 1] - ellipse.y)[:, None]
    cos, sin, grow = np.cos(ellipse.angle)[:, None], np.sin(ellipse.angle)[:, None], np.exp(2 * ellipse.m)[:, None]
    anomaly = np.arctan2((y * cos - x * sin) * grow, x * cos + y * sin)
    return np.minimum(((anomaly / (2 * np.pi) + 0.5) * PARTS).astype(np.intp), PARTS - 1)
