"""Other methods compared with the genetic algorithm, on the same corners and by the same measures."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.optimize import differential_evolution, least_squares, minimize

from ..calibration import (
    BOX,
    CALIBRATION_METHODS,
    Calibration,
    TwoStageObjective,
    calibrate_dlt,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    calibration_at,
)
from ..checks import CalibrationError
from .ga_success import PRINTED
from .held_out import held_out_distances, leave_one_out

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike
    from pandas import DataFrame

    from ..camera import TsaiCamera

GENETIC, DIFFERENTIAL_EVOLUTION = CALIBRATION_METHODS["genetic"].label, "differential evolution"
PARTICLES, PARTICLE_STEPS = 30, 100
INERTIA, PULL = 0.7298, 1.49618  # Clerc and Kennedy's constriction


# --- rivals ------------------------------------------------------------------------------------------------


def compare(
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    camera: TsaiCamera,
    *,
    truth: tuple[float, float] | None = None,
    rng: int = 0,
) -> DataFrame:
    """Calibrate with every method and compare all by the same measures.

    The single-view methods get view 1 and the principal point of `camera`; Zhang's and the joint one get all views.

    Parameters
    ----------
    object_points, image_points : sequences of (n, 3) and (n, 2) array_like
        mm and px, an entry a view, planar; at least three views.
    camera : TsaiCamera
        As for `calibrate_genetic`.
    truth : (float, float), optional
        f (mm) and the depth of the middle of view 1 (mm).
    rng : seed
        Of the methods that draw.

    Returns
    -------
    DataFrame
        A row for each method: E (Eq. 7), rms, sd_x and sd_y (px) on view 1; f (mm); f_error (%) and T_z_error (mm) if the
        truth is given; held_out (px), the mean E of views 2, 3, ... when only their pose is fitted through a
        camera that has not seen them: that of view 1, or, of the methods for all views, that of all views but the
        one judged; evaluations of the objective (NaN where there is no such thing); ms of processor time, stage 1
        included where the method starts from it.  All numbers of a method that refuses the views (`CalibrationError`) are
        NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, study
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001)
    >>> board, turns = Checkerboard(4, 3, 60.0).object_points, Rotation.from_rotvec(0.5 * np.eye(3))
    >>> poses = [RigidTransform.from_components([-90, -70, 500], turn) for turn in turns]
    >>> table = study.compare([board] * 3, [camera.project(board, pose) for pose in poses], camera)
    >>> table.set_index("method")["f"][["linear only", "joint"]].round(1).to_dict()
    {'linear only': 8.1, 'joint': 8.0}
    """
    views, rows = list(zip(object_points, image_points, strict=True)), []
    for name, (method, shared) in _RIVALS.items():
        start = time.process_time()
        try:
            found, evaluations = method(views, camera) if shared else search(name, *views[0], camera, rng)
        except CalibrationError:
            rows.append((name, *[np.nan] * 10))
            continue
        ms = 1e3 * (time.process_time() - start)
        measures = _measures(found, views, truth, camera.pixel_pitch[0])
        rows.append((name, *measures, _held_out(found, method, shared, views, camera), evaluations, ms))
    columns = ["method", "E", "rms", "sd_x", "sd_y", "f", "f_error", "T_z_error", "held_out", "evaluations", "ms"]
    return pd.DataFrame(rows, columns=columns)


def search(
    name: str,
    object_points: ArrayLike,
    image_points: ArrayLike,
    camera: TsaiCamera,
    rng: int | Sequence[int] | np.random.Generator | None,
) -> tuple[Calibration, float]:
    """Calibrate one view by one of the single-view methods of `compare`.

    Returns
    -------
    Calibration, int or NaN
        And the evaluations of the objective.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> name, *view = study.trial_sets()[0]
    >>> found, evaluations = search("Nelder-Mead", *view, rng=0)
    >>> bool(found.mean_distance < 0.1), evaluations > 0
    (True, True)
    """
    method, _ = _RIVALS[name]
    return method(_Setting(object_points, image_points, camera, rng))


class _Setting:
    """One view, and what its methods start from: stage 1 and Eq. 7 over the box, computed on first use."""

    def __init__(self, object_points, image_points, camera, rng):
        self.view, self.rng = (object_points, image_points, camera), rng

    @cached_property
    def linear(self):
        return calibrate_tsai(*self.view)

    @cached_property
    def objective(self):
        return TwoStageObjective(*self.view[:2], self.linear)

    @cached_property
    def centre(self):
        """f and T_z of stage 1, mm."""
        return np.array([self.linear.camera.focal_length, self.linear.cam_from_object[0].translation[2]])

    @cached_property
    def bounds(self):
        """Of f and of T_z, (2, 2), mm."""
        return np.column_stack([(1 - BOX) * self.centre, (1 + BOX) * self.centre])

    def result(self, chromosome, kappa1=None):
        """The calibration with (f, T_z); kappa1 by Eq. 6 if it is not given."""
        kappa1 = self.objective.kappa1(chromosome[None]).item() if kappa1 is None else kappa1
        found = calibration_at(self.linear, chromosome, kappa1)
        residuals = found.camera.project(self.view[0], found.cam_from_object[0]) - self.view[1]
        return replace(found, residuals=[residuals])


def _genetic(setting, **options):
    found = calibrate_genetic(*setting.view, rng=setting.rng, **options)
    return found, found.history["evaluations"].iloc[-1]


def _differential_evolution(setting):
    found = differential_evolution(
        lambda x: setting.objective(x.T),
        setting.bounds,
        rng=setting.rng,
        vectorized=True,
        updating="deferred",
        polish=False,
        tol=1e-10,
        maxiter=300,
    )
    return setting.result(found.x), len(found.population) * (found.nit + 1)


def _particle_swarm(setting):
    """Particle swarm with constriction: each particle is attracted to its own best place and to that of the swarm."""
    rng = np.random.default_rng(setting.rng)
    low, high = setting.bounds.T
    places, speeds = rng.uniform(low, high, (PARTICLES, 2)), np.zeros((PARTICLES, 2))
    best, values = places.copy(), setting.objective(places)
    for _ in range(PARTICLE_STEPS):
        own, common = rng.random((2, PARTICLES, 2))
        speeds = INERTIA * speeds + PULL * (own * (best - places) + common * (best[values.argmin()] - places))
        places = np.clip(places + speeds, low, high)
        found = setting.objective(places)
        better = found < values
        best[better], values[better] = places[better], found[better]
    return setting.result(best[values.argmin()]), PARTICLES * (PARTICLE_STEPS + 1)


def _nelder_mead(setting):
    found = minimize(
        lambda x: setting.objective(x[None])[0],
        setting.centre,
        method="Nelder-Mead",
        bounds=setting.bounds,
        options={"xatol": 1e-9, "fatol": 1e-12, "maxfev": 4000},
    )
    return setting.result(found.x), found.nfev


def _three_parameters(setting):
    """Least squares of the signed residuals over f, T_z and kappa1, R, T_x and T_y held at stage 1."""
    start = np.array([*setting.centre, 0.0])
    scale = np.array([*setting.centre, 1 / setting.objective.squared_radius.max()])

    def residuals(x):
        try:
            return setting.result(x[:2] * scale[:2], x[2] * scale[2]).residuals[0].ravel()
        except ValueError:  # behind the camera, or outside the range of Eq. 3
            return np.full(2 * len(setting.view[0]), 1e6)

    found = least_squares(residuals, start / scale, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return setting.result(found.x[:2] * scale[:2], found.x[2] * scale[2]), found.nfev


def _all_of_one_view(setting):
    object_points, image_points, camera = setting.view
    return calibrate_joint([object_points], [image_points], camera, principal_point="fixed"), np.nan


def _direct_linear_transform(setting):
    return calibrate_dlt(*setting.view), np.nan


def _of_table(name):
    """A method of `calibration.CALIBRATION_METHODS`, and whether it is for all views."""
    calibrate = CALIBRATION_METHODS[name]

    def of_one(setting):
        object_points, image_points, camera = setting.view
        return calibrate([object_points], [image_points], camera, setting.rng), np.nan

    def of_all(views, camera):
        return calibrate(*map(list, zip(*views, strict=True)), camera), np.nan

    return (of_all if calibrate.all_views else of_one), calibrate.all_views


_RIVALS = {  # name: (method, whether it is for all views)
    CALIBRATION_METHODS["tsai"].label: (lambda setting: (setting.linear, np.nan), False),
    "GA as printed": (lambda setting: _genetic(setting, initialisation="equal", **PRINTED), False),
    "GA corrected": (lambda setting: _genetic(setting, genes="printed"), False),
    GENETIC: (_genetic, False),
    DIFFERENTIAL_EVOLUTION: (_differential_evolution, False),
    "particle swarm": (_particle_swarm, False),
    "Nelder-Mead": (_nelder_mead, False),
    "least squares of f, T_z, k1": (_three_parameters, False),
    "least squares of one view": (_all_of_one_view, False),
    "direct linear transform": (_direct_linear_transform, False),
}
for _name, _method in CALIBRATION_METHODS.items():  # the rest of the package's own table
    _RIVALS.setdefault(_method.label, _of_table(_name))


def _measures(found, views, truth, pitch):
    """E, rms and standard deviations on view 1, f (mm), and its error and that of the depth."""
    residuals = found.residuals[0]
    alone = Calibration(found.camera, found.cam_from_object[:1], [residuals])
    parameters = found.camera.parameters
    f = parameters["focal_length"] if "focal_length" in parameters else parameters["f_x"] * pitch
    errors = np.nan, np.nan
    if truth is not None:
        middle = found.cam_from_object[0].apply(views[0][0].mean(axis=0))[2]
        errors = 100 * (f / truth[0] - 1), middle - truth[1]
    return alone.mean_distance, alone.rms, *alone.axis_std, f, *errors


def _held_out(found, method, shared, views, camera):
    """Mean E of views 2, 3, ... with cameras that were calibrated without them."""
    if not shared:
        return np.mean([_unseen_error(found.camera, *view) for view in views[1:]])
    left_out = leave_one_out(
        lambda *others: method(list(zip(*others, strict=True)), camera)[0], *zip(*views, strict=True)
    )
    return left_out["mean_distance"].iloc[1:].mean()


def _unseen_error(camera, object_points, image_points):
    """E of one view when only its pose is fitted; NaN if the camera gives it no pose."""
    try:
        return float(held_out_distances(camera, object_points, image_points).mean())
    except (CalibrationError, ValueError):
        return np.nan
