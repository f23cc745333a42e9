"""Hand-eye calibration recovers a simulated truth, and its intervals hold it."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import t as student

from pegpose_lab import calibrate_hand_eye
from pegpose_lab.handeye.adjust import evaluate, moved
from pegpose_lab.handeye.pairs import SETUPS, Pairs
from pegpose_lab.handeye.start import Solution, closed_rotations, closed_solution
from pegpose_lab.tests.handeye.robots import NOISE, REPEATABILITY, TURN_NOISE, difference, drawn


def solved(robot, **options):
    return calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target, setup=robot.setup, **options)


@pytest.mark.parametrize("setup", SETUPS)
@pytest.mark.parametrize("scale", [1.0, 0.8])
def test_exact_poses_give_the_truth(setup, scale):
    robot = drawn(np.random.default_rng(0), 8, setup, noise=0, scale=scale)
    found = solved(robot, estimate_scale=scale != 1, working_point=(30, 20, 0))
    assert np.abs(difference(found.mount_from_cam, robot.mount_from_cam)).max() < 1e-6
    assert np.abs(difference(found.holder_from_target, robot.holder_from_target)).max() < 1e-6
    assert found.target_scale == pytest.approx(scale, abs=1e-9) and found.left_out_error < 1e-6


@pytest.mark.parametrize("scaled", [False, True])
def test_intervals_hold_the_truth(scaled):
    """500 set-ups of 10 to 20 poses, half of them eye-in-hand: 95 % intervals of the camera's pose, and of the scale."""
    rng, inside, scales, flags = np.random.default_rng(1), [], [], []
    for trial in range(500):
        size = 0.97 if scaled else 1.0
        robot = drawn(rng, int(rng.integers(10, 21)), SETUPS[trial % 2], scale=size)
        found = solved(robot, estimate_scale=scaled)
        inside.append(np.abs(difference(found.mount_from_cam, robot.mount_from_cam)) < found.half_widths)
        quantile = student.ppf(0.975, found.degrees_of_freedom.mean())
        scales.append(abs(found.target_scale - size) <= quantile * found.target_scale_sigma)
        flags += found.flags
    assert 0.93 < np.mean(inside) < 0.97
    assert (np.mean(inside, axis=0) > 0.92).all()  # each of the six: four standard deviations of 500 trials below 95 %
    assert 0.92 < np.mean(scales) <= (0.98 if scaled else 1)
    assert len(flags) <= 5  # a flag on the target's size comes once in 1000


def test_errors_that_differ_between_poses():
    """Depth and tilt are worse than the rest, and some pictures than others by a factor of two: intervals hold still."""
    rng, inside, flagged = np.random.default_rng(5), [], 0
    for _ in range(150):
        robot = drawn(rng, int(rng.integers(10, 21)), noise=0)
        size = np.exp(0.6 * rng.standard_normal((len(robot.cam_from_target), 1)))
        shifts = size * NOISE * rng.standard_normal((len(size), 3)) * [1, 1, 3]
        turns = Rotation.from_rotvec(size * TURN_NOISE * rng.standard_normal((len(size), 3)) * [2, 2, 1])
        seen = robot.cam_from_target
        seen = RigidTransform.from_components(seen.translation + shifts, turns * seen.rotation)
        found = calibrate_hand_eye(robot.robot_from_end_effector, seen)
        inside.append(np.abs(difference(found.mount_from_cam, robot.mount_from_cam)) < found.half_widths)
        flagged += any(flag.code == "misfit-pose" for flag in found.flags)
    assert 0.93 < np.mean(inside) < 0.99 and flagged < 0.2 * 150


def test_five_poses_are_enough_to_settle():
    rng = np.random.default_rng(6)
    for _ in range(200):
        assert solved(drawn(rng, 5)).half_widths.max() < 100


def test_noise_is_found_and_predicted():
    """The estimated sigmas are those drawn, and a new pose is where the calibration and they say."""
    rng, sigmas, inside = np.random.default_rng(2), [], []
    for _ in range(200):
        robot = drawn(rng, 13)
        poses, seen = robot.robot_from_end_effector, robot.cam_from_target
        found = calibrate_hand_eye(poses[:12], seen[:12])
        sigmas.append((found.translation_sigma, found.rotation_sigma))
        error = difference(seen[12], found.cam_from_target(poses[12]).pose)
        inside.append(np.abs(error) < found.new_pose_half_widths(poses[12]))
    assert np.median(sigmas, axis=0) == pytest.approx([np.hypot(NOISE, REPEATABILITY), TURN_NOISE], rel=0.05)
    assert 0.93 < np.mean(inside) < 0.97


def test_leaving_out_in_one_step_is_a_refit():
    robot = drawn(np.random.default_rng(3), 10)
    poses, seen = robot.robot_from_end_effector, robot.cam_from_target
    sigmas = {"translation_sigma": NOISE, "rotation_sigma": TURN_NOISE}
    found = calibrate_hand_eye(poses, seen, **sigmas)
    for k in (0, 4, 9):
        rest = np.arange(10) != k
        again = calibrate_hand_eye(poses[rest], seen[rest], **sigmas)
        error = difference(seen[k], again.cam_from_target(poses[k]).pose)
        np.testing.assert_allclose(error, found.left_out[k], atol=2e-3)
    assert found.left_out_error > np.sqrt(np.mean(np.sum(found.residuals[:, :3] ** 2, axis=1)))


def test_derivatives():
    """Of the prediction by each unknown, against differences, at a solution without residuals."""
    robot = drawn(np.random.default_rng(4), 5, noise=0)
    pairs = Pairs.of_poses(robot.robot_from_end_effector, robot.cam_from_target, robot.setup)
    x, y, point = robot.mount_from_cam, robot.holder_from_target, np.array([40.0, 30.0, 5.0])
    truth = Solution(x.rotation.as_matrix(), x.translation, y.rotation.as_matrix(), y.translation, 1.0)
    residuals, design = evaluate(pairs, truth, point, True)
    assert np.abs(residuals).max() < 1e-9
    for unknown in range(13):
        step = 1e-6 * np.eye(13)[unknown]
        ahead, behind = (evaluate(pairs, moved(truth, sign * step), point, True)[0] for sign in (1, -1))
        np.testing.assert_allclose(design[:, :, unknown], -(ahead - behind) / 2e-6, atol=1e-5)


def test_the_closed_solution_is_near():
    robot = drawn(np.random.default_rng(5), 12)
    pairs = Pairs.of_poses(robot.robot_from_end_effector, robot.cam_from_target, robot.setup)
    start = closed_solution(pairs, *closed_rotations(pairs), True)
    assert np.linalg.norm(start.x_shift - robot.mount_from_cam.translation) < 10
    assert start.scale == pytest.approx(1, abs=0.01)


def test_frames_may_be_chosen_anew():
    """Another robot base and target frame change the answer by just that: the fit has no frame of its own."""
    robot = drawn(np.random.default_rng(6), 10)
    base, sheet = (
        RigidTransform.from_components(shift, Rotation.from_rotvec(turn))
        for shift, turn in (([300.0, -200, 50], [0.4, -1.2, 2.0]), ([25.0, 15, 0], [0, 0, 0.7]))
    )
    found = solved(robot)
    other = calibrate_hand_eye(
        base * robot.robot_from_end_effector, robot.cam_from_target * sheet, working_point=sheet.inv().translation
    )
    assert np.abs(difference(other.mount_from_cam, base * found.mount_from_cam)).max() < 1e-6
    assert np.abs(difference(other.holder_from_target, found.holder_from_target * sheet)).max() < 1e-6
    turn = np.kron(np.eye(2), base.rotation.as_matrix())
    expected = turn @ found.covariance @ turn.T
    np.testing.assert_allclose(other.covariance, expected, atol=1e-5 * np.abs(expected).max())
