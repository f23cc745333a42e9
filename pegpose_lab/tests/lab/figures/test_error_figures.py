"""Figures of notebook 07: what is drawn is what was given."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from numpy.testing import assert_allclose

from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import error_histograms as draw


@pytest.fixture
def ax():
    fig, ax = plotting.figure()
    yield ax
    plt.close(fig)


def test_histograms_count_all_points_and_name_the_share(ax):
    near, far = np.array([0.01, 0.02, 0.04, 0.05]), np.array([0.01, 0.01, 0.02, 0.05])
    draw.plot_distances(ax, {"stages 1 + 2": near, "Zhang": far}, 0.03, np.linspace(0, 0.06, 7))
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert set(labels) == {"stages 1 + 2: 50 % below", "Zhang: 75 % below", "limit of Fig. 6, 0.03 px"}
    assert {to_hex(patch.get_edgecolor()) for patch in ax.patches[1:]} == {plotting.COLORS["zhang"].lower()}


@pytest.mark.parametrize(("square", "shape"), [(True, plt.Rectangle), (False, plt.Circle)])
def test_a_limit_of_coordinates_is_a_square_and_one_of_distances_a_circle(ax, square, shape):
    errors = np.array([[0.1, 0.2], [-0.3, 0.0]])
    draw.plot_errors(ax, errors, "red", 0.5, square=square, reach=0.8)
    assert_allclose(ax.lines[0].get_xydata(), errors)
    (limit,) = ax.patches
    assert isinstance(limit, shape)
    assert_allclose(limit.get_extents().transformed(ax.transData.inverted()).extents, [-0.5, -0.5, 0.5, 0.5], atol=1e-9)
    assert ax.get_xlim() == ax.get_ylim() == (-0.8, 0.8)


def test_share_over_mean_has_a_point_for_each_kind_of_corners(ax):
    table = pd.DataFrame(
        {"mean distance (px)": [0.005, 0.02, 0.03, 0.4], "share": [1, 0.9, 0.6, 0]}, index=list("abcd")
    )
    curve = np.array([0.001, 1.0]), np.array([100.0, 0.0])
    draw.plot_share_over_mean(ax, curve, {"stages 1 + 2": table, "Zhang": table}, (0.031, 57))
    assert [text.get_text() for text in ax.texts] == list("abcd")
    assert_allclose(ax.lines[1].get_ydata(), [100, 90, 60, 0])
    assert_allclose(ax.lines[-1].get_xydata(), [[0.031, 57]])


def test_an_interval_for_each_number_reading_and_source(ax):
    rows = [[n, reading, 40, 60, 0, 42, 62, 0] for n in (48, 240) for reading in draw.READINGS]
    names = [f"{source}: {name} (%)" for source in ("independent", "two stages") for name in ("low", "high", "chance")]
    draw.plot_share_intervals(ax, pd.DataFrame(rows, columns=["points", "it is the", *names]), 57)
    ends = np.array([segment[:, 1] for lines in ax.collections for segment in lines.get_segments()])
    assert_allclose(ends, np.tile([[40, 60], [40, 60], [42, 62], [42, 62]], (2, 1)))
    assert [text.get_text() for text in ax.get_xticklabels()] == ["48", "240"]


def test_turn_scan_and_radius_errors_draw_their_curves(ax):
    turns = np.linspace(-8, 8, 5)
    draw.plot_turn_scan(ax, turns, {0.0: turns**2, 1.5: turns**2 + 1}, {"all": 3.0, "noise": 1.0}, -3.0)
    assert_allclose(ax.lines[1].get_ydata(), turns**2 + 1)
    assert len(ax.lines) == 5 and len(ax.get_legend().get_texts()) == 5
    ax.clear()
    draw.plot_radius_errors(ax, {"one scale": [0.1, 0.2], "camera and plane": [0.0, 0.001]}, unit=1000)
    assert_allclose(ax.lines[1].get_xydata(), [[1, 0], [2, 1]])
    assert ax.lines[0].get_color() != ax.lines[1].get_color()
