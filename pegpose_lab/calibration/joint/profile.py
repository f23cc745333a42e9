"""The profile likelihood of f, and the direction that the views determine least."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtri

from ...camera import Sensor, TsaiCamera, as_sensor
from ...checks import as_choice, as_number, as_views, undetermined_if_singular
from ..result import MINIMUM_POINTS, Calibration, pose_names
from .bundle import minimise
from .covariance import in_words
from .fitting import fit_views
from .judge import _demand_signal, _demand_tilt, _with_focal_length
from .models import lens_model
from .starts import demand_views

PROFILED, PROFILE_STEP = 20.0, 0.05
"""The profile is followed up to this factor from the best f, in these steps of ln f."""


@undetermined_if_singular()
def profile_focal_length(
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    camera: Sensor | TsaiCamera,
    *,
    principal_point: str = "free",
    level: float = 0.95,
) -> tuple[float, float]:
    r"""The interval of f by its profile likelihood: all values of f that explain the views nearly as well as the best.

    For each f the sum of squares is minimised over all other parameters.  f belongs to the interval while

    .. math:: SSE(f) \le SSE_{min} + r\, s^2 F_{level}(1, \nu)

    with the variance s^2 of a coordinate, r = 1 and the degrees of freedom :math:`\nu` of s^2.  If the errors of a
    view's points are not independent (`clustered`), r is the stated variance of f over the classical one, and
    :math:`\nu` that of the stated sigmas (L. Pace, A. Salvan and N. Sartori, Statistica Sinica 21, 129-148, 2011).
    Unlike +-1.96 sigma the interval need not be symmetric, and it is correct also if f trades off with T_z along a
    curve.  Like the sigmas it is valid if the lens follows the model.

    Parameters
    ----------
    object_points, image_points, camera, principal_point
        As for `calibrate_joint`; one view is enough.
    level : float
        Between 0 and 1.

    Returns
    -------
    low, high : float
        mm; 0 or infinity if the interval does not end within a factor `PROFILED` of the best f.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        As for `calibrate_joint`, except that a wide interval is no error.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, profile_focal_length
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001)
    >>> board, turns = Checkerboard().object_points, Rotation.from_rotvec(0.5 * np.eye(3))
    >>> poses = [RigidTransform.from_components([-90, -70, 500], turn) for turn in turns]
    >>> images = [camera.project(board, pose) for pose in poses]
    >>> images = images + 0.1 * np.random.default_rng(0).standard_normal(np.shape(images))
    >>> low, high = profile_focal_length([board] * 3, images, camera.sensor)
    >>> round(low, 2), round(high, 2), low < 8 < high
    (7.99, 8.06, True)
    """
    level = as_number(level, "level", 0, 1, exclusive=True)
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    sensor = as_sensor(camera)
    as_choice(principal_point, "principal_point", ("free", "fixed"))
    demand_views(object_points, image_points, sensor.image_size)
    fit = fit_views(lens_model(sensor, principal_point == "free", False, None), object_points, image_points)
    _demand_tilt(fit, object_points)
    _demand_signal(fit)
    wider = fit.covariance.iloc[0, 0] / fit.classical_covariance.iloc[0, 0]
    limit = fit.equations.cost + wider * fit.variance * fdtri(1, fit.sigma_freedom, level)
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
    """The smallest sum of squares with a given f, and its state, found from the state of a nearby f."""
    model, state = _with_focal_length(fit, focal_length, near)
    state, equations = minimise(model, fit.views, state, fit.weights)
    return equations.cost, replace(state, shared=np.array([focal_length, *state.shared]))


def _crossing(fit, state, outside, limit):
    """The f at which the smallest sum of squares crosses the limit, by bisection in ln f between a state's f and
    `outside`."""
    while abs(np.log(outside / state.shared[0])) > 1e-5:
        middle = np.sqrt(state.shared[0] * outside)
        cost, found = _profile(fit, middle, state)
        if cost > limit:
            outside = middle
        else:
            state = found
    return float(np.sqrt(state.shared[0] * outside))


@undetermined_if_singular()
def weakest_direction(calibration: Calibration) -> tuple[float, str]:
    """The combination of the camera's parameters and T_z that the views determine least, by the stated covariance.

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
        The parameters, for instance "focal_length and T_z trade off".

    Raises
    ------
    ValueError
        If the calibration has no covariance.
    CalibrationError
        If its covariance is singular.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_joint, weakest_direction
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001)
    >>> board, turns = Checkerboard().object_points, Rotation.from_rotvec(0.5 * np.eye(3))
    >>> poses = [RigidTransform.from_components([-90, -70, 500], turn) for turn in turns]
    >>> images = [camera.project(board, pose) for pose in poses]
    >>> images = images + 0.1 * np.random.default_rng(0).standard_normal(np.shape(images))
    >>> eigenvalue, words = weakest_direction(calibrate_joint([board] * 3, images, camera.sensor))
    >>> round(eigenvalue, 3), words
    (0.001, 'focal_length and T_z trade off')
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
