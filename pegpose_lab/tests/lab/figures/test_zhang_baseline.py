"""The figures of notebook 05 show every number that they are given, a colour for each method."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from pegpose_lab.lab.figures import zhang_baseline
from pegpose_lab.lab.plotting import COLORS, figure

TWO = {"first": COLORS["genetic"], "second": COLORS["zhang"]}
VIEWS = pd.Index(["a", "b", "c"], name="view")


@pytest.fixture
def axes():
    fig, axes = figure(8, 4, columns=2)
    yield axes
    plt.close(fig)


def dots(ax, label):
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return line.get_xdata(), to_hex(line.get_color())


def test_each_definition_has_a_row_and_each_printed_number_a_line(axes):
    table = pd.DataFrame([[0.1, 0.2], [0.3, 0.4]], index=list(TWO), columns=["mean", "rms"])
    zhang_baseline.plot_definitions(axes, {"left": table, "right": 2 * table}, {"toolbox": "0.37"}, colors=TWO)
    assert dots(axes[0], "second")[0].tolist() == [0.3, 0.4] and dots(axes[1], "first")[0].tolist() == [0.2, 0.4]
    assert dots(axes[0], "printed in Sect. 5")[0] == [0.37, 0.37]
    assert [text.get_text() for text in axes[0].texts] == ["toolbox:\n0.37 px"]


def test_intervals_stand_about_the_truth_in_micrometres(axes):
    rows = [(ax, method, 48.001, 47.998, 48.002) for ax in ("fine", "coarse") for method in TWO]
    table = pd.DataFrame(rows, columns=["detector", "method", "f", "low", "high"])
    zhang_baseline.plot_focal_by_detector(axes, table, 48.0, colors=TWO)
    assert [ax.get_title() for ax in axes] == ["fine", "coarse"]
    for ax in axes:
        assert [len(ax.containers), ax.get_xlim()[0]] == [2, -ax.get_xlim()[1]]
        (bar,) = ax.containers[0].lines[2]
        assert bar.get_segments()[0][:, 0] == pytest.approx([-2, 2], abs=1e-6)
        assert [text.get_text() for text in ax.texts] == ["±2.0 µm", "±2.0 µm"]


def test_a_solution_on_the_edge_of_its_box_gets_a_ring(axes):
    columns = {f"f {s} ({letter})": [500.0, 510.0, 520.0] for letter in "ck" for s in ("1", "1+2")}
    views = pd.DataFrame({**columns, "edge (c)": ["", "*", ""], "edge (k)": ["", "", ""]}, index=VIEWS)
    zhang_baseline.plot_real_focal_lengths(axes, views, (530.0, 540.0))
    rings = [dots(ax, "on the edge of its box")[0] for ax in axes]
    assert [ring.tolist() for ring in rings] == [[510.0], []]


def test_held_out_errors_are_shown_by_method_and_the_two_kinds_of_rows_apart():
    fig, axes = figure(9, 4, columns=3)
    inside = pd.DataFrame({"first": [0.15, 0.2, 0.3], "second": [0.2, 0.2, 0.2]}, index=VIEWS)
    zhang_baseline.plot_held_out(axes, inside, 1.5 * inside, colors=TWO, single_view=["first"])
    for ax, factor, methods in zip(axes, (1.0, 1.5, 1.5), (list(TWO), ["first"], ["second"]), strict=True):
        assert [line.get_label() for line in ax.lines if line.get_marker() == "o"] == methods
        for method in methods:
            shown, drawn = dots(ax, method)
            assert np.allclose(shown, factor * inside[method]) and drawn == TWO[method].lower()
    plt.close(fig)
