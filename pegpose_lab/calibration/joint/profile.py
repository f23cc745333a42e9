"""The profile likelihood of f, and the direction in which the views know least."""

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
"""How far from the best f its profile is followed, as a factor, and in which steps of ln f."""


@undetermined_if_singular()
def profile_focal_length(
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    camera: Sensor | TsaiCamera,
    *,
    principal_point: str = "free",
    level: float = 0.95,
) -> tuple[float, float]:
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

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, profile_focal_length
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001), Checkerboard().object_points
    >>> poses = [RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec(turn)) for turn in 0.5 * np.eye(3)]
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


def weakest_direction(calibration: Calibration) -> tuple[float, str]:
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

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_joint, weakest_direction
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001), Checkerboard().object_points
    >>> poses = [RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec(turn)) for turn in 0.5 * np.eye(3)]
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
