"""A lens model fitted to all views: from the start to the covariance; what it is worth others judge (`joint`)."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .bundle import SMALLEST_RMS, Equations, State, Views, covariance_of, evaluate, minimise, minimise_robust
from .checks import CalibrationError
from .starts import find_start


@dataclass(frozen=True)
class Fit:
    """The least squares of a model: the state at the minimum, its equations without weights, and what follows.

    `weights` are 1 where there is a point, or those of a robust loss; `variance` is that of a coordinate, px^2.
    """

    model: object
    views: Views
    state: State
    equations: object
    weights: np.ndarray
    variance: float
    freedom: int
    covariance: pd.DataFrame


def fit_views(model, object_points, image_points, loss="linear"):
    """Minimise; not yet judged."""
    views = Views.stack(object_points, image_points)
    state = find_start(model, views, object_points, image_points)
    count, unknowns = 2 * int(views.used.sum()), len(model.names) + 6 * len(object_points)
    freedom = count - unknowns
    if freedom <= 0:
        raise CalibrationError(f"{count} coordinates cannot determine {unknowns} parameters; add points or views")
    state, equations = minimise(model, views, state, views.used)
    weights, variance = views.used, max(equations.cost / freedom, SMALLEST_RMS**2)
    if loss != "linear":
        state, weights, variance = minimise_robust(model, views, state, loss)
        equations = Equations.of(*evaluate(model, views, state), views.used)
    covariance = covariance_of(model, views, state, equations, variance)
    return Fit(model, views, state, equations, weights, variance, freedom, covariance)
