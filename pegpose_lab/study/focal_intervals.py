"""The focal length of a calibration with its 95 % interval, in mm for every camera model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..calibration import Calibration


def focal_interval(runs: Sequence[Calibration], pitch: float) -> tuple[float, float, float]:
    """Return f and its 95 % interval (f, low, high), mm.

    One calibration states its own interval.  Several, of one view each, give their mean, and Student's interval of it
    from their scatter.

    Parameters
    ----------
    runs : sequence of Calibration
    pitch : float
        mm/px, for cameras whose f is in px.

    Examples
    --------
    >>> from pegpose_lab import calibrate_joint, calibrate_tsai, paper, study
    >>> truth, rng = paper.paper_experiment(), np.random.default_rng(0)
    >>> board = truth.board.object_points
    >>> seen = [truth.camera.project(board, pose) + 0.1 * rng.standard_normal((48, 2)) for pose in truth.cam_from_boards]
    >>> joint = calibrate_joint([board] * 5, seen, truth.camera.sensor)
    >>> [round(number, 2) for number in study.focal_interval([joint], truth.camera.pixel_pitch[0])]
    [47.92, 47.87, 47.97]
    >>> single = [calibrate_tsai(board, points, truth.camera.sensor) for points in seen]
    >>> [round(number, 1) for number in study.focal_interval(single, truth.camera.pixel_pitch[0])]
    [47.5, 46.5, 48.6]
    """
    name = "f_x" if "f_x" in runs[0].camera.parameters else "focal_length"
    scale = pitch if name == "f_x" else 1.0
    if len(runs) == 1:
        low, high = runs[0].interval(name)
        return scale * runs[0].camera.parameters[name], scale * low, scale * high
    values = scale * np.array([run.camera.parameters[name] for run in runs])
    half = stdtrit(len(values) - 1, 0.975) * values.std(ddof=1) / np.sqrt(len(values))
    return float(values.mean()), float(values.mean() - half), float(values.mean() + half)
