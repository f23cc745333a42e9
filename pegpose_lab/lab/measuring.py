"""The tables of data/measured that ``python3 -m pegpose_lab measure`` makes, each with the function that writes it.

The list is here and not in `study`, so that ``measure --help`` can show it on a bare Python.  This file imports only
the standard library; a function's package is imported when the function is called.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


class Measurement(NamedTuple):
    """A line of `MEASUREMENTS`."""

    function: str  # package and name of the function, which takes the output folder
    files: tuple  # the CSV files that it writes
    takes: str  # approximate time on two cores
    photographs: tuple = ()  # data sets of third-party photographs that it needs
    tools: tuple = ()  # other calibration tools (`calibrators`), one of which it needs


MEASUREMENTS = {
    "circle_counts": Measurement(
        "study.write_circle_counts", ("circle_counts", "missed_circles"), "5 s",
        ("visp-mire2-a", "visp-grid36-a", "skimage-coins", "conrods-a", "screws4-a", "opencv-samples"),
    ),
    "peer_counts": Measurement(
        "bench.write_peer_counts", ("peer_counts",), "1 min",
        ("visp-mire2-a", "visp-grid36-a", "skimage-coins", "conrods-a", "screws4-a", "opencv-samples"),
    ),
    "screw_bits": Measurement("study.write_screw_bits", ("screw_bits",), "1 s", ("screws4-a",)),
    "segmented_parts": Measurement("study.write_parts", ("segmented_parts",), "1 s", ("skimage-coins",)),
    "visp_circles_centers": Measurement("study.write_grid", ("visp_circles_centers",), "2 s", ("visp_circles",)),
    "disc_pulls": Measurement(
        "study.write_disc_pulls", ("disc_pulls",), "20 s", ("discocal-left", "robot-dots-10x10", "open3dv-dots")
    ),
    "assemblies": Measurement(
        "study.write_assemblies", ("pose_intervals", "insertion_rates", "chain_clearances"), "15 min"
    ),
    "moving_hub": Measurement("study.write_moving_hub", ("moving_hub",), "3 min"),
    "servo_runs": Measurement("study.write_servo_runs", ("servo_runs", "servo_steps"), "6 min"),
    "hand_eyes": Measurement(
        "study.write_hand_eyes", ("hand_eyes",), "20 s", ("visp_franka_eye_to_hand", "robot-dots-10x10")
    ),
    "real_rings": Measurement(
        "study.write_real_rings", ("real_rings", "real_ring_places", "real_ring_circles", "real_ring_runs"), "30 s",
        ("rings-a", "visp-mire2-a", "visp-mire2-b"),
    ),
    "opencv_left_corners": Measurement(
        "study.write_left_corners", ("opencv_left_corners",), "4 s", ("opencv_left",)
    ),
    "opencv_left_detectors": Measurement(
        "study.write_sensitivity", ("opencv_left_detectors",), "5 s", ("opencv_left",)
    ),
    "split_halves": Measurement("study.write_split_halves", ("split_halves",), "4 min", (
        "opencv_left", "boards-opencv-right", "boards-udacity", "boards-sony", "boards-stereo-l",
    )),
    "sector_corners": Measurement("study.write_sector_corners", ("sector_corners",), "15 s"),
    "mrcal_uncertainty": Measurement(
        "bench.write_mrcal_uncertainty", ("mrcal_uncertainty",), "20 s", tools=("mrcal", "mrcal, Debian")
    ),
    "bent_boards": Measurement("study.write_bent_boards", ("bent_boards",), "2 min"),
    "ga_success": Measurement("study.write_success", ("ga_success",), "3 min"),
    "disc_constants": Measurement("bench.write_disc_constants", ("disc_constants",), "4 min"),
    "rendered_trials": Measurement("study.write_rendered_trials", ("rendered_trials",), "10 min"),
    "peer_settings": Measurement("bench.write_peer_settings", ("peer_settings",), "10 min"),
    "two_stage_counts": Measurement("study.write_two_stage_counts", ("two_stage_counts",), "10 min"),
}  # fmt: skip
"""Measurements by name: first those of third-party photographs, then the others from fast to slow."""


def known(name: str) -> str:
    """Return the name of a measurement; SystemExit with one sentence if there is none of that name."""
    if name not in MEASUREMENTS:
        raise SystemExit(f"Nothing to measure is called {name}; there are: {', '.join(MEASUREMENTS)}.")
    return name


def listed() -> str:
    """Return the list of measurements for ``measure --help``."""
    rows = [
        (name, f"about {line.takes}", ", ".join(f"{file}.csv" for file in line.files) + " *" * bool(line.photographs))
        for name, line in MEASUREMENTS.items()
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]
    notes = "* in third-party photographs; rendered_trials makes the trials that its file does not have"
    return "\n".join(["NAME, time on two cores, what is written into data/measured:", *lines, notes])


def measure(names: Sequence[str], folder: Path) -> int:
    """Repeat measurements and write them into a folder; return the exit code.

    Parameters
    ----------
    names : list of str
        Keys of `MEASUREMENTS`; an empty list means all that can be made here.
    folder : Path

    Raises
    ------
    SystemExit
        If a measurement was requested by name and its photographs are missing; then nothing is written.
    """
    reasons = {name: _missing(name) for name in names or MEASUREMENTS}
    missing = [reason for reason in reasons.values() if reason]
    if names and missing:
        raise SystemExit("\n".join(missing))
    for name in reasons:
        if not reasons[name]:
            print(f"{name}: about {MEASUREMENTS[name].takes}", flush=True)
            _function(name)(folder)
    for reason in missing:
        print(f"Left out: {reason}", file=sys.stderr)
    return 0


def _missing(name):
    """One sentence that says why a measurement cannot be made here, or "" if it can."""
    from .. import study
    from . import calibrators

    absent, tools = [], MEASUREMENTS[name].tools
    if tools:
        calibrators.add_calibrators()
        reasons = [calibrators.missing(tool) for tool in tools]
        if all(reasons):
            return f"{name} cannot be measured: {', and '.join(reasons)}."
    for dataset in MEASUREMENTS[name].photographs:
        try:
            study.dataset(dataset)
        except (ValueError, FileNotFoundError):
            absent.append(dataset)
    if not absent:
        return ""
    return (
        f"{name} is measured in the photographs of {', '.join(absent)}, which are not found: set PEGPOSE_DATA to the "
        "folder that holds them (data/README.md says where they come from)."
    )


def _function(name):
    """The function of a measurement."""
    from .. import bench, study

    room, function = MEASUREMENTS[name].function.split(".")
    return getattr({"bench": bench, "study": study}[room], function)
