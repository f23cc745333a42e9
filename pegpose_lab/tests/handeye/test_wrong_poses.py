"""Poses that do not determine the camera, or are not what they are said to be, are refused or flagged in words."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import CalibrationError, calibrate_hand_eye
from pegpose_lab.handeye.pairs import SETUPS
from pegpose_lab.tests.handeye.robots import drawn


def scaled(poses, factor):
    return RigidTransform.from_components(factor * poses.translation, poses.rotation)


def transposed(poses):
    return RigidTransform.from_components(poses.translation, poses.rotation.inv())


def in_degrees(poses):
    return RigidTransform.from_components(
        poses.translation, Rotation.from_rotvec(np.rad2deg(poses.rotation.as_rotvec()))
    )


def shuffled(poses, rng):
    order = np.arange(len(poses))
    while (order == np.arange(len(poses))).all():
        order = rng.permutation(len(poses))
    return poses[order]


WRONG = {
    "shuffled": (lambda robot, seen, rng: (robot, shuffled(seen, rng)), "do not fit each other"),
    "robot in m": (lambda robot, seen, rng: (scaled(robot, 1e-3), seen), "the robot's in m and the camera's in mm"),
    "camera in m": (lambda robot, seen, rng: (robot, scaled(seen, 1e-3)), "the robot's in mm and the camera's in m"),
    "camera in cm": (lambda robot, seen, rng: (robot, scaled(seen, 0.1)), "the robot's in mm and the camera's in cm"),
    "camera in inches": (lambda robot, seen, rng: (robot, scaled(seen, 1 / 25.4)), "the camera's in inches"),
    "degrees": (lambda robot, seen, rng: (in_degrees(robot), seen), "in radians"),
    "robot transposed": (lambda robot, seen, rng: (transposed(robot), seen), "rotations of robot_from_end_eff"),
    "camera transposed": (lambda robot, seen, rng: (robot, transposed(seen)), "rotations of cam_from_target"),
    "both transposed": (lambda robot, seen, rng: (transposed(robot), transposed(seen)), "all rotations transposed"),
    "robot inverted": (lambda robot, seen, rng: (robot.inv(), seen), "they fit (as|with cam_from_target inverted)"),
    "camera inverted": (lambda robot, seen, rng: (robot, seen.inv()), "target_from_cam"),
    "both inverted": (lambda robot, seen, rng: (robot.inv(), seen.inv()), "target_from_cam"),
    "one place later": (lambda robot, seen, rng: (robot, seen[np.roll(np.arange(len(seen)), -1)]), "place later"),
}


@pytest.mark.parametrize("turn", [0.35, 0.15])
@pytest.mark.parametrize("setup", SETUPS)
@pytest.mark.parametrize("case", WRONG)
def test_wrong_poses_are_refused_in_words(case, setup, turn):
    rng, (spoil, words) = np.random.default_rng(3), WRONG[case]
    for trial in range(25):  # four of these are 100
        robot = drawn(rng, 10 + trial % 6, setup, turns=(turn, turn, turn))
        poses = spoil(robot.robot_from_end_effector, robot.cam_from_target, rng)
        with pytest.raises((CalibrationError, ValueError), match=words):
            calibrate_hand_eye(*poses, setup=setup)


def test_all_in_metres_is_flagged():
    rng = np.random.default_rng(4)
    for _ in range(100):
        robot = drawn(rng, 12)
        found = calibrate_hand_eye(scaled(robot.robot_from_end_effector, 1e-3), scaled(robot.cam_from_target, 1e-3))
        assert "small-lengths" in [flag.code for flag in found.flags]


def test_two_exchanged_poses_are_refused_or_flagged():
    rng = np.random.default_rng(5)
    for _ in range(100):
        robot, order = drawn(rng, 15), np.arange(15)
        first, second = rng.choice(15, 2, replace=False)
        order[[first, second]] = second, first
        try:
            found = calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target[order])
        except CalibrationError:
            continue
        assert "misfit-pose" in [flag.code for flag in found.flags]


def test_another_size_of_the_target_is_flagged():
    robot = drawn(np.random.default_rng(6), 15, scale=25.4 / 20)
    found = calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target)
    (flag,) = (flag for flag in found.flags if flag.code == "target-scale")
    assert "target is 1.2" in flag
    again = calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target, estimate_scale=True)
    assert again.target_scale == pytest.approx(1.27, abs=0.01) and not again.flags


@pytest.mark.parametrize("turns, words", [((0, 0, 0), "pure translation"), ((0, 0, 0.5), "parallel axes")])
def test_turns_that_leave_the_camera_free(turns, words):
    robot = drawn(np.random.default_rng(7), 12, turns=turns)
    with pytest.raises(CalibrationError, match=words):
        calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target)


def test_nearly_parallel_axes_are_flagged():
    robot = drawn(np.random.default_rng(8), 12, turns=(0.03, 0.03, 0.5))
    found = calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target)
    assert [flag.code for flag in found.flags] == ["little-turn"]


def test_one_pose_that_carries_the_answer():
    """All turns about one axis but in one pose: without that the others leave the camera free."""
    robot = drawn(np.random.default_rng(9), 8, turns=(0, 0, 0.5), noise=0)
    lonely = RigidTransform.from_components([0.0, 0, 500], Rotation.from_rotvec([0.5, 0, 0]))
    seen = RigidTransform.concatenate([*robot.cam_from_target, lonely])
    moved = robot.mount_from_cam * seen * robot.holder_from_target.inv()
    with pytest.raises(CalibrationError, match="without pose 8"):
        calibrate_hand_eye(moved, seen)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"robot_from_end_effector": None}, "sequence of scipy RigidTransforms"),
        ({"cam_from_target": np.eye(4)}, "sequence of scipy RigidTransforms"),
        ({"cam_from_target": []}, "sequence"),
        ({"setup": "eye-on-hand"}, "setup"),
        ({"working_point": (0, 0)}, "working_point"),
        ({"translation_sigma": 0.2}, "both, or neither"),
        ({"translation_sigma": 0.2, "rotation_sigma": 0.0}, "rotation_sigma"),
        ({"estimate_scale": "yes"}, "estimate_scale"),
    ],
)
def test_unusable_input(change, words):
    robot = drawn(np.random.default_rng(10), 10)
    usual = {"robot_from_end_effector": robot.robot_from_end_effector, "cam_from_target": robot.cam_from_target}
    with pytest.raises(ValueError, match=words):
        calibrate_hand_eye(**(usual | change))


def test_numbers_of_poses():
    robot = drawn(np.random.default_rng(11), 10)
    with pytest.raises(ValueError, match="10 poses and cam_from_target 9"):
        calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target[:9])
    with pytest.raises(ValueError, match="at least 5"):
        calibrate_hand_eye(robot.robot_from_end_effector[:4], robot.cam_from_target[:4])
