"""The simulated cell: its noise, its robot, and runs in it."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import study
from pegpose_lab.insertion import RP_OF_SIGMA
from pegpose_lab.servo import remaining
from pegpose_lab.study import servo_cell, servo_runs
from pegpose_lab.study.servo_cell import Cell, goal_pose, start_pose


def test_starts_are_within_the_stated_ranges():
    rests = np.array(
        [remaining(start_pose(goal_pose(), np.random.default_rng(seed)), goal_pose()) for seed in range(500)]
    )
    shift = np.linalg.norm(rests[:, :3], axis=1)
    assert shift.max() <= 60 and np.quantile(shift, 0.5) == pytest.approx(60 * 0.5 ** (1 / 3), rel=0.05)
    tilts = []
    for seed in range(500):
        pose = start_pose(goal_pose(), np.random.default_rng(seed))
        tilts.append(np.degrees((pose.rotation.inv() * goal_pose().rotation).as_rotvec(), dtype=float))
    assert np.linalg.norm(np.array(tilts)[:, :2], axis=1).max() < 16 and np.abs(np.array(tilts)[:, 2]).max() < 42


def test_the_fast_mode_is_as_noisy_as_rendered_frames():
    """Rms errors of x, y, z and the turn about z, at poses of a run, in 40 frames of each kind."""
    found = {}
    for rendered in (False, True):
        rows = []
        for seed in range(40):
            rng = np.random.default_rng([seed, 3])
            pose = start_pose(goal_pose(), np.random.default_rng([seed, 4]), shift=30.0)
            cell = Cell.__new__(Cell)  # a camera known exactly, nothing taught
            cell.experiment = servo_cell.paper_experiment(noise=5.0)
            cell.camera, cell.place, cell.rng = cell.experiment.camera, pose, rng
            cell.noise, cell.rendered = 5.0, rendered
            rows.append(remaining(cell.observe().cam_from_hub, pose, servo_cell.HALF_TURN))
        found[rendered] = np.sqrt(np.mean(np.square(rows), axis=0))
    ratio = found[True] / found[False]
    assert ((ratio > 0.55) & (ratio < 1.8)).all()  # of 40 each: 0.8 to 1.25 within one sigma of the ratio


def test_the_robot_repeats_its_motions_to_its_repeatability():
    rng = np.random.default_rng(0)
    cell = Cell(goal_pose(), rng, repeatability=0.1)
    places = []
    for _ in range(1500):
        cell.place = goal_pose()
        cell.move(RigidTransform.from_components([5.0, 0, 0], Rotation.from_rotvec([0, 0, 0.1])))
        places.append(cell.place.translation)
    off = np.linalg.norm(places - np.mean(places, axis=0), axis=1)
    assert off.mean() + 3 * off.std() == pytest.approx(0.1, rel=0.05)  # ISO 9283
    assert np.std(places, axis=0) == pytest.approx(np.full(3, 0.1 / RP_OF_SIGMA), rel=0.08)


def test_runs_reach_the_goal_in_both_modes():
    for seed in range(3):
        drawn = servo_runs.servo_run(seed)
        assert drawn["outcome"] == "reached" and drawn["inside"] and drawn["off"] < 0.1
    rendered = servo_runs.servo_run(0, rendered=True)
    assert rendered["outcome"] == "reached" and rendered["inside"]
    steps = servo_runs.step_table(0)
    assert len(steps) == rendered["steps"] + 1 and steps["off"].iloc[0] == pytest.approx(rendered["start"])


def test_a_hub_out_of_the_image_is_refused():
    start = RigidTransform.from_components([400.0, 0, 400.0], goal_pose().rotation)
    cell = Cell(start, np.random.default_rng(0))
    with pytest.raises(servo_cell.DetectionError, match="outside of the image"):
        cell.observe()


def test_the_measured_runs_end_inside_or_with_a_reason():
    """Of the committed table: every run ends in one of the outcomes, and at most one in 200 of those reached is outside."""
    table = study.load_measured("servo_runs")
    outcomes = table[list(servo_runs.OUTCOMES)]
    assert (outcomes.sum(axis=1) == table["runs"]).all()
    assert (table["false"] <= 0.005 * table["reached"]).all()
    starts = table[table["case"].isin(["starts", "rendered"]) & (table["noise"] == 2.0)]
    assert (starts["reached"] >= 0.99 * starts["runs"]).all()
