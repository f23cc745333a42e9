"""Repeated calibrations of a camera whose truth is known (Monte Carlo)."""

from __future__ import annotations

import csv
import io
import time
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.spatial.transform import RigidTransform, Rotation
from tqdm import tqdm

from .. import paper
from ..calibration import CALIBRATION_METHODS
from ..checks import CalibrationError, DetectionError, as_choice, as_count, as_number
from ..corners import find_corners
from ..files import MEASURED_FOLDER
from ..lab import results
from ..paper import Experiment, paper_camera
from ..render import render_board
from ..targets import Checkerboard

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike
    from typing import Any

    from pandas import DataFrame

CORNERS = ("simulated", "rendered")  # where `monte_carlo` takes its corners from

PARAMETERS = ("focal_length", "c_x", "c_y", "kappa1")
SAVED_EVERY = 10.0  # s, between two writes of the file
BOARD_DEPTH = 310.0  # mm, of the board's middle: all corners of a board tilted by up to 45 degrees are in the image
BOARD_SHIFT = 25.0  # mm, largest in x and y

_KEY = {"seed": int, "corners": str, "noise": float, "tilt": float, "views": int, "method": str, "trial": int}
_FOUND = [*PARAMETERS, "T_z_error", "rms", "mean_distance", "corner_sigma", "expected_rms"]
_NUMBERS = [*(column for name in PARAMETERS for column in (name, f"{name}_sigma")), *_FOUND[len(PARAMETERS) :]]
_COLUMNS = [*_KEY, *_NUMBERS, "status", "flags"]

RENDERED_FILE = "rendered_trials.csv"
RENDERED = {"corners": "rendered", "noises": (2.0,), "trials": 200}
"""The trials of `write_rendered_trials`: images with the noise of the paper's experiment."""


def monte_carlo(
    *,
    corners: str = "simulated",
    noises: Sequence[float] = (0.1,),
    tilts: Sequence[float] = (30.0,),
    views: Sequence[int] = (5,),
    methods: Sequence[str] = ("joint",),
    trials: int = 100,
    seed: int = 0,
    workers: int | None = None,
    path: str | PathLike[str] | None = None,
    progress: bool = True,
) -> DataFrame:
    """Calibrate the paper's camera, whose true parameters are known, many times in all combinations of the conditions.

    A trial draws its boards from the seed, the tilt, the number of views and its own number, and the noise
    from these and the level: all methods get the same corners, all noise levels the same boards, and the
    numbers are the same for any number of workers, in whatever order they work.

    The engine is joblib, so another backend takes the trials over by a context manager, for instance a Dask
    cluster, where ``workers`` stays None::

        from dask.distributed import Client
        with Client(cluster), joblib.parallel_config("dask"):
            table = monte_carlo(noises=[0.05, 0.1, 0.2], trials=10_000, path="trials.csv")

    Parameters
    ----------
    corners : {"simulated", "rendered"}
        Exact corners with noise, or those that `find_corners` finds in rendered images (about 2 s a trial).
    noises : sequence of float
        Standard deviation of the simulated corners' noise per axis, px, or of the noise in the images, grey values.
    tilts : sequence of float
        Angle between board and image plane, degrees, at most 45; the directions of the views are spread evenly.
    views : sequence of int
        Number of boards.
    methods : sequence of str
        Of `calibration.CALIBRATION_METHODS`; those of one view get the first alone, and the true principal point.
    trials : int
        Of each combination.
    seed : int
    workers : int, optional
        Processes; None leaves it to joblib's context, which is one process without a context.
    path : path, optional
        CSV file to which finished trials are written every few seconds and at the end, also of an interrupted run;
        those that it has already are not run again.  Of its lines, those that are cut or damaged do not count.
    progress : bool
        Show a progress bar.

    Returns
    -------
    DataFrame
        A row for each trial, ordered by its key seed, corners, noise, tilt, views, method, trial: focal_length and kappa1
        (mm, mm^-2), c_x, c_y (px), each with its stated sigma (NaN if the method states none); T_z_error, mm, of
        the first view's middle; rms and mean_distance, px; corner_sigma, px: the noise of simulated corners, of found
        ones the root mean square error per axis; expected_rms = corner_sigma sqrt(2 (1 - p / 2n)), px, for n
        points and p parameters; status, empty or the text of the `DetectionError` or `CalibrationError`, or the type
        and text of a numerical error, and then the numbers are NaN; flags, what the calibration says must be known
        before using its numbers, empty if nothing.

    Raises
    ------
    ValueError
        If an argument is unusable or the file has other columns.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> study.monte_carlo(trials=2, workers=1, progress=False)["rms"].round(1).tolist()
    [0.1, 0.1]
    """
    corners = as_choice(corners, "corners", CORNERS)
    conditions = _as_conditions(noises, tilts, views, methods, trials)
    seed = as_count(seed, "seed", 0)
    wanted = [(seed, corners, *condition) for condition in conditions]
    done = _finished(path)
    known = set(done[[*_KEY]].itertuples(index=False, name=None))
    tasks = [key for key in wanted if key not in known]
    run = Parallel(n_jobs=workers, return_as="generator")(delayed(run_trial)(*key) for key in tasks)
    rows, saved = [], time.monotonic()
    try:
        for row in tqdm(run, total=len(tasks), unit="trial", disable=not progress):
            rows.append(row)
            if time.monotonic() - saved > SAVED_EVERY:
                _save(path, done, rows)
                saved = time.monotonic()
    finally:
        done = _save(path, done, rows)
    return done.set_index([*_KEY]).loc[sorted(wanted)].reset_index()


def run_trial(
    seed: int, corners: str, noise: float, tilt: float, views: int, method: str, trial: int
) -> tuple[Any, ...]:
    """One row of `monte_carlo`'s table, as a tuple."""
    camera, board = paper_camera(), Checkerboard(8, 6, paper.printed("setup.pitch"))
    poses = trial_poses(board, tilt, views, [seed, _whole(tilt), views, trial])
    rng = np.random.default_rng([seed, _whole(tilt), views, trial, _whole(noise)])
    key = (seed, corners, noise, tilt, views, method, trial)
    try:
        image_points, sigma = _see(corners, camera, board, poses, noise, rng)
        found = _calibrate(method, [board.object_points] * views, image_points, camera, rng)
    except (DetectionError, CalibrationError) as error:
        return _failed(key, str(error))
    except (ValueError, ArithmeticError, cv2.error) as error:  # a failure in one trial must not end the others
        return _failed(key, f"{type(error).__name__}: {error}")
    values = [value for name in PARAMETERS for value in _estimate(found, name, camera)]
    middle = [pose.apply(board.center)[2] for pose in (found.cam_from_object[0], poses[0])]
    n = sum(len(points) for points in found.residuals)
    expected = sigma * np.sqrt(2 * (1 - found.n_parameters / (2 * n)))
    numbers = *values, middle[0] - middle[1], found.rms, found.mean_distance, sigma, expected
    return (*key, *numbers, "", " ".join(found.flags))


def _failed(key, reason):
    """The row of a failed trial: no numbers, and the reason on one line."""
    return (*key, *[np.nan] * len(_NUMBERS), " ".join(reason.split()), "")


def _see(corners, camera, board, poses, noise, rng):
    """The corners of a trial, an (n, 2) array for each board, and their standard deviation per axis, px."""
    exact = [camera.project(board.object_points, pose) for pose in poses]
    if corners == "simulated":
        return [points + noise * rng.standard_normal(points.shape) for points in exact], noise
    pictures = [render_board(camera, pose, board, blur=Experiment.blur, noise=noise, rng=rng) for pose in poses]
    found = [find_corners(picture, board) for picture in pictures]
    return found, float(np.sqrt(np.mean(np.square(np.subtract(found, exact)))))


def trial_poses(
    board: Checkerboard, tilt: float, views: int, rng: int | Sequence[int] | np.random.Generator | None
) -> list[RigidTransform]:
    """Poses of `views` boards, each tilted by `tilt` degrees, about axes spread evenly from a random first one.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, study
    >>> tilts = [np.arccos(pose.rotation.as_matrix()[2, 2]) for pose in study.trial_poses(Checkerboard(), 30.0, 3, 0)]
    >>> np.degrees(tilts).round(3).tolist()
    [30.0, 30.0, 30.0]
    """
    rng = np.random.default_rng(rng)
    first, poses = rng.uniform(0, 2 * np.pi), []
    for view in range(views):
        axis = first + 2 * np.pi * view / views
        tilted = Rotation.from_rotvec(np.deg2rad(tilt) * np.array([np.cos(axis), np.sin(axis), 0.0]))
        rotation = tilted * Rotation.from_rotvec([0, 0, rng.uniform(-0.3, 0.3)])
        middle = np.array([*rng.uniform(-BOARD_SHIFT, BOARD_SHIFT, 2), BOARD_DEPTH * rng.uniform(1.0, 1.1)])
        poses.append(RigidTransform.from_components(middle - rotation.apply(board.center), rotation))
    return poses


def _calibrate(method, object_points, image_points, camera, rng):
    """The calibration by a method."""
    return CALIBRATION_METHODS[method](object_points, image_points, camera.sensor, rng)


def _estimate(found, name, camera):
    """A parameter in the paper camera's units, and its stated sigma or NaN."""
    parameters, pitch = found.camera.parameters, camera.pixel_pitch[0]
    if name in parameters:
        column, value, scale = name, parameters[name], 1.0
    else:
        f = parameters["f_x"] * pitch
        column, value, scale = {
            "focal_length": ("f_x", f, pitch),
            "kappa1": ("k1", -parameters["k1"] / f**2, f**-2),
        }[name]
    stated = found.covariance is not None and column in found.covariance.index
    return value, scale * found.sigma(column) if stated else np.nan


def _as_conditions(noises, tilts, views, methods, trials):
    """The checked combinations (noise, tilt, views, method, trial), each once."""
    noises = [as_number(noise, "noises", 0) for noise in _as_sequence(noises, "noises")]
    tilts = [as_number(tilt, "tilts", 0, 45) for tilt in _as_sequence(tilts, "tilts")]
    views = [as_count(number, "views", 1) for number in _as_sequence(views, "views")]
    methods = [as_choice(name, "methods", tuple(CALIBRATION_METHODS)) for name in _as_sequence(methods, "methods")]
    return list(dict.fromkeys(product(noises, tilts, views, methods, range(as_count(trials, "trials", 1)))))


def _as_sequence(values, name):
    if np.ndim(values) != 1 or len(values) == 0:
        raise ValueError(f"{name} is {values!r}; expected a sequence of at least one value")
    return list(values)


def _finished(path):
    """The finished rows of the file, each key once; none if there is no file yet."""
    if path is None or not Path(path).exists():
        return pd.DataFrame(columns=_COLUMNS)
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    try:
        lines = list(csv.reader(io.StringIO(text, newline="")))
    except csv.Error as error:
        raise ValueError(f"path {path} is not a CSV file: {error}") from error
    columns = lines[0] if lines else []
    if columns != _COLUMNS:
        raise ValueError(f"path {path} has columns {', '.join(columns)}; expected {', '.join(_COLUMNS)}")
    whole = lines[1:] if text.endswith("\n") else lines[1:-1]  # a truncated line may look like a complete one
    rows = [row for row in map(_as_row, whole) if row is not None]
    return pd.DataFrame(rows, columns=_COLUMNS).drop_duplicates([*_KEY], ignore_index=True)


def _as_row(fields):
    """The row that a line of the file holds, or None if that is not a finished trial."""
    types = [*_KEY.values(), *[lambda field: float(field or "nan")] * len(_NUMBERS), str, str]
    try:
        row = [read(field) for read, field in zip(types, fields, strict=True)]
    except ValueError:
        return None
    values = dict(zip(_COLUMNS, row, strict=True))
    return row if values["status"] or np.isfinite([values[name] for name in _FOUND]).all() else None


def _save(path, done, rows):
    """All trials so far, in a table and, if there are new ones, in the file."""
    if not rows:
        return done
    new = pd.DataFrame(rows, columns=_COLUMNS)
    table = pd.concat([done, new]) if len(done) else new
    if path is not None:
        results.write_csv(path, table, float_format="%.17g")
    return table


def write_rendered_trials(folder: Path = MEASURED_FOLDER, *, workers: int = 2) -> None:
    """Run the trials `RENDERED` of `monte_carlo`, or those that the file in `folder` does not have yet."""
    monte_carlo(**RENDERED, workers=workers, path=folder / RENDERED_FILE)


def load_rendered_trials(folder: Path = MEASURED_FOLDER) -> DataFrame:
    """Read what `write_rendered_trials` wrote.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> study.load_rendered_trials()["corners"].unique().tolist()
    ['rendered']
    """
    return _finished(folder / RENDERED_FILE)


def _whole(value):
    """A number as a whole one, millionths, for a seed."""
    return round(1e6 * value)
