"""Trials of the whole chain: their errors, tables, and insertions."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import study
from pegpose_lab.insertion import RP_OF_SIGMA
from pegpose_lab.paper import paper_experiment
from pegpose_lab.study import assembly_trials, insertion_rates
from pegpose_lab.study.assembly_trials import JOINT, Trial

HUB = paper_experiment().hub


@pytest.fixture(scope="module")
def trials():
    return list(assembly_trials.run_frame(9, range(1)))


def moved(motion):
    """A trial whose estimate is off the truth by a motion (6,) in the axes of the plane, mm and rad."""
    truth, turn = paper_experiment().cam_from_hubs[0], paper_experiment().cam_from_plane.rotation
    shift, rotation = turn.apply(motion[:3]), Rotation.from_rotvec(turn.apply(motion[3:]))
    found = RigidTransform.from_components(truth.translation + shift, rotation * truth.rotation)
    pose = type("Pose", (), {"cam_from_hub": found, "covariance": np.eye(6), "used": None})()
    return Trial("clean", JOINT, 0, 0, False, truth, pose)


def test_errors_are_in_the_axes_of_the_plane():
    motion = np.array([0.1, -0.2, 0.3, 0.001, -0.002, 0.003])
    np.testing.assert_allclose(moved(motion).error, motion, atol=1e-9)
    np.testing.assert_allclose(moved(motion).sigmas, 1.0)
    assert np.isnan(Trial("clean", JOINT, 0, 0, False, None, None).error).all()


def test_every_chain_is_near_the_truth(trials):
    clean = {trial.chain: trial for trial in trials if trial.scene == "clean" and not trial.free}
    assert set(clean) == set(study.CHAINS)
    within = {"joint": 0.01, "Zhang": 0.01, "stages 1 + 2": 0.05, "stage 1": 1.0, "one scale": 1.0}
    for name, limit in within.items():
        assert np.abs(clean[name].error[:2]).max() < limit
    assert np.abs(clean["joint, whole pixels"].error[:2]).max() < 0.2
    hidden = [trial for trial in trials if trial.scene == "highlights"]  # frame 10 is one of each fifth
    assert len(hidden) == 4 and all(trial.pose.used.sum() == 3 for trial in hidden)
    assert all(trial.peg_error < 0.01 for trial in hidden)


def test_the_single_scale_is_exact_where_it_is_taught():
    observation = study.assembly_trials.locate_pegs(paper_experiment(noise=0.5).hub_frame(0), HUB)
    truth = assembly_trials._with_labels(paper_experiment(), 0, observation)
    pose = assembly_trials._by_scale(paper_experiment(), observation, truth)
    trial = Trial("clean", "one scale", 0, 0, False, truth, pose)
    assert np.abs(trial.error).max() < 2e-3


@pytest.mark.parametrize("offset", [0.0, 0.05, 0.2])
def test_an_exact_robot_needs_the_clearance_of_the_offset(offset):
    trial, rng = moved(np.array([offset, 0, 0, 0, 0, 0])), np.random.default_rng(0)
    (need,) = insertion_rates._needed(trial, insertion_rates.EXACT, 1, rng)
    assert need == pytest.approx(offset, abs=1e-9)
    for clearance, outcome in ((offset + 0.01, "free"), (offset - 0.01, "blocked")):
        if clearance > 0:
            plan = RigidTransform.identity()
            assert insertion_rates._drawn_entry(trial, insertion_rates.EXACT, clearance, plan, rng).outcome == outcome


def test_the_robots_errors_are_drawn_as_stated():
    """Of an exact pose without hole zone and hand-eye error, the need is the robot's lateral error: Rayleigh."""
    cell = insertion_rates.Cell("robot", repeatability=0.05)
    needs = insertion_rates._needed(moved(np.zeros(6)), cell, 2000, np.random.default_rng(1))
    assert np.mean(needs) == pytest.approx(0.05 / RP_OF_SIGMA * np.sqrt(np.pi / 2), rel=0.04)


def test_a_missing_pose_needs_more_than_any_clearance():
    trial = Trial("clean", "joint, whole pixels", 0, 0, False, None, None)
    assert np.isinf(insertion_rates._needed(trial, insertion_rates.EXACT, 2, None)).all()
    needs = pd.DataFrame({"cell": "a", "chain": "b", "need": [0.01] * 999 + [np.inf]})
    curve = study.curve_table(needs)
    assert curve["share"].max() == 0.999 and curve["clearance"].iloc[-1] == pytest.approx(0.01)


def test_intervals_of_normal_errors_hold_95_percent():
    rng, n = np.random.default_rng(0), 4000
    sigma = rng.uniform(0.5, 2.0, (n, 6))
    columns = [*study.AXES, *(f"{axis}_sigma" for axis in study.AXES)]
    errors = pd.DataFrame(np.hstack([sigma * rng.standard_normal((n, 6)), sigma]), columns=columns)
    table = study.interval_table(errors.assign(scene="clean", chain=JOINT, free=False, peg_error=0.002))
    assert table["quantity"].tolist() == ["x", "y", "z", "tilt", "theta"]
    assert ((table["held"] > 94.0) & (table["held"] < 96.0)).all()
    np.testing.assert_allclose(table["rms"] / table["sigma"], 1.0, rtol=0.04)
    assert table["peg_error"].tolist() == pytest.approx([2.0] * 5)


def test_rates_have_wilson_intervals():
    came = np.arange(100) < 30
    rows = pd.DataFrame({"cell": "a", "tilt": 0.0, "clearance": 0.1, "outcome": "free", "promised": 0.33, "came": came})
    (row,) = study.rate_table(rows).itertuples(index=False)
    assert (row.runs, row.promised, row.came) == (100, pytest.approx(33.0), 30.0)
    assert (row.low, row.high) == (pytest.approx(21.9, abs=0.1), pytest.approx(39.6, abs=0.1))


def test_a_small_run():
    errors, insertions, needs = study.run_trials(seeds=1, frames=1, workers=1, progress=False)
    assert len(errors) == 14 and len(insertions) == 2 * 3 * 3 * 2
    assert len(needs) == len(study.CHAINS) * (1 + insertion_rates.ROBOT_DRAWS)
    assert insertions["promised"].between(0, 1).all()
    enters = insertions.pivot_table(index=["cell", "tilt", "clearance"], columns="outcome", values="promised")
    assert (enters["enters"] >= enters["free"] - 1e-12).all()


def test_the_measured_rates_are_as_promised():
    """Committed: of an industrial robot in the Wilson intervals; of an exact one, which needs a few um, within 5 points."""
    rates = study.load_measured("insertion_rates")
    assert (rates["runs"] >= 200).all()
    inside = (rates["promised"] >= rates["low"]) & (rates["promised"] <= rates["high"])
    industrial = rates["cell"] == "industrial robot"
    assert industrial.sum() == 18 and inside[industrial].mean() > 0.94
    assert (np.abs(rates["promised"] - rates["came"])[~industrial] < 5.0).all()
