"""Pictures of an animation: the pose is drawn where it is, and its numbers below."""

from types import SimpleNamespace

import numpy as np

from pegpose_lab.lab.figures import pose_sequence
from pegpose_lab.paper import paper_experiment

LIMITS = (40, 1000, 10, 650)


def _poses(count):
    truth = paper_experiment()
    return [
        SimpleNamespace(
            cam_from_hub=truth.cam_from_hubs[k], x=truth.shifts[k] + 30, y=-0.001, theta=np.radians(-141.2 - 3 * k)
        )
        for k in range(count)
    ]


def test_readouts_count_from_the_origin():
    first, second = pose_sequence.readouts(_poses(2), (30.0, 0.0))
    assert first == "frame  1   x   0.00 mm   y  0.00 mm   θ \u2212141.20°"
    assert second == "frame  2   x   1.50 mm   y  0.00 mm   θ \u2212144.20°"
    assert len(first) == len(second)


def test_a_picture_has_the_pose_in_its_place():
    truth = paper_experiment()
    image, poses = np.full((1200, 1600), 40, np.uint8), _poses(1)
    (plain,) = pose_sequence.draw_poses([image], poses, ["a"], truth.camera, truth.hub, limits=LIMITS)
    assert plain.shape == (348, 480, 3) and plain.dtype == np.uint8
    colored = np.ptp(plain.astype(int), axis=2) > 60
    x, y = (truth.camera.project([[0, 0, 0]], truth.cam_from_hubs[0])[0] - (40, 10)) / 2
    assert colored[round(y), round(x)] and not colored[320:].any()
    assert 0 < colored.sum() < 0.05 * colored.size
    (other,) = pose_sequence.draw_poses([image], poses, ["b"], truth.camera, truth.hub, limits=LIMITS)
    assert np.array_equal(plain[:320], other[:320]) and not np.array_equal(plain[320:], other[320:])
