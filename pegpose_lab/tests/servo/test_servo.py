"""Visual servoing: the law, how runs end, and that "reached" holds as often as it says."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

import pegpose_lab as pl
from pegpose_lab.servo import correction, remaining
from pegpose_lab.servo.loop import MOST_BLIND, MOST_LOOKS, STALLED

GOAL = RigidTransform.from_components([0.0, 0.0, 400.0], Rotation.from_rotvec([0.1, -0.05, 0.3]))
START = RigidTransform.from_components([40.0, -30.0, 430.0], Rotation.from_rotvec([0.2, 0.1, -0.3]))
SIGMAS = np.array([0.002, 0.002, 0.01, 5e-5, 5e-5, 1e-5])


class Robot:
    """A part that is moved through a wrong hand-eye transform, and seen with noise."""

    def __init__(self, start=START, *, hand_eye=None, sigmas=SIGMAS, scatter=0.0, rng=0, flags=()):
        self.place, self.hand_eye = start, RigidTransform.identity() if hand_eye is None else hand_eye
        self.sigmas, self.scatter, self.flags = np.asarray(sigmas, float), scatter, flags
        self.rng, self.looks = np.random.default_rng(rng), 0

    def observe(self):
        self.looks += 1
        off = self.sigmas * self.rng.standard_normal(6)
        seen = RigidTransform.from_components(
            self.place.translation + off[:3], Rotation.from_rotvec(off[3:]) * self.place.rotation
        )
        return SimpleNamespace(cam_from_hub=seen, covariance=np.diag(self.sigmas**2), flags=self.flags)

    def move(self, motion):
        shaken = RigidTransform.from_translation(self.scatter * self.rng.standard_normal(3))
        self.place = shaken * self.hand_eye * motion * self.hand_eye.inv() * self.place

    def run(self, **options):
        return pl.visual_servo(self.observe, self.move, GOAL, **options)


def turned(degrees, axis=(0, 0, 1.0)):
    return RigidTransform.from_rotation(Rotation.from_rotvec(np.deg2rad(degrees) * np.asarray(axis)))


# ---- the law ----

angles = st.floats(-1.0, 1.0)


@settings(max_examples=40)
@given(st.tuples(*[st.floats(-60, 60)] * 3), st.tuples(angles, angles, angles), st.floats(0.05, 1.0))
def test_an_exact_motion_leaves_the_rest_of_the_gain(shift, turn, gain):
    part = RigidTransform.from_components(np.add(GOAL.translation, shift), Rotation.from_rotvec(turn) * GOAL.rotation)
    rest = remaining(part, GOAL)
    after = remaining(correction(part, rest, gain) * part, GOAL)
    np.testing.assert_allclose(after, (1 - gain) * rest, atol=1e-9)


@pytest.mark.parametrize("gain", [0.4, 0.7, 1.0])
@pytest.mark.parametrize("degrees", [0.0, 20.0, 45.0])
def test_a_turned_hand_eye_shrinks_the_rest_by_its_factor(degrees, gain):
    """|1 - gain exp(i beta)| a step, for a shift across the axis of the error."""
    part = RigidTransform.from_components(GOAL.translation + [10.0, 0, 0], GOAL.rotation)
    robot = Robot(part, hand_eye=turned(degrees))
    robot.move(correction(part, remaining(part, GOAL), gain))
    left = np.linalg.norm(remaining(robot.place, GOAL)[:3])
    assert left == pytest.approx(10 * abs(1 - gain * np.exp(1j * np.deg2rad(degrees))), abs=1e-9)


def test_the_nearest_of_equal_goals_counts():
    part = GOAL * turned(170.0)
    assert np.degrees(np.linalg.norm(remaining(part, GOAL)[3:])) == pytest.approx(170.0)
    assert np.degrees(np.linalg.norm(remaining(part, GOAL, 2)[3:])) == pytest.approx(10.0)
    assert np.degrees(np.linalg.norm(remaining(part, GOAL, 4)[3:])) == pytest.approx(10.0)


# ---- how runs end ----


def test_an_exact_robot_is_there_after_one_motion_at_full_gain():
    robot = Robot()
    run = robot.run(gain=1.0)
    assert run.reached and len(run.poses) == 2 and run.frames == robot.looks
    rest = remaining(robot.place, GOAL)
    assert np.linalg.norm(rest[:3]) < 0.1 and np.degrees(np.linalg.norm(rest[3:])) < 0.05


@pytest.mark.parametrize("degrees", [-50.0, 10.0, 40.0])
def test_a_wrong_hand_eye_costs_steps_only(degrees):
    robot = Robot(hand_eye=RigidTransform.from_translation([20.0, -10.0, 5.0]) * turned(degrees, (0.6, 0, 0.8)))
    run = robot.run()
    assert run.reached and len(run.poses) > 5
    assert np.linalg.norm(remaining(robot.place, GOAL)[:3]) < 0.1


def test_a_hand_eye_beyond_the_limit_diverges():
    run = Robot(hand_eye=turned(100.0)).run(gain=1.0)
    assert run.outcome == "diverging" and "hand-eye" in run.reason
    assert Robot(hand_eye=turned(100.0)).run(gain=0.1).outcome in ("diverging", "no-progress", "steps-used-up")


def test_a_robot_that_scatters_makes_no_progress():
    run = Robot(scatter=0.3).run(distance=0.02)
    assert run.outcome == "no-progress" and "does not repeat" in run.reason
    assert len(run.poses) < 41 and run.distances[-STALLED:].min() > 0.02


def test_a_pose_too_coarse_for_the_tolerance_is_told():
    run = Robot(sigmas=10 * SIGMAS).run(distance=0.05)
    assert run.outcome == "too-uncertain" and "mm" in run.reason
    coarse = Robot().run(goal_covariance=np.diag([0.2] * 3 + [1e-8] * 3) ** 2)
    assert coarse.outcome == "too-uncertain"


def test_two_poses_are_never_taken_for_one():
    run = Robot(flags=(pl.Flag("two-poses", "Another pose explains the pegs."),)).run()
    assert run.outcome == "too-uncertain"


def test_averaging_reaches_what_one_frame_cannot():
    """Of frames whose sigma times the quantile is above the tolerance, eight are enough."""
    sigmas = np.array([0.01] * 3 + [1e-5] * 3)
    robot = Robot(sigmas=sigmas)
    run = robot.run(distance=0.025)
    assert run.reached and run.frames > len(run.poses)
    assert run.frames <= MOST_LOOKS * len(run.poses)


def test_a_part_that_is_lost_once_is_looked_at_again():
    robot, seen = Robot(), []

    def observe():
        seen.append(len(seen))
        if len(seen) in (2, 5):
            raise pl.DetectionError("no peg")
        return robot.observe()

    run = pl.visual_servo(observe, robot.move, GOAL)
    assert run.reached and run.frames == len(seen) == robot.looks + 2


def test_a_part_out_of_view_is_told():
    def observe():
        raise pl.DetectionError("found 0 discs")

    run = pl.visual_servo(observe, lambda motion: None, GOAL)
    assert run.outcome == "not-seen" and "found 0 discs" in run.reason and run.frames == MOST_BLIND
    assert run.errors.shape == (0, 6) and run.covariances.shape == (0, 6, 6) and run.poses == ()


def test_steps_can_be_used_up():
    run = Robot().run(gain=0.05, max_steps=5)
    assert run.outcome == "steps-used-up" and len(run.poses) == 6 and "5 steps" in run.reason


def test_reached_holds_as_often_as_it_says():
    """With a noise that just allows the tolerance: of 300 runs that end, the truth is inside in 95 % at least."""
    sigmas, inside, ended = np.array([0.02] * 3 + [8e-5] * 3), 0, 0
    for seed in range(300):
        robot = Robot(sigmas=sigmas, scatter=0.02, rng=seed)
        run = robot.run(distance=0.08)
        if run.reached:
            rest = remaining(robot.place, GOAL)
            ended += 1
            inside += np.linalg.norm(rest[:3]) <= 0.08 and np.degrees(np.linalg.norm(rest[3:])) <= 0.05
    assert ended > 250 and inside >= 0.95 * ended


# ---- unusable input ----


@pytest.mark.parametrize(
    "options",
    [{"gain": 0.0}, {"gain": 1.2}, {"distance": 0.0}, {"angle": -1.0}, {"confidence": 1.0}, {"max_steps": 0},
     {"symmetry": 0}, {"goal_covariance": np.eye(3)}],
)  # fmt: skip
def test_unusable_options(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        Robot().run(**options)


def test_a_pose_without_covariance_is_refused():
    pose = SimpleNamespace(cam_from_hub=START, covariance=None)
    with pytest.raises(ValueError, match="without a covariance"):
        pl.visual_servo(lambda: pose, lambda motion: None, GOAL)


def test_nothing_in_place_of_a_pose_is_refused():
    with pytest.raises(ValueError, match="observe returned NoneType"):
        pl.visual_servo(lambda: None, lambda motion: None, GOAL)
