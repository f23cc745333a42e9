"""From circles to discs: all the fits of an image."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from ..checks import as_choice, as_image, as_number, as_points
from .ellipse import _Ellipse, _inside
from .group import _fit_group
from .result import Discs, _collect, _Fit
from .start import _start

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..circles import Circles

SAME = 1.0  # px, distance of centres and radii below which two fits are of one disc
GROUP = 500  # sum of the radii (px) of the discs that are fitted together: their arrays stay in the cache


def fit_discs(image: ArrayLike, circles: Circles | Discs, *, max_chi2: float = 1.5, max_misfit: float = 0.05) -> Discs:
    """Fit a blurred ellipse to the image around each circle.

    Parameters
    ----------
    image : (height, width) uint8
    circles : object with .centers (n, 2) and .radii (n,) in px
        Bright or dark discs, for example from `find_circles`; starting values are refined along rays,
        so they may be off by some 20 % of the radius.  With a .polarity, "bright" or "dark", only discs
        of that kind are measured; without it each is what its strongest edge says.
    max_chi2, max_misfit : float
        A disc is measured in part only when its chi2 exceeds `max_chi2` *and* the part of the residual that noise
        does not explain exceeds `max_misfit` of the contrast.  The second condition is there because in
        an image without noise any departure from the model is significant, however small.

    Returns
    -------
    Discs
        A row for each circle, with a state: "measured"; "partial", where something disturbs the measurement and the
        sigmas cover it; or "rejected".  The last two have a reason, which `pegpose_lab.discs.reasons` explains.  All
        values are finite, except for sigmas, covariance and chi2 (infinite) where there is no fit at all; centre
        and radius are then the circle's own.

    Raises
    ------
    ValueError
        If the image or the circles are unusable.

    Notes
    -----
    The noise that chi2 is judged by comes from the differences of residuals in the ring, of neighbours or, where these
    err together, of pixels some way apart; edges that the model does not describe are left out, and the variance is never
    below that of rounding, 1/12.  The ratio of the residuals to the noise tells structure from noise to 1/sqrt(number of
    pixels): above 1 + 5/sqrt(n), or where the ground farther out is not even, the disc is fitted again by sectors
    (see `_refit`), so that highlights, walls, swarf or hidden parts spoil their own sectors only.

    The sigmas are scaled by the residuals of the fit itself.  Where neighbouring pixels err together (demosaicing,
    compression, smoothing, sharpening) their autocorrelation enters the covariance (see `discs.correlation`); where the
    edge is displaced more over long stretches than over short ones (rough rims, texture) the displacements do (see
    `discs.spectrum`).  What no residual shows stays unknown: a side wall or a chamfer that displaces the edge alike along
    half of it or all around, and values that are clipped at 0 or 255.
    For a circle the angle is undetermined; its sigma is then that of a uniform distribution over half a turn, pi/sqrt(12).

    References
    ----------
    J. Heikkila, "Geometric camera calibration using circular control points", IEEE Transactions on Pattern Analysis and
    Machine Intelligence 22(10), 2000.
    S. M. Kay, "Fundamentals of Statistical Signal Processing: Estimation Theory", 1993 (maximum likelihood).

    Examples
    --------
    >>> import cv2
    >>> import numpy as np
    >>> import pegpose_lab as pl
    >>> image = cv2.circle(np.full((100, 120), 60, np.uint8), (70, 40), 20, 200, -1)
    >>> image = cv2.GaussianBlur(image, (0, 0), 1.0)
    >>> image += np.random.default_rng(0).integers(0, 5, image.shape, np.uint8)
    >>> discs = pl.fit_discs(image, pl.find_circles(image, (15, 30)))
    >>> discs.centers.round(1).tolist(), discs.radii.round().tolist()
    ([[70.0, 40.0]], [20.0])
    >>> bool((discs.sigmas[:, :2] < 0.05).all())
    True
    """
    image = as_image(image)
    limits = as_number(max_chi2, "max_chi2", 0.0), as_number(max_misfit, "max_misfit", 0.0)
    rows = _as_circles(circles)
    sign = _SIGNS[as_choice(getattr(circles, "polarity", ""), "circles.polarity", _SIGNS)]
    circles = _Ellipse(*rows.T.copy(), np.zeros(len(rows)), np.zeros(len(rows)))
    fits = [None] * len(rows)
    usable = (rows[:, 2] >= 2) & _inside(circles, image.shape)
    for i in np.flatnonzero(~usable):
        fits[i] = _Fit(circles[i], "radius too small" if rows[i, 2] < 2 else "leaves the image")
    if len(rows) == 0:
        return _collect([])
    starts, started = _start(image, circles, sign)
    for i in np.flatnonzero(usable & ~started):
        fits[i] = _Fit(circles[i], "no edge")
    for group in _groups(np.flatnonzero(usable & started), rows[:, 2]):
        for i, fit in zip(group, _fit_group(image, circles[group], starts[group], sign, *limits), strict=True):
            fits[i] = fit
    return _collect(_without_repetitions(fits))


_SIGNS = {"bright": 1, "dark": -1, "": 0}


def _as_circles(circles):
    """The circles as (n, 3) rows x, y, r."""
    if not (hasattr(circles, "centers") and hasattr(circles, "radii")):
        raise ValueError(f"circles is a {type(circles).__name__}; expected an object with .centers and .radii")
    centers = as_points(circles.centers, 2, "circles.centers", 0)
    radii = as_points(np.reshape(circles.radii, (-1, 1)), 1, "circles.radii", 0)
    if len(centers) != len(radii) or (radii <= 0).any():
        raise ValueError(f"circles has {len(centers)} centers and {len(radii)} radii; expected one radius > 0 each")
    return np.hstack([centers, radii])


def _without_repetitions(fits):
    """The fits, but of two that are nowhere SAME px apart only one is kept: a measured one, or the first."""
    accepted = [i for i, fit in enumerate(fits) if not fit.reason or fit.partly]
    accepted.sort(key=lambda i: fits[i].partly)
    places = [(fits[i].ellipse.x, fits[i].ellipse.y, fits[i].ellipse.r) for i in accepted]
    for first, second in sorted(cKDTree(places).query_pairs(SAME)) if places else ():
        if fits[accepted[first]].reason != "same disc":
            fits[accepted[second]] = replace(fits[accepted[second]], reason="same disc", partly=False)
    return fits


def _groups(indices, radii):
    """Arrays of indices of discs that are fitted together: some ten thousand pixels in all.

    That saves time only: no disc's result depends on the others in its group.
    """
    if len(indices) == 0:
        return []
    group = ((np.cumsum(radii[indices]) - radii[indices]) // GROUP).astype(int)
    return np.split(indices, np.flatnonzero(np.diff(group)) + 1)
