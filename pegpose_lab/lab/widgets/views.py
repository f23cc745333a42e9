"""The explorer for what a calibration knows of f: tilt and number of the boards, and the corners' noise."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import ipywidgets
import numpy as np

from ... import study
from ...calibration import calibrate_joint
from ...checks import CalibrationError
from .explorer import Explorer, _slider
from .intervals import _blank, _drawn

if TYPE_CHECKING:
    from ...paper import Experiment

DRAWS = 6  # of the noise


def views_explorer(experiment: Experiment) -> Explorer:
    """Sliders for the boards' tilt, their number and the corners' noise: 95 % intervals of f against the truth.

    Parameters
    ----------
    experiment : Experiment
        Camera and board.

    Returns
    -------
    Explorer
        Controls ``tilt`` (deg), ``views``, ``noise`` (px per axis).
    """
    camera, board = experiment.camera, experiment.board

    @lru_cache(maxsize=64)
    def calibrations(tilt, views, noise):
        exact = [camera.project(board.object_points, pose) for pose in study.trial_poses(board, tilt, views, 4)]
        found = []
        for draw in range(DRAWS):
            rng = np.random.default_rng([draw, 3])
            seen = [points + noise * rng.standard_normal(points.shape) for points in exact]
            found.append(calibrate_joint([board.object_points] * views, seen, camera.sensor))
        return found

    def draw(picture, tilt, views, noise):
        try:
            found = calibrations(tilt, views, noise)
        except CalibrationError as error:
            raise CalibrationError(f"these boards do not determine the camera: {error}") from error
        stated = np.array([run.interval("focal_length") for run in found])
        picture[:] = _drawn(stated, camera.focal_length)
        width = np.ptp(stated, axis=1).mean() / 2 / camera.focal_length
        holds = int(np.sum((stated[:, 0] < camera.focal_length) & (camera.focal_length < stated[:, 1])))
        rms = np.mean([run.rms for run in found])
        return (
            f"f is known to ± {100 * width:.2f} % (95 %), and the truth is in {holds} of {DRAWS} intervals;\n"
            f"the residual says nothing of it: rms {rms:.3f} px"
        )

    controls = {
        "tilt": _slider(ipywidgets.IntSlider, "tilt of the boards (deg)", 20, 5, 45, step=5, live=False),
        "views": _slider(ipywidgets.IntSlider, "number of boards", 5, 3, 15, live=False),
        "noise": _slider(ipywidgets.FloatSlider, "corner noise (px)", 0.1, 0.02, 0.3, step=0.02, live=False),
    }
    return Explorer("views explorer", lambda **_: _blank(), draw, controls)
