"""Judges whether the views determine f: flags if they hardly do, errors if they do not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from ...flags import Flag
from ..planes import relief
from ..result import LEAST_VIEWS, judge_focal_length, judge_principal_point
from ..two_stage.tsai import SMALL_TILT, TILT_SIGNIFICANCE
from .bundle import Equations, descend
from .models import GivenFocalLength
from .starts import plane_rotations
from .views import State, evaluate

if TYPE_CHECKING:
    from .fitting import Fit

LITTLE_WORTH = 0.05
"""The information about f is tested if its relative sigma, times the root of the number of views, is above this."""

FLAGGED_SHARE, REFUSED_SHARE = 0.03, 0.1
"""f is flagged, or refused, if noise makes more than this fraction of the information about it."""

LEAST_RELIEF = 2e-3
"""Points with more relief than this (see `planes.relief`) determine f also through their depth, not by tilt alone."""

LEAST_RISE = 25.0
"""The sum of squares must grow by this many variances when f is multiplied by one of `OTHER_FACTORS`."""

OTHER_FACTORS = (1 / 2, 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64)
"""Most are below 1, because noise on a small tilt makes f too large, by a factor of up to a hundred."""


def _with_focal_length(fit, focal_length, near):
    """The model with a given f (or f_x), and the state of a nearby f with its depths scaled like f."""
    depth = focal_length / near.shared[0]
    state = State(near.shared[1:], near.rotations, near.positions * [1, 1, depth])
    return GivenFocalLength(fit.model, focal_length), state


def _judge(fit, object_points):
    """Flags of a fit; `CalibrationError` if f is not determined."""
    largest = _demand_tilt(fit, object_points)
    value, name, unit = fit.state.shared[0], fit.model.names[0], fit.model.unit
    flags = judge_focal_length(fit.covariance, name, value, unit, fit.sigma_freedom)
    flags += judge_principal_point(fit.covariance, fit.model.sensor.image_size, fit.sigma_freedom)
    if _is_suspect(fit, largest):
        share = _demand_signal(fit)
        _demand_ends(fit)
        if share > FLAGGED_SHARE:
            text = (
                f"{100 * share:.0f} % of the views' information about f comes from noise, so its sigma is too small; "
                "tilt the board by about 30 deg."
            )
            flags += (Flag("noisy-focal-length", text),)
    if largest < SMALL_TILT:
        sigma = np.sqrt(fit.covariance.loc[name, name])
        text = (
            f"The boards are tilted by {largest:.1f} deg at most, so f ({value:.5g} +- {sigma:.2g} {unit}) trades off "
            "with T_z; tilt them by about 30 deg."
        )
        flags += (Flag("little-tilt", text),)
    return flags


def judge_independence(fit: Fit) -> tuple[Flag, ...]:
    """A flag if the errors of a view's corners are not independent; it says which sigmas are stated."""
    scatter = fit.scatter
    if not scatter.dependent:
        return ()
    signs = [f"residuals of neighbouring corners have a correlation of {scatter.correlation:.2f}"]
    if scatter.ratio > 1:
        signs.append(f"the views differ by {np.sqrt(scatter.ratio):.2g} times as much as independent errors explain")
    found = (
        f"The errors of a view's corners are not independent of each other ({' and '.join(signs)}), as with a bent board, "
        "blur, or a lens that differs from the model"
    )
    if not fit.clustered:
        few = f"with {len(fit.views.used)} of the {LEAST_VIEWS} views that it takes to state them by the scatter between views"
        return (
            Flag("correlated-corners", f"{found}; {few}, the stated sigmas assume that they are, and are too small."),
        )
    name = fit.model.names[0]
    factor = np.sqrt(fit.covariance.loc[name, name] / fit.classical_covariance.loc[name, name])
    text = (
        f"{found}. So the sigmas are stated by the scatter between the views: that of {name} is {factor:.2g} times the "
        f"classical one, and intervals take Student's t of {fit.sigma_freedom} degrees of freedom. More views make them "
        "smaller, more corners do not."
    )
    return (Flag("clustered-sigmas", text),)


def _demand_tilt(fit, object_points):
    """The largest board tilt, deg (90 for objects that are not planar); refused if no tilt is significant."""
    if any(relief(points) > LEAST_RELIEF for points in object_points):
        return 90.0
    tilts, sigmas, matrix = [], [], fit.covariance.to_numpy()
    normals = (fit.state.rotations @ plane_rotations(object_points).transpose(0, 2, 1))[:, :, 2]
    for first, (x, y, _) in zip(range(len(fit.model.names), len(matrix), 6), normals, strict=True):
        across = np.array([-y, x])  # the axis of the tilt, times its sine
        sine = np.linalg.norm(across)
        axis = across / sine if sine > 0 else np.array([1.0, 0.0])
        tilts.append(np.degrees(np.arcsin(min(sine, 1.0))))
        sigmas.append(np.degrees(np.sqrt(axis @ matrix[first : first + 2, first : first + 2] @ axis)))
    if all(tilt < TILT_SIGNIFICANCE * sigma or tilt < 0.05 for tilt, sigma in zip(tilts, sigmas, strict=True)):
        raise CalibrationError(
            f"all planes are seen from straight ahead (tilts up to {max(tilts):.2g} deg, not distinguishable from 0): "
            "f and T_z trade off and are not determined; tilt the board by about 30 deg"
        )
    return max(tilts)


def _is_suspect(fit, tilt):
    """Whether the information about f must be tested: the tilt is small, or each view has little information."""
    relative = np.sqrt(fit.classical_covariance.iloc[0, 0]) / fit.state.shared[0]
    return tilt < SMALL_TILT or relative * np.sqrt(len(fit.state.rotations)) > LITTLE_WORTH


def _demand_signal(fit):
    """The share of the information about f that noise makes; refused if it is large."""
    share = _noise_share(fit)
    if share > REFUSED_SHARE:
        raise CalibrationError(
            f"f is not determined: {100 * min(share, 1):.0f} % of the views' information about it comes from noise, as "
            "with planes seen from nearly straight ahead or tilted about one axis; f and T_z trade off; tilt the board "
            "by about 30 deg in several directions"
        )
    return share


def _noise_share(fit):
    r"""The share of the information about f that the noise of the poses makes.

    The information S is a function of the estimated poses, which differ from the true ones by noise of covariance
    :math:`s^2 C_v^{-1}`.  On average this noise adds to S

    .. math:: \Delta S = \frac{1}{2} \sum_k (S(+c_k) + S(-c_k) - 2 S)

    where S is taken at poses moved by the columns c_k of the root of this covariance.  The information about f alone
    is :math:`u^T S u` along :math:`u = S^{-1} e_1`, so the share is :math:`u^T \Delta S u / u^T S u`.
    """
    try:
        root = np.linalg.cholesky(np.linalg.inv(fit.equations.c) * fit.own_variance)
    except np.linalg.LinAlgError:  # the points do not determine a pose numerically
        return np.inf
    information = fit.equations.eliminated()[0]
    added = np.zeros_like(information)
    for column in np.concatenate([root, -root], axis=2).transpose(2, 0, 1):
        evaluated = evaluate(fit.model, fit.views, fit.state.moved(0.0, column[:, :3], column[:, 3:]))
        if evaluated is None:
            return np.inf
        equations = Equations.of(*evaluated, fit.views.used).with_prior(fit.model.prior(fit.state.shared))
        added += (equations.eliminated()[0] - information) / 2
    k = len(information)
    direction = fit.classical_covariance.iloc[:k, 0].to_numpy()
    return float(direction @ added @ direction / (direction @ information @ direction))


def _demand_ends(fit):
    """Refuse a fit if a search finds another f that explains the points nearly as well, or better.

    Half and twice the f detect a valley that is nearly level.  The other factors detect a second valley: with f_x and
    f_y, boards with little tilt can also be explained as tilted boards seen by a camera with another pixel pitch.
    """
    best = float(np.sum(fit.weights[:, :, None] * evaluate(fit.model, fit.views, fit.state)[0] ** 2))
    value, unit = fit.state.shared[0], fit.model.unit
    for other in np.multiply(OTHER_FACTORS, value):
        rise = (_least_cost(fit, other) - best) / fit.own_variance
        if rise < LEAST_RISE:
            raise CalibrationError(
                f"f is not determined: {other:.4g} {unit} explains the points nearly as well as {value:.4g} {unit}, or "
                f"better (the sum of squares grows by {rise:.2g} variances); f and T_z trade off; tilt the board by "
                "about 30 deg in several directions"
            )


def _least_cost(fit, focal_length):
    """The least sum of squares that a search with a given f finds; infinite if a point has no image at its start."""
    model, state = _with_focal_length(fit, focal_length, fit.state)
    if evaluate(model, fit.views, state) is None:
        return np.inf
    return descend(model, fit.views, state, fit.weights)[1].cost
