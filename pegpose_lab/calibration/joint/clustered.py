r"""The covariance when the errors of one view are not independent: by the scatter between the views.

A bent board, blur, and a lens that differs from the model make the errors of neighbouring corners alike.  Many corners
then say less than the classical covariance :math:`\sigma^2 S^{-1}` assumes.  The errors of two views remain independent,
so the scatter between the views still shows how well the camera is known.

With the poses eliminated, view v has the information :math:`S_v` about the camera and the score :math:`g_v`.  Without
it the estimate moves by :math:`d_v = (S - S_v)^{-1} g_v` (one step from the minimum), and the jackknife's covariance,
CR3 of the literature on clustered errors, is

.. math:: C = \frac{V - 1}{V} \sum_v d_v d_v^T .

Its quantiles are those of Student's t with V - 1 degrees of freedom.  It is noisier than the classical covariance, and
if the errors are independent it is too large where a view has much of the information.  So it is stated only if one of
two tests contradicts independent errors: that of the scores' scatter (`_score_ratio`) or that of the correlation of
neighbouring residuals (`_neighbour_test`).  In no direction does it then go below the classical one.

References: R. M. Bell and D. F. McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage
samples", Survey Methodology 28(2), 169-181, 2002.  J. G. MacKinnon, M. Ø. Nielsen and M. D. Webb, "Fast and reliable
jackknife and bootstrap methods for cluster-robust inference", Journal of Applied Econometrics 38(5), 671-694, 2023.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from scipy.special import fdtrc, ndtr

from ..result import LEAST_VIEWS
from .bundle import SMALLEST_RMS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .bundle import Equations
    from .views import Views

LEVEL = 0.01
"""Probability that the clustered covariance is stated although the errors are independent; half for each test."""

NEIGHBOURS = 4
"""Nearest corners that a corner's residual is compared with: on a checkerboard, those one square away."""

MOST_LEVERAGE = 0.9
"""A direction of which a view has a larger share of the information is not taken as left out with the view: the
others hardly determine it, and the jackknife would be larger than the error by the root of 1 / (1 - share)."""


@dataclass(frozen=True)
class Scatter:
    """What the views tell about the independence of the errors.

    Attributes
    ----------
    dependent : bool
        Whether one of the two tests contradicts independent errors.
    ratio : float
        How many times larger the scores' scatter is than independent errors make it: a variance ratio, over all of the
        camera's parameters.  NaN for one view.
    correlation : float
        Mean correlation of neighbouring residuals, above what the fit itself makes of independent errors.
    shared : (k, k) ndarray or None
        Covariance of the camera's parameters to be stated; None for the classical one.
    """

    dependent: bool
    ratio: float
    correlation: float
    shared: np.ndarray | None


def scatter_of_views(
    views: Views,
    residuals: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    equations: Equations,
    variance: float,
    freedom: int,
) -> Scatter:
    """Test whether the errors are independent, and state the covariance of the camera's parameters if they are not.

    Parameters
    ----------
    views : Views
    residuals : (V, m, 2) ndarray
        px; of a robust loss, Huber's pseudo-residuals, whose sum of squares is `variance` times `freedom`.
    jacobian : (V, m, 2, k + 6) ndarray
        As `views.evaluate` returns it.
    equations : Equations
        Of this Jacobian, without weights.
    variance : float
        Of one coordinate, px^2.
    freedom : int
        Its degrees of freedom.
    """
    v, k = len(residuals), len(equations.a)
    rows = (jacobian * views.used[:, :, None, None]).reshape(v, -1, k + 6)
    poses = np.linalg.qr(rows[:, :, k:])[0]
    values, directions, _ = equations.directions()
    whitener = directions / np.sqrt(values)[:, None] / np.sqrt(np.diagonal(equations.a))  # makes S the unit matrix
    own = rows[:, :, :k] - poses @ (poses.transpose(0, 2, 1) @ rows[:, :, :k])
    own = own @ whitener.T
    errors = (residuals * views.used[:, :, None]).reshape(v, -1, 1) / np.sqrt(variance)
    errors = errors - poses @ (poses.transpose(0, 2, 1) @ errors)
    errors = errors - own @ np.sum(own.transpose(0, 2, 1) @ errors, axis=0)  # OpenCV stops near the minimum, not at it
    if np.sum(errors**2) * variance <= freedom * SMALLEST_RMS**2:  # nothing but rounding
        return Scatter(False, np.nan, np.nan, None)
    scores, shares = (own.transpose(0, 2, 1) @ errors)[:, :, 0], own.transpose(0, 2, 1) @ own
    ratio, degrees = _score_ratio(scores, shares)
    correlation, surprise = _neighbour_test(views, errors, poses, own, freedom)
    dependent = bool(fdtrc(degrees, freedom, ratio) < LEVEL / 2 or ndtr(-surprise) < LEVEL / 2)
    if not dependent or v < LEAST_VIEWS:
        return Scatter(dependent, ratio, correlation, None)
    larger, axes = np.linalg.eigh(_jackknife(scores, shares))
    root = np.sqrt(variance * np.maximum(larger, 1))[:, None] * (axes.T @ whitener)
    return Scatter(True, ratio, correlation, root.T @ root)


def _score_ratio(scores, shares):
    r"""Ratio of the scores' scatter to its mean for independent errors, and its degrees of freedom.

    The whitened scores :math:`u_v` have the covariances :math:`M_v - M_v^2` and, of two views, :math:`-M_v M_w`, where
    :math:`M_v` is the view's share of the information.  :math:`T = \sum |u_v|^2` has the mean E = trace, and nearly
    the distribution of :math:`E \chi^2_d / d` with :math:`d = E^2 / \sum_{v w} |cov_{v w}|^2` (Satterthwaite).
    """
    mean = np.trace(shares, axis1=1, axis2=2).sum() - np.sum(shares**2)
    if not mean > 1e-9:  # one view has all the information
        return np.nan, 1.0
    squares = shares @ shares
    across = np.sum(squares.sum(axis=0) ** 2) - np.sum(squares**2)  # sum of |M_v M_w|^2, two views
    within = np.sum((shares - squares) ** 2)
    return float(np.sum(scores**2) / mean), float(mean**2 / (within + across))


def _neighbour_test(views, errors, poses, own, freedom):
    r"""Correlation of neighbouring residuals, and how many standard deviations it is above that of independent errors.

    Moran's :math:`I = e^T W e / e^T e` with W = 1 for neighbours of one view and coordinate.  For residuals
    e = M r of a fit, :math:`M = 1 - H` of rank n, it has the mean :math:`t_1 / n` and the variance
    :math:`2 (n t_2 - t_1^2) / (n^2 (n + 2))` with :math:`t_1 = tr(M W)`, :math:`t_2 = tr(M W M W)` (Cliff and Ord, Spatial
    Processes, 1981, Sect. 8.3).
    """
    weights = _neighbours(views)
    pairs = 2 * weights.sum()  # both coordinates

    def spread(columns):  # W times columns (V, 2 m, number)
        v, coordinates, number = columns.shape
        return (weights @ columns.reshape(v * coordinates // 2, 2 * number)).reshape(columns.shape)

    of_poses, of_own = spread(poses), spread(own)
    first, mixed, last = (
        poses.transpose(0, 2, 1) @ of_poses,
        poses.transpose(0, 2, 1) @ of_own,
        own.transpose(0, 2, 1) @ of_own,
    )
    last = last.sum(axis=0)
    lost = np.trace(first, axis1=1, axis2=2).sum() + np.trace(last)
    moment = 2 * np.sum(weights.data**2) - 2 * (np.sum(of_poses**2) + np.sum(of_own**2))
    moment += np.sum(first**2) + 2 * np.sum(mixed**2) + np.sum(last**2)
    statistic = np.sum(errors * spread(errors)) / np.sum(errors**2)
    mean, variance = -lost / freedom, 2 * (freedom * moment - lost**2) / (freedom**2 * (freedom + 2))
    return float((statistic - mean) / (pairs / (2 * views.used.sum()))), float((statistic - mean) / np.sqrt(variance))


def _neighbours(views):
    """The sparse W (V m, V m): how often two points of a view are among each other's `NEIGHBOURS` nearest on the object."""
    first, second, found = [], [], {}
    for view, (points, used) in enumerate(zip(views.points, views.used, strict=True)):
        places = np.flatnonzero(used)
        number, known = min(NEIGHBOURS, len(places) - 1), points[places].tobytes()
        if known not in found:  # all views of one board have the same
            found[known] = places[cKDTree(points[places]).query(points[places], number + 1)[1][:, 1:]].ravel()
        first.append(view * len(used) + np.repeat(places, number))
        second.append(view * len(used) + found[known])
    first, second = np.concatenate(first), np.concatenate(second)
    directed = csr_array((np.ones(len(first)), (first, second)), shape=(views.used.size, views.used.size))
    return (directed + directed.T).tocsr()


def _jackknife(scores, shares):
    """CR3 of the whitened parameters (k, k), in variances of one coordinate; see `MOST_LEVERAGE`."""
    values, axes = np.linalg.eigh(shares)
    rest = 1 - np.clip(values, 0, 1)
    kept = np.where(values <= MOST_LEVERAGE, rest, np.sqrt(rest * (1 - MOST_LEVERAGE)))
    along = (axes.transpose(0, 2, 1) @ scores[:, :, None])[:, :, 0]
    moves = (axes @ (along / np.maximum(kept, SMALLEST_RMS))[:, :, None])[:, :, 0]
    return (len(scores) - 1) / len(scores) * moves.T @ moves
