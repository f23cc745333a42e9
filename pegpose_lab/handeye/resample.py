r"""Covariance by leaving out whole poses (jackknife), and the errors at the poses left out.

A covariance from the residuals takes the errors of all measurements as independent, and is too small by a factor of
about three on real poses.  Leaving out whole poses asks instead how much the answer depends on each.  Without pose i, with
white derivatives J_i, residuals r_i and the normal matrix H, the unknowns change by

.. math:: d_i = -(H - J_i^T J_i)^{-1} J_i^T r_i, \qquad V = \frac{n - 1}{n} \sum_i d_i d_i^T

in one step, which is exact for linear equations; here the second order is far below the noise.  With few poses V is too
large, because a pose that is left out is missed.  How much too large, and how many degrees of freedom a Student interval
from V has, follows for independent errors from the derivatives alone.

References
----------
R. M. Bell, D. F. McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples", 2002.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .adjust import Fit

LEAST_SHARE = 1e-6
"""The part of the information on some direction that must remain without a pose: below it is rounding."""


@dataclass(frozen=True, eq=False)
class Resampled:
    """What leaving out each pose says.

    Attributes
    ----------
    covariance : (k, k) ndarray
        Of the unknowns, corrected for the number of poses.
    degrees_of_freedom : (k,) ndarray
        Of a Student interval for each unknown.
    left_out : (n, 6) ndarray
        Measured minus predicted by the other poses: working point, mm, rotation vector, rad.
    distances : (n,) ndarray
        Mahalanobis distances of the poses left out.
    """

    covariance: NDArray[np.float64]
    degrees_of_freedom: NDArray[np.float64]
    left_out: NDArray[np.float64]
    distances: NDArray[np.float64]


def leave_out(fit: Fit) -> Resampled:
    """Leave out each pose of a fit.

    Raises
    ------
    CalibrationError
        If the poses do not determine the unknowns without one of them.
    """
    design, residuals, information = fit.white_design, fit.white_residuals, fit.information
    count, k = len(design), design.shape[2]
    inverse = np.linalg.inv(information)
    rest = np.eye(6) - design @ inverse @ design.transpose(0, 2, 1)
    least = np.linalg.eigvalsh(rest)[:, 0]
    if least.min() < LEAST_SHARE:
        raise CalibrationError(
            f"without pose {int(least.argmin())} (counted from 0) the others do not determine the camera and the target; "
            "add poses whose turns have other axes"
        )
    back = np.linalg.inv(rest)
    gains = inverse @ design.transpose(0, 2, 1) @ back  # (H - J_i^T J_i)^-1 J_i^T
    changes = -np.einsum("nki,ni->nk", gains, residuals)
    rows = design.reshape(-1, k)
    residual_maker = (np.eye(6 * count) - rows @ inverse @ rows.T).reshape(count, 6, 6 * count)
    share = np.sqrt((count - 1) / count)
    changes, by_noise = share * changes, share * gains @ residual_maker
    correct = _correction(information, np.einsum("nkj,nlj->kl", by_noise, by_noise))
    changes, by_noise = changes @ correct.T, correct @ by_noise
    gram = np.einsum("nkj,mkj->knm", by_noise, by_noise)
    degrees = np.trace(gram, axis1=1, axis2=2) ** 2 / np.sum(gram**2, axis=(1, 2))
    left_out = np.einsum("nij,nj->ni", back, residuals)
    distances = np.sqrt(np.einsum("ni,ni->n", residuals, left_out))
    return Resampled(changes.T @ changes, degrees, left_out * fit.sigmas, distances)


def _correction(information, expected):
    """The matrix (k, k) that takes the expected covariance to the right one, the inverse of `information`.

    Symmetric where the information is the identity: so no choice of frames or units changes it.
    """
    size = np.sqrt(np.diag(information))
    root = size[:, None] * np.linalg.cholesky(information / np.outer(size, size))
    values, vectors = np.linalg.eigh(root.T @ expected @ root)
    return np.linalg.inv(root.T) @ (vectors / np.sqrt(values)) @ vectors.T @ root.T
