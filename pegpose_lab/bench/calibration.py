"""Benchmarks of calibration: joint calibration beside OpenCV's, the genetic algorithm beside differential evolution."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd
from tqdm import tqdm

from .. import paper, study
from ..calibration import calibrate_joint, optimum_in_box
from ..targets import Checkerboard
from .score import one_thread

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

SEED = 20


def measure_joint(views: Sequence[int], *, repeats: int = 3) -> pd.DataFrame:
    """Time of `calibrate_joint` and `cv2.calibrateCamera` with the same unknowns: f_x, f_y, c_x, c_y, k1 and poses.

    Parameters
    ----------
    views : sequence of int
        Numbers of views; each shows 48 simulated corners of a board tilted by 30 degrees, with 0.1 px of noise.
    repeats : int

    Returns
    -------
    DataFrame
        views, ms, opencv_ms (medians), ratio, rms_difference (ours minus OpenCV's, px).
    """
    rows, camera = [], paper.paper_camera()
    board = Checkerboard(8, 6, 29.0)
    flags = cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    with one_thread():
        for number in tqdm(views, unit="set", desc="joint ", disable=None):
            rng = np.random.default_rng([SEED, number])
            poses = study.trial_poses(board, 30.0, number, rng)
            images = [camera.project(board.object_points, pose) + 0.1 * rng.standard_normal((48, 2)) for pose in poses]
            points, times, opencv_times = [board.object_points] * number, [], []
            single = [[array.astype(np.float32) for array in arrays] for arrays in (points, images)]
            for _ in range(repeats + 1):
                start = time.process_time()
                found = calibrate_joint(points, images, camera, focal="two", coefficients=("k1",))
                times.append(time.process_time() - start)
                start = time.process_time()
                rms = cv2.calibrateCamera(*single, camera.image_size, None, None, flags=flags)[0]
                opencv_times.append(time.process_time() - start)
            ours, theirs = 1e3 * np.median(times[1:]), 1e3 * np.median(opencv_times[1:])
            rows.append((number, ours, theirs, ours / theirs, found.rms - rms))
    return pd.DataFrame(rows, columns=["views", "ms", "opencv_ms", "ratio", "rms_difference"])


def measure_genetic(sets: list[Any] | None = None, *, seeds: int = 10) -> pd.DataFrame:
    """The genetic algorithm beside `scipy.optimize.differential_evolution`: same view, box and objective.

    Parameters
    ----------
    sets : list, optional
        Views as `study.trial_sets` returns them; these are the default.
    seeds : int
        Number of seeds; both methods get the seeds 0, 1, ...

    Returns
    -------
    DataFrame
        One row per view: ms and de_ms, the processor times of both (medians over the seeds, stage 1 included); ratio,
        the median of their ratios for the same seed; reached and de_reached, the share of seeds that end within
        `study.REACHED` of the optimum in the box, %.
    """
    rows = []
    for name, *view in tqdm(study.trial_sets() if sets is None else sets, unit="view", desc="genetic", disable=None):
        optimum = optimum_in_box(*view).mean_distance
        times, reached = np.empty((2, seeds, 2))
        for seed in range(seeds):
            for k, method in enumerate((study.GENETIC, study.DIFFERENTIAL_EVOLUTION)):
                start = time.process_time()
                found, _ = study.search(method, *view, seed)
                times[seed, k] = time.process_time() - start
                reached[seed, k] = found.mean_distance <= optimum + study.REACHED
        ratio = np.median(times[:, 0] / times[:, 1])
        rows.append((name, *1e3 * np.median(times, axis=0), ratio, *100 * reached.mean(axis=0)))
    return pd.DataFrame(rows, columns=["view", "ms", "de_ms", "ratio", "reached", "de_reached"])


def measure_rivals(*, repeats: int = 3) -> pd.DataFrame:
    """The cost of every method of `study.compare` on the photographs' corners.

    Parameters
    ----------
    repeats : int
        Number of seeds for the methods that draw random numbers.

    Returns
    -------
    DataFrame
        method, evaluations of the objective (NaN if there is no objective), ms of processor time (medians).
    """
    photographs = [view for name, *view in study.trial_sets() if name.startswith("left")]
    object_points, image_points, cameras = zip(*photographs, strict=True)
    tables = [study.compare(object_points, image_points, cameras[0], rng=seed) for seed in range(repeats)]
    middle = pd.concat(tables).groupby("method", sort=False)[["evaluations", "ms"]].median()
    return middle.reset_index()
