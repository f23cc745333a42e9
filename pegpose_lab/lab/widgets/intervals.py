"""The explorer for stated intervals: a bent board and corners that err together, against the truth."""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING

import ipywidgets
import numpy as np

from ... import study
from ...calibration import calibrate_joint
from ..style import COLORS
from .drawing import _chart, _charted
from .explorer import SHOWN_WIDTH, Explorer, _slider

if TYPE_CHECKING:
    from ...paper import Experiment

HEIGHT = 360  # px, height of the image
VIEWS, DRAWS, NOISE = 8, 8, 0.1  # boards, draws of the noise, px per axis
REACH = 0.15  # mm shown on either side of the true f, doubled until all intervals are seen


def interval_explorer(experiment: Experiment) -> Explorer:
    """Sliders for what makes stated intervals too short: the board's bow, and the correlation of the corners' errors.

    The paper's camera is calibrated from eight boards, with eight draws of the noise; each interval of f is drawn as it is
    stated and as it would be for a flat board and independent errors.

    Parameters
    ----------
    experiment : Experiment
        Camera and board.

    Returns
    -------
    Explorer
        Controls ``bow`` (mm) and ``correlation`` (the length over which errors are alike, px).
    """
    camera, board = experiment.camera, experiment.board
    poses = study.trial_poses(board, 30.0, VIEWS, 4)

    @lru_cache(maxsize=64)
    def calibrations(bow, correlation):
        exact = [camera.project(study.bowed_board(board, bow), pose) for pose in poses]
        found = []
        for draw in range(DRAWS):
            rng = np.random.default_rng([draw, 9])
            seen = [points + NOISE * study.correlated_noise(points, correlation, rng) for points in exact]
            found.append(calibrate_joint([board.object_points] * VIEWS, seen, camera.sensor))
        return found

    def draw(picture, bow, correlation):
        found, true = calibrations(bow, correlation), camera.focal_length
        stated = np.array([run.interval("focal_length") for run in found])
        middles = stated.mean(axis=1)
        sigmas = [run.classical_sigma("focal_length") for run in found]
        classical = middles[:, None] + 1.96 * np.outer(sigmas, [-1, 1])
        picture[:] = _drawn(stated, true, classical)
        holds = [int(np.sum((low < true) & (true < high))) for low, high in (stated.T, classical.T)]
        codes = Counter(flag.code for run in found for flag in run.flags)
        told = "; ".join(f"{code} ({number} of {DRAWS})" for code, number in codes.items())
        return (
            f"the truth is in {holds[0]} of {DRAWS} stated 95 % intervals, and in {holds[1]} of those for independent "
            f"errors;\nflags: {told or 'none'}"
        )

    return Explorer(
        "interval explorer",
        lambda **_: _blank(),
        draw,
        {
            "bow": _slider(ipywidgets.FloatSlider, "bow of the board (mm)", 0.0, 0.0, 0.5, step=0.05, live=False),
            "correlation": _slider(ipywidgets.IntSlider, "errors alike over (px)", 0, 0, 300, step=20, live=False),
        },
    )


def _blank():
    return np.full((HEIGHT, SHOWN_WIDTH, 3), 255, np.uint8)


def _drawn(stated, true, classical=None):
    """The intervals (n, 2) as an image; with the classical ones within, if they are given."""
    fig, ax = _chart(HEIGHT)
    rows = np.arange(len(stated))
    ax.hlines(rows, *stated.T, color=COLORS["joint"], linewidth=6, alpha=0.4, label="95 %, stated")
    if classical is not None:
        ax.hlines(rows, *classical.T, color=COLORS["joint"], linewidth=2, label="95 %, if errors were independent")
    ax.plot(stated.mean(axis=1), rows, "o", color=COLORS["joint"], markersize=4)
    ax.axvline(true, color=COLORS["truth"], linewidth=1.2, label="truth")
    reach = REACH * 2.0 ** np.ceil(np.log2(max(np.abs(stated - true).max() / REACH, 1.0)))
    ax.set(xlabel="focal length f (mm)", ylabel="draw of the noise", yticks=rows, xlim=(true - reach, true + reach))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.16), ncols=3, fontsize=9)
    return _charted(fig, HEIGHT)
