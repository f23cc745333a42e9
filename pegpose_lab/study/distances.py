"""How many reprojection errors (distances) lie below a limit, given the mean of the same distances.

A share below a limit and a mean that are printed of *one* sample are not two independent numbers: the sample's own
scale is in both.  What can be compared is how many distances lie below a multiple of their own mean, in which the
scale of the noise cancels.  `rayleigh_counts` draws that number for independent normal errors, `two_stage_counts` for
what the paper's two stages leave of normal corner noise: those residuals are neither independent nor of one scale.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from .. import paper
from ..calibration import calibrate_genetic
from ..checks import as_choice, as_count, as_number
from ..files import MEASURED_FOLDER
from ..paper import paper_experiment
from .measured import made_by, write_measured

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

GIVEN = ("mean", "rms")
"""What the limit is a multiple of: the mean of the distances (Eq. 7 as printed), or their root mean square."""

TRIALS = 500
"""Trials of `write_two_stage_counts`."""

_BATCH = 4_000_000  # numbers drawn at once


def count_below(distances: ArrayLike, ratio: float, given: str = "mean") -> NDArray[np.int_]:
    """Return how many of the distances (..., n) lie below `ratio` times their own mean or rms, (...,) int.

    Raises
    ------
    ValueError
        If there is no distance, `ratio` is no positive number, or `given` is none of `GIVEN`.

    Examples
    --------
    >>> int(count_below([1.0, 2.0, 6.0], 1.0))  # the mean is 3
    2
    """
    distances, ratio = np.asarray(distances, np.float64), as_number(ratio, "ratio", 0, exclusive=True)
    if distances.ndim == 0 or distances.shape[-1] == 0:
        raise ValueError(f"distances has shape {distances.shape}; expected (..., n) with n >= 1")
    given = as_choice(given, "given", GIVEN)
    scale = np.mean(distances, axis=-1) if given == "mean" else np.sqrt(np.mean(distances**2, axis=-1))
    return np.count_nonzero(distances < ratio * scale[..., None], axis=-1)


def rayleigh_counts(
    n: int, ratio: float, *, samples: int = 20_000, rng: int | Sequence[int] | np.random.Generator | None = None
) -> dict[str, NDArray[np.int_]]:
    """Draw samples of n independent Rayleigh distances; count those below `ratio` times their own mean and rms.

    Rayleigh's is the distribution of the length of an error that is normal, with one sigma, in both coordinates.

    Parameters
    ----------
    n, samples : int
        Distances in a sample, and how many samples.
    ratio : float
        Limit over mean, or over rms.
    rng : None, int, sequence of int or Generator

    Returns
    -------
    dict
        {"mean": (samples,) int, "rms": (samples,) int}, of the same samples.

    Raises
    ------
    ValueError
        If an argument is unusable.

    Examples
    --------
    >>> counts = rayleigh_counts(48, 1.0, samples=10, rng=0)
    >>> list(counts), counts["mean"].shape
    (['mean', 'rms'], (10,))
    """
    n, samples = as_count(n, "n", 1), as_count(samples, "samples", 1)
    rng, rows = np.random.default_rng(rng), max(_BATCH // n, 1)
    parts = []
    for first in range(0, samples, rows):
        distances = rng.rayleigh(size=(min(rows, samples - first), n))
        parts.append([count_below(distances, ratio, given) for given in GIVEN])
    return dict(zip(GIVEN, np.concatenate(parts, axis=1), strict=True))


def two_stage_counts(trials: Iterable[int], ratio: float, *, seed: int = 0) -> DataFrame:
    """Simulate the paper's two stages; count their residual distances below `ratio` times their own mean and rms.

    Each trial adds normal noise to the exact corners of the experiment's boards, calibrates each view alone by both
    stages, and pools the residuals of the first one, two, three, ... views.  The noise is such that Eq. 7 comes out
    near the printed error.  Every trial and view has generators of its own, for the noise and for the algorithm.

    Parameters
    ----------
    trials : iterable of int
        Numbers of the trials, which seed them.
    ratio : float
    seed : int

    Returns
    -------
    DataFrame
        trial, n (points), mean_distance (px), mean and rms: how many of the n are below that multiple of either.
    """
    rows = []
    for trial in trials:
        views = list(_trial_distances(trial, seed))
        for number in range(1, len(views) + 1):
            pooled = np.concatenate(views[:number])
            rows.append([trial, len(pooled), pooled.mean(), *(count_below(pooled, ratio, given) for given in GIVEN)])
    return pd.DataFrame(rows, columns=["trial", "n", "mean_distance", *GIVEN])


def _trial_distances(trial, seed):
    """Residual distances (n,), px, of both stages on each of the experiment's boards alone."""
    truth = paper_experiment()
    board, unknown = truth.board.object_points, replace(truth.camera, focal_length=1.0, kappa1=0.0)
    sigma = paper.printed("E-rms") / np.sqrt(np.pi / 2)
    for view, place in enumerate(truth.cam_from_boards):
        noise = np.random.default_rng([seed, trial, view, 0]).standard_normal((len(board), 2))
        seen = truth.camera.project(board, place) + sigma * noise
        found = calibrate_genetic(board, seen, unknown, rng=np.random.default_rng([seed, trial, view, 1]))
        yield np.hypot(*found.residuals[0].T)


def printed_ratio() -> float:
    """Return the limit of Fig. 6 over the error of Sect. 5.

    Examples
    --------
    >>> round(printed_ratio(), 3)
    0.968
    """
    return paper.printed("F6.limit") / paper.printed("E-rms")


def write_two_stage_counts(folder: Path = MEASURED_FOLDER, *, trials: int = TRIALS) -> None:
    """Run `two_stage_counts` at the printed ratio and write its table into `folder`."""
    table = two_stage_counts(range(trials), printed_ratio())
    write_measured(folder, "two_stage_counts", table, made_by("two_stage_counts"), float_format="%.6g")
