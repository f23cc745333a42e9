"""The figures of notebook 09 show the numbers that they are given."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from numpy.testing import assert_allclose

from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import uncertainty


def drawn(width, rows=1, columns=1):
    fig, axes = plotting.figure(width, 3.0, rows, columns)
    yield axes
    fig.draw_without_rendering()
    plotting.plt.close(fig)


@pytest.fixture
def ax():
    yield from drawn(5)


@pytest.fixture
def four():
    yield from drawn(9, columns=4)


@pytest.fixture
def three():
    yield from drawn(9, columns=3)


@pytest.fixture
def two():
    yield from drawn(9, columns=2)


def test_a_panel_for_each_parameter(four):
    z = pd.DataFrame(np.random.default_rng(0).normal(size=(500, 4)), columns=list(uncertainty.SYMBOLS))
    uncertainty.plot_interval_errors(four, z)
    heights = [[bar.get_height() for bar in ax.patches] for ax in four]
    assert_allclose(np.sum(heights, axis=1) * 0.5, 1, atol=0.01)  # densities of bins of 0.5
    assert [ax.get_title() for ax in four] == ["$f$", "$c_x$", "$c_y$", r"$\kappa_1$"]


def test_tilt_and_floor_have_one_colour_a_number_of_views(two):
    sigma = pd.DataFrame([[0.7, 0.03], [0.3, 0.011]], index=[3, 20], columns=[5.0, 40.0])
    uncertainty.plot_tilt(two, sigma, sigma / sigma, 0.01 * sigma)
    assert_allclose([line.get_ydata() for line in two[0].lines], sigma)
    points = [container.lines[0] for container in two[1].containers]
    assert [line.get_color() for line in points] == [line.get_color() for line in two[0].lines]


def test_one_view_is_drawn_as_its_difference(ax):
    single = pd.DataFrame({"f (mm)": [55.0], "low (mm)": [49.0], "high (mm)": [60.0]}, index=[4.0])
    uncertainty.plot_single_view(ax, single, 50.0)
    (bars,) = ax.containers
    assert_allclose(np.asarray(bars.lines[0].get_ydata(), float), [10.0])
    assert_allclose(bars.lines[2][0].get_segments()[0][:, 1], [-2.0, 20.0])


def test_models_of_one_panel_are_drawn_side_by_side(ax):
    rings = pd.DataFrame({"radius": [50.0, 100.0], "residual": [0.1, -0.1], "sigma": [0.01, 0.01]})
    uncertainty.plot_profiles(ax, {"one": rings, "two": rings}, {"one": "#332288", "two": "#CC6677"})
    one, two = (container.lines[0] for container in ax.containers)
    assert_allclose((two.get_xdata() - one.get_xdata()).astype(float), uncertainty.BESIDE)
    assert one.get_color() != two.get_color()


def test_halves_tell_sigmas_by_colour_and_lenses_by_panel(three):
    lenses = ["f, k1 (Eq. 3)", "f_x, f_y, k1, k2", "f_x, f_y, k1, k2, p1, p2"]
    index = pd.MultiIndex.from_product([["a", "b"], lenses], names=["dataset", "lens"])
    pooled = pd.DataFrame({"rms_z": np.arange(1.0, 7), "classical_rms_z": np.arange(2.0, 8)}, index=index)
    uncertainty.plot_halves(three, pooled)
    for ax, first in zip(three, (1, 2, 3), strict=True):
        classical, stated = ax.lines[:2]
        assert_allclose(stated.get_xdata(), [first, first + 3])
        assert_allclose(classical.get_xdata(), [first + 1, first + 4])
        assert to_hex(classical.get_color()) != to_hex(stated.get_color())
    assert three[0].get_title() == "$f$, $k_1$ (Eq. 3)" and three[1].get_title() == "$f_x$, $f_y$, $k_1$, $k_2$"


def test_empty_cells_are_not_drawn(ax):
    shown = uncertainty.plot_coverage(ax, np.array([[0, 3], [5, 1]]), (640, 480))
    assert shown.get_array().mask.tolist() == [[True, False], [False, False]]
    assert ax.get_ylim()[0] > ax.get_ylim()[1]
