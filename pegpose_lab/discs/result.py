"""What `fit_discs` returns: a row for each disc, with its state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .ellipse import _Ellipse
from .model import QUANTISATION

if TYPE_CHECKING:
    from numpy.typing import NDArray


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
    states : (n,) str
        "measured"; "partial", where something disturbs the measurement and the sigmas cover it; or "rejected".
    reasons : (n,) str
        Empty where measured, else one of `REASONS` in `pegpose_lab.discs.reasons`, which explains each.

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
    states: np.ndarray
    reasons: np.ndarray

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of the circle of equal area, sqrt(a b), px."""
        return np.sqrt(self.semi_axes.prod(axis=1))

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Whether each disc is measured without reserve."""
        return self.states == "measured"

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Whether each disc is measured, at least in part: its sigmas may be relied on."""
        return self.states != "rejected"

    def __len__(self) -> int:
        return len(self.centers)


@dataclass(frozen=True)
class _Fit:
    """What is known of one disc; the defaults are what is returned where there is no fit."""

    ellipse: _Ellipse
    reason: str
    partly: bool = False
    covariance: np.ndarray = None
    chi2: float = np.inf
    contrast: float = 0.0
    blur: float = 0.0
    noise: float = np.sqrt(QUANTISATION)


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
    partly = np.array([fit.partly for fit in fits], bool)
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
        states=np.where(reasons == "", "measured", np.where(partly, "partial", "rejected")),
        reasons=reasons,
    )
