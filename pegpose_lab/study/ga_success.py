"""Tests of the genetic algorithm: its success over many seeds, and other methods on the same corners and measures.

``python3 -m pegpose_lab measure ga_success`` writes data/measured/ga_success.csv: how often each variant of the algorithm
ends at the optimum of its box, over 100 seeds, on rendered boards and on OpenCV's photographs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from tqdm import tqdm

from .. import paper
from ..calibration import optimum_in_box, repeat_calibration
from ..camera import Sensor
from ..corners import find_corners
from ..files import MEASURED_FOLDER
from . import photographs
from .measured import made_by, write_measured

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import Any

    from pandas import DataFrame

SEEDS = 100
REACHED = 1e-4  # px above the optimum that count as reaching it

PRINTED = {"genes": "printed", "crossover": "printed", "mutation": "printed"}
VARIANTS = {
    "default: Eqs. 9, 10 corrected, genes (m, T_z)": {},
    "corrected, genes (f, T_z)": {"genes": "printed"},
    "corrected, genes (f, T_z), Eq. 4": {"genes": "printed", "initialisation": "equal"},
    "printed, genes (f, T_z)": PRINTED,
    "printed, genes (f, T_z), Eq. 4": PRINTED | {"initialisation": "equal"},
}
"""The genetic algorithm of this package, and the one that the paper prints: options of `calibrate_genetic`."""

GROUPS = {"paper": "paper's view", "rendered": "5 rendered views", "left": "13 photographs"}
"""First letters of the views' names in `trial_sets`, and the name of each group."""


# --- success over seeds ----------------------------------------------------------------------------------


def trial_sets() -> list[tuple[Any, ...]]:
    """The views of the trial: name, object_points, image_points, camera.

    The paper's view is that of Table 1 with exact corners and 0.025 px of noise; the rendered ones have their corners
    found in the images; the real ones are OpenCV's photographs with this project's corners, the principal point in the
    middle of the image.

    Examples
    --------
    >>> sets = trial_sets()
    >>> sets[0][0], len(sets)
    ("paper's view", 19)
    """
    truth = paper.paper_experiment()
    unknown = truth.camera.sensor
    board = truth.board.object_points
    world = truth.world_from_board.apply(board)
    exact = truth.camera.project(world, paper.paper_pose())
    noise = 0.025 * np.random.default_rng(0).standard_normal(exact.shape)
    sets = [("paper's view", world, exact + noise, unknown)]
    sets += [
        (f"rendered view {k + 1}", board, find_corners(truth.board_image(k), truth.board), unknown) for k in range(5)
    ]
    object_points, image_points, (width, height), names = photographs.load_corners()
    sensor = Sensor((1.0, 1.0), ((width - 1) / 2, (height - 1) / 2), (width, height))
    return sets + [(name, *view, sensor) for name, *view in zip(names, object_points, image_points, strict=True)]


def success_rates(
    sets: list[tuple[Any, ...]] | None = None,
    *,
    variants: Sequence[str] = tuple(VARIANTS),
    seeds: int = SEEDS,
    workers: int = 2,
    progress: bool = True,
) -> DataFrame:
    """Count the seeds of each variant that end within `REACHED` of the optimum of the box, on each view.

    Parameters
    ----------
    sets : list, optional
        As `trial_sets` returns, which is the default.
    variants : sequence of str
        Of `VARIANTS`.
    seeds : int
        Runs of the algorithm, each with a generator of its own: it is seeded by the names of view and variant, too, so
        that all runs are independent.
    workers : int
        Processes; the numbers do not depend on them.
    progress : bool
        Show a progress bar.

    Returns
    -------
    DataFrame
        view, variant, optimum (px), seeds, reached, median_excess and worst_excess (px above the optimum).
    """
    sets = trial_sets() if sets is None else sets
    tasks = [delayed(_success)(*view, variant, seeds) for view in sets for variant in variants]
    rows = tqdm(Parallel(workers, return_as="generator")(tasks), total=len(tasks), unit="variant", disable=not progress)
    columns = ["view", "variant", "optimum", "seeds", "reached", "median_excess", "worst_excess"]
    return pd.DataFrame(list(rows), columns=columns)


def _success(name, object_points, image_points, camera, variant, seeds):
    """A row of `success_rates`."""
    optimum = optimum_in_box(object_points, image_points, camera).mean_distance
    key = [crc32(text.encode()) for text in (name, variant)]
    rngs = [np.random.default_rng([*key, seed]) for seed in range(seeds)]
    runs = repeat_calibration(object_points, image_points, camera, rngs, **VARIANTS[variant])
    excess = np.maximum(np.array([run.mean_distance for run in runs]) - optimum, 0)
    return name, variant, optimum, seeds, int(np.sum(excess <= REACHED)), float(np.median(excess)), float(excess.max())


def success_shares(rates: DataFrame) -> DataFrame:
    """The shares of runs that reach the optimum, the views taken together in groups.

    Parameters
    ----------
    rates : DataFrame
        As `success_rates` returns, with the same number of seeds on each view.

    Returns
    -------
    DataFrame
        A row for each variant and group ("paper's view", "5 rendered views", "13 photographs"): runs, reached, share
        (%), and sigma (%), its standard error from the runs on each view, which are independent.  The views are these,
        not a sample of all views.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> shares = study.success_shares(study.load_measured("ga_success"))
    >>> len(shares), int(shares["runs"].max()), float(shares["share"].max())
    (15, 1300, 100.0)
    """
    views = rates["view"].str.extract(rf"^({'|'.join(GROUPS)})")[0].map(GROUPS)
    rows = []
    for (variant, name), group in rates.groupby(["variant", views], sort=False):
        runs, reached = int(group["seeds"].sum()), int(group["reached"].sum())
        share = group["reached"] / group["seeds"]
        sigma = np.sqrt(np.sum(share * (1 - share) / group["seeds"])) / len(group)
        rows.append((variant, name, runs, reached, *(100 * x for x in (reached / runs, sigma))))
    return pd.DataFrame(rows, columns=["variant", "views", "runs", "reached", "share", "sigma"])


def write_success(folder: Path = MEASURED_FOLDER) -> None:
    """Write the table of `success_rates` into `folder`."""
    table = success_rates().round({"optimum": 6, "median_excess": 6, "worst_excess": 6})
    what = f"seeds that end within {REACHED:g} px of the optimum of the box (Eq. 7, px)"
    write_measured(folder, "ga_success", table, f"{what}; {made_by('ga_success')}")
