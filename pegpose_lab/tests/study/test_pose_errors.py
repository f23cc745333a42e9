"""Errors of poses: a known error is found in the plane's axes, and a covariance is turned with them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import study
from pegpose_lab.paper import paper_experiment

TRUTH = paper_experiment()


def _estimate(index, error):
    """The true pose of a frame, moved in the axes of the plane."""
    place = TRUTH.cam_from_plane * error * TRUTH.cam_from_plane.inv() * TRUTH.cam_from_hubs[index]
    return SimpleNamespace(
        cam_from_hub=place, peg_centers=place.apply(TRUTH.hub.peg_centers), peg_radii=np.full(4, 10.2)
    )


def test_a_shift_in_the_plane_is_found():
    error = RigidTransform.from_translation([0.3, -0.4, 0.0])
    errors = study.pose_errors([_estimate(k, error) for k in range(3)], TRUTH.cam_from_boards[4], TRUTH)
    assert np.allclose(errors.in_plane, [0.3, -0.4, 0.0], atol=1e-9) and errors.pegs.shape == (3, 4, 3)
    rms = errors.rms
    assert rms["peg centres (mm)"] == pytest.approx(0.5) and rms["peg radius (mm)"] == pytest.approx(0.1)


def test_a_wrong_plane_shows_in_depth_alone():
    lower = RigidTransform.from_translation([0.0, 0.0, 0.5])  # along the plane's normal
    plane = TRUTH.cam_from_boards[4] * lower
    errors = study.pose_errors([_estimate(k, lower) for k in range(2)], plane, TRUTH)
    assert np.allclose(errors.in_plane, 0, atol=1e-9)
    assert 0.45 < errors.rms["depth (mm)"] < errors.rms["peg centres (mm)"] == pytest.approx(0.5)


def test_a_turn_is_found_in_thousandths_of_a_degree():
    turn = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, np.radians(0.002)]))
    found = _estimate(0, turn)  # the hub's centre is the plane's origin in frame 1
    (error,) = study.errors_in_plane([found], TRUTH.cam_from_hubs[:1], TRUTH.cam_from_plane)
    assert np.allclose(error, [0, 0, 0, 0, 0, 2.0], atol=1e-6)


def test_covariance_and_errors_have_the_same_axes():
    rng, plane = np.random.default_rng(0), TRUTH.cam_from_plane
    axes = np.kron(np.eye(2), plane.rotation.as_matrix())
    covariance = axes @ np.diag([1, 2, 3, 1e-2, 2e-2, 3e-2]) ** 2 @ axes.T * 1e-6
    draws = rng.multivariate_normal(np.zeros(6), covariance, 4000)
    place = TRUTH.cam_from_hubs[0]
    found = [
        SimpleNamespace(
            cam_from_hub=RigidTransform.from_components(
                place.translation + draw[:3], Rotation.from_rotvec(draw[3:]) * place.rotation
            )
        )
        for draw in draws
    ]
    errors = study.errors_in_plane(found, [place] * len(found), plane)
    stated = np.sqrt(np.diag(study.covariance_in_plane(covariance, plane)))
    assert np.allclose(stated, [1, 2, 3, *np.degrees([0.01, 0.02, 0.03])])
    assert np.allclose(errors.std(axis=0) / stated, 1, atol=0.05)


def test_distances_are_those_left_after_shift_and_turn():
    rng = np.random.default_rng(0)
    targets = rng.normal(size=(5, 4, 2))
    turn = Rotation.from_rotvec([0, 0, 2.5]).as_matrix()[:2, :2]
    assert np.allclose(study.aligned_distances(targets @ turn.T + 7, targets), 0)
    assert study.aligned_distances(1.1 * targets, targets).max() > 0.05  # a scale is no shift and no turn
