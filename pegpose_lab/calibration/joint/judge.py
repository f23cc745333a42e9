"""Whether the views determine f: flags, and the errors where they do not."""

import numpy as np

from ...checks import CalibrationError, Flag
from ..planes import relief
from ..result import judge_focal_length, judge_principal_point
from ..two_stage.tsai import SMALL_TILT, TILT_SIGNIFICANCE
from .bundle import Equations, descend
from .models import GivenFocalLength
from .starts import plane_rotations
from .views import State, evaluate

LITTLE_WORTH = 0.05
"""Relative sigma of f times the root of the number of views, above which the information about f is put to the test."""

FLAGGED_SHARE, REFUSED_SHARE = 0.03, 0.1
"""Parts of the information about f that the noise makes, from which it is flagged and refused."""

LEAST_RELIEF = 2e-3
"""Relief of points (see `planes.relief`) from which f does not rest on the tilt alone; on less it could not."""

LEAST_RISE = 25.0
"""Variances by which the sum of squares must grow when f is changed by one of `OTHER_FACTORS`."""

OTHER_FACTORS = (1 / 2, 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64)
"""Most are below 1: noise on little tilt makes f too large, up to a hundred times."""


def _with_focal_length(fit, focal_length, near):
    """The model with a given f (or f_x), and the state of a near f with the depths changed as f is."""
    depth = focal_length / near.shared[0]
    state = State(near.shared[1:], near.rotations, near.positions * [1, 1, depth])
    return GivenFocalLength(fit.model, focal_length), state


def _judge(fit, object_points):
    """Flags; `CalibrationError` if f is not determined."""
    largest = _demand_tilt(fit, object_points)
    value, name, unit = fit.state.shared[0], fit.model.names[0], fit.model.unit
    flags = judge_focal_length(fit.covariance, name, value, unit, fit.freedom)
    flags += judge_principal_point(fit.covariance, fit.model.sensor.image_size, fit.freedom)
    if _is_suspect(fit, largest):
        share = _demand_signal(fit)
        _demand_ends(fit)
        if share > FLAGGED_SHARE:
            text = (
                f"The noise makes {100 * share:.0f} % of what the views seem to know of f: its sigma is too small; "
                "tilt the board by about 30 deg."
            )
            flags += (Flag("noisy-focal-length", text),)
    if largest < SMALL_TILT:
        sigma = np.sqrt(fit.covariance.loc[name, name])
        text = (
            f"The boards are tilted by {largest:.1f} deg at most, and f ({value:.5g} +- {sigma:.2g} {unit}) rests on "
            "that: it trades off with T_z; tilt them by about 30 deg."
        )
        flags += (Flag("little-tilt", text),)
    return flags


def _demand_tilt(fit, object_points):
    """The largest tilt of planes, deg (90 of other objects); refused if none is more than its own sigma explains."""
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
    """Whether the information about f must be tested: little tilt, or little information in each view."""
    relative = np.sqrt(fit.covariance.iloc[0, 0]) / fit.state.shared[0]
    return tilt < SMALL_TILT or relative * np.sqrt(len(fit.state.rotations)) > LITTLE_WORTH


def _demand_signal(fit):
    """The share of the information about f that the noise makes; refused if it is large."""
    share = _noise_share(fit)
    if share > REFUSED_SHARE:
        raise CalibrationError(
            f"f is not determined: {100 * min(share, 1):.0f} % of what the views seem to know of it is the points' "
            "noise, as with planes seen from nearly straight ahead or tilted about one axis; f and T_z trade off; tilt "
            "the board by about 30 deg in several directions"
        )
    return share


def _noise_share(fit):
    r"""The share of the information about f that the noise of the poses makes.

    The information S is a function of the estimated poses, and they differ from the true ones by noise of covariance
    :math:`s^2 C_v^{-1}`.  On average that adds to S

    .. math:: \Delta S = \frac{1}{2} \sum_k (S(+c_k) + S(-c_k) - 2 S)

    with S taken at poses moved by the columns c_k of the root of this covariance.  Of the information about f alone,
    which is :math:`u^T S u` along :math:`u = S^{-1} e_1`, the share is :math:`u^T \Delta S u / u^T S u`.
    """
    try:
        root = np.linalg.cholesky(np.linalg.inv(fit.equations.c) * fit.variance)
    except np.linalg.LinAlgError:  # a pose that the points do not determine, to the last digits
        return np.inf
    information = fit.equations.eliminated()[0]
    added = np.zeros_like(information)
    for column in np.concatenate([root, -root], axis=2).transpose(2, 0, 1):
        evaluated = evaluate(fit.model, fit.views, fit.state.moved(0.0, column[:, :3], column[:, 3:]))
        if evaluated is None:
            return np.inf
        added += (Equations.of(*evaluated, fit.views.used).eliminated()[0] - information) / 2
    k = len(information)
    direction = fit.covariance.iloc[:k, 0].to_numpy()
    return float(direction @ added @ direction / (direction @ information @ direction))


def _demand_ends(fit):
    """Refuse a fit if another f explains the points nearly as well, or better (as far as the search comes).

    Half and twice are for a valley that is nearly level; the others for a valley of its own, as there is with f_x and
    f_y if boards with little tilt are taken for tilted ones of a camera with pixels that are not as stated.
    """
    best = float(np.sum(fit.weights[:, :, None] * evaluate(fit.model, fit.views, fit.state)[0] ** 2))
    value, unit = fit.state.shared[0], fit.model.unit
    for other in np.multiply(OTHER_FACTORS, value):
        rise = (_least_cost(fit, other) - best) / fit.variance
        if rise < LEAST_RISE:
            raise CalibrationError(
                f"f is not determined: {other:.4g} {unit} explains the points nearly as well as {value:.4g} {unit}, or "
                f"better (the sum of squares grows by {rise:.2g} variances); f and T_z trade off; tilt the board by "
                "about 30 deg in several directions"
            )


def _least_cost(fit, focal_length):
    """The sum of squares that a search with a given f comes to; infinite if not all points can be seen with it."""
    model, state = _with_focal_length(fit, focal_length, fit.state)
    if evaluate(model, fit.views, state) is None:
        return np.inf
    return descend(model, fit.views, state, fit.weights)[1].cost
