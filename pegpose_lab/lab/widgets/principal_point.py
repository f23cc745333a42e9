"""The explorer for the assumed principal point: what it does to f and T_z of one view."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import ipywidgets
import numpy as np

from ... import paper
from ...calibration import calibrate_tsai, optimum_in_box
from ..style import COLORS
from .drawing import _bgr
from .explorer import FONT, SHOWN_WIDTH, Explorer, _slider

if TYPE_CHECKING:
    from ...paper import Experiment

HEIGHT = 400  # px
FOCAL_LENGTHS, DEPTHS = (30.0, 66.0), (170.0, 370.0)  # mm, shown
NOISE = 0.004  # px per axis
LABELS = {"truth": (-55, 0), "Table 1, stage 2": (-145, 20), "stages 1 + 2": (12, 18)}
"""Where names stand beside their points, px; the others above on the right."""


def principal_point_explorer(experiment: Experiment, *, start: tuple[int, int] = (0, 0)) -> Explorer:
    """Sliders for how far the assumed principal point is off the true one: f and T_z of view 1, by both stages.

    Parameters
    ----------
    experiment : Experiment
    start : (int, int)
        Where the sliders stand first, even numbers of px.

    Returns
    -------
    Explorer
        Controls ``dx``, ``dy`` (px).
    """
    camera, world = experiment.camera, experiment.world_from_board.apply(experiment.board.object_points)
    exact = camera.project(experiment.board.object_points, experiment.cam_from_boards[0])
    corners = exact + NOISE * np.random.default_rng(3).standard_normal(exact.shape)
    printed = paper.table1().set_index("stage")
    true = (
        camera.focal_length,
        float((experiment.cam_from_boards[0] * experiment.world_from_board.inv()).translation[2]),
    )
    fixed = {
        "truth": (*true, "truth"),
        "Table 1, stage 1": (*printed.loc["linear", ["f", "t_z"]], "paper"),
        "Table 1, stage 2": (*printed.loc["genetic", ["f", "t_z"]], "paper"),
    }

    @lru_cache(maxsize=64)
    def found(dx, dy):
        x, y = camera.principal_point
        sensor = replace(camera.sensor, principal_point=(x + dx, y + dy))
        return calibrate_tsai(world, corners, sensor), optimum_in_box(world, corners, sensor)

    def draw(picture, dx, dy):
        linear, best = found(dx, dy)
        points = fixed | {
            "stage 1": (*_of(linear), "linear"),
            "stages 1 + 2": (*_of(best), "genetic"),
        }
        _draw_points(picture, points)
        (f_1, z_1), (f_2, z_2) = _of(linear), _of(best)
        return (
            f"principal point off by ({dx}, {dy}) px: stage 1 f = {f_1:.2f} mm, T_z = {z_1:.1f} mm; "
            f"both stages f = {f_2:.2f} mm, T_z = {z_2:.1f} mm,\nmean distance {best.mean_distance:.4f} px"
        )

    controls = {
        name: _slider(ipywidgets.IntSlider, f"assumed {name[1]}, off by (px)", value, -60, 60, step=2)
        for name, value in zip(("dx", "dy"), start, strict=True)
    }
    return Explorer("principal point explorer", lambda **_: _axes(), draw, controls)


def _of(calibration):
    return calibration.camera.focal_length, float(calibration.cam_from_object[0].translation[2])


def _place(f, t_z):
    x = 60 + (SHOWN_WIDTH - 90) * (f - FOCAL_LENGTHS[0]) / (FOCAL_LENGTHS[1] - FOCAL_LENGTHS[0])
    y = HEIGHT - 40 - (HEIGHT - 60) * (t_z - DEPTHS[0]) / (DEPTHS[1] - DEPTHS[0])
    return round(float(np.clip(x, -1e4, 1e4))), round(float(np.clip(y, -1e4, 1e4)))


def _axes():
    """An empty diagram of T_z over f, with numbers."""
    picture = np.full((HEIGHT, SHOWN_WIDTH, 3), 255, np.uint8)
    cv2.rectangle(picture, _place(FOCAL_LENGTHS[0], DEPTHS[1]), _place(FOCAL_LENGTHS[1], DEPTHS[0]), (225, 225, 225), 1)
    for f in range(30, 67, 6):
        x, y = _place(f, DEPTHS[0])
        cv2.putText(picture, f"{f}", (x - 10, y + 20), FONT, 0.5, (90, 90, 90), 1, cv2.LINE_AA)
    for depth in range(200, 371, 50):
        x, y = _place(FOCAL_LENGTHS[0], depth)
        cv2.putText(picture, f"{depth}", (x - 42, y + 5), FONT, 0.5, (90, 90, 90), 1, cv2.LINE_AA)
    cv2.putText(picture, "f (mm)", (SHOWN_WIDTH - 80, HEIGHT - 6), FONT, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    cv2.putText(picture, "T_z (mm)", (6, 14), FONT, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    return picture


def _draw_points(picture, points):
    for name, (f, t_z, color) in points.items():
        x, y = _place(f, t_z)
        cv2.circle(picture, (x, y), 6, _bgr(COLORS[color]), -1 if color not in ("paper", "truth") else 2, cv2.LINE_AA)
        dx, dy = LABELS.get(name, (10, -8))
        cv2.putText(picture, name, (x + dx, y + dy), FONT, 0.5, _bgr(COLORS[color]), 1, cv2.LINE_AA)
