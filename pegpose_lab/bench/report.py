"""The benchmark's tables as files, as blocks of a README and as text."""

from __future__ import annotations

import json
import platform
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from ..lab import results
from . import peers
from .plan import Report
from .scenes import BLUR, MAIN, SCENES, TARGET_NOISE


def write(report: Report, folder: Path, readme: Path | None = None) -> None:
    """Write bench_circles, _methods, _sizes, _joint, _genetic, _rivals, _calibrators, _chain and _targets (.csv and .tex).

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


def load(folder: Path) -> Report:
    """Read back what `write` wrote."""
    names = Report.__dataclass_fields__
    return Report(**{name: results.read_csv(Path(folder, f"bench_{name}.csv")) for name in names})


def readme_is_current(readme: Path, folder: Path) -> bool:
    """Return whether a README's block is what `write` would make from the tables in a folder; raises like `write`."""
    return results.block_is_current(readme, "bench", to_markdown(load(folder)))


_SHOWN = {
    "method": "method", "frames": "frames", "ms": "ms", "time_ratio": "time ratio", "detection": "detected, %",
    "false_positives": "false per frame", "center": "centre / bound", "center_rms": "its rms",
    "radius": "radius / bound", "arc_bound": "arc bound / bound",
    "center_arc": "centre / arc bound", "radius_arc": "radius / arc bound",
    "center_sd": "sd of centre error / sigma", "coverage": "95 % intervals that hold, %",
}  # fmt: skip


def to_markdown(report: Report) -> str:
    """A README's block: one table of the results at the noise of the targets, then the aims, then all tables."""
    circles = report.circles[report.circles["noise"] == TARGET_NOISE]
    head = ["scene", "quantity", "low", "high", "measured", "met"]
    rows = [_shown(row) for row in report.targets[head].to_numpy()]
    met = (report.targets["met"] == "yes").sum()
    parts = [_heading(circles), _overview(circles), *_absent(report.methods)]
    parts += _folded(
        f"Aims and what was measured: {met} of {len(rows)} met", [results.markdown([head, *rows], "llrrrl")]
    )
    parts += _folded("Every scene in full", _scenes(circles))
    parts += _folded("Calibration: the joint one, the genetic algorithm, and its rivals", _calibration(report))
    parts += _folded("From a frame to a pose with its covariance", _chain(report.chain))
    return "\n\n".join(parts)


def _chain(chain):
    """A title and the table of `measure_chain`."""
    head = ["method", "frames", "ms", "frames a second", "x, y, mm", "z, mm", "rms of error / sigma"]
    note = "**chain**: frames of the paper's experiment, one thread; position of the hub in six degrees of freedom"
    return [note, results.markdown([head, *(_shown(row) for row in chain.to_numpy())], "lrrrrrr")]


def _folded(title, parts):
    """Parts that are hidden until the reader opens their title."""
    return [f"<details><summary>{title}</summary>", *parts, "</details>"]


def _heading(circles):
    """The conditions of all tables."""
    values = 8 * circles.loc[circles["method"] == peers.OURS, "frames"].max()  # two axes of four pegs
    return (
        f"Noise {TARGET_NOISE} grey values, blur {BLUR[0]} to {BLUR[1]} px, 1600 x 1200 px, four pegs; time: processor "
        f"time, as a ratio to {peers.REFERENCE} in the same frames. Centre / bound: 1.4826 times the median error over "
        "the Cramér-Rao bound of the whole edge, which is the rms / bound of normal errors, known here to "
        f"{100 / np.sqrt(2 * 0.37 * values):.0f} % for the methods that got every frame. `pegpose_lab.bench` has the "
        "definitions, `data/results/bench_methods.csv` the peers' settings, versions and memory."
    )


def _overview(circles):
    """A row for each method: time, errors over the bound in the main scenes, and detections in the hardest of them."""
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
        *_calibrators(report.calibrators),
    ]


def _calibrators(table):
    """A title and a table of the tools on each set of corners, and a line for each that could not run."""
    columns = {
        "tool": "tool", "version": "version", "f": "f_x, px", "sigma": "its sigma", "half_px": "halves differ, px",
        "z": "z of halves", "ms": "ms", "corner_inf": "corner, infinity, px", "corner_1m": "corner, 1 m, px",
        "off_mrcal": "off mrcal's, %",
    }  # fmt: skip
    parts = [
        "**calibrators**: joint calibration beside other tools, same corners and model (OpenCV's k1, k2, p1, p2, k3); "
        "corner: the largest stated uncertainty of projection at the image's corners"
    ]
    for name, rows in table.groupby("corners", sort=False):
        there = rows[rows["missing"].isna() | (rows["missing"] == "")]
        shown = [
            [row["tool"], str(row["version"]), f"{row['f']:.2f}", *_shown(row[list(columns)[3:]].to_numpy(float))]
            for _, row in there.iterrows()
        ]
        parts += [f"Corners: {name}", results.markdown([list(columns.values()), *shown], "ll" + "r" * 8)]
    missing = table[table["missing"].notna() & (table["missing"] != "")].drop_duplicates("tool")
    return parts + [f"{row.tool}: not measured, {row.missing}." for row in missing.itertuples()]


def _genetic_table(genetic):
    """One row for all views of a kind: the median times, and the smallest shares that reach the optimum."""
    kind = genetic["view"].str.replace(r" \d+$|\d+$", "", regex=True).replace({"left": "photographs"})
    head = ["views", "ms", "differential evolution's ms", "ratio", "at the optimum, %", "differential evolution, %"]
    rows = [
        [
            f"{len(part)} {name}",
            *_shown([*part[["ms", "de_ms", "ratio"]].median(), *part[["reached", "de_reached"]].min()]),
        ]
        for name, part in genetic.groupby(kind, sort=False)
    ]
    return results.markdown([head, *rows], "lrrrrr")


def _absent(methods):
    """A line for each method that could not run."""
    rows = methods[methods["missing"].notna() & (methods["missing"] != "")]
    return [f"{row.method}: not measured, {row.missing}." for row in rows.itertuples()]


def _shown(row):
    """Cells as text: numbers with three digits, "" for NaN."""
    return [value if isinstance(value, str) else _digits(value) for value in row]


def _digits(value):
    """A number with three digits, or all digits of a whole number; "" for NaN."""
    if np.isnan(value):
        return ""
    return f"{value:.0f}" if abs(value) >= 100 or value == round(value) else f"{value:.3g}"


def to_text(report: Report) -> str:
    """All tables for a terminal."""
    names = Report.__dataclass_fields__
    with pd.option_context("display.width", 250, "display.max_columns", 30, "display.max_rows", 500):
        parts = [getattr(report, name).round(3).to_string(index=False, na_rep="") for name in names]
    machine = {"python": platform.python_version(), "opencv": cv2.__version__, "numpy": np.__version__}
    met = f"{(report.targets['met'] == 'yes').sum()} of {len(report.targets)} aims met."
    return "\n\n".join([json.dumps(machine), *parts, met])
