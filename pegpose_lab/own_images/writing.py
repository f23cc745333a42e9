"""The files of a run: calibration, corners, discs, poses, forecasts and the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..files import replacing
from ..pose import pose_table, write_detection
from .report import as_html

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..calibration import Calibration
    from .boards import BoardImage
    from .description import Description
    from .frames import Frame

CAMERAS = {"camera.yaml": "opencv", "camera_info.yaml": "ros"}
TABLES = ("corners.csv", "discs.csv", "poses.csv", "forecasts.csv")
POSE, REPORT = "pose.yaml", "report.html"


def write_results(
    target: Path,
    described: Description,
    boards: Sequence[BoardImage],
    calibration: Calibration | None,
    why_not: str,
    frames: Sequence[Frame],
) -> list[Path]:
    """Write what there is, and remove what an earlier run left; returns the files."""
    for name in (*CAMERAS, *TABLES, POSE, REPORT):
        (target / name).unlink(missing_ok=True)
    files = []
    if calibration is not None:
        for name, form in CAMERAS.items():
            calibration.save(target / name, form)
            files.append(target / name)
    for name, table in zip(TABLES, _tables(boards, frames), strict=True):
        if len(table):
            with replacing(target / name) as temporary:
                table.to_csv(temporary, index=False, lineterminator="\n")
            files.append(target / name)
    posed = [one.pose for one in frames if one.pose is not None and not one.doubtful]
    if posed:
        write_detection(target / POSE, posed[-1], "camera")
        files.append(target / POSE)
    with replacing(target / REPORT) as temporary:
        temporary.write_text(as_html(described, boards, calibration, why_not, frames), encoding="utf-8")
    return [*files, target / REPORT]


def _tables(boards, frames):
    """In the order of `TABLES`."""
    poses = pose_table([one.pose or one.fate for one in frames])
    poses.insert(1, "image", [one.path.name for one in frames])
    return corner_table(boards), disc_table(frames), poses, forecast_table(frames)


def corner_table(boards: Sequence[BoardImage]) -> pd.DataFrame:
    """The corners of all images, px: image, corner (counted from 0), x, y."""
    rows = [
        [one.path.name, index, *point]
        for one in boards
        if one.corners is not None
        for index, point in zip(one.index, one.corners, strict=True)
    ]
    return pd.DataFrame(rows, columns=["image", "corner", "x", "y"])


def disc_table(frames: Sequence[Frame]) -> pd.DataFrame:
    """The part's discs in each frame, px: image, disc (counted from 1), state, x, y, radius and the sigmas of x and y."""
    rows = [
        [one.path.name, number, state, *center, radius, *np.where(np.isfinite(sigmas), sigmas, np.nan)]
        for one in frames
        if (seen := one.observation) is not None
        for number, (state, center, radius, sigmas) in enumerate(
            zip(seen.states, seen.peg_centers, seen.peg_radii, seen.peg_sigmas, strict=True), 1
        )
    ]
    return pd.DataFrame(rows, columns=["image", "disc", "state", "x", "y", "radius", "sigma_x", "sigma_y"])


def forecast_table(frames: Sequence[Frame]) -> pd.DataFrame:
    """Of each frame with a forecast: shares of insertions that meet nothing and that enter, and the clearance needed.

    Examples
    --------
    >>> list(forecast_table([]).columns)
    ['frame', 'free', 'enters', 'limiting_peg', 'free_clearance_mm']
    """
    rows = [
        [one.path.name, told.probabilities["free"], told.enters, told.limiting_peg, told.free_clearance]
        for one in frames
        if (told := one.forecast) is not None
    ]
    return pd.DataFrame(rows, columns=["frame", "free", "enters", "limiting_peg", "free_clearance_mm"])
