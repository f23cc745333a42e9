"""What was seen of the pegs decides their weight: part of one, none of it, radii, a ring without a hub."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import CalibrationError, RingPattern, locate_pegs, render_hub
from pegpose_lab.paper import paper_camera
from pegpose_lab.pose import estimate_pose, project_discs
from pegpose_lab.targets import Hub
from pegpose_lab.tests.pose.test_pose_fit import difference, observe

CAMERA, HUB = paper_camera(), Hub(n_pegs=6)
TRUTH = RigidTransform.from_components([10.0, -20.0, 300.0], Rotation.from_rotvec([0.3, -0.2, 0.5]))
SIGMA, PART, RADIUS_SIGMA, TRIALS = 0.02, 0.3, 0.015, 200  # px


def seen(rng, exact, sigmas):
    """The exact observation with noise of each peg's own sigma (n,), px, and these sigmas stated."""
    rng = np.random.default_rng(rng)
    noise = np.where(np.isfinite(sigmas), sigmas, 100.0)[:, None] * rng.standard_normal((len(sigmas), 2))
    radii = exact.peg_radii + RADIUS_SIGMA * rng.standard_normal(len(sigmas))
    stated = {"peg_sigmas": np.column_stack([sigmas, sigmas]), "peg_radii": radii}
    return SimpleNamespace(**vars(exact) | stated | {"peg_centers": exact.peg_centers + noise})


@pytest.mark.parametrize("plane, freedom, quantile", [(None, 6, 12.592), (TRUTH, 3, 7.815)])
def test_hidden_and_partial_pegs_are_weighed(plane, freedom, quantile):
    """A peg of which a part is seen, and one that is not seen at all: the covariance is that of the errors."""
    sigmas = np.array([SIGMA, PART, SIGMA, np.inf, SIGMA, SIGMA])
    exact, distances, scale = observe(TRUTH, CAMERA, HUB), [], np.repeat([1, 1e-2], 3)
    for rng in range(TRIALS):
        pose = estimate_pose(seen(rng, exact, sigmas), CAMERA, HUB, plane=plane)
        assert pose.used.tolist() == np.isfinite(sigmas).tolist() and pose.rms < 1
        values, vectors = np.linalg.eigh(pose.covariance / np.outer(scale, scale))
        free = (difference(pose.cam_from_hub, TRUTH) / scale) @ vectors[:, -freedom:]
        distances.append(np.sum(free**2 / values[-freedom:]))
    assert np.mean(distances) == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom / TRIALS))
    assert np.mean(np.array(distances) < quantile) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / TRIALS))


def test_weights_make_the_pose_better_than_equal_ones():
    """With a partial peg the weighted pose has the smaller errors, by its own covariance and in fact."""
    sigmas = np.array([SIGMA, PART, SIGMA, SIGMA, SIGMA, SIGMA])
    exact, errors = observe(TRUTH, CAMERA, HUB), []
    for rng in range(60):
        observation = seen(rng, exact, sigmas)
        equal = SimpleNamespace(**vars(observation) | {"peg_sigmas": np.full((6, 2), SIGMA)})
        errors.append([difference(estimate_pose(o, CAMERA, HUB).cam_from_hub, TRUTH) for o in (observation, equal)])
    spread = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (spread[0, [0, 1, 2]] < 0.7 * spread[1, [0, 1, 2]]).all()


def test_radii_add_what_they_know():
    """Information about the depth of an untilted ring grows by 2 r^2 / R^2 (radii known sqrt(2) times as well)."""
    truth = RigidTransform.from_components([0, 0, 300.0], Rotation.from_rotvec([1e-3, 0, 0.2]))
    exact = observe(truth, CAMERA, HUB)
    observation = seen(0, exact, np.full(6, SIGMA))
    without = estimate_pose(observation, CAMERA, HUB).covariance[2, 2]
    observation.peg_radius_sigmas = np.full(6, SIGMA / np.sqrt(2))
    gain = without / estimate_pose(observation, CAMERA, HUB).covariance[2, 2]
    expected = 2 * HUB.peg_radius**2 / (HUB.pitch_circle_diameter / 2) ** 2
    assert gain - 1 == pytest.approx(expected, rel=0.1)
    depths = []
    for rng in range(TRIALS):
        observation = seen(rng, exact, np.full(6, SIGMA))
        observation.peg_radius_sigmas = np.full(6, RADIUS_SIGMA)
        pose = estimate_pose(observation, CAMERA, HUB)
        depths.append((pose.cam_from_hub.translation[2] - 300) / np.sqrt(pose.covariance[2, 2]))
    assert np.std(depths) == pytest.approx(1, abs=0.2) and abs(np.mean(depths)) < 0.3


def test_three_pegs_are_enough_and_two_are_not():
    exact = observe(TRUTH, CAMERA, HUB)
    three = np.where(np.arange(6) % 2 == 0, SIGMA, np.inf)
    pose = estimate_pose(seen(1, exact, three), CAMERA, HUB)
    assert np.abs(difference(pose.cam_from_hub, TRUTH)[:3]).max() < 1 and pose.peg_centers.shape == (6, 3)
    two = np.where(np.arange(6) < 2, SIGMA, np.inf)
    for plane in (None, TRUTH):
        with pytest.raises(CalibrationError, match="2 of 6 pegs were measured; at least 3"):
            estimate_pose(seen(1, exact, two), CAMERA, HUB, plane=plane)


def test_a_ring_has_a_pose_in_space_and_in_a_known_plane():
    """Any pattern in mm: here a rectangle; nothing but its places is needed."""
    ring = RingPattern(centers=[[-60, -40], [60, -40], [60, 40], [-60, 40]], disc_radius=9.0)
    places = np.column_stack([ring.places, np.zeros(4)])
    centers, radii = project_discs(CAMERA, TRUTH, places, np.full(4, ring.disc_radius))
    observation = SimpleNamespace(peg_centers=centers, peg_radii=radii, peg_sigmas=np.full((4, 2), SIGMA))
    for plane in (None, TRUTH * RigidTransform.from_translation([5, 3, 0])):
        pose = estimate_pose(observation, CAMERA, ring, plane=plane)
        assert np.abs(difference(pose.cam_from_hub, TRUTH)).max() < 1e-5 and pose.chi2 < 1e-6
        np.testing.assert_allclose(pose.peg_radii, 9.0, atol=1e-6)


def test_both_poses_of_a_plane_are_told():
    """A flat ring from far away: the likelihood decides where it can, and the flag says where it cannot."""
    ring, sigma = RingPattern(6, pitch_radius=48.5, disc_radius=10.1), 0.1
    places, flagged, wrong = np.column_stack([ring.places, np.zeros(6)]), {}, {}
    for depth in (300.0, 4000.0):
        truth = RigidTransform.from_components([0, 0, depth], Rotation.from_rotvec([0.35, 0, 0]))
        centers, radii = project_discs(CAMERA, truth, places, np.full(6, ring.disc_radius))
        poses = []
        for rng in range(60):
            noise = sigma * np.random.default_rng(rng).standard_normal((6, 2))
            observation = SimpleNamespace(
                peg_centers=centers + noise, peg_radii=radii, peg_sigmas=np.full((6, 2), sigma)
            )
            poses.append(estimate_pose(observation, CAMERA, ring))
        off = [np.degrees((pose.cam_from_hub.rotation * truth.rotation.inv()).magnitude()) > 20 for pose in poses]
        flags = np.array([[flag.code for flag in pose.flags] == ["two-poses"] for pose in poses])
        flagged[depth], wrong[depth] = flags.mean(), (np.array(off) & ~flags).mean()
        assert all((pose.alternative is not None) or not pose.flags for pose in poses)
        assert all(pose.log_likelihood_ratio >= 0 for pose in poses)
    assert flagged[300.0] == 0 and flagged[4000.0] > 0.5
    assert max(wrong.values()) <= 0.05  # 20 to 1 leaves that


def test_unusable_sigmas():
    good = observe(TRUTH, CAMERA, HUB, SIGMA, 0)
    for name, value, message in (
        ("peg_covariances", np.full((6, 2, 2), -1.0), "negative variance"),
        ("peg_sigmas", np.zeros((5, 2)), r"peg_sigmas has shape \(5, 2\)"),
        ("peg_radius_sigmas", np.full(6, -1.0), "peg_radius_sigmas"),
    ):
        with pytest.raises(ValueError, match=message):
            estimate_pose(SimpleNamespace(**vars(good) | {name: value}), CAMERA, HUB)
    with pytest.raises(ValueError, match="screw_centers has 2 rows"):
        estimate_pose(good, CAMERA, replace(HUB, screw_angles=(0.5, 1.5, 2.5)))


def test_pegs_that_do_not_fit_the_pose_are_flagged():
    """A part with a peg half a millimetre from its place."""
    camera, hub = paper_camera(), Hub()
    pose = RigidTransform.from_components([4.0, -3.0, 420.0], Rotation.from_euler("xyz", [12, -8, 25], True))
    found = locate_pegs(render_hub(camera, pose, hub, rng=0), hub)
    assert "misfit-pegs" not in [flag.code for flag in estimate_pose(found, camera, hub).flags]
    moved = found.peg_centers + np.array([[1.5, -1.0], [0, 0], [0, 0], [0, 0]])
    for plane in (None, pose):
        flags = estimate_pose(replace(found, peg_centers=moved), camera, hub, plane=plane).flags
        assert "misfit-pegs" in [flag.code for flag in flags]
