"""Repeated linear calibrations (stage 1) of simulated views: how far corner noise spreads f and T_z."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.transform import RigidTransform, Rotation

from ..calibration import solve_coplanar, solve_images
from ..checks import CalibrationError, as_count, as_number
from ..paper import paper_experiment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

    from ..camera import Sensor, TsaiCamera

FEWEST = 20
"""Solutions at one tilt; from fewer no standard deviation is stated."""


def noisy_solutions(
    object_points: ArrayLike,
    image_points: ArrayLike,
    camera: Sensor | TsaiCamera,
    noise: float,
    *,
    trials: int = 100,
    seed: Sequence[int] = (0,),
) -> NDArray[np.float64]:
    """Solve a view of a board many times by stage 1, each time with new normal noise in its corners.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, with z = 0; see `solve_images`.
    image_points : (n, 2) array_like
        px, without noise.
    camera : Sensor or TsaiCamera
        What stage 1 assumes.
    noise : float
        Standard deviation per axis, px.
    trials : int
    seed : sequence of int
        Each trial has a generator of its own, seeded by this and its number.

    Returns
    -------
    (trials, 3) ndarray
        f and T_z, mm, and the mean distance of Eq. 7, px.

    Raises
    ------
    ValueError
        If an argument is unusable.
    CalibrationError
        If a trial has no solution with the whole board in front of the camera.

    Examples
    --------
    >>> from pegpose_lab import paper, study
    >>> truth = paper.paper_experiment()
    >>> points, pose = truth.board.object_points, truth.cam_from_boards[1]
    >>> exact = truth.camera.project(points, pose)
    >>> study.noisy_solutions(points, exact, truth.camera, 0.1, trials=4).shape
    (4, 3)
    """
    noise, trials = as_number(noise, "noise", 0), as_count(trials, "trials", 1)
    exact = np.asarray(image_points, np.float64)
    draws = [np.random.default_rng([*seed, trial]).standard_normal(exact.shape) for trial in range(trials)]
    return np.transpose(solve_images(object_points, exact + noise * np.array(draws), camera))


def tilt_trials(tilts: Sequence[float], *, noise: float = 0.1, trials: int = 100, seed: int = 0) -> DataFrame:
    """Solve views of the paper's board by stage 1 at several tilts: how often it refuses, how far f scatters.

    The board is tilted about the camera's x axis, where view 1 of the experiment has it; the lens has no distortion.

    Parameters
    ----------
    tilts : sequence of float
        Degrees.
    noise : float
        Standard deviation per axis, px.
    trials : int
        At each tilt.
    seed : int

    Returns
    -------
    DataFrame
        tilt (deg); refused (%), the share of trials; sd of f (%), of the true f; predicted (%), the median of the standard
        deviations that stage 1 states.  The last two are NaN where fewer than `FEWEST` trials were solved.

    Raises
    ------
    ValueError
        If an argument is unusable.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> study.tilt_trials([0.5, 30.0], trials=25)["refused (%)"].tolist()
    [100.0, 0.0]
    """
    noise, trials = as_number(noise, "noise", 0), as_count(trials, "trials", 2)
    rows = []
    for number, tilt in enumerate(tilts):
        found = _at_tilt(as_number(tilt, "tilts", 0, 90), noise, [[seed, number, trial] for trial in range(trials)])
        known = len(found) >= FEWEST
        shares = (found[:, 0].std(ddof=1), np.median(found[:, 1])) if known else (np.nan, np.nan)
        rows.append([tilt, 100 * (1 - len(found) / trials), *shares])
    return pd.DataFrame(rows, columns=["tilt (deg)", "refused (%)", "sd of f (%)", "predicted (%)"])


def _at_tilt(tilt, noise, seeds):
    """f and its stated standard deviation (k, 2), % of the true f, of the trials that are not refused."""
    truth = paper_experiment()
    points, pinhole = truth.board.object_points, replace(truth.camera, kappa1=0.0)
    turn = Rotation.from_euler("x", tilt, degrees=True)
    middle = truth.cam_from_boards[0].apply(points).mean(axis=0)
    exact = pinhole.project(points, RigidTransform.from_components(middle - turn.apply(truth.board.center), turn))
    found = []
    for seed in seeds:
        seen = exact + noise * np.random.default_rng(seed).standard_normal(exact.shape)
        try:
            solution = solve_coplanar(points, pinhole.to_sensor(seen))
        except CalibrationError:
            continue
        found.append((solution.focal_length, solution.focal_length_sigma))
    return 100 * np.reshape(found, (-1, 2)) / pinhole.focal_length
