"""The trial of Eqs. 9 and 10: all combinations run, every run by itself, and effects recovered from made-up arrivals."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from pegpose_lab import study
from pegpose_lab.paper import paper_experiment

TRUTH = paper_experiment()
BOARD = TRUTH.board.object_points
FORMS = ("printed", "corrected")


def test_every_combination_runs_on_every_view():
    images = [TRUTH.camera.project(BOARD, pose) for pose in TRUTH.cam_from_boards[:2]]
    trial = study.operator_trials(BOARD, images, TRUTH.camera, runs=2)
    assert (trial.groupby(["view", "Eq. 9", "Eq. 10"]).size() == 2).all() and len(trial) == 16
    assert (trial[["off halfway", "off at the end", "spread"]] >= 0).all(axis=None)
    assert trial.loc[trial["arrived"], "off at the end"].max() < 0.1
    assert trial["off at the end"].nunique() > 8  # every run has a generator of its own
    again = study.operator_trials(BOARD, images, TRUTH.camera, runs=2)
    pd.testing.assert_frame_equal(trial, again)


def made_up(share, rng):
    """Arrivals of 5 views with 40 runs of each combination; `share` maps the form of Eq. 9 to the chance to arrive."""
    rows = [
        (view, blend, mutation, rng.random() < share[blend])
        for view, blend, mutation, _ in product(range(5), FORMS, FORMS, range(40))
    ]
    return pd.DataFrame(rows, columns=["view", "Eq. 9", "Eq. 10", "arrived"])


def test_an_effect_is_recovered_and_none_is_not():
    rng = np.random.default_rng(0)
    trial = made_up({"printed": 0.8, "corrected": 0.5}, rng)
    printed, corrected, apart = study.printed_effect(trial, "Eq. 9")
    assert printed == pytest.approx(0.8, abs=0.06) and corrected == pytest.approx(0.5, abs=0.08) and apart > 5
    apart = [study.printed_effect(made_up({"printed": 0.6, "corrected": 0.6}, rng), "Eq. 10")[2] for _ in range(100)]
    assert abs(np.mean(apart)) < 0.35 and np.std(apart) == pytest.approx(1, abs=0.25)  # standard errors indeed


def test_shares_of_groups_are_those_of_their_runs():
    rows = {"view": ["paper's view", "left01", "left02"], "variant": "v", "seeds": 100, "reached": [50, 20, 100]}
    shares = study.success_shares(pd.DataFrame(rows)).set_index("views")
    assert shares["share"].to_dict() == {"paper's view": 50, "13 photographs": 60}
    assert shares["runs"].tolist() == [100, 200] and shares["reached"].tolist() == [50, 120]
    assert shares["sigma"].tolist() == pytest.approx([5.0, 2.0])  # sqrt(0.2 0.8 / 100) / 2, the view with all has none
