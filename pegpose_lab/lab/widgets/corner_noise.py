"""The explorer for the corners' errors: what they leave of E, by every definition, in two stages and in Zhang's method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import ipywidgets
import numpy as np

from ... import paper, study
from ...calibration import calibrate_zhang
from ...corners import find_corners
from .. import plotting
from ..style import COLORS
from .drawing import DPI, _bgr, _charted
from .explorer import SHOWN_WIDTH, Explorer, _look, _slider

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...paper import Experiment

HEIGHT = 330  # px, height of the image
UNIT = 0.1  # px per axis: the residuals are computed for this noise, and grow with it in proportion
SIMULATED, DETECTORS = "simulated normal noise", ("find_corners", "cornerSubPix", "whole pixels")
METHODS = {"stages 1 + 2": ("genetic", -0.15), "Zhang": ("zhang", 0.15)}  # colour, place beside the row
LIMITS = (2e-4, 2.0)  # px


def corner_noise_explorer(experiment: Experiment) -> Explorer:
    """Where corners come from, and how noisy they are: the error of two stages and of Zhang's method, by each definition.

    The detectors see the rendered boards, with the noise of the images; simulated corners have normal noise of the size
    chosen.  All states are computed beforehand.  Residuals are proportional to small noise, so those of one size
    are scaled.  Stage 2's optimum is found by the simplex, and the genetic algorithm ends at the same.

    Parameters
    ----------
    experiment : Experiment

    Returns
    -------
    Explorer
        Controls ``detector`` and ``noise`` (px per axis; disabled unless the noise is simulated).
    """
    exact, corners = _corners(experiment)
    residuals = {name: _residuals(experiment, seen) for name, seen in corners.items()}
    chart = _Chart()

    def draw(picture, detector, noise):
        scale = noise / UNIT if detector == SIMULATED else 1.0
        off = scale * float(np.std(np.concatenate(corners[detector]) - np.concatenate(exact)))
        errors = {
            method: study.errors_by_definition([scale * view for view in views])
            for method, views in residuals[detector].items()
        }
        chart.draw(picture, errors)
        return _told(detector, off, errors)

    options = (SIMULATED, *DETECTORS)
    detector = ipywidgets.Dropdown(options=options, description="corners from", **_look())
    noise = _slider(ipywidgets.FloatSlider, "corner noise (px)", 0.1, 0.005, 0.5, step=0.005)
    noise.readout_format = ".3f"
    # it does nothing for corners that come from images
    ipywidgets.dlink((detector, "value"), (noise, "disabled"), lambda name: name != SIMULATED)
    controls = {"noise": noise, "detector": detector}
    return Explorer("corner noise explorer", lambda **_: chart.background, draw, controls)


def _corners(experiment):
    """The exact corners of each board, and by name those of the detectors and with normal noise of `UNIT`."""
    board, rng = experiment.board, np.random.default_rng(3)
    exact = [experiment.camera.project(board.object_points, pose) for pose in experiment.cam_from_boards]
    images = [experiment.board_image(view) for view in range(len(exact))]
    found = [find_corners(image, board) for image in images]
    whole = [np.rint(points) for points in found]
    gradient = [study.sub_pixel_corners(image, start) for image, start in zip(images, whole, strict=True)]
    noisy = [points + UNIT * rng.standard_normal(points.shape) for points in exact]
    return exact, dict(zip((*DETECTORS, SIMULATED), (found, gradient, whole, noisy), strict=True))


def _residuals(experiment, corners):
    """Residuals (n, 2) px of each view, by method."""
    board, sensor = experiment.board.object_points, experiment.camera.sensor
    single = [study.search("Nelder-Mead", board, points, sensor, 0)[0].residuals[0] for points in corners]
    shared = calibrate_zhang([board] * len(corners), corners, sensor.image_size)
    return dict(zip(METHODS, (single, shared.residuals), strict=True))


def _told(detector, off, errors):
    """The errors in words, in the order of the paper: two stages by Eq. 7, Zhang's method as a root mean square."""
    mean, rms, sd_x, sd_y, _ = study.DEFINITIONS
    stages, zhang = errors.values()
    printed = paper.printed_numbers()["printed"]
    ratio = paper.printed("E-zhang") / paper.printed("E-rms")
    return (
        f"{detector}: corners off the truth by {off:.4f} px per axis\n"
        f"stages 1 + 2: mean distance (Eq. 7) {stages[mean]:.4f} px, rms {stages[rms]:.4f} px; printed "
        f"{printed['E-rms']} px\n"
        f"Zhang: rms {zhang[rms]:.4f} px, sd {zhang[sd_x]:.4f} and {zhang[sd_y]:.4f} px, mean distance "
        f"{zhang[mean]:.4f} px; printed {printed['E-zhang']} px\n"
        f"Zhang's rms over the mean distance of stages 1 + 2: {zhang[rms] / stages[mean]:.2f}; printed {ratio:.1f}"
    )


class _Chart:
    """Empty axes with the printed numbers, drawn once; the errors are dots in it."""

    def __init__(self):
        fig, self.ax = plotting.figure(SHOWN_WIDTH / DPI, HEIGHT / DPI)
        nothing = {method: np.full(len(study.DEFINITIONS), np.nan) for method in METHODS}
        colors = {method: COLORS[color] for method, (color, _) in METHODS.items()}
        plotting.plot_dots(self.ax, study.DEFINITIONS, nothing, colors=colors, unit="error (px)", logarithmic=True)
        for label, name in (("stages 1 + 2", "E-rms"), ("toolbox", "E-zhang")):
            number = paper.printed(name)
            self.ax.axvline(number, color=COLORS["paper"], linestyle=":", linewidth=1.2)
            text = f"printed, {label}:\n{paper.printed_numbers().at[name, 'printed']} px"
            place = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom", "fontsize": 9}
            self.ax.annotate(text, (number, 1.01), **place)
        self.ax.set_xlim(*LIMITS)
        fig.legend(*self.ax.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
        self.background = _charted(fig, HEIGHT)

    def draw(self, picture: NDArray[np.uint8], errors: dict) -> None:
        """Draw a dot for each error."""
        for method, (color, beside) in METHODS.items():
            for row, definition in enumerate(study.DEFINITIONS):
                x, y = self.ax.transData.transform((errors[method][definition], row + beside))
                place = np.rint(16 * (np.array([x, HEIGHT - y]) - 0.5)).astype(int).tolist()
                cv2.circle(picture, place, 16 * 5, _bgr(COLORS[color]), -1, cv2.LINE_AA, 4)
