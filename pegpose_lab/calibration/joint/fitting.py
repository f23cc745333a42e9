"""Fits a lens model to all views, from the start to the covariance; `judge` and `misfit` judge the result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from .bundle import SMALLEST_RMS, Equations, minimise, minimise_robust
from .clustered import Scatter, scatter_of_views
from .covariance import covariance_of
from .views import State, Views, evaluate
from .wide import find_any_start

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    import pandas as pd
    from numpy.typing import NDArray

    from .models import FisheyeModel, OpenCVModel, TsaiModel


@dataclass(frozen=True)
class Fit:
    """A fitted model: the state at the minimum, its equations without weights, and the covariance that is stated.

    `weights` are 1 where there is a point, or those of a robust loss; `variance` is that of one image coordinate, px^2,
    and `freedom` its degrees of freedom.  `scatter` says whether `covariance` is the classical one.
    """

    model: TsaiModel | OpenCVModel | FisheyeModel
    views: Views
    state: State
    equations: Equations
    weights: np.ndarray
    variance: float
    freedom: int
    covariance: pd.DataFrame
    classical_covariance: pd.DataFrame
    scatter: Scatter

    @property
    def clustered(self) -> bool:
        """Whether the stated covariance is that of the scatter between the views (`clustered`)."""
        return self.scatter.shared is not None

    @property
    def own_variance(self) -> float:
        """The variance of one coordinate, px^2, that would give the poses' own errors if it were independent."""
        return self.variance * max(self.scatter.ratio, 1.0) if self.clustered else self.variance

    @property
    def sigma_freedom(self) -> int:
        """Degrees of freedom of the stated sigmas."""
        return len(self.views.used) - 1 if self.clustered else self.freedom

    def stated(self) -> dict[str, Any]:
        """The fields of a `Calibration` that say how well its parameters are known."""
        return {
            "covariance": self.covariance,
            "classical_covariance": self.classical_covariance,
            "freedom": self.sigma_freedom,
            "n_parameters": len(self.covariance),
        }

    @property
    def squares(self) -> float:
        """Sum of the squared residuals, px^2; with a robust loss, of Huber's pseudo-residuals."""
        return self.variance * self.freedom


def fit_views(
    model: TsaiModel | OpenCVModel | FisheyeModel,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    loss: str = "linear",
    start: State | None = None,
) -> Fit:
    """Fit a model to all views, from a start if one is given; the result is not judged yet."""
    views = Views.stack(object_points, image_points)
    _demand_freedom(model, views)
    state = find_any_start(model, views, object_points, image_points) if start is None else start
    state = minimise(model, views, state, views.used)[0]
    if loss == "linear":
        return fit_at(model, views, state)
    return fit_at(model, views, *minimise_robust(model, views, state, loss))


def fit_at(
    model: TsaiModel | OpenCVModel | FisheyeModel,
    views: Views,
    state: State,
    weights: NDArray[np.float64] | None = None,
    variance: float | None = None,
) -> Fit:
    """The `Fit` of a state at a minimum; by default the variance is that of the residuals."""
    freedom = _demand_freedom(model, views)
    residuals, jacobian = evaluate(model, views, state)
    equations = Equations.of(residuals, jacobian, views.used).with_prior(model.prior(state.shared))
    if variance is None:
        weights, variance = views.used, max(equations.cost / freedom, SMALLEST_RMS**2)
    else:  # Huber's pseudo-residuals
        residuals = residuals * weights[..., None]
        residuals *= np.sqrt(variance * freedom / np.sum(residuals**2))
    classical = covariance_of(model, views, state, equations, variance)
    scatter = scatter_of_views(views, residuals, jacobian, equations, variance, freedom)
    fit = Fit(model, views, state, equations, weights, variance, freedom, classical, classical, scatter)
    if not fit.clustered:
        return fit
    return replace(fit, covariance=covariance_of(model, views, state, equations, fit.own_variance, scatter.shared))


def _demand_freedom(model, views):
    """The degrees of freedom; CalibrationError if there are none."""
    count, unknowns = 2 * int(views.used.sum()), len(model.names) + 6 * len(views.used)
    if count <= unknowns:
        raise CalibrationError(f"{count} coordinates cannot determine {unknowns} parameters; add points or views")
    return count - unknowns
