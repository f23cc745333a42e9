"""The benchmark's tables as files, as blocks of a README and as text."""

import json
import platform
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from ..lab import results
from . import detectors
from .calibration import measure_genetic, measure_joint, measure_rivals
from .score import (
    BLUR,
    MAIN,
    OTHER,
    SCENES,
    TARGET_NOISE,
    describe_methods,
    exponent,
    growth,
    measure,
    measure_sizes,
    summarize,
)

WORKERS = 2


@dataclass(frozen=True)
class Plan:
    """How much is measured: {scene: (frames, noise levels)}, sizes in megapixels, numbers of views, seeds of the genetic
    algorithm, methods, whose memory, repeats of what is timed."""

    cells: dict
    sizes: tuple
    views: tuple
    seeds: int
    methods: tuple = tuple(detectors.METHODS)
    memory: tuple = tuple(detectors.METHODS)
    repeats: int = 3


FULL = Plan(
    dict.fromkeys(MAIN, (200, (1, 2, 5, 10))) | dict.fromkeys(OTHER, (50, (TARGET_NOISE,))),
    (0.5, 1, 2, 5, 10, 20),
    (5, 13, 25, 50, 100, 200),
    10,
)
QUICK = Plan(dict.fromkeys(MAIN, (1, (TARGET_NOISE,))), (0.5, 2), (5, 13), 1, memory=(detectors.OURS,), repeats=1)


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


def run(plan=FULL, *, workers=WORKERS):
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


# scene: largest centre/bound, radius/bound, time ratio, false positives; least detection
_LIMITS = {
    "clean": (1.05, 1.2, 1.0, 0.0, 100.0),
    "tilt": (1.05, 1.2, 1.0, 0.0, 100.0),
    "highlights": (1.6, 2.0, 3.0, 0.0, 100.0),
    "clutter": (2.0, 2.5, 3.0, 0.01, 99.5),
}
_HONEST = {"clean": (0.9, 1.1), "tilt": (0.9, 1.1)}  # scene: range of the standard deviation of error / sigma
_ELSEWHERE = (0.0, 1.3)
_COVERAGE = (93.0, 97.0)  # %, of the 95 % intervals


def judge(circles, methods, sizes, joint, genetic):
    """What was aimed at, beside what was measured: sizes of errors and times at the noise of the targets, the
    honesty of the sigmas at the worst noise, in every scene.

    Returns
    -------
    DataFrame
        scene, quantity, low, high (the limits; NaN for none), measured, met.
    """
    ours = circles[circles["method"] == detectors.OURS]
    rows = []
    for scene, cells in ours.groupby("scene", sort=False):
        if scene in _LIMITS:
            rows += _error_targets(cells[cells["noise"] == TARGET_NOISE].iloc[0], *_LIMITS[scene])
        rows += _honesty_targets(scene, cells)
    worst = ours.loc[ours["scene"] == "clean", "center"].max()
    rows.append(("clean", "centre / bound, worst noise", np.nan, 1.1, worst))
    memory = methods.set_index("method").loc[detectors.OURS, "memory_mb"]
    rows.append(("tilt", "memory, MB", np.nan, 100.0, memory))
    rows.append(("clean", "exponent of time over megapixels", np.nan, 1.1, growth(sizes)))
    thirteen = joint.loc[joint["views"] == 13, "ratio"].item()
    rows.append(("joint", "time / cv2.calibrateCamera, 13 views", np.nan, 3.0, thirteen))
    rows.append(("joint", "exponent of time over views", np.nan, 1.1, exponent(joint["views"], joint["ms"])))
    rows.append(("genetic", "time / differential evolution, worst view", np.nan, 3.0, genetic["ratio"].max()))
    rows.append(("genetic", "seeds at the optimum of the box, %", 100.0, np.nan, genetic["reached"].min()))
    table = pd.DataFrame(rows, columns=["scene", "quantity", "low", "high", "measured"])
    below, above = table["measured"] < table["low"], table["measured"] > table["high"]
    table["met"] = np.where(table["measured"].isna(), "not measured", np.where(below | above, "no", "yes"))
    return table


def _error_targets(row, center, radius, ratio, false_positives, detection):
    """A scene's part of `judge`'s rows: how large errors and times are."""
    return [
        (row.scene, "centre / bound", np.nan, center, row.center),
        (row.scene, "radius / bound", np.nan, radius, row.radius),
        (row.scene, f"time / {detectors.REFERENCE}", np.nan, ratio, row.time_ratio),
        (row.scene, "detection, %", detection, np.nan, row.detection),
        (row.scene, "false positives per frame", np.nan, false_positives, row.false_positives),
    ]


def _honesty_targets(scene, cells):
    """A scene's part of `judge`'s rows: whether errors are as large as the sigmas say, at the worst noise."""
    low, high = _HONEST.get(scene, _ELSEWHERE)
    rows = []
    for quantity, name in (("centre", "center_sd"), ("radius", "radius_sd")):
        worst = cells[name].iloc[np.abs(np.log(cells[name].to_numpy())).argmax()]
        rows.append((scene, f"sd of {quantity} error / sigma, worst noise", low, high, worst))
    worst = cells["coverage"].iloc[np.abs(cells["coverage"].to_numpy() - 95).argmax()]
    return [*rows, (scene, "95 % intervals that hold the truth, %, worst noise", *_COVERAGE, worst)]


def write(report, folder, readme=None):
    """Write bench_circles, _methods, _sizes, _joint, _genetic, _rivals and _targets (.csv and .tex) into a folder.

    Parameters
    ----------
    report : Report
    folder : Path
    readme : Path, optional
        A Markdown file whose block between ``<!-- bench:begin -->`` and ``<!-- bench:end -->`` is renewed.

    Raises
    ------
    ValueError
        If the file does not have exactly one such pair.
    """
    for name in Report.__dataclass_fields__:
        results.write_table(folder, f"bench_{name}", getattr(report, name))
    if readme is not None:
        results.update_block(readme, "bench", to_markdown(load(folder)))


def load(folder):
    """Read back what `write` wrote."""
    names = Report.__dataclass_fields__
    return Report(**{name: pd.read_csv(Path(folder, f"bench_{name}.csv")) for name in names})


def readme_is_current(readme, folder):
    """Return whether a README's block is what `write` would make of the tables in a folder; raises as it does."""
    return results.block_is_current(readme, "bench", to_markdown(load(folder)))


_SHOWN = {
    "method": "method", "frames": "frames", "ms": "ms", "time_ratio": "time ratio", "detection": "detected, %",
    "false_positives": "false per frame", "center": "centre / bound", "center_rms": "its rms",
    "radius": "radius / bound", "arc_bound": "arc bound / bound",
    "center_arc": "centre / arc bound", "radius_arc": "radius / arc bound",
    "center_sd": "sd of centre error / sigma", "coverage": "95 % intervals that hold, %",
}  # fmt: skip


def to_markdown(report):
    """The block of a README: what was measured at the noise of the targets in one table, the aims, then all tables."""
    circles = report.circles[report.circles["noise"] == TARGET_NOISE]
    head = ["scene", "quantity", "low", "high", "measured", "met"]
    rows = [_shown(row) for row in report.targets[head].to_numpy()]
    met = (report.targets["met"] == "yes").sum()
    parts = [_heading(circles), _overview(circles), *_absent(report.methods)]
    parts += _folded(f"Aims and what was measured: {met} of {len(rows)} met", [results.markdown([head, *rows], "llrrrl")])
    parts += _folded("Every scene in full", _scenes(circles))
    parts += _folded("Calibration: the joint one, the genetic algorithm, and its rivals", _calibration(report))
    return "\n\n".join(parts)


def _folded(title, parts):
    """Parts behind a title that opens them."""
    return [f"<details><summary>{title}</summary>", *parts, "</details>"]


def _heading(circles):
    """What holds for all tables."""
    values = 8 * circles.loc[circles["method"] == detectors.OURS, "frames"].max()  # two axes of four pegs
    return (
        f"Noise {TARGET_NOISE} grey values, blur {BLUR[0]} to {BLUR[1]} px, 1600 x 1200 px, four pegs; time: processor time, "
        f"as a ratio to {detectors.REFERENCE} in the same frames. Centre / bound: 1.4826 times the median error over the "
        "Cramér-Rao bound of the whole edge, which is the rms / bound of normal errors, known here to "
        f"{100 / np.sqrt(2 * 0.37 * values):.0f} % for the methods that got every frame. `pegpose_lab.bench` has the "
        "definitions, `data/results/bench_methods.csv` the peers' settings, versions and memory."
    )


def _overview(circles):
    """A row for each method: time, errors over the bound in the main scenes, and what it finds in the hardest of these."""
    scenes = [scene.name for scene in MAIN]
    cells = circles.set_index(["method", "scene"])
    head = ["method", "time ratio", *(f"centre / bound, {name}" for name in scenes), "radius / bound, clean"]
    head += [f"detected, %, {scenes[-1]}", f"false per frame, {scenes[-1]}"]
    rows = []
    for method in circles["method"].unique():
        clean, last = cells.loc[(method, scenes[0])], cells.loc[(method, scenes[-1])]
        errors = [cells.loc[(method, name), "center"] for name in scenes]
        numbers = [clean["time_ratio"], *errors, clean["radius"], last["detection"], last["false_positives"]]
        rows.append([method, *_shown(numbers)])
    return results.markdown([head, *rows], "l" + "r" * (len(head) - 1))


def _scenes(circles):
    """A title and a table for each scene."""
    parts = []
    for scene, note in SCENES.items():
        part = circles[circles["scene"] == scene.name]
        if len(part):
            rows = [list(_SHOWN.values()), *(_shown(row) for row in part[list(_SHOWN)].to_numpy())]
            parts += [f"**{scene.name}**: {note}", results.markdown(rows, "l" + "r" * (len(_SHOWN) - 1))]
    return parts


def _calibration(report):
    """A title and a table for each part of `bench.calibration`."""
    head = ["views", "ms", "OpenCV's ms", "ratio"]
    joint = [_shown(row) for row in report.joint[["views", "ms", "opencv_ms", "ratio"]].to_numpy(float)]
    rivals = [_shown(row) for row in report.rivals.to_numpy()]
    return [
        "**joint**: `calibrate_joint` beside `cv2.calibrateCamera`, same corners and unknowns",
        results.markdown([head, *joint], "rrrr"),
        "**genetic**: `calibrate_genetic` beside `scipy.optimize.differential_evolution`, same objective and box",
        _genetic_table(report.genetic),
        "**rivals**: every method of notebook 05 on the corners of the photographs",
        results.markdown([list(report.rivals.columns), *rivals], "lrr"),
    ]


def _genetic_table(genetic):
    """The views of one kind in one row: times of the middle view, the least reached."""
    kind = genetic["view"].str.replace(r" \d+$|\d+$", "", regex=True).replace({"left": "photographs"})
    head = ["views", "ms", "differential evolution's ms", "ratio", "at the optimum, %", "differential evolution, %"]
    rows = [
        [f"{len(part)} {name}", *_shown([*part[["ms", "de_ms", "ratio"]].median(), *part[["reached", "de_reached"]].min()])]
        for name, part in genetic.groupby(kind, sort=False)
    ]
    return results.markdown([head, *rows], "lrrrrr")


def _absent(methods):
    """A line for each method that could not run."""
    rows = methods[methods["missing"].notna() & (methods["missing"] != "")]
    return [f"{row.method}: not measured, {row.missing}." for row in rows.itertuples()]


def _shown(row):
    """Cells as text, numbers with three digits, nothing for NaN."""
    return [value if isinstance(value, str) else _digits(value) for value in row]


def _digits(value):
    """Three digits, but all of a whole number's; nothing for NaN."""
    if np.isnan(value):
        return ""
    return f"{value:.0f}" if abs(value) >= 100 or value == round(value) else f"{value:.3g}"


def to_text(report):
    """All tables for a terminal."""
    names = Report.__dataclass_fields__
    with pd.option_context("display.width", 250, "display.max_columns", 30, "display.max_rows", 500):
        parts = [getattr(report, name).round(3).to_string(index=False, na_rep="") for name in names]
    machine = {"python": platform.python_version(), "opencv": cv2.__version__, "numpy": np.__version__}
    met = f"{(report.targets['met'] == 'yes').sum()} of {len(report.targets)} aims met."
    return "\n\n".join([json.dumps(machine), *parts, met])
