"""Pegs and a wheel as clouds of points: the oracle of the insertion's geometry, and poses drawn one by one."""

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

CAM_FROM_HUB = RigidTransform.from_components([30.0, -20.0, 500.0], Rotation.from_rotvec([0.1, -0.2, 0.4]))


def covariance(sigmas, seed):
    """A covariance (6, 6) with all correlations, of about these sigmas: mm and rad."""
    mix = np.linalg.qr(np.random.default_rng(seed).standard_normal((6, 6)))[0] * np.array(
        [1.3, 1.2, 1.0, 0.9, 0.8, 0.6]
    )
    return (mix * 1.0) @ mix.T * np.outer(sigmas, sigmas)


def pose_with(**budget):
    """A pose of the hub with a budget, as `estimate_pose` returns it."""
    return SimpleNamespace(cam_from_hub=CAM_FROM_HUB, covariance=sum(budget.values()), budget=budget, flags=())


def perturbed(pose, errors):
    """The poses with left perturbations (m, 6) in axes of the camera at the origin of what is posed."""
    return RigidTransform.from_components(
        pose.translation + errors[:, :3], Rotation.from_rotvec(errors[:, 3:]) * pose.rotation
    )


def peg_points(hub, top, axis, along=200, around=720):
    """Points (m, 3) on the side and the rim of the top of one peg that begins at `top` and runs along `axis`."""
    across = np.linalg.svd(np.atleast_2d(axis))[2][1:]
    angles = 2 * np.pi * np.arange(around) / around
    ring = hub.peg_radius * (np.cos(angles)[:, None] * across[0] + np.sin(angles)[:, None] * across[1])
    steps = np.linspace(
        0, hub.peg_height * 1.2, along
    )  # longer than the peg: a tilted wheel reaches further on one side
    return (top + steps[:, None, None] * axis + ring).reshape(-1, 3)


def hole_radius(z, hub, wheel):
    """Radius of a hole at z <= 0 in the wheel frame, mm."""
    return hub.peg_radius + wheel.clearance + np.maximum(wheel.chamfer + z, 0.0)


def overlap(points, hole, depth, hub, wheel):
    """How deep, mm, points (m, 3) of a peg lie in the wheel's material at a depth of insertion; negative: room."""
    z = points[:, 2] - depth
    inside = (z <= 0) & (z >= -wheel.thickness)
    distance = np.linalg.norm(points[:, :2] - hole, axis=1) - hole_radius(z, hub, wheel)
    return np.max(distance[inside], initial=-np.inf)
