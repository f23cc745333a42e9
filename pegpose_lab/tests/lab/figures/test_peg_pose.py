"""The figures of the pegs' pose draw what they were given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import peg_pose
from pegpose_lab.paper import paper_experiment


@pytest.fixture
def axes():
    def make(*shape):
        return plotting.figure(6, 6, *shape)[1]

    yield make
    plt.close("all")


def test_where_a_formula_fails_is_marked(axes):
    directions = np.arange(-180, 181, 45)
    wrong = (directions + 90.0) % 180 - 90
    wrong[np.abs(directions) == 90] = np.nan
    left, right = axes(1, 2)
    peg_pose.plot_equation11((left, right), directions, {"right": directions, "wrong": wrong}, [10.0, 20.0])
    assert len(left.lines) == 2 and len(right.lines) == 4  # the curve and the frames; two gaps
    shaded = [len(ax.collections[0].get_paths()) for ax in (left, right)]
    assert shaded == [0, 2]


def test_a_square_has_its_numbers_and_lengths(axes):
    ax = axes()
    peg_pose.plot_square(ax, np.array([[0, 0], [9, 0], [9, 9], [0, 9.0]]), [1.0, 2.0, 3.0, 4.0], "square", color="k")
    assert {text.get_text() for text in ax.texts} == {"1", "2", "3", "4", "1.0 mm", "2.0 mm", "3.0 mm", "4.0 mm"}


def test_line_1_runs_from_the_centre_to_peg_1(axes):
    truth, ax = paper_experiment(), axes()
    place = truth.cam_from_hubs[0]
    peg_pose.plot_hub_pose(ax, truth.camera, place, truth.hub)
    *rims, line, center = ax.lines
    middle, peg = truth.camera.project([[0, 0, 0], truth.hub.peg_centers[0]], place)
    assert len(rims) == 4 and [text.get_text() for text in ax.texts] == ["1", "2", "3", "4"]
    assert np.allclose(line.get_xydata(), [middle, peg]) and np.allclose(center.get_xydata(), [middle])
    for text, rim in zip(ax.texts, rims, strict=True):
        assert np.hypot(*np.subtract(text.get_position(), rim.get_xydata().mean(axis=0))) < 30  # px


def test_ellipses_hold_95_percent(axes):
    covariance = np.array([[4.0, 1.0], [1.0, 1.0]])
    errors = np.random.default_rng(0).multivariate_normal([3.0, 0.0], covariance, 4000)
    ax = axes()
    peg_pose.plot_pose_ellipses(ax, errors, {"all": 9 * covariance, "noise": covariance})
    _, noise, dots = ax.lines[:3]
    inside = plt.Polygon(noise.get_xydata()).get_path().contains_points(dots.get_xydata())
    assert inside.mean() == pytest.approx(0.95, abs=0.01)


def test_trajectory_shows_lengths_of_errors(axes):
    row = axes(1, 3)
    errors = np.array([[0.0, -1.0, 4.0], [-2.0, 3.0, -5.0]])
    peg_pose.plot_trajectory(row, [1, 2], {"scale": (errors, "k")})
    assert np.array_equal(row[0].lines[0].get_ydata(), [np.nan, 2.0], equal_nan=True)  # no logarithm of 0
    assert row[2].lines[0].get_ydata().tolist() == [4, 5]
    assert row[2].get_ylabel().endswith("(deg)") and row[1].get_yscale() == "log"


def test_errors_have_a_row_for_each_title(axes):
    grid = axes(2, 4)
    rows = [(name, np.ones((4, 4)), "k", ("mm", "mm", "deg", "mm")) for name in ("fine", "coarse")]
    rows[1][1][:, 3] = np.nan
    peg_pose.plot_pose_errors(grid, range(4), rows)
    assert [row[0].get_title(loc="left") for row in grid] == ["fine", "coarse"]
    assert all(ax.get_ylabel().endswith(("(mm)", "(deg)")) for ax in grid.ravel()[:-1])
    assert [text.get_text() for text in grid[1, 3].texts] == ["no depth"] and grid[0, 3].get_xlabel() == "frame"


def test_shifts_are_enlarged_and_stand_against_the_radius(axes):
    grid = axes(2, 3)
    centers, shifts = [np.full((3, 2), 50.0)] * 5, [np.full((3, 2), 0.1 * k) for k in range(1, 6)]
    radii = [np.array([4.0, 5.0, 6.0])] * 5
    peg_pose.plot_center_shifts(grid, centers, shifts, radii, [10, 20, 30, 40, 50], (320, 240))
    *panels, last = grid.ravel()
    assert all(ax.collections[0].N == 3 and ax.collections[0].scale == 1 / peg_pose.LONGER for ax in panels)
    assert all(len(ax.artists) == 1 for ax in panels)  # a key in each
    assert np.allclose([line.get_ydata()[0] for line in last.lines], 0.1 * np.sqrt(2) * np.arange(1, 6))
    assert [line.get_label() for line in last.lines] == [f"{k}, {10 * k}°" for k in range(1, 6)]
