"""Covariances of products, inverses and of the chain to the robot, against redrawn errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import HandEye, UncertainPose, calibrate_hand_eye
from pegpose_lab.handeye.pairs import SETUPS
from pegpose_lab.pose import hub_from_end_effector
from pegpose_lab.tests.handeye.robots import difference, drawn

NOISE = np.array([0.2, 0.3, 0.5, 1e-3, 2e-3, 3e-3])


def random_uncertain(rng):
    pose = RigidTransform.from_components(rng.uniform(-500, 500, 3), Rotation.random(rng=rng))
    mix = rng.standard_normal((6, 6)) * NOISE[:, None] / 3
    return UncertainPose.checked(pose, mix @ mix.T)


def redrawn(uncertain, rng):
    error = rng.multivariate_normal(np.zeros(6), uncertain.covariance)
    return RigidTransform.from_components(
        uncertain.pose.translation + error[:3], Rotation.from_rotvec(error[3:]) * uncertain.pose.rotation
    )


def check(result, redraw, trials=2000):
    """Whitened errors have unit covariance, to four standard deviations of its entries."""
    errors = np.array([difference(redraw(), result.pose) for _ in range(trials)])
    white = np.linalg.solve(np.linalg.cholesky(result.covariance), errors.T)
    assert np.abs(white @ white.T / trials - np.eye(6)).max() < 5 * np.sqrt(2 / trials)


def test_products_and_inverses():
    rng = np.random.default_rng(0)
    first, second = random_uncertain(rng), random_uncertain(rng)
    check(first * second, lambda: redrawn(first, rng) * redrawn(second, rng))
    check(first.inv(), lambda: redrawn(first, rng).inv())


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_rules_of_frames(seed):
    """Products are associative, and an inverse undoes itself and turns a product about."""
    rng = np.random.default_rng(seed)
    a, b, c = (random_uncertain(rng) for _ in range(3))
    for left, right in (((a * b) * c, a * (b * c)), (a.inv().inv(), a), ((a * b).inv(), b.inv() * a.inv())):
        assert np.abs(difference(left.pose, right.pose)).max() < 1e-9
        size = np.sqrt(np.outer(np.diag(right.covariance), np.diag(right.covariance)))
        assert np.abs((left.covariance - right.covariance) / size).max() < 1e-6


@pytest.mark.parametrize("setup", SETUPS)
def test_chain_to_the_robot(setup):
    """Eqs. 1 and 2: the hub in the robot's base and the end effector in the hub's frame, and their errors."""
    rng = np.random.default_rng(1)
    drawn_robot = drawn(rng, 12, setup)
    robot, seen = drawn_robot.robot_from_end_effector, drawn_robot.cam_from_target
    found = calibrate_hand_eye(robot, seen, setup=setup)
    hub, arm = UncertainPose.checked(seen[0], np.diag(NOISE**2) / 9), UncertainPose.exact(robot[3])
    camera = UncertainPose(found.mount_from_cam, found.covariance)
    at_base = found.robot_from_hub(hub, arm)
    at_hub = found.hub_from_end_effector(hub, arm)
    exact = robot[3] if setup == "eye-in-hand" else RigidTransform.identity()
    check(at_base, lambda: exact * redrawn(camera, rng) * redrawn(hub, rng))
    cam_from_end_effector = found.mount_from_cam.inv() * (robot[3] if setup == "eye-to-hand" else exact * exact.inv())
    expected = hub_from_end_effector(hub.pose, cam_from_end_effector)
    assert np.abs(difference(at_hub.pose, expected)).max() < 1e-9
    both = at_base.inv() * arm
    assert np.abs(difference(both.pose, at_hub.pose)).max() < 1e-9


def test_poses_of_the_robot_that_are_needed():
    robot = drawn(np.random.default_rng(2), 12, "eye-in-hand")
    found = calibrate_hand_eye(robot.robot_from_end_effector, robot.cam_from_target, setup="eye-in-hand")
    assert isinstance(found, HandEye)
    hub = UncertainPose.exact(robot.cam_from_target[0])
    assert found.hub_from_end_effector(hub).covariance.shape == (6, 6)
    with pytest.raises(ValueError, match="robot_from_end_effector is NoneType"):
        found.robot_from_hub(hub)
    with pytest.raises(ValueError, match="cam_from_hub is RigidTransform"):
        found.robot_from_hub(hub.pose)
    with pytest.raises(ValueError, match="one scipy RigidTransform"):
        found.cam_from_target(None)


@pytest.mark.parametrize("covariance", [np.eye(3), -np.eye(6), np.full((6, 6), np.nan), np.triu(np.ones((6, 6)))])
def test_what_is_no_covariance(covariance):
    with pytest.raises(ValueError, match="covariance of pose"):
        UncertainPose.checked(RigidTransform.identity(), covariance)
