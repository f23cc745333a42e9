"""Radial lens distortion as in Eq. 3: distorted radii from undistorted ones, and how far that is possible."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def max_undistorted_radius(kappa1: ArrayLike) -> NDArray[np.float64]:
    """Return the largest undistorted radius that Eq. 3 can produce: 2 / (3 sqrt(-3 kappa1)), or infinity.

    For kappa1 >= 0 the map r_d -> r_d (1 + kappa1 r_d^2) is monotonic.  For kappa1 < 0 it turns back at
    r_d = 1 / sqrt(-3 kappa1); scene points beyond that radius have no image.

    Examples
    --------
    >>> from pegpose_lab.camera import max_undistorted_radius
    >>> max_undistorted_radius([0.001, -0.001]).round(2).tolist()
    [inf, 12.17]
    """
    kappa1 = np.asarray(kappa1, dtype=np.float64)
    if kappa1.ndim == 0:
        return np.array(2 / (3 * np.sqrt(-3 * kappa1)) if kappa1 < 0 else np.inf)
    negative = np.minimum(kappa1, -np.finfo(float).tiny)
    return np.where(kappa1 < 0, 2 / (3 * np.sqrt(-3 * negative)), np.inf)


def distort_radius(radius: ArrayLike, kappa1: ArrayLike) -> NDArray[np.float64]:
    r"""Solve Eq. 3 for the distorted radius: :math:`r_d (1 + \kappa_1 r_d^2) = r_u`.

    The root next to r_u is written in closed form, with hyperbolic functions for barrel distortion
    (kappa1 > 0) and circular ones for pincushion distortion (kappa1 < 0), then polished by one Newton
    step.  Nothing is iterated to convergence, so strong distortion is as exact as weak.

    Parameters
    ----------
    radius : array_like
        Undistorted radius r_u >= 0, mm.
    kappa1 : array_like
        Coefficient, mm^-2; broadcast against `radius`.

    Returns
    -------
    ndarray
        Distorted radius r_d, mm; beyond `max_undistorted_radius` the radius at which the map turns back.

    Examples
    --------
    >>> from pegpose_lab.camera import distort_radius
    >>> r_d = distort_radius(3.0, 0.001)
    >>> round(float(r_d), 4), round(float(r_d * (1 + 0.001 * r_d**2)), 4)
    (2.9737, 3.0)
    """
    radius, kappa1 = np.asarray(radius, np.float64), np.asarray(kappa1, np.float64)
    scale = np.sqrt(3 * np.maximum(np.abs(kappa1), np.finfo(float).tiny))
    argument = 1.5 * radius * scale
    pincushion = kappa1 < 0
    if not np.any(pincushion):
        root = np.sinh(np.arcsinh(argument) / 3)
    elif np.all(pincushion):
        root = np.sin(np.arcsin(np.minimum(argument, 1.0)) / 3)
    else:  # each form only where it holds, since they take most of the time
        barrel, pincushion = (np.broadcast_to(chosen, argument.shape) for chosen in (~pincushion, pincushion))
        third = np.arcsinh(argument, where=barrel, out=np.zeros(argument.shape))
        third = np.arcsin(np.minimum(argument, 1.0), where=pincushion, out=third) / 3
        root = np.sinh(third, where=barrel, out=np.zeros(argument.shape))
        root = np.sin(third, where=pincushion, out=root)
    root = root * (2 / scale)
    if np.any(kappa1 == 0):
        root = np.where(kappa1 == 0, radius, root)
    stretch = kappa1 * root**2
    excess, slope = root * (1 + stretch) - radius, 1 + 3 * stretch
    if np.any(pincushion):
        reachable = radius <= max_undistorted_radius(kappa1) * (1 - 1e-6)  # at the turning point the slope is 0
        if not np.all(reachable):
            excess, slope = np.where(reachable, excess, 0.0), np.where(reachable, slope, 1.0)
    return root - excess / slope
