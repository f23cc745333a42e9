"""The covariance of a pose by cause: each is redrawn alone and has the errors that its share states."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import calibrate_joint
from pegpose_lab.paper import paper_experiment
from pegpose_lab.pose import estimate_pose, project_discs
from pegpose_lab.tests.pose.test_pose_fit import difference, moved, observe

EXPERIMENT = paper_experiment()
CAMERA, HUB, BOARD = EXPERIMENT.camera, EXPERIMENT.hub, EXPERIMENT.board.object_points
TRIALS, SIGMA, CORNER_NOISE = 150, 0.02, 0.05  # px
IN_PLANE = RigidTransform.from_components([60.0, 40.0, 0.0], Rotation.from_rotvec([0, 0, 0.7]))


def check(errors, covariances, freedom):
    """Squared Mahalanobis distances have the mean of chi squared, and 95 % of its intervals hold."""
    scale, distances = np.repeat([1, 1e-2], 3), []
    for error, covariance in zip(errors, covariances, strict=True):
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        assert (values[: 6 - freedom] < 1e-6 * values[-1]).all()
        distances.append(np.sum(((error / scale) @ vectors[:, -freedom:]) ** 2 / values[-freedom:]))
    assert np.mean(distances) == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom / len(distances)))
    quantile = {3: 7.815, 4: 9.488, 6: 12.592}[freedom]
    assert np.mean(np.array(distances) < quantile) > 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(distances))


@pytest.mark.parametrize("in_plane, freedom", [(False, 6), (True, 3)])
def test_tolerance_of_the_part(in_plane, freedom):
    """Pegs that are displaced on the part: the share states what the pose makes of them."""
    truth, sigma, rng = EXPERIMENT.cam_from_hubs[5], 0.05, np.random.default_rng(0)
    exact, poses = observe(truth, CAMERA, HUB), []
    for _ in range(TRIALS):
        off = sigma * np.column_stack([rng.standard_normal((4, 2)), np.zeros(4)])
        centers, radii = project_discs(CAMERA, truth, HUB.peg_centers + off, np.full(4, HUB.peg_radius))
        seen = {"peg_centers": centers, "peg_radii": radii, "peg_sigmas": np.full((4, 2), 1e-3)}
        plane = truth if in_plane else None
        poses.append(estimate_pose(SimpleNamespace(**vars(exact) | seen), CAMERA, HUB, plane=plane, part_sigma=sigma))
    check([difference(pose.cam_from_hub, truth) for pose in poses], [pose.covariance for pose in poses], freedom)
    for pose in poses[:3]:
        assert set(pose.budget) == {"discs", "part"}
        np.testing.assert_allclose(sum(pose.budget.values()), pose.covariance, rtol=1e-12)


@pytest.mark.parametrize("view, freedom", [(None, 4), (0, 6)])
def test_calibration_drawn_anew(view, freedom):
    """The camera alone (f, kappa1 and principal point), and with it the plane from one of its views."""
    truth, rng, errors, covariances = EXPERIMENT.cam_from_boards[0] * IN_PLANE, np.random.default_rng(1), [], []
    exact = observe(truth, CAMERA, HUB)
    exact.peg_sigmas = np.full((4, 2), 1e-4)
    corners = [CAMERA.project(BOARD, pose) for pose in EXPERIMENT.cam_from_boards]
    for _ in range(TRIALS):
        noisy = [points + CORNER_NOISE * rng.standard_normal(points.shape) for points in corners]
        found = calibrate_joint([BOARD] * 5, noisy, CAMERA)
        plane = None if view is None else found.cam_from_object[view]
        pose = estimate_pose(exact, found, HUB, plane=plane, plane_view=view)
        assert pose.budget["discs"].trace() < 0.02 * pose.covariance.trace()
        errors.append(difference(pose.cam_from_hub, truth))
        covariances.append(pose.budget["calibration"] if view is None else pose.covariance)
    check(errors, covariances, freedom)


def test_plane_known_from_elsewhere():
    """What moves the plane in itself moves no disc in it: three of the six numbers count."""
    truth, rng = EXPERIMENT.cam_from_hubs[5], np.random.default_rng(2)
    plane = truth * RigidTransform.from_components([30.0, -20.0, 0.0], Rotation.from_rotvec([0, 0, 0.4]))
    exact = observe(truth, CAMERA, HUB)
    exact.peg_sigmas = np.full((4, 2), 1e-4)
    root = rng.standard_normal((6, 6)) * np.repeat([0.1, 1e-3], 3)[:, None]
    errors, covariances = [], []
    for _ in range(TRIALS):
        wrong = moved(plane, root @ rng.standard_normal(6))
        pose = estimate_pose(exact, CAMERA, HUB, plane=wrong, plane_covariance=root @ root.T)
        errors.append(difference(pose.cam_from_hub, truth))
        covariances.append(pose.covariance)
    check(errors, covariances, 3)


def test_causes_need_what_they_refer_to():
    exact = observe(EXPERIMENT.cam_from_hubs[5], CAMERA, HUB, SIGMA, 0)
    plane = EXPERIMENT.cam_from_plane
    for arguments, message in (
        ({"plane_view": 0}, "need a plane"),
        ({"plane_covariance": np.eye(6)}, "need a plane"),
        ({"plane": plane, "plane_view": 0}, "plane_view needs a Calibration"),
        ({"plane": plane, "plane_covariance": np.eye(3)}, r"plane_covariance has shape \(3, 3\)"),
        ({"part_sigma": -1}, "part_sigma"),
    ):
        with pytest.raises(ValueError, match=message):
            estimate_pose(exact, CAMERA, HUB, **arguments)
