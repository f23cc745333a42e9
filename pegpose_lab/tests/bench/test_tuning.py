"""The choice of the peers' settings: the rule, the trial, and that the committed ranking is what the peers have."""

import pandas as pd
import pytest

from pegpose_lab.bench import FULL, QUICK, peers, scenes, tuning
from pegpose_lab.study import load_measured, made_by

PEERS = [name for name, method in peers.COMPARED.items() if method.module != "pegpose_lab"]


def _table(*rows):
    """Made-up scores: settings, missed, false, error, ms."""
    table = pd.DataFrame(rows, columns=["settings", "missed", "false", "error", "ms"])
    table.insert(0, "peer", "someone")
    return table


def _order(*rows):
    return "".join(tuning.rank(_table(*rows))["settings"])


def test_pegs_found_come_first_then_false_circles_then_the_error_then_the_time():
    assert _order(("a", 9, 0, 1.0, 1), ("b", 0, 9, 9.0, 9)) == "ba"
    assert _order(("a", 0, 9, 1.0, 1), ("b", 0, 0, 9.0, 9)) == "ba"
    assert _order(("a", 0, 0, 2.0, 1), ("b", 0, 0, 1.0, 9)) == "ba"
    assert _order(("a", 0, 0, 1.0, 9), ("b", 0, 0, 1.0, 1)) == "ba"
    assert _order(("a", 0, 0, 1.0, 1), ("b", 0, 0, 1.0, 1)) == "ab"


def test_what_is_within_the_noise_ties():
    assert _order(("a", 0, 0, 2.0, 1), ("b", 1, 0, 1.0, 1)) == "ba"  # 1 <= sqrt(1)
    assert _order(("a", 0, 0, 2.0, 1), ("b", 2, 0, 1.0, 1)) == "ab"  # 2 > sqrt(2)
    assert _order(("a", 0, 1, 2.0, 1), ("b", 0, 3, 1.0, 1)) == "ba"  # 2 <= sqrt(4)
    assert _order(("a", 0, 0, 1.0, 9), ("b", 0, 0, 1.04, 1)) == "ba"
    assert _order(("a", 0, 0, 1.0, 9), ("b", 0, 0, 1.06, 1)) == "ab"
    assert _order(("a", 0, 0, 1.0, 1.2), ("b", 0, 0, 1.0, 1.0)) == "ab"


def test_the_second_rank_is_the_choice_among_the_rest():
    """Without a, which c misses too many pegs to tie with, c ties with b and is better."""
    rows = ("a", 0, 0, 1.0, 1), ("b", 1, 0, 3.0, 1), ("c", 3, 0, 2.0, 1)
    assert _order(*rows) == "acb"
    ranked = tuning.rank(_table(*rows))
    assert list(ranked["rank"]) == [1, 2, 3] and list(ranked["missed"]) == [0, 3, 1]


def test_peers_have_the_first_settings_of_the_committed_ranking():
    ranking = load_measured(tuning.NAME)
    first = ranking[ranking["rank"] == 1].set_index("peer")["settings"]
    assert dict(first) == {name: peers.COMPARED[name].settings for name in PEERS}


def test_committed_ranking_is_that_of_its_scores_and_of_the_whole_grid():
    """Ranked again from the grid's order; its numbers are rounded, so that ties may turn only behind the first."""
    ranking, frames = load_measured(tuning.NAME), tuning.FRAMES * len(scenes.MAIN)
    assert list(tuning.GRIDS) == PEERS
    for name, part in ranking.groupby("peer"):
        grid = [method.settings for method in tuning.candidates(name)]
        assert sorted(part["settings"]) == sorted(set(grid)) and len(part) == len(grid)
        assert set(part["frames"]) == {frames} and set(part["pegs"]) == {4 * frames}
        again = tuning.rank(part.drop(columns="rank").set_index("settings").loc[grid].reset_index())
        assert again["settings"][0] == part["settings"].iloc[0]


def test_frames_are_not_the_benchmarks():
    most = max(frames for plan in (FULL, QUICK) for frames, _ in plan.cells.values())
    assert most < tuning.FIRST_FRAME and most + tuning.FRAMES < 10**6


def test_a_trial_counts_and_measures(monkeypatch, tmp_path):
    """On one clean frame: a good threshold, and one that no peg reaches."""
    name = "contours + fitEllipse"
    grid = {"smoothing": (1,), "threshold": (100, 250), "ratio": (0.8,)}
    monkeypatch.setattr(tuning, "GRIDS", {name: grid})
    table = tuning.try_settings((name,), scenes=scenes.MAIN[:1], frames=1, workers=1)
    good, bad = table.itertuples()
    assert (good.frames, good.pegs, good.missed, good.false) == (1, 4, 0, 0)
    assert (bad.pegs, bad.missed) == (4, 4) and bad.error == float("inf")
    assert 1 < good.center < 10 and good.error == pytest.approx((good.center * good.radius) ** 0.5)
    assert good.settings == "Gaussian 1 px, threshold 100, outline > pi r_min, axes' ratio > 0.8" and good.ms > 0
    tuning.write_settings(tuning.rank(table), tmp_path)
    assert (tmp_path / "peer_settings.csv").read_text(encoding="utf-8").split("\n")[0].endswith(made_by(tuning.NAME))
    assert list(load_measured(tuning.NAME, tmp_path)["rank"]) == [1, 2]
