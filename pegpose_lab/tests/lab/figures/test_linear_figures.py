"""The figures of the linear calibration: they hold the data that they are given, within their axes."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.quiver import Quiver

from pegpose_lab.lab.figures import linear_calibration
from pegpose_lab.lab.plotting import figure
from pegpose_lab.paper import paper_camera

CAMERA = paper_camera()


@pytest.fixture
def three():
    fig, axes = figure(10, 3.2, columns=3)
    yield axes
    fig.canvas.draw()
    plt.close(fig)


def test_radial_alignment_shows_every_corner(three):
    straight = np.array(CAMERA.principal_point) + [[-300.0, -200.0], [250.0, -180.0], [40.0, 30.0], [280.0, 210.0]]
    exact = CAMERA.to_image(CAMERA.distort(CAMERA.to_sensor(straight)))
    distance, distorted = (np.hypot(*(points - CAMERA.principal_point).T) for points in (straight, exact))
    linear_calibration.plot_radial_alignment(three, CAMERA, straight, distorted - distance, np.full(4, 0.002))
    (arrows,) = [artist for artist in three[0].collections if isinstance(artist, Quiver)]
    assert np.allclose(np.transpose([arrows.U, arrows.V]), exact - straight)
    (low, high), (bottom, top) = three[0].get_xlim(), three[0].get_ylim()
    assert low < -300 + 799.5 < 280 + 799.5 < high and bottom > top and high - low < 700  # filled by the corners
    line, dots = three[1].lines
    assert np.allclose(np.interp(distance, *line.get_data()), dots.get_ydata(), atol=2e-3)  # on Eq. 3
    assert np.allclose(three[2].lines[1].get_ydata(), 2.0)  # thousandths of a pixel


def test_bias_has_a_colour_for_each_view(three):
    kappas = np.linspace(-1e-5, 1e-5, 5)
    linear_calibration.plot_linear_bias(three[0], kappas, {1: 48 + 0 * kappas, 5: 48 - 1e5 * kappas}, CAMERA, 54.74)
    lines = three[0].lines
    assert len(lines) == 5 and lines[0].get_color() != lines[1].get_color()
    assert lines[4].get_xdata()[0] == pytest.approx(1e5 * CAMERA.kappa1)


def test_tilts_without_a_scatter_are_left_out(three):
    columns = ["tilt (deg)", "refused (%)", "sd of f (%)", "predicted (%)"]
    table = pd.DataFrame([[1, 99, np.nan, np.nan], [4, 0, 2.9, 3.0], [20, 0, 0.2, 0.2]], columns=columns)
    linear_calibration.plot_tilt_scatter(*three[:2], table, 100)
    assert [len(line.get_xdata()) for line in three[0].lines] == [2, 2]
    assert [label.get_text() for label in three[1].get_xticklabels()] == ["4", "20"]


def test_the_map_of_principal_points_has_y_down(three):
    shifts = np.linspace(-50, 50, 5)
    maps = np.stack(np.meshgrid(48 + 0.1 * shifts, 270 - 0.8 * shifts), axis=-1)
    filled = linear_calibration.plot_principal_points(three[0], shifts, maps, (50.0, 280.0), (20.0, -12.5))
    assert three[0].get_ylim() == (50, -50)
    assert filled.levels[0] <= 43 and filled.levels[-1] >= 53
    assert len(three[0].get_legend().get_texts()) == 4
