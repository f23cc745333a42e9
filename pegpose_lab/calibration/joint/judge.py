"""Whether the views determine f: flags, and the errors where they do not."""

from dataclasses import replace

import numpy as np
from scipy.special import fdtri

from ...camera import demand_tsai
from ...checks import CalibrationError, as_choice, as_number, as_views, undetermined_if_singular
from ..planes import is_planar, relief
from ..result import (
    MINIMUM_POINTS,
    Calibration,
    judge_focal_length,
    judge_image_size,
    judge_principal_point,
    pose_names,
)
from ..two_stage.tsai import SMALL_TILT, TILT_SIGNIFICANCE
from .bundle import Equations, State, Views, descend, evaluate, in_words, minimise
from .fitting import fit_views
from .misfit import judge_misfit, views_in_doubt
from .models import GivenFocalLength, lens_model
from .starts import demand_views, focal_length_of, homographies_of, plane_rotations, poses_of

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

PROFILED, PROFILE_STEP = 20.0, 0.05
"""How far from the best f its profile is followed, as a factor, and in which steps of ln f."""


@undetermined_if_singular()
def calibrate_joint(
    object_points, image_points, camera, *, principal_point="free", focal="one", coefficients=None, loss="linear"
):
    r"""Least squares of all views at once, with the paper's camera model (Eq. 3) or OpenCV's.

    Minimises the sum of the squared signed x and y residuals (not of Eq. 7's distances, whose derivative
    jumps at zero) over the camera's parameters and the pose of each view, by Levenberg and Marquardt's method
    with exact derivatives.  It starts at the f of the views' homographies, or at the view whose linear solution
    (stage 1) has the smallest relative sigma of f.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry a view.
    image_points : sequence of (n, 2) array_like
        px.
    camera : TsaiCamera
        Gives pixel pitch, image size, scale_x and the principal point to start from (or to keep).
    principal_point : {"free", "fixed"}
        Whether it is estimated.
    focal : {"one", "two"}
        One f; or two, f_x and f_y in px.  With the paper's model the second is scale_x, Tsai's uncertainty factor.
    coefficients : sequence of str, optional
        None: the paper's model, with kappa1.  Else OpenCV's distorting model with these of `COEFFICIENTS` free and
        the others zero, none of them for a camera without distortion; the result is an `OpenCVCamera`.
    loss : {"linear", "huber", "cauchy"}
        What a point's distance costs.  The two robust losses bend at `HUBER` and `CAUCHY` standard deviations (by
        the median of the distances), so that single wrong corners hardly count.

    Returns
    -------
    Calibration
        With `covariance` of all parameters: ``focal_length`` (mm), ``scale_x``, ``kappa1``, ``c_x``, ``c_y`` as far as
        they are free, or ``f_x``, ``f_y`` (or ``f_x`` for both), ``c_x``, ``c_y`` and the coefficients; and for
        view v ``rx_v, ry_v, rz_v, tx_v, ty_v, tz_v``.  A robust loss's is that of M-estimation (`_robust_variance`).
        Its sigmas, and intervals made of them, hold on two conditions: the lens is of the fitted model, and the
        noise is independent and alike at all points.  `flags` say it when the residuals speak for a richer model or
        against a view (`misfit`; correlated noise and bent boards are not seen), when planes are tilted by less than
        `SMALL_TILT`, or f or the principal point is hardly known.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If the views do not determine f, as when all are fronto-parallel as far as the noise can tell, or not all
        parameters together, or no minimum is found.
    """
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    demand_tsai(camera)
    as_choice(principal_point, "principal_point", ("free", "fixed"))
    as_choice(focal, "focal", ("one", "two"))
    as_choice(loss, "loss", ("linear", "huber", "cauchy"))
    model = lens_model(camera, principal_point == "free", focal == "two", coefficients)
    demand_views(object_points, image_points, camera.image_size)
    fit = fit_views(model, object_points, image_points, loss)
    try:
        flags = _judge(fit, object_points)
    except CalibrationError as error:
        doubt = views_in_doubt(fit, object_points, image_points, loss)
        raise CalibrationError(f"{doubt} With all views: {error}" if doubt else str(error)) from error
    found, poses = model.camera(fit.state.shared), fit.state.poses(fit.views)
    flags += judge_image_size(found, image_points) + judge_misfit(fit, object_points, image_points, loss)
    residuals = [
        found.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    return Calibration(found, poses, residuals, flags, covariance=fit.covariance)


@undetermined_if_singular()
def profile_focal_length(object_points, image_points, camera, *, principal_point="free", level=0.95):
    r"""The interval of f by its profile likelihood: all f with which the views can be explained nearly as well.

    For each f the sum of squares is minimised over everything else; f belongs to the interval while

    .. math:: SSE(f) \le SSE_{min} \left(1 + \frac{F_{level}(1, \nu)}{\nu}\right)

    with :math:`\nu` degrees of freedom.  Unlike +-1.96 sigma it need not be symmetric, and is right where f trades
    off with T_z along a curve.  Like sigmas it holds if the lens is of the model and the noise independent and alike:
    the flags of `calibrate_joint` say whether the residuals speak against that.

    Parameters
    ----------
    object_points, image_points, camera, principal_point
        As for `calibrate_joint`; one view will do.
    level : float
        Between 0 and 1.

    Returns
    -------
    low, high : float
        mm.  0 or infinity where the interval does not end within a factor `PROFILED` of the best f.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        As `calibrate_joint`, but not because the interval is wide.
    """
    level = as_number(level, "level", 0, 1, exclusive=True)
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    demand_tsai(camera)
    as_choice(principal_point, "principal_point", ("free", "fixed"))
    demand_views(object_points, image_points, camera.image_size)
    fit = fit_views(lens_model(camera, principal_point == "free", False, None), object_points, image_points)
    _demand_tilt(fit, object_points)
    _demand_signal(fit)
    limit = fit.equations.cost * (1 + fdtri(1, fit.freedom, level) / fit.freedom)
    best, ends = fit.state.shared[0], []
    for direction in (-1, 1):
        state, inside, factor = fit.state, best, np.exp(direction * PROFILE_STEP)
        while True:
            outside = inside * factor
            if not 1 / PROFILED < outside / best < PROFILED:
                ends.append(0.0 if direction < 0 else np.inf)
                break
            cost, found = _profile(fit, outside, state)
            if cost > limit:
                ends.append(_crossing(fit, state, outside, limit))
                break
            state, inside = found, outside
    return tuple(ends)


def _profile(fit, focal_length, near):
    """The smallest sum of squares with a given f, and where it is, found from the state of a near f."""
    model, state = _with_focal_length(fit, focal_length, near)
    state, equations = minimise(model, fit.views, state, fit.weights)
    return equations.cost, replace(state, shared=np.array([focal_length, *state.shared]))


def _with_focal_length(fit, focal_length, near):
    """The model with a given f (or f_x), and the state of a near f with the depths changed as f is."""
    depth = focal_length / near.shared[0]
    state = State(near.shared[1:], near.rotations, near.positions * [1, 1, depth])
    return GivenFocalLength(fit.model, focal_length), state


def _crossing(fit, state, outside, limit):
    """f between a state's and another at which the smallest sum of squares passes the limit, by bisection in ln f."""
    while abs(np.log(outside / state.shared[0])) > 1e-5:
        middle = np.sqrt(state.shared[0] * outside)
        cost, found = _profile(fit, middle, state)
        if cost > limit:
            outside = middle
        else:
            state = found
    return float(np.sqrt(state.shared[0] * outside))


@undetermined_if_singular()
def calibrate_dlt(object_points, image_points, camera):
    """The direct linear transform of one view of a plane: homography, f by Zhang's two constraints, pose.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 5, of one plane.
    image_points : (n, 2) array_like
        px.
    camera : TsaiCamera
        Gives pixel pitch, scale_x, principal point and image size.

    Returns
    -------
    Calibration
        With kappa1 = 0.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If the view does not determine f, or no camera sees the plane so.
    """
    object_points, image_points = as_views([object_points], [image_points], MINIMUM_POINTS)
    demand_tsai(camera)
    if not is_planar(object_points[0]):
        raise ValueError(
            f"object_points leave the plane through them by {100 * relief(object_points[0]):.2g} % of their width; "
            "expected a plane"
        )
    demand_views(object_points, image_points, camera.image_size)
    views, planes = Views.stack(object_points, image_points), plane_rotations(object_points)
    homographies = homographies_of(views, planes, camera)
    focal_length = focal_length_of(homographies)
    if focal_length is None:
        raise CalibrationError("the homography belongs to no camera with this principal point; tilt the board more")
    camera = replace(camera, focal_length=focal_length, kappa1=0.0)
    pose = State(np.zeros(0), *poses_of(homographies, planes, focal_length)).poses(views)[0]
    return Calibration(camera, [pose], [camera.project(object_points[0], pose) - image_points[0]])


def _judge(fit, object_points):
    """Flags in words; `CalibrationError` if f is not determined."""
    largest = _demand_tilt(fit, object_points)
    value, name, unit = fit.state.shared[0], fit.model.names[0], fit.model.unit
    flags = judge_focal_length(fit.covariance, name, value, unit, fit.freedom)
    flags += judge_principal_point(fit.covariance, fit.model.start_camera.image_size, fit.freedom)
    if _is_suspect(fit, largest):
        share = _demand_signal(fit)
        _demand_ends(fit)
        if share > FLAGGED_SHARE:
            flags += (
                f"The noise makes {100 * share:.0f} % of what the views seem to know of f: its sigma is too small; "
                "tilt the board by about 30 deg.",
            )
    if largest < SMALL_TILT:
        sigma = np.sqrt(fit.covariance.loc[name, name])
        flags += (
            f"The boards are tilted by {largest:.1f} deg at most, and f ({value:.5g} +- {sigma:.2g} {unit}) rests on "
            "that: it trades off with T_z; tilt them by about 30 deg.",
        )
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


def weakest_direction(calibration):
    """What the views know least: the combination of the camera's parameters and T_z that has the least information.

    Parameters
    ----------
    calibration : Calibration
        With `covariance`.

    Returns
    -------
    eigenvalue : float
        Smallest eigenvalue of the inverse covariance with its diagonal scaled to 1: 1 if no parameter is confounded
        with another, 0 if some can change together without moving a point.
    words : str
        Which ones, for instance "focal_length and T_z trade off".

    Raises
    ------
    ValueError
        If the calibration has no covariance.
    """
    if calibration.covariance is None:
        raise ValueError("calibration has no covariance; expected one of calibrate_joint or calibrate_zhang")
    poses = pose_names(len(calibration.cam_from_object))
    names = [name for name in calibration.covariance.index if name not in poses]
    kept = names + poses[5::6]
    information = np.linalg.inv(calibration.covariance.loc[kept, kept].to_numpy())
    scale = np.sqrt(np.diagonal(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    shifts = np.zeros((len(poses) // 6, 6))
    shifts[:, 5] = vectors[len(names) :, 0]
    return float(values[0]), in_words(names, vectors[: len(names), 0], shifts)
