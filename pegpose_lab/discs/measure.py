"""From circles to discs: the fits of a picture, and what is returned of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from ..checks import as_choice, as_image, as_number, as_points
from .ellipse import _distance, _Ellipse, _inside
from .fit import _settle, _variance
from .ground import _use_ground
from .model import QUANTISATION
from .refit import NEAR, NEAR_CHI2, _refit
from .sectors import _sectors
from .start import _start

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..circles import Circles

SAME = 1.0  # px, distance of centres and radii below which two fits are of one disc
GROUP = 250  # sum of the radii (px) of the discs that are fitted together: their arrays stay in the cache
REFIT_SIGMAS = 5.0  # excess of the simple model's chi2, in standard deviations, that calls for a refit by sectors


@dataclass(frozen=True)
class Discs:
    """Discs measured in a picture, one row for each circle that was given, in the same order.

    Attributes
    ----------
    centers : (n, 2) px
    semi_axes : (n, 2) px
        Major first.
    angles : (n,) rad
        Direction of the major axis from x towards y, in (-pi/2, pi/2].
    sigmas : (n, 5)
        Standard deviations of x, y, major, minor (px) and angle (rad); infinite where no fit was possible.
    covariance : (n, 5, 5)
        Covariance in the same order.
    chi2 : (n,)
        Mean squared residual over the noise variance of the picture in the disc's own ring.
    contrasts, blurs, noises : (n,)
        A (positive for bright discs; grey values), s (px), standard deviation of the noise (grey values).
    accepted : (n,) bool
    reasons : (n,) str
        Empty where accepted, else one of `REASONS` in `pegpose_lab.discs.reasons`, which explains each.

    Examples
    --------
    >>> import cv2, numpy as np, pegpose_lab as pl
    >>> image = cv2.circle(np.full((100, 120), 60, np.uint8), (70, 40), 20, 200, -1)
    >>> discs = pl.fit_discs(image, pl.find_circles(image, (15, 30)))
    >>> len(discs), discs.centers.shape, discs.sigmas.shape
    (1, (1, 2), (1, 5))
    """

    centers: np.ndarray
    semi_axes: np.ndarray
    angles: np.ndarray
    sigmas: np.ndarray
    covariance: np.ndarray
    chi2: np.ndarray
    contrasts: np.ndarray
    blurs: np.ndarray
    noises: np.ndarray
    accepted: np.ndarray
    reasons: np.ndarray

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of the circle of equal area, sqrt(a b), px."""
        return np.sqrt(self.semi_axes.prod(axis=1))

    def __len__(self) -> int:
        return len(self.centers)


def fit_discs(image: ArrayLike, circles: Circles | Discs, *, max_chi2: float = 1.5, max_misfit: float = 0.05) -> Discs:
    """Fit a blurred ellipse to the picture around each circle.

    Parameters
    ----------
    image : (height, width) uint8
    circles : object with .centers (n, 2) and .radii (n,) in px
        Bright or dark discs, for example from `find_circles`; starting values are refined along rays,
        so they may be off by some 20 % of the radius.  With a .polarity, "bright" or "dark", only discs
        of that kind are accepted; without it each is what its strongest edge says.
    max_chi2, max_misfit : float
        A fit is rejected when its chi2 exceeds `max_chi2` *and* the part of the residual that noise
        does not explain exceeds `max_misfit` of the contrast.  The second condition is there because in
        a picture without noise any departure from the model is significant, however small.

    Returns
    -------
    Discs
        A row for each circle.  Rows that are not accepted have a reason: "leaves the image",
        "radius too small", "no edge", "does not converge", "edge hidden" (less than 40 % of it fits),
        "contrast below noise", "other polarity", "chi2", "same disc" (as an earlier row's).  All values
        are finite, except for sigmas, covariance and chi2 (infinite) where there is no fit at all; centre
        and radius are then the circle's own.

    Raises
    ------
    ValueError
        If the image or the circles are unusable.

    Notes
    -----
    The noise that chi2 is judged by comes from the differences of neighbouring residuals in the ring, edges that
    the model does not describe left out; its variance is never below that of rounding, 1/12.  Their ratio tells
    structure from noise to 1/sqrt(number of pixels): above 1 + 5/sqrt(n), or where the ground farther out is not
    even, the disc is fitted again by sectors
    (see `_refit`), so that highlights, walls, swarf or hidden parts spoil their own sectors only.  The sigmas
    are scaled by the residual of the fit itself.  They hold for white noise and for levels that change slowly around the
    disc: where the ground changes within some pixels of the edge (a narrow side wall), where values are
    clipped at 0 or 255, or where the picture was smoothed, compressed or sharpened, errors are larger than stated.
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
    """The fits, but of two accepted ones that are nowhere SAME px apart only the first is accepted."""
    accepted = [i for i, fit in enumerate(fits) if not fit.reason]
    places = [(fits[i].ellipse.x, fits[i].ellipse.y, fits[i].ellipse.r) for i in accepted]
    for first, second in sorted(cKDTree(places).query_pairs(SAME)) if places else ():
        if not fits[accepted[first]].reason:
            fits[accepted[second]] = replace(fits[accepted[second]], reason="same disc")
    return fits


@dataclass(frozen=True)
class _Fit:
    """What is known of one disc; the defaults are what is returned where there is no fit."""

    ellipse: _Ellipse
    reason: str
    covariance: np.ndarray = None
    chi2: float = np.inf
    contrast: float = 0.0
    blur: float = 0.0
    noise: float = np.sqrt(QUANTISATION)


def _groups(indices, radii):
    """Arrays of indices of discs that are fitted together: of about one size, and some thousand pixels in all.

    That saves time only: no disc's result depends on the others in its group.
    """
    indices = indices[np.argsort(radii[indices], kind="stable")]
    groups, first = [], 0
    for i in range(1, len(indices) + 1):
        smallest = radii[indices[first]]
        if i == len(indices) or radii[indices[i]] > 1.2 * smallest + 2 or (i - first) * smallest > GROUP:
            groups.append(indices[first:i])
            first = i
    return groups if len(indices) else []


def _fit_group(image, circles, starts, sign, max_chi2, max_misfit):
    """Fit some discs: the simple model, a refit by sectors where it fails, and the judgement; a list of `_Fit`."""
    solution, reasons = _settle(image, starts)
    fitted, contrast, noise = reasons == "", solution.levels[:, 1], np.maximum(solution.noise, 1e-3)
    fails = _variance(solution) > (1 + REFIT_SIGMAS / np.sqrt(np.maximum(solution.count, 1))) * noise**2
    simple = fitted & solution.converged.astype(bool) & ~(fails & (np.abs(contrast) > noise))
    simple[_use_ground(image, solution, np.flatnonzero(simple & ~fails))] = False
    again = np.flatnonzero(fitted & ~simple)
    ellipse, contrast, s = solution.ellipse, solution.levels[:, 1], np.exp(solution.log_s)
    variance = _variance(solution)
    covariance = np.zeros((len(s), 5, 5))
    covariance[fitted] = np.linalg.inv(solution.normal[fitted])[:, :5, :5] * variance[fitted, None, None]
    if len(again):
        near = solution.converged[again].astype(bool) & (variance[again] < NEAR_CHI2 * noise[again] ** 2)
        near &= _distance(ellipse[again], starts[again]) < NEAR
        for part, sectors in _sectors(image, _choose(near, ellipse[again], starts[again])):
            rows = again[part]
            refit = _refit(image.shape, sectors, contrast[rows], noise[rows])
            reasons[rows], done = refit.reasons, refit.reasons == ""
            ellipse[rows[done]], covariance[rows[done]] = refit.ellipse[done], refit.covariance[done]
            variance[rows[done]], s[rows[done]] = refit.variance[done], np.exp(refit.log_s[done])
    vanished = fitted & ~(ellipse.r > 1)
    reasons[vanished], fitted = "does not converge", fitted & ~vanished
    misfit = np.sqrt(np.maximum(variance - noise**2, 0))
    reasons[(reasons == "") & (np.abs(contrast) <= noise)] = "contrast below noise"
    reasons[(reasons == "") & (contrast * sign < 0)] = "other polarity"
    reasons[(reasons == "") & (variance > max_chi2 * noise**2) & (misfit > max_misfit * np.abs(contrast))] = "chi2"
    fits = [_Fit(circles[i], reasons[i]) for i in range(len(s))]
    for i in np.flatnonzero(fitted):
        chi2, values = float(variance[i] / noise[i] ** 2), (float(contrast[i]), float(s[i]), float(noise[i]))
        fits[i] = _Fit(ellipse[i], reasons[i], _to_axes(ellipse[i], covariance[i]), chi2, *values)
    return fits


def _choose(where, first, second):
    """The first ellipses where that is said, else the second."""
    return _Ellipse(
        *(np.where(where, getattr(first, name), getattr(second, name)) for name in ("x", "y", "r", "m", "angle"))
    )


# -------------------------------------------------------------------------------------------------- sectors


def _to_axes(ellipse, covariance):
    """Covariance of x, y, r, p, q turned to x, y, major, minor, angle.

    With the shape's change (p, q) in the ellipse's own axes: dm = p, d angle = q / sinh 2m, da = a (dr/r + p),
    db = b (dr/r - p).  The divisor is kept large enough for the angle's sigma to be at most pi/sqrt(12).
    """
    (a, b), r = ellipse.axes, ellipse.r
    jacobian = np.zeros((5, 5))
    jacobian[0, 0] = jacobian[1, 1] = 1
    jacobian[2, 2:4] = a / r, a
    jacobian[3, 2:4] = b / r, -b
    jacobian[4, 4] = 1 / max(np.sinh(2 * ellipse.m), np.sqrt(12 * covariance[4, 4]) / np.pi)
    return jacobian @ covariance @ jacobian.T


def _collect(fits):
    """One `Discs` from the single fits."""
    n = len(fits)
    unknown = np.diag(np.full(5, np.inf))
    covariance = [unknown if fit.covariance is None else fit.covariance for fit in fits]
    covariance = np.array(covariance).reshape(n, 5, 5)
    reasons = np.array([fit.reason for fit in fits], dtype=np.str_)
    return Discs(
        centers=np.array([(fit.ellipse.x, fit.ellipse.y) for fit in fits], float).reshape(n, 2),
        semi_axes=np.array([fit.ellipse.axes for fit in fits], float).reshape(n, 2),
        angles=np.array([fit.ellipse.angle for fit in fits], float),
        sigmas=np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)),
        covariance=covariance,
        chi2=np.array([fit.chi2 for fit in fits], float),
        contrasts=np.array([fit.contrast for fit in fits], float),
        blurs=np.array([fit.blur for fit in fits], float),
        noises=np.array([fit.noise for fit in fits], float),
        accepted=reasons == "",
        reasons=reasons,
    )
