"""Bent boards: the stored summary keeps its promises, and a few trials of it are current."""

import numpy as np
import pytest

from pegpose_lab.study import bent_board_trials, load_measured, summarize_bent_boards
from pegpose_lab.study.bent_boards import BOARD, bowed_board


def test_bow_is_that_of_the_middle():
    points = bowed_board(BOARD, 0.3)
    assert points[:, 2].max() == pytest.approx(0.3) and points[:, 2].min() == pytest.approx(0)
    np.testing.assert_array_equal(points[:, :2], BOARD.object_points[:, :2])


def test_warp_repairs_what_a_bow_does():
    """In 100 trials of each bow; a flat board is flagged in 1 % by design."""
    table = load_measured("bent_boards").set_index(["board", "bow"])
    assert (table["trials"] == 100).all()
    exact, warp = table.loc["exact"], table.loc["warp"]
    assert (exact.loc[[0.1, 0.2, 0.5], "flagged"] >= 95).all() and exact.loc[0.0, "flagged"] <= 5
    assert (warp["f_rms_z"] <= 1.2).all() and (warp["warp_rms_z"] <= 1.2).all() and (warp["warp_rms"] <= 0.01).all()
    assert exact.loc[0.5, "f_classical_rms_z"] > 3


def test_the_stored_summary_is_current():
    """The first trials again: errors and sigmas of f as the stored means and ratios make them likely."""
    trials = bent_board_trials([0.0, 0.5], trials=3)
    assert trials.query("board == 'exact' and bow == 0.5")["flagged"].all()
    summary = summarize_bent_boards(trials).set_index(["board", "bow"])
    stored = load_measured("bent_boards").set_index(["board", "bow"])
    for key in summary.index:
        spread = trials.query("board == @key[0] and bow == @key[1]")["f_sigma"].mean()
        assert summary.loc[key, "f_error"] == pytest.approx(stored.loc[key, "f_error"], abs=3 * spread)
