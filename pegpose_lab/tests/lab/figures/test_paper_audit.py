"""The figures of the audit show what they are given: rows, symbols, lengths, intervals."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from pegpose_lab import paper
from pegpose_lab.lab.figures import paper_audit
from pegpose_lab.lab.plotting import figure
from pegpose_lab.lab.style import COLORS


@pytest.fixture
def ax():
    fig, ax = figure()
    yield ax
    plt.close(fig)


def texts(ax):
    return [text.get_text() for text in ax.texts]


def test_overview_has_a_symbol_a_row_and_counts_them(ax):
    row = {"item": "Eq. 1", "finding": "one of two"}
    rows = [{**row, "status": status} for status in ("determined", "candidate", "candidate")]
    paper_audit.plot_overview(ax, rows)
    symbols = [(line.get_marker(), to_hex(line.get_color())) for line in ax.lines if len(line.get_xdata()) == 1]
    assert [(color.lower(), mark) for mark, color in symbols] == [
        (paper_audit.STATUS[row["status"]][0].lower(), paper_audit.STATUS[row["status"]][1]) for row in rows
    ]
    shown = [text.get_text() for text in ax.get_legend().get_texts()]
    assert shown == ["determined: 1", "not determined: 0", "not determined, with a candidate: 2"]
    (bold,) = [text for text in ax.texts if text.get_text() == "one of two" and text.get_weight() == "bold"]
    assert to_hex(bold.get_color()) == paper_audit.STATUS["determined"][0].lower()


def test_square_has_the_lengths_of_its_sides_and_rings_for_the_free_fit(ax):
    square = np.array([[0, 0], [100, 0], [100, 100], [0, 100]], float)
    paper_audit.plot_square(ax, square, {"A": 2 * square, "B": square + 1}, tilts={"A": 11.9, "B": 1.9})
    assert texts(ax)[:8] == ["100 px"] * 4 + ["200 px"] * 4 and texts(ax)[8:] == [f"peg {k}" for k in (1, 2, 3, 4)]
    assert np.array_equal(ax.lines[2].get_xydata(), square + 1)


def test_drift_beside_table_3():
    fig, axes = figure(columns=2)
    angles, curve = np.linspace(0, 2 * np.pi, 9), np.ones((3, 9))
    both = {"A": curve, "B": 2 * curve}
    models = {"A": np.zeros(45), "B": np.ones(45)}
    paper_audit.plot_drift(axes, angles, both, {"A": 12.0, "B": 2.0}, models, paper.table3())
    assert [line.get_ydata()[0] for line in axes[0].lines] == [1, 2] and len(axes[0].collections) == 2
    assert len(axes[1].lines[0].get_xdata()) == 45 and axes[1].get_xlabel() == "frame"
    plt.close(fig)


def test_shares_have_an_interval_for_each_reading_and_source(ax):
    intervals = {"A": [np.array([48, 56]), np.array([49, 57])], "B": [np.array([57, 65]), np.array([58, 67])]}
    paper_audit.plot_shares(ax, intervals, {"A": 52, "B": 61}, printed=57, names={"A": "mean", "B": "rms"})
    spans = [tuple(line.get_xdata()) for line in ax.lines if len(line.get_xdata()) == 2 and line.get_linewidth() == 7]
    assert spans == [(48, 56), (49, 57), (57, 65), (58, 67)]
    assert len(ax.get_yticks()) == 4


def test_candidates_have_the_colours_of_their_methods(ax):
    table = pd.DataFrame({"two stages, Eq. 7": [0.01, 0.02], "Zhang, rms": [0.3, np.nan]}, index=["a", "b, one k_1"])
    paper_audit.plot_candidates(ax, table, (0.031, 0.37))
    assert [line.get_color() for line in ax.lines[:2]] == [COLORS["genetic"], COLORS["zhang"]]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a", "b, one $k_1$"]
    assert texts(ax) == ["printed, two stages:\n0.0310 px", "printed, toolbox:\n0.37 px"]
