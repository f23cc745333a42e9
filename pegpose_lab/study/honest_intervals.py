"""Whether stated sigmas hold where corners do not err independently: simulated correlated noise, and halves of real sets."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd

from ..calibration import calibrate_joint
from ..camera import Sensor
from ..checks import CalibrationError, DetectionError, as_count, as_number
from ..corners import find_corners
from ..files import MEASURED_FOLDER
from ..paper import paper_experiment
from ..targets import Checkerboard
from .datasets import dataset
from .measured import made_by, write_measured
from .trials import trial_poses

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

    from ..calibration import Calibration

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

_CAMERA = ("focal_length", "f_x", "f_y", "c_x", "c_y")


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
        classical = np.sqrt(found.classical_covariance.loc[name, name])
        low, high = found.interval(name)
        holds = low < camera.parameters[name] < high
        yield name, error, found.sigma(name), classical, holds, abs(error) < 1.96 * classical, flagged


def split_halves(
    calibrate: Callable[..., Calibration],
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    halves: int = HALVES,
    rng: int | np.random.Generator | None = 0,
) -> DataFrame:
    r"""Compare calibrations of random halves of the views: a check of the sigmas that needs no truth.

    If they hold, :math:`z = (a - b) / \sqrt{\sigma_a^2 + \sigma_b^2}` of the two halves' estimates has the rms 1.

    Parameters
    ----------
    calibrate : callable
        Maps lists of object points and image points to a `Calibration`.
    object_points, image_points : sequences of (n, 3) and (n, 2) array_like
        mm and px, an entry a view; at least four.
    halves : int
        Number of random partitions.
    rng : int or numpy.random.Generator, optional

    Returns
    -------
    DataFrame
        A row for each partition and each of f (or f_x, f_y), c_x and c_y: half, parameter, difference, z, classical_z.

    Raises
    ------
    ValueError
        If there are fewer than four views.
    CalibrationError
        If none of the partitions gives two calibrations.

    Examples
    --------
    >>> from pegpose_lab import Sensor, calibrate_joint, study
    >>> object_points, image_points, size, _ = study.load_corners()
    >>> sensor = Sensor((1.0, 1.0), (319.5, 239.5), size)
    >>> table = study.split_halves(lambda *views: calibrate_joint(*views, sensor), object_points, image_points, 2)
    >>> len(table), bool(table["z"].abs().max() < table["classical_z"].abs().max())
    (6, True)
    """
    if len(object_points) < 4 or len(object_points) != len(image_points):
        raise ValueError(
            f"object_points has {len(object_points)} views and image_points {len(image_points)}; expected as many, four or more"
        )
    rng, rows, error = np.random.default_rng(rng), [], None
    for half in range(as_count(halves, "halves", 1)):
        order = rng.permutation(len(object_points))
        parts = np.array_split(order, 2)
        try:
            first, second = (
                calibrate(*([v[k] for k in part] for v in (object_points, image_points))) for part in parts
            )
        except CalibrationError as refused:
            error = refused
            continue
        for name in [name for name in _CAMERA if name in first.covariance.index]:
            difference = first.camera.parameters[name] - second.camera.parameters[name]
            tables = [first.covariance, second.covariance], [first.classical_covariance, second.classical_covariance]
            sigmas = [np.sqrt(sum(table.loc[name, name] for table in pair)) for pair in tables]
            rows.append((half, name, difference, *(difference / sigma for sigma in sigmas)))
    if not rows:
        raise CalibrationError(f"none of {halves} partitions gives two calibrations; add views (the last: {error})")
    return pd.DataFrame(rows, columns=["half", "parameter", "difference", "z", "classical_z"])


def measure_split_halves(sets: Sequence[str] = tuple(BOARDS), lenses: Sequence[str] = tuple(LENSES)) -> DataFrame:
    """`split_halves` of sets of photographs (`BOARDS`), summarised for each lens model (`LENSES`) and parameter.

    Returns
    -------
    DataFrame
        dataset, views, lens, parameter, halves (number of partitions); rms_z and within (share of z within 1.96, %), and
        the same by the classical sigmas.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    """
    rows = []
    for name in sets:
        board = BOARDS[name]
        image_points, size = _corners(name, board)
        sensor = Sensor((1.0, 1.0), ((size[0] - 1) / 2, (size[1] - 1) / 2), size)
        object_points = [board.object_points] * len(image_points)
        for lens in lenses:
            options = LENSES[lens]
            table = split_halves(
                lambda *views, o=options, s=sensor: calibrate_joint(*views, s, **o), object_points, image_points
            )
            for parameter, part in table.groupby("parameter", sort=False):
                shares = [100 * np.mean(part[z].abs() < 1.96) for z in ("z", "classical_z")]
                rms = [np.sqrt(np.mean(part[z] ** 2)) for z in ("z", "classical_z")]
                rows.append((name, len(image_points), lens, parameter, len(part), rms[0], shares[0], rms[1], shares[1]))
    columns = [
        "dataset",
        "views",
        "lens",
        "parameter",
        "halves",
        "rms_z",
        "within",
        "classical_rms_z",
        "classical_within",
    ]
    return pd.DataFrame(rows, columns=columns)


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
