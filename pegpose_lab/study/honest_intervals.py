"""Whether stated sigmas hold where corners do not err independently: simulated correlated noise, and halves of real sets."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd

from ..calibration import calibrate_joint
from ..camera import Sensor
from ..checks import DetectionError, as_count, as_number
from ..corners import find_corners
from ..files import MEASURED_FOLDER
from ..paper import paper_experiment
from ..targets import Checkerboard
from .datasets import dataset
from .measured import made_by, write_measured
from .trials import trial_poses

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame, Series


HALVES = 100
BOARDS = {
    "opencv_left": Checkerboard(9, 6, 30.0),
    "boards-opencv-right": Checkerboard(9, 6, 30.0),
    "boards-udacity": Checkerboard(9, 6, 30.0),
    "boards-sony": Checkerboard(4, 6, 30.0),
    "boards-stereo-l": Checkerboard(9, 6, 24.23),
}
"""The sets of photographs of `write_split_halves`, and their boards, mm; udacity's square is not known, 30 mm is taken."""

LENSES = {
    "f, k1 (Eq. 3)": {},
    "f_x, f_y, k1, k2": {"focal": "two", "coefficients": ("k1", "k2")},
    "f_x, f_y, k1, k2, p1, p2": {"focal": "two", "coefficients": ("k1", "k2", "p1", "p2")},
}
"""The lens models of `write_split_halves`: options of `calibrate_joint`."""

NORMAL_95 = 1.959963984540054
"""Standard deviations of the normal distribution's 95 % interval."""

_CAMERA = ("focal_length", "f_x", "f_y", "c_x", "c_y")


def interval_coverage(trials: DataFrame, truth: Series) -> tuple[DataFrame, DataFrame]:
    """Compare the estimates of many trials, and their stated sigmas, with the truth.

    Parameters
    ----------
    trials : DataFrame
        A row for each trial: a column for each parameter and one with its sigma, as of `monte_carlo`.
    truth : Series
        The true value of each parameter.

    Returns
    -------
    z : DataFrame
        Error over stated sigma, a row for each trial, a column for each parameter.
    table : DataFrame
        A row for each parameter: the truth, the standard deviation of the estimates, the mean stated sigma, the standard
        deviation of z, and how many of the 95 % intervals hold the truth (%).

    Examples
    --------
    >>> import pandas as pd
    >>> from pegpose_lab.study import interval_coverage
    >>> trials = pd.DataFrame({"f": [47.0, 50.0, 48.0, 48.5], "f_sigma": [1.0, 0.5, 1.0, 1.0]})
    >>> z, table = interval_coverage(trials, pd.Series({"f": 48.0}))
    >>> z["f"].tolist(), table.loc["f", "95 % intervals that hold it (%)"].item()
    ([-1.0, 4.0, 0.0, 0.5], 75.0)
    """
    estimates = trials[list(truth.index)]
    sigmas = trials[[f"{name}_sigma" for name in truth.index]].set_axis(truth.index, axis=1)
    z = (estimates - truth) / sigmas
    columns = {
        "truth": truth,
        "sd of the estimates": estimates.std(),
        "mean stated sigma": sigmas.mean(),
        "sd of error / sigma": z.std(),
        "95 % intervals that hold it (%)": 100 * (z.abs() < NORMAL_95).mean(),
    }
    return z, pd.DataFrame(columns)


def correlated_noise(points: ArrayLike, length: float, rng: np.random.Generator) -> NDArray[np.float64]:
    r"""Draw noise of unit variance for x and y, (n, 2), with the correlation :math:`e^{-d^2 / 2 L^2}` at distance d.

    Parameters
    ----------
    points : (n, 2) array_like
        px.
    length : float
        L, px; 0 for independent noise.
    rng : numpy.random.Generator

    Examples
    --------
    >>> import numpy as np
    >>> near, far = correlated_noise([[0, 0], [1, 0]], 100.0, np.random.default_rng(0))
    >>> bool(np.abs(near - far).max() < 0.1)  # a hundredth of the length apart
    True
    """
    points, length = np.asarray(points, float), as_number(length, "length", 0)
    draws = rng.standard_normal((len(points), 2))
    if length == 0:
        return draws
    squares = np.sum((points[:, None] - points) ** 2, axis=2)
    return np.linalg.cholesky(np.exp(-squares / (2 * length**2)) + 1e-9 * np.eye(len(points))) @ draws


def correlated_trials(
    *,
    lengths: Sequence[float] = (0.0, 60.0, 200.0),
    views: Sequence[int] = (5, 10),
    noise: float = 0.1,
    trials: int = 200,
    seed: int = 0,
) -> DataFrame:
    """Calibrate the paper's camera many times from corners whose errors are correlated within each view.

    The boards are the same in all trials of a number of views, tilted by 30 degrees.

    Parameters
    ----------
    lengths : sequence of float
        Correlation lengths of the noise in the picture (`correlated_noise`), px.
    views : sequence of int
        Numbers of boards.
    noise : float
        Standard deviation of the noise per axis, px.
    trials : int
        Of each combination.
    seed : int

    Returns
    -------
    DataFrame
        A row for each length, views, trial and parameter (f in mm, c_x and c_y in px, kappa1 in mm^-2): error, sigma,
        classical_sigma; holds and classical_holds, whether the 95 % interval holds the truth; flagged, whether a flag
        says that the errors are not independent.

    Raises
    ------
    CalibrationError
        If a calibration fails.

    Examples
    --------
    >>> table = correlated_trials(lengths=[200.0], views=[10], trials=2)
    >>> len(table), bool(table["flagged"].all())
    (8, True)
    """
    experiment, rows = paper_experiment(), []
    camera, board = experiment.camera, experiment.board
    for length, number in product(lengths, views):
        poses = trial_poses(board, 30.0, number, [seed, number])
        exact = [camera.project(board.object_points, pose) for pose in poses]
        for trial in range(as_count(trials, "trials", 1)):
            rng = np.random.default_rng([seed, number, trial])
            seen = [points + noise * correlated_noise(points, length, rng) for points in exact]
            found = calibrate_joint([board.object_points] * number, seen, camera.sensor)
            rows += [(length, number, trial, *row) for row in _judged(found, camera)]
    columns = ["length", "views", "trial", "parameter", "error", "sigma", "classical_sigma", "holds", "classical_holds"]
    return pd.DataFrame(rows, columns=[*columns, "flagged"])


def _judged(found, camera):
    """Rows of `correlated_trials` without their key."""
    flagged = any(flag.code in ("clustered-sigmas", "correlated-corners") for flag in found.flags)
    for name, value in found.camera.parameters.items():
        if name not in found.covariance.index:
            continue
        error = value - camera.parameters[name]
        classical = found.classical_sigma(name)
        low, high = found.interval(name)
        holds = low < camera.parameters[name] < high
        yield name, error, found.sigma(name), classical, holds, abs(error) < 1.96 * classical, flagged


def measure_split_halves(sets: Sequence[str] = tuple(BOARDS), lenses: Sequence[str] = tuple(LENSES)) -> DataFrame:
    """Calibrations of random halves of the views of photographed sets: their differences over the sigmas.

    Unlike `calibration.split_halves` it compares the parameters only, so that a half's distortion need not be
    invertible over the whole image, and has the classical sigmas beside the stated ones.

    Parameters
    ----------
    sets, lenses : sequences of str
        Of `BOARDS` and `LENSES`.

    Returns
    -------
    DataFrame
        A row for each set, lens model and parameter: dataset, views, lens, parameter, repeats; rms_z and within (share
        of z within 1.96, %) by the stated sigmas, classical_rms_z and classical_within.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    CalibrationError
        If a half cannot be calibrated.
    """
    rows = []
    for name in sets:
        image_points, size = _corners(name, BOARDS[name])
        sensor = Sensor((1.0, 1.0), ((size[0] - 1) / 2, (size[1] - 1) / 2), size)
        for lens in lenses:
            z = _differences(BOARDS[name].object_points, image_points, sensor, LENSES[lens])
            for parameter, both in z.items():
                stated, classical = (
                    (np.sqrt(np.mean(values**2)), 100 * np.mean(np.abs(values) <= 1.96))
                    for values in np.transpose(both)
                )
                rows.append((name, len(image_points), lens, parameter, len(both), *stated, *classical))
    columns = ["dataset", "views", "lens", "parameter", "repeats", "rms_z", "within", "classical_rms_z"]
    return pd.DataFrame(rows, columns=[*columns, "classical_within"])


def _differences(board, image_points, sensor, options):
    """For each parameter but the distortion, z of each repeat by the stated and by the classical sigmas."""
    rng, z = np.random.default_rng(0), {}
    for _ in range(HALVES):
        first, second = (
            calibrate_joint([board] * len(part), [image_points[k] for k in part], sensor, **options)
            for part in np.array_split(rng.permutation(len(image_points)), 2)
        )
        for name in (name for name in _CAMERA if name in first.covariance.index):
            difference = first.camera.parameters[name] - second.camera.parameters[name]
            stated = np.hypot(first.sigma(name), second.sigma(name))
            tables = first.classical_covariance, second.classical_covariance
            classical = np.sqrt(sum(table.loc[name, name] for table in tables))
            z.setdefault(name, []).append((difference / stated, difference / classical))
    return z


def _corners(name, board):
    """Corners of the photographs of a set that show the whole board, and the pictures' size."""
    found, size = [], None
    for path in sorted(dataset(name).glob("*.jpg")):
        image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_GRAYSCALE)
        try:
            found.append(find_corners(image, board))
        except DetectionError:
            continue
        size = image.shape[::-1]
    return found, size


def write_split_halves(folder: Path = MEASURED_FOLDER) -> None:
    """Write the table of `measure_split_halves` into `folder`; raises as it does."""
    comment = (
        f"differences of {HALVES} random halves over their sigmas, share within 1.96 (%); {made_by('split_halves')}"
    )
    write_measured(folder, "split_halves", measure_split_halves().round(3), comment)
