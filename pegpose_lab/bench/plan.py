"""A run of the benchmark: its plan and its report.

`score` defines what is measured of circles, `calibration` what is measured of calibrations; `aims` has the aims.
"""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from . import peers
from .aims import judge
from .calibration import measure_genetic, measure_joint, measure_rivals
from .calibrators import measure_calibrators
from .chain import measure_chain
from .resources import describe_methods, measure_sizes
from .scenes import MAIN, OTHER, TARGET_NOISE
from .score import measure
from .statistics import summarize

WORKERS = 2


@dataclass(frozen=True)
class Plan:
    """The amount of work: {scene: (frames, noise levels)}, sizes in megapixels, numbers of views, seeds of the genetic
    algorithm, methods, methods whose memory is measured, repeats of timed calls, splits of views into halves, and frames of
    the paper's experiment."""

    cells: dict
    sizes: tuple
    views: tuple
    seeds: int
    methods: tuple = tuple(peers.COMPARED)
    memory: tuple = tuple(peers.COMPARED)
    repeats: int = 3
    splits: int = 10
    chain: int = 45


FULL = Plan(
    dict.fromkeys(MAIN, (200, (1, 2, 5, 10))) | dict.fromkeys(OTHER, (100, (TARGET_NOISE,))),
    (0.5, 1, 2, 5, 10, 20),
    (5, 13, 25, 50, 100, 200),
    10,
)
QUICK = Plan(
    dict.fromkeys(MAIN, (1, (TARGET_NOISE,))), (0.5, 2), (5, 13), 1, memory=(peers.OURS,), repeats=1, splits=2, chain=3
)


# ---- the report ----


@dataclass(frozen=True)
class Report:
    """Tables of a run: `circles` (`summarize`), `methods` (`describe_methods`), `sizes` (`measure_sizes`), `joint`
    (`measure_joint`), `genetic` (`measure_genetic`), `rivals` (`measure_rivals`), `calibrators`
    (`measure_calibrators`), `chain` (`measure_chain`), `targets` (`judge`)."""

    circles: pd.DataFrame
    methods: pd.DataFrame
    sizes: pd.DataFrame
    joint: pd.DataFrame
    genetic: pd.DataFrame
    rivals: pd.DataFrame
    calibrators: pd.DataFrame
    chain: pd.DataFrame
    targets: pd.DataFrame


def run(plan: Plan = FULL, *, workers: int = WORKERS) -> Report:
    """Measure everything in a plan.

    Returns
    -------
    Report
    """
    frames, discs = measure(plan.cells, plan.methods, workers=workers)
    circles = summarize(frames, discs)
    methods = describe_methods(plan.methods, plan.memory)
    sizes = measure_sizes(plan.sizes, repeats=plan.repeats)
    joint = measure_joint(plan.views, repeats=plan.repeats)
    genetic = measure_genetic(seeds=plan.seeds)
    rivals = measure_rivals(repeats=plan.repeats)
    calibrators = measure_calibrators(splits=plan.splits, repeats=plan.repeats)
    chain = measure_chain(plan.chain, repeats=plan.repeats)
    targets = judge(circles, methods, sizes, joint, genetic)
    return Report(circles, methods, sizes, joint, genetic, rivals, calibrators, chain, targets)
