"""The maps of a calibration over the image: axes, units, and the points on them."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.testing import assert_allclose

from pegpose_lab import calibrate_joint, difference, paper, projection_uncertainty, split_halves
from pegpose_lab.lab.maps import plot_image_map
from pegpose_lab.lab.plotting import figure
from pegpose_lab.tests.calibration.two_models import tilted_views

CAMERA = paper.paper_camera()


@pytest.fixture(scope="module")
def maps():
    boards, images, _ = tilted_views(CAMERA, 6, 0.1)
    found = calibrate_joint(boards, images, CAMERA)
    halves = split_halves(boards, images, lambda *views: calibrate_joint(*views, CAMERA), repeats=2, rng=0)
    return images, [
        projection_uncertainty(found, distance=300.0).map("mm"),
        difference(found, CAMERA).map(),
        halves.map(),
    ]


def test_three_maps_in_one_figure(maps):
    images, three = maps
    fig, axes = figure(12, 3, columns=3)
    for ax, drawn in zip(axes, three, strict=True):
        filled = plot_image_map(ax, drawn, image_points=images, title="a title")
        assert ax.get_xlim() == (0, 1599) and ax.get_ylim() == (1199, 0)
        assert len(ax.lines) == 6 and ax.get_title() == "a title" and ax.get_xlabel() == "x (px)"
        assert filled.levels[0] <= drawn.values.min() and drawn.values.max() <= filled.levels[-1]
    labels = [ax.get_ylabel() for ax in fig.axes[3:]]
    assert labels == ["sigma at 300 mm (mm)", "difference (px)", "difference of halves (px)"]
    plt.close(fig)


def test_the_values_are_where_they_belong(maps):
    """The uncertainty of the paper's views is least near the middle, and grows to the corners."""
    uncertain = maps[1][0]
    row, column = np.unravel_index(uncertain.values.argmin(), uncertain.values.shape)
    assert abs(uncertain.x[column] - 799.5) < 400 and abs(uncertain.y[row] - 599.5) < 300
    assert uncertain.values[0, 0] > 3 * uncertain.values.min()


def test_a_logarithmic_map_shows_three_decades_at_most(maps):
    uncertain, differs, _ = maps[1]
    fig, axes = figure(8, 3, columns=2)
    for ax, drawn in zip(axes, (uncertain, differs), strict=True):
        filled = plot_image_map(ax, drawn, logarithmic=True)
        levels, high = filled.levels, drawn.values.max()
        assert_allclose(levels[1:] / levels[:-1], levels[1] / levels[0])
        assert_allclose(levels[[0, -1]], [max(drawn.values.min(), high / 1000), high], rtol=2e-3)
        marks = [float(label.get_text()) for label in fig.axes[-1].get_yticklabels()]
        assert len(marks) > 1 and {f"{mark:e}"[0] for mark in marks} <= set("125")
    fig.draw_without_rendering()
    plt.close(fig)


def test_a_map_with_a_centre_shows_it_in_the_middle_of_its_scale(maps):
    fig, ax = figure(4.0, 3.0)
    filled = plot_image_map(ax, maps[1][-1], center=1.0)
    assert (filled.levels[0] + filled.levels[-1]) / 2 == pytest.approx(1.0)
    assert filled.levels[0] <= maps[1][-1].values.min() and maps[1][-1].values.max() <= filled.levels[-1]
    assert filled.get_cmap().name == "RdBu_r"
    plt.close(fig)
