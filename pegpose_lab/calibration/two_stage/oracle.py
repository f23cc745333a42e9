"""The optimum in the box of Eq. 5, which is the best that stage 2 can find, by ever narrower scans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...camera import Sensor, TsaiCamera
from ...checks import CalibrationError, as_number, undetermined_if_singular
from ..result import Calibration
from .genes import BOX, _Genes
from .objective import PENALTY, TwoStageObjective
from .stages import calibrate_tsai, calibration_at

SCANNED, SCANNED_F = 401, 41
"""Number of T_z values across the box with which `optimum_in_box` starts, and of f values for each of them."""

STARTS = 3
NARROWED = 9
"""Number of points of each later scan; it is a quarter as wide as the one before."""

COARSE, FINE = 8, 25
"""Numbers of narrower scans: to find the valleys to 1e-6 of the box, and to end at the last digits."""


@undetermined_if_singular()
def optimum_in_box(
    object_points: ArrayLike, image_points: ArrayLike, camera: Sensor | TsaiCamera, *, box: float = BOX
) -> Calibration:
    r"""The smallest Eq. 7 in the box of Eq. 5, found without randomness.  The genetic algorithm is judged by it.

    The search has two unknowns, but it can be reduced to a search over T_z alone, of

    .. math:: g(T_z) = \min_{f_{low} \le f \le f_{high}} E(f, T_z),

    which follows the floor of a valley, however oblique and narrow it is, and the edge of the box where the valley
    leaves the box.  For a given T_z the undistorted problem is linear in f and kappa1, and E has one minimum.  It lies
    between the neighbours of the best of `SCANNED_F` values, and ever narrower scans find it.  g is scanned at
    `SCANNED` values of T_z, and its `STARTS` deepest valleys are narrowed in the same way, to the last digits.

    Parameters
    ----------
    object_points, image_points, camera, box
        As for `calibrate_genetic`.

    Returns
    -------
    Calibration
        With flags if the optimum lies on the edge of its box.

    Raises
    ------
    ValueError, CalibrationError
        As for `calibrate_genetic`.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, optimum_in_box
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard(4, 3, 60.0).object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> found = optimum_in_box(board, image, sensor)
    >>> round(found.camera.focal_length, 2), round(found.mean_distance, 3)
    (8.0, 0.0)
    """
    box = as_number(box, "box", 0, 1, exclusive=True)
    linear = calibrate_tsai(object_points, image_points, camera)
    objective = TwoStageObjective(object_points, image_points, linear)
    coding = _Genes("printed", linear, objective.c2, box)
    f_range = coding.lower[0], coding.upper[0]
    t_z = np.linspace(coding.lower[1], coding.upper[1], SCANNED)
    values = _valley_floor(objective, t_z, f_range, COARSE)[1]
    if values.min() >= PENALTY:
        raise CalibrationError("no chromosome in the box sees all points; check the points and stage 1")
    padded = np.pad(values, 1, constant_values=np.inf)
    valleys = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    starts = valleys[np.argsort(values[valleys])][:STARTS]
    low, high = t_z[np.maximum(starts - 1, 0)], t_z[np.minimum(starts + 1, SCANNED - 1)]
    found, values = _narrow(lambda t: _valley_floor(objective, t, f_range, FINE)[1], low, high, NARROWED, FINE)
    t_z = found[values.argmin()]
    best = np.array([_valley_floor(objective, t_z, f_range, FINE)[0], t_z])
    kappa1 = objective.kappa1(best[None]).item()
    optimum = calibration_at(linear, best, kappa1, objective.residuals(best[None])[0])
    return replace(optimum, flags=linear.flags + coding.flags(best))


def _valley_floor(objective, t_z, f_range, scans):
    """For each T_z (any shape): the f in its range, ends included, with the smallest Eq. 7, and that value, px."""
    shape, t_z = np.shape(t_z), np.ravel(t_z)

    def at(f):
        chromosomes = np.stack([f, np.broadcast_to(t_z[:, None], f.shape)], axis=-1)
        return objective(chromosomes.reshape(-1, 2)).reshape(f.shape)

    f, values = _narrow(at, *(np.full(len(t_z), end) for end in f_range), SCANNED_F, scans)
    return f.reshape(shape), values.reshape(shape)


def _narrow(function, low, high, points, scans):
    """The minimum of a function of (n, k) between low (n,) and high (n,), both included: its place and value, (n,)."""
    for count in (points, *[NARROWED] * scans):
        places = np.linspace(low, high, count, axis=1)
        values = function(places)
        best = values.argmin(axis=1)[:, None]
        low, high = (np.take_along_axis(places, np.clip(best + k, 0, count - 1), 1)[:, 0] for k in (-1, 1))
    return np.take_along_axis(places, best, 1)[:, 0], np.take_along_axis(values, best, 1)[:, 0]
