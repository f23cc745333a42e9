"""Robots with a camera, drawn at random: true poses, and what is measured of them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

TURN_NOISE, NOISE, REPEATABILITY = np.deg2rad(0.1), 0.2, 0.05  # rad and mm of the camera, mm of the robot


@dataclass(frozen=True, eq=False)
class Robot:
    """A set-up: the true poses and the stacks of measured ones."""

    setup: str
    mount_from_cam: RigidTransform
    holder_from_target: RigidTransform
    robot_from_end_effector: RigidTransform
    cam_from_target: RigidTransform


def drawn(rng, n, setup="eye-to-hand", *, turns=(0.35, 0.35, 0.35), noise=1.0, scale=1.0):
    """A robot in n poses; `turns` (rad) about the camera's axes, `noise` times the usual, the target `scale` times its size."""
    x = RigidTransform.from_components(rng.uniform(-1000, 1000, 3), Rotation.random(rng=rng))
    y = RigidTransform.from_components(rng.uniform(-80, 80, 3), Rotation.random(rng=rng))
    places = rng.uniform([-150, -150, 400], [150, 150, 700], (n, 3))
    seen = RigidTransform.from_components(places, Rotation.from_rotvec(rng.standard_normal((n, 3)) * turns))
    a = x * seen * y.inv()
    robot = RigidTransform.from_components(
        a.translation + noise * REPEATABILITY * rng.standard_normal((n, 3)), a.rotation
    )
    error = Rotation.from_rotvec(noise * TURN_NOISE * rng.standard_normal((n, 3)))
    measured = RigidTransform.from_components(
        (places + noise * NOISE * rng.standard_normal((n, 3))) / scale, error * seen.rotation
    )
    return Robot(setup, x, y, robot if setup == "eye-to-hand" else robot.inv(), measured)


def difference(pose, truth):
    """Left perturbation (6,) that takes the truth to the pose: mm, rad, at the origin of the inner frame."""
    return np.concatenate([pose.translation - truth.translation, (pose.rotation * truth.rotation.inv()).as_rotvec()])
