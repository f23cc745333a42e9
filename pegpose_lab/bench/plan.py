"""The benchmark: circle measurement and calibration beside their peers and their bounds, measured in one run.

What is measured, and how, stands in `bench` and `bench.calibration`; here are the plan of a run, the aims,
and the report.
"""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from . import peers
from .aims import judge
from .calibration import measure_genetic, measure_joint, measure_rivals
from .resources import describe_methods, measure_sizes
from .scenes import MAIN, OTHER, TARGET_NOISE
from .score import measure
from .statistics import summarize

WORKERS = 2


@dataclass(frozen=True)
class Plan:
    """How much is measured: {scene: (frames, noise levels)}, sizes in megapixels, numbers of views, seeds of the genetic
    algorithm, methods, whose memory, repeats of what is timed."""

    cells: dict
    sizes: tuple
    views: tuple
    seeds: int
    methods: tuple = tuple(peers.COMPARED)
    memory: tuple = tuple(peers.COMPARED)
    repeats: int = 3


FULL = Plan(
    dict.fromkeys(MAIN, (200, (1, 2, 5, 10))) | dict.fromkeys(OTHER, (50, (TARGET_NOISE,))),
    (0.5, 1, 2, 5, 10, 20),
    (5, 13, 25, 50, 100, 200),
    10,
)
QUICK = Plan(dict.fromkeys(MAIN, (1, (TARGET_NOISE,))), (0.5, 2), (5, 13), 1, memory=(peers.OURS,), repeats=1)


# ---- the report ----


@dataclass(frozen=True)
class Report:
    """Tables of a run: `circles` (`summarize`), `methods`, `sizes` (`measure_sizes`), `joint` (`measure_joint`),
    `genetic` (`measure_genetic`), `baselines` (`measure_rivals`), `targets` (`judge`)."""

    circles: pd.DataFrame
    methods: pd.DataFrame
    sizes: pd.DataFrame
    joint: pd.DataFrame
    genetic: pd.DataFrame
    rivals: pd.DataFrame
    targets: pd.DataFrame


def run(plan: Plan = FULL, *, workers: int = WORKERS) -> Report:
    """Measure all that a plan names.

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
    return Report(circles, methods, sizes, joint, genetic, rivals, judge(circles, methods, sizes, joint, genetic))
