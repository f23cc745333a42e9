"""The explorer for Eq. 6: one distortion for each point, or one for all."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import ipywidgets
import numpy as np

from ...calibration import TwoStageObjective, calibrate_tsai
from ..style import COLORS
from .drawing import _chart, _charted
from .explorer import Explorer, _slider
from .intervals import HEIGHT, _blank

if TYPE_CHECKING:
    from ...paper import Experiment

BOX = 0.25  # of T_z on either side, as in Eq. 5
STEPS = 121
ROUNDING = 1e-9  # px


def equation6_explorer(experiment: Experiment) -> Explorer:
    """Sliders for f and the corners' noise: the objective over T_z with k1 for each point (Eq. 6 as printed) and shared.

    Per point, the y residual is zero and the x residual the same for every (f, T_z): there is nothing to find.

    Parameters
    ----------
    experiment : Experiment

    Returns
    -------
    Explorer
        Controls ``f`` (% off the true one), ``noise`` (px per axis).
    """
    world = experiment.world_from_board.apply(experiment.board.object_points)
    exact = experiment.camera.project(experiment.board.object_points, experiment.cam_from_boards[0])
    t_z = float((experiment.cam_from_boards[0] * experiment.world_from_board.inv()).translation[2])
    depths = t_z * np.linspace(1 - BOX, 1 + BOX, STEPS)

    @lru_cache(maxsize=16)
    def objectives(noise):
        corners = exact + noise * np.random.default_rng(3).standard_normal(exact.shape)
        linear = calibrate_tsai(world, corners, experiment.camera)
        return {kind: TwoStageObjective(world, corners, linear, kappa1=kind) for kind in ("per-point", "shared")}

    def draw(picture, f, noise):
        focal = experiment.camera.focal_length * (1 + f / 100)
        chromosomes = np.column_stack([np.full(STEPS, focal), depths])
        curves = {kind: objective(chromosomes) for kind, objective in objectives(noise).items()}
        picture[:] = _drawn(depths, curves, t_z)
        per_point, shared = curves["per-point"], curves["shared"]
        spread = np.ptp(per_point)
        told = f"by less than {ROUNDING:g} px" if spread < ROUNDING else f"by {spread:.1e} px"
        return (
            f"per point: E = {per_point.min():.4f} px for every T_z (it varies {told});\n"
            f"shared: E from {shared.min():.4f} px at T_z = {depths[shared.argmin()]:.1f} mm to {shared.max():.2f} px"
        )

    controls = {
        "f": _slider(ipywidgets.FloatSlider, "f off the true one (%)", 0.0, -20.0, 20.0, step=1.0),
        "noise": _slider(ipywidgets.FloatSlider, "corner noise (px)", 0.02, 0.0, 0.3, step=0.01),
    }
    return Explorer("equation 6 explorer", lambda **_: _blank(), draw, controls)


def _drawn(depths, curves, true):
    """The objectives over T_z as an image."""
    fig, ax = _chart(HEIGHT)
    for (kind, values), (color, label) in zip(
        curves.items(),
        (("paper", "one k1 for each point (Eq. 6 as printed)"), ("genetic", "one k1 for all points")),
        strict=True,
    ):
        ax.semilogy(depths, np.maximum(values, 1e-6), color=COLORS[color], label=f"{kind}: {label}")
    ax.axvline(true, color=COLORS["truth"], linewidth=1.0, label="true T_z")
    ax.set(xlabel="T_z (mm)", ylabel="E, Eq. 7 (px)", ylim=(1e-3, 30))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.22), ncols=2, fontsize=9)
    return _charted(fig, HEIGHT)
