"""Calibrations from a board that is bent: what it does to f, whether a flag says so, and what an estimated warp repairs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..calibration import calibrate_joint
from ..checks import as_count
from ..files import MEASURED_FOLDER
from ..paper import paper_camera
from ..targets import Checkerboard
from .measured import made_by, write_measured
from .trials import trial_poses

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from pandas import DataFrame

BOARD = Checkerboard(9, 7, 30.0)
"""240 x 180 mm between its outer corners."""

BOWS = (0.0, 0.1, 0.2, 0.5)
"""mm, height of the middle of the bow above its ends."""


def bowed_board(board: Checkerboard, bow: float) -> NDArray[np.float64]:
    """Points (n, 3) of a board that is bent along x, so that its middle is `bow` mm off the plane of its ends.

    Examples
    --------
    >>> bowed_board(Checkerboard(9, 7, 30.0), 0.2)[:9, 2].round(3).tolist()
    [0.0, 0.088, 0.15, 0.188, 0.2, 0.188, 0.15, 0.088, 0.0]
    """
    points = board.object_points.copy()
    half = (board.columns - 1) * board.square / 2
    points[:, 2] += bow * (1 - (points[:, 0] / half - 1) ** 2)
    return points


def bent_board_trials(
    bows: Sequence[float] = BOWS, *, views: int = 13, noise: float = 0.1, trials: int = 100, seed: int = 0
) -> DataFrame:
    """Calibrate the paper's camera from boards that are bent, taken for flat and with an estimated warp.

    Parameters
    ----------
    bows : sequence of float
        mm.
    views : int
        Boards, tilted by 30 degrees in all directions, drawn anew in each trial.
    noise : float
        Of the corners, px per axis.
    trials : int
        Of each bow.
    seed : int

    Returns
    -------
    DataFrame
        A row for each bow, trial and `board` ("exact" or "warp"): f_error, f_sigma and f_classical_sigma (mm); warp_error
        and warp_sigma (mm; NaN for "exact"); flagged, whether a flag says that the board is bent; clustered, whether the
        scatter between views makes the stated sigmas.

    Raises
    ------
    CalibrationError
        If a calibration fails.

    Examples
    --------
    >>> table = bent_board_trials([0.2], trials=1)
    >>> table[["board", "flagged"]].to_numpy().tolist()
    [['exact', True], ['warp', False]]
    """
    camera, rows = paper_camera(), []
    for bow in bows:
        true_points = bowed_board(BOARD, bow)
        for trial in range(as_count(trials, "trials", 1)):
            rng = np.random.default_rng([seed, trial])
            poses = trial_poses(BOARD, 30.0, views, rng)
            seen = [camera.project(true_points, pose) for pose in poses]
            seen = [points + noise * rng.standard_normal(points.shape) for points in seen]
            for name, options in (("exact", ()), ("warp", ("warp",))):
                found = calibrate_joint([BOARD.object_points] * views, seen, camera.sensor, board=options)
                rows.append((bow, trial, name, *_judged(found, camera, bow)))
    columns = ["bow", "trial", "board", "f_error", "f_sigma", "f_classical_sigma", "warp_error", "warp_sigma"]
    return pd.DataFrame(rows, columns=[*columns, "flagged", "clustered"])


def _judged(found, camera, bow):
    """A row of `bent_board_trials` without its key."""
    warp = (found.board.values["warp_x"] - bow, found.sigma("warp_x")) if found.board else (np.nan, np.nan)
    codes = {flag.code for flag in found.flags}
    f_error = found.camera.focal_length - camera.focal_length
    return (
        f_error,
        found.sigma("focal_length"),
        found.classical_sigma("focal_length"),
        *warp,
        "misfit-board" in codes,
        "clustered-sigmas" in codes,
    )


def summarize_bent_boards(trials: DataFrame) -> DataFrame:
    """A row for each bow and board of `bent_board_trials`.

    Returns
    -------
    DataFrame
        bow, board, trials, f_error (mean, mm), f_rms_z, f_classical_rms_z (error over sigma), warp_rms, warp_rms_z,
        flagged, clustered (%).

    Examples
    --------
    >>> summary = summarize_bent_boards(bent_board_trials([0.2], trials=2))
    >>> summary[["bow", "board", "trials"]].to_numpy().tolist()
    [[0.2, 'exact', 2], [0.2, 'warp', 2]]
    """

    def rms(values):
        return float(np.sqrt(np.mean(np.square(values))))

    rows = [
        (
            *key,
            len(part),
            part["f_error"].mean(),
            rms(part["f_error"] / part["f_sigma"]),
            rms(part["f_error"] / part["f_classical_sigma"]),
            rms(part["warp_error"]),
            rms(part["warp_error"] / part["warp_sigma"]),
            100 * part["flagged"].mean(),
            100 * part["clustered"].mean(),
        )
        for key, part in trials.groupby(["bow", "board"], sort=False)
    ]
    columns = ["bow", "board", "trials", "f_error", "f_rms_z", "f_classical_rms_z", "warp_rms", "warp_rms_z"]
    return pd.DataFrame(rows, columns=[*columns, "flagged", "clustered"])


def write_bent_boards(folder: Path = MEASURED_FOLDER) -> None:
    """Write the summary of `bent_board_trials` into `folder`; raises as it does."""
    comment = f"joint calibration from bent boards, taken for flat and with an estimated warp; {made_by('bent_boards')}"
    write_measured(folder, "bent_boards", summarize_bent_boards(bent_board_trials()).round(5), comment)
