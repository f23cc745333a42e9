"""The explorer for the insertion: clearance, tilt, image noise and robot against the chance that the wheel goes on."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import TYPE_CHECKING

import cv2
import ipywidgets
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...calibration import calibrate_joint
from ...insertion import Wheel, assembly_forecast
from ...pose import estimate_pose, project_discs
from ..style import COLORS
from .drawing import _bgr
from .explorer import FONT, SHOWN_WIDTH, Explorer, _slider

if TYPE_CHECKING:
    from ...paper import Experiment

HEIGHT = 300  # px
CORNER_SIGMA, CENTER_SIGMA = 0.002, 0.003  # px for each grey value of noise: corners of a board, centres of pegs
PLANE_VIEW = 4
OUTCOMES = {"free": "joint", "wall": "measured", "chamfer": "linear", "blocked": "genetic"}
"""The outcomes with the colours of their bars."""


def insertion_explorer(experiment: Experiment) -> Explorer:
    """Sliders for clearance, tilt of the hand, image noise and robot: the chance of insertion, and what limits it.

    The camera is calibrated by the joint method from five boards and the hub seen in frame 1, both with errors that grow with
    the noise of the images; the pose with its covariance goes into `assembly_forecast`.

    Parameters
    ----------
    experiment : Experiment
        Camera, board and hub.

    Returns
    -------
    Explorer
        Controls ``clearance`` (mm), ``tilt`` (deg), ``noise`` (grey values), ``repeatability`` (RP, mm).
    """
    hub = experiment.hub

    @lru_cache(maxsize=64)
    def pose_at(noise):
        return _pose(experiment, noise)

    def draw(picture, clearance, tilt, noise, repeatability):
        wheel = Wheel(n_holes=hub.n_pegs, clearance=10.0**clearance, chamfer=0.0)
        tilted = RigidTransform.from_rotation(Rotation.from_rotvec([np.deg2rad(tilt), 0, 0]))
        forecast = assembly_forecast(
            pose_at(noise), hub, wheel, robot_repeatability=repeatability, hub_from_wheel=tilted
        )
        _draw_bars(picture, forecast.probabilities)
        largest = max(forecast.shares, key=forecast.shares.get)
        part = 100 * forecast.shares[largest] / sum(forecast.shares.values())
        return (
            f"clearance {wheel.clearance:.3f} mm: {100 * forecast.probabilities['free']:.1f} % go in freely; 99.9 % need "
            f"{forecast.free_clearance:.3f} mm;\npeg {forecast.limiting_peg} limits most often; {part:.0f} % of its variance "
            f"comes from: {largest}"
        )

    return Explorer(
        "insertion explorer",
        lambda **_: np.full((HEIGHT, SHOWN_WIDTH, 3), 255, np.uint8),
        draw,
        {
            "clearance": _slider(ipywidgets.FloatSlider, "log10 clearance (mm)", -1.3, -3.0, 0.0, step=0.05),
            "tilt": _slider(ipywidgets.FloatSlider, "tilt of the wheel (deg)", 0.0, 0.0, 0.5, step=0.01),
            "noise": _slider(ipywidgets.FloatSlider, "image noise (grey values)", 2.0, 0.5, 20.0, step=0.5),
            "repeatability": _slider(ipywidgets.FloatSlider, "robot RP (mm)", 0.05, 0.0, 0.2, step=0.01),
        },
    )


def _pose(experiment, noise):
    """The pose in frame 1, with a camera calibrated from the five boards: exact points, with the covariances of that noise."""
    camera, hub, board = experiment.camera, experiment.hub, experiment.board.object_points
    rng = np.random.default_rng(0)
    corners = [camera.project(board, pose) for pose in experiment.cam_from_boards]
    seen = [points + CORNER_SIGMA * noise * rng.standard_normal(points.shape) for points in corners]
    found = calibrate_joint([board] * len(seen), seen, camera.sensor)
    centers, radii = project_discs(
        camera, experiment.cam_from_hubs[0], hub.peg_centers, np.full(hub.n_pegs, hub.peg_radius)
    )
    sigmas = np.full((hub.n_pegs, 2), CENTER_SIGMA * noise)
    observation = SimpleNamespace(peg_centers=centers, peg_radii=radii, peg_sigmas=sigmas)
    return estimate_pose(observation, found, hub, plane=found.cam_from_object[PLANE_VIEW], plane_view=PLANE_VIEW)


def _draw_bars(picture, probabilities):
    """A bar for each outcome, its name before it and its percentage behind."""
    left, width, pitch = 150, SHOWN_WIDTH - 260, HEIGHT // (len(OUTCOMES) + 1)
    for number, (outcome, color) in enumerate(OUTCOMES.items()):
        middle = round(pitch * (number + 1))
        end = left + round(width * probabilities[outcome])
        cv2.rectangle(picture, (left, middle - 16), (left + width, middle + 16), (235, 235, 235), -1)
        cv2.rectangle(picture, (left, middle - 16), (max(end, left + 1), middle + 16), _bgr(COLORS[color]), -1)
        cv2.putText(picture, outcome, (24, middle + 8), FONT, 0.7, (40, 40, 40), 1, cv2.LINE_AA)
        share = f"{100 * probabilities[outcome]:.1f} %"
        cv2.putText(picture, share, (left + width + 12, middle + 8), FONT, 0.6, (40, 40, 40), 1, cv2.LINE_AA)
