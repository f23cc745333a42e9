"""Which of the printed operators matters: Eqs. 9 and 10 of the genetic algorithm, printed and corrected in turn."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..calibration import blend_crossover, repeat_calibration
from .ga_success import REACHED

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

    from ..calibration import Calibration
    from ..camera import Sensor, TsaiCamera

FORMS = ("printed", "corrected")
PAIRS = 2000
"""Number of pairs of parents drawn from each population."""


def operator_trials(
    object_points: ArrayLike,
    image_points: Sequence[ArrayLike],
    camera: Sensor | TsaiCamera,
    *,
    runs: int = 12,
    seed: int = 32,
    halfway: int = 20,
) -> DataFrame:
    """Run the algorithm with the genes (f, T_z) on each view with each combination of Eqs. 9 and 10.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm.
    image_points : sequence of (n, 2) array_like
        px, an entry for each view.
    camera
        As for `calibrate_genetic`.
    runs : int
        Runs of each combination on each view; every run has a generator of its own.
    seed : int
        Of the generators.
    halfway : int
        A generation, at which the best chromosome is looked at.

    Returns
    -------
    DataFrame
        A row for each run: view, "Eq. 9" and "Eq. 10" (printed or corrected), arrived (whether it ends within `REACHED` of
        the optimum), "off halfway" and "off at the end" (mm, the T_z of the best chromosome less that of the optimum),
        and spread (mm, standard deviation of T_z in the last generation).  The optimum is that of the genes (m, T_z).

    Examples
    --------
    >>> from pegpose_lab import paper, study
    >>> truth = paper.paper_experiment()
    >>> board = truth.board.object_points
    >>> image = truth.camera.project(board, truth.cam_from_boards[0])
    >>> trial = study.operator_trials(board, [image], truth.camera, runs=1)
    >>> trial.shape
    (4, 7)
    """
    rows = []
    optima = repeat_calibration(object_points, image_points, camera, range(len(image_points)))
    for view, (measured, optimum) in enumerate(zip(image_points, optima, strict=True)):
        true_depth = optimum.cam_from_object[0].translation[2]
        for number, (crossover, mutation) in enumerate(product(FORMS, FORMS)):
            options = {"genes": "printed", "crossover": crossover, "mutation": mutation}
            rngs = [np.random.default_rng([seed, view, number, run]) for run in range(runs)]
            for found in repeat_calibration(object_points, measured, camera, rngs, **options):
                arrived = found.mean_distance - optimum.mean_distance <= REACHED
                off = np.abs(found.populations[[halfway, -1], 0, 1] - true_depth)
                rows.append([view, crossover, mutation, arrived, *off, found.populations[-1][:, 1].std()])
    return pd.DataFrame(rows, columns=["view", "Eq. 9", "Eq. 10", "arrived", "off halfway", "off at the end", "spread"])


def printed_effect(trial: DataFrame, equation: str) -> tuple[float, float, float]:
    """What it changes that an equation stands as printed.

    Parameters
    ----------
    trial : DataFrame
        As `operator_trials` returns.
    equation : {"Eq. 9", "Eq. 10"}

    Returns
    -------
    float, float, float
        The share of runs that arrive as printed and as corrected, and their difference in standard errors; the shares of
        the views are kept apart.

    Examples
    --------
    >>> import pandas as pd
    >>> from pegpose_lab import study
    >>> rows = {"view": [0] * 4, "Eq. 9": ["printed", "printed", "corrected", "corrected"], "arrived": [1, 1, 1, 0]}
    >>> printed, corrected, apart = study.printed_effect(pd.DataFrame(rows), "Eq. 9")
    >>> printed, corrected, round(float(apart), 2)
    (1.0, 0.5, 1.15)
    """
    arrivals = trial.groupby([equation, "view"])["arrived"]
    size, share = arrivals.size().iloc[0], trial.groupby("view")["arrived"].mean()
    totals = arrivals.sum().groupby(equation).sum()
    apart = (totals["printed"] - totals["corrected"]) / np.sqrt(np.sum(2 * size * share * (1 - share)))
    shares = totals / (size * len(share))
    return float(shares["printed"]), float(shares["corrected"]), float(apart)


def good_children(
    objective: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    found: Sequence[Calibration],
    box: NDArray[np.float64],
    *,
    generation: int = 5,
    seed: int = 34,
) -> tuple[float, float]:
    """How many children of Eq. 9 as printed are better than the median of their parents' population.

    Parameters
    ----------
    objective : callable
        Of chromosomes (n, 2), f and T_z in mm.
    found : sequence of Calibration
        Runs of `calibrate_genetic`.
    box : (2, 2) ndarray
        Lower and upper end of f, and of T_z, mm.
    generation : int
        Of which the parents are.
    seed : int
        Of the generators, one for each run.

    Returns
    -------
    float, float
        The shares, of children from intervals that Eq. 9 narrows in both genes, and from those that it widens in both.

    Examples
    --------
    >>> from pegpose_lab import calibrate_genetic, calibrate_tsai, paper, study
    >>> from pegpose_lab.calibration import TwoStageObjective
    >>> truth = paper.paper_experiment()
    >>> view = truth.board.object_points, truth.camera.project(truth.board.object_points, truth.cam_from_boards[0])
    >>> run = calibrate_genetic(*view, truth.camera, rng=0, genes="printed", generations=6)
    >>> linear = calibrate_tsai(*view, truth.camera)
    >>> box = np.outer([linear.camera.focal_length, linear.cam_from_object[0].translation[2]], [0.75, 1.25])
    >>> narrowed, widened = study.good_children(TwoStageObjective(*view, linear), [run], box)
    >>> narrowed > widened
    True
    """
    better = {"narrowed": [], "widened": []}
    for number, run in enumerate(found):
        parents, rng = run.populations[generation], np.random.default_rng([seed, number])
        pool = parents[rng.integers(len(parents), size=PAIRS)]
        following, children = np.roll(pool, -1, axis=0), blend_crossover(pool, rng, form="printed")
        good = objective(np.clip(children, *box.T)) < np.median(objective(parents))
        better["narrowed"].extend(good[np.all(pool < following, axis=1)])
        better["widened"].extend(good[np.all(pool > following, axis=1)])
    return float(np.mean(better["narrowed"])), float(np.mean(better["widened"]))
