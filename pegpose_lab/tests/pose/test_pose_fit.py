"""The fit of a pose: the minimum that slow least squares finds, derivatives, and a covariance that holds."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab.camera import OpenCVCamera, TsaiCamera
from pegpose_lab.paper import paper_camera
from pegpose_lab.pose import estimate_pose, fit, project_discs
from pegpose_lab.pose.discs import DiscImages, Pose, pose_of
from pegpose_lab.render import disc_outlines
from pegpose_lab.targets import Hub

HUB = Hub()
CAMERAS = [
    paper_camera(),
    TsaiCamera(8.0, (0.01, 0.01), (399.5, 299.5), (800, 600), kappa1=0.004, scale_x=1.01),
    TsaiCamera(8.0, (0.01, 0.01), (399.5, 299.5), (800, 600), kappa1=-0.004),
    OpenCVCamera([[800, 0, 399], [0, 810, 299], [0, 0, 1]], [-0.2, 0.08, 0.002, -0.003, 0.01], (800, 600)),
]

TRUTH = RigidTransform.from_components([10.0, -20.0, 300.0], Rotation.from_rotvec([0.3, -0.2, 0.5]))
SIGMA = 0.02

cameras = st.sampled_from(CAMERAS)
poses = st.builds(
    lambda tilt, azimuth, turn, x, y, depth: RigidTransform.from_components(
        [x * depth, y * depth, depth],
        Rotation.from_rotvec(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0])) * Rotation.from_rotvec([0, 0, turn]),
    ),
    st.floats(0, 1), st.floats(0, 6.3), st.floats(-3.1, 3.1), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(250, 600),
)  # fmt: skip
seeds = st.integers(0, 2**32 - 1)


def observe(pose, camera, hub=HUB, noise=0.0, rng=None):
    """What a detector of a known noise, px, would see of the hub."""
    centers = np.vstack([hub.peg_centers, hub.screw_centers, hub.bore_center])
    radii = [hub.peg_radius] * hub.n_pegs + [hub.screw_radius] * len(hub.screw_centers) + [hub.bore_radius]
    seen, radii = project_discs(camera, pose, centers, radii)
    seen = seen + noise * np.random.default_rng(rng).standard_normal(seen.shape)
    n = hub.n_pegs
    return SimpleNamespace(
        peg_centers=seen[:n], peg_radii=radii[:n], peg_sigmas=np.full((n, 2), noise), screw_centers=seen[n:-1],
        bore_center=seen[-1],
    )  # fmt: skip


def moved(cam_from_object, step):
    """The pose after a step (x, y, z, rotation vector) in axes of the camera, by scipy's rotations."""
    rotation = Rotation.from_rotvec(step[3:]) * cam_from_object.rotation
    return RigidTransform.from_components(cam_from_object.translation + step[:3], rotation)


def difference(estimate, truth):
    """The step (6,) that takes the truth to an estimate."""
    turn = (estimate.rotation * truth.rotation.inv()).as_rotvec()
    return np.append(estimate.translation - truth.translation, turn)


def numerical(function, count, steps):
    """Derivatives of a function of `count` numbers at 0, by central differences of the fourth order."""
    columns = []
    for k, h in enumerate(np.broadcast_to(steps, count)):
        a, b, c, d = (function(factor * h * np.eye(count)[k]) for factor in (-2, -1, 1, 2))
        columns.append((a - 8 * b + 8 * c - d) / (12 * h))
    return np.stack(columns, axis=-1)


# ---- the same minimum as slow least squares ----


def slow_images(camera, cam_from_hub, centers, radii, number=32):
    """Centres of area of discs' images, derivatives by Fourier series, Green's theorem."""
    outlines = disc_outlines(camera, cam_from_hub, centers, radii, number)
    middle = outlines.mean(axis=1)
    x, y = np.moveaxis(outlines - middle[:, None], 2, 0)
    order = 1j * np.arange(number // 2 + 1)
    dx, dy = (np.fft.irfft(order * np.fft.rfft(curve, axis=1), number, axis=1) for curve in (x, y))
    area = np.mean(x * dy - y * dx, axis=1) / 2
    return middle + np.stack([np.mean(x**2 * dy, axis=1), -np.mean(y**2 * dx, axis=1)], axis=1) / 2 / area[:, None]


def slow_polish(pose, camera, centers, radii, measured):
    """Least squares of the images' centres, px, with numerical derivatives."""
    scale = np.array([50, 50, 50, 1, 1, 1])  # steps of like effect

    def residuals(step):
        return (slow_images(camera, moved(pose, step * scale), centers, radii) - measured).ravel()

    found = least_squares(residuals, np.zeros(6), "3-point", method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return moved(pose, found.x * scale)


@settings(max_examples=30)
@given(cameras, poses, st.integers(4, 7), st.sampled_from([0.0, 0.01, 0.05]), seeds)
def test_same_minimum_as_slow_least_squares(camera, truth, n_pegs, noise, rng):
    hub = Hub(n_pegs=n_pegs)
    observation = observe(truth, camera, hub, noise, rng)
    pose = estimate_pose(observation, camera, hub)
    radii = np.full(n_pegs, hub.peg_radius)
    slow = slow_polish(pose.cam_from_hub, camera, hub.peg_centers, radii, observation.peg_centers)
    step = difference(pose.cam_from_hub, slow)
    assert np.abs(step[:3]).max() < 1e-6 and np.abs(step[3:]).max() < 1e-8
    left = slow_images(camera, pose.cam_from_hub, hub.peg_centers, radii) - observation.peg_centers
    np.testing.assert_allclose(pose.residuals, left, atol=1e-9)


@settings(max_examples=15)
@given(cameras, poses, st.sampled_from([0.0, 0.05]), seeds)
def test_same_minimum_from_the_same_start(camera, truth, noise, rng):
    """Pegs, bore and screws first, then the pegs alone, from the pose that is parallel to the image."""
    observation = observe(truth, camera, HUB, noise, rng)
    flat = Rotation.from_rotvec([0, 0, np.arctan2(*truth.rotation.as_matrix()[[1, 0], 0])])
    slow = RigidTransform.from_components(truth.translation, flat)
    centers = np.vstack([HUB.peg_centers, HUB.screw_centers, HUB.bore_center])
    radii = np.repeat([HUB.peg_radius, HUB.screw_radius, HUB.bore_radius], [4, 2, 1])
    measured = np.vstack([observation.peg_centers, observation.screw_centers, observation.bore_center])
    slow = slow_polish(slow, camera, centers, radii, measured)
    slow = slow_polish(slow, camera, centers[:4], radii[:4], measured[:4])
    step = difference(estimate_pose(observation, camera, HUB).cam_from_hub, slow)
    assert np.abs(step[:3]).max() < 1e-6 and np.abs(step[3:]).max() < 1e-8


@pytest.mark.parametrize("rng", range(12))
def test_a_pose_is_a_minimum_where_two_fit_nearly_alike(rng):
    """From far away the squares have two minima at opposite tilts, and a saddle between them, where Newton's method ends
    as readily: all eigenvalues of the second derivative have to be positive."""
    truth = RigidTransform.from_components([0, 0, 1200.0], Rotation.from_rotvec([0.01, 0, 0.3]))
    observation = observe(truth, CAMERAS[0], HUB, 0.3, rng)
    pose = estimate_pose(observation, CAMERAS[0], HUB).cam_from_hub
    radii, scale = np.full(4, HUB.peg_radius), np.repeat([50, 1], 3)

    def squares(step):
        seen = project_discs(CAMERAS[0], moved(pose, step * scale), HUB.peg_centers, radii)[0]
        return np.sum((seen - observation.peg_centers) ** 2) / 2

    second = numerical(lambda step: numerical(lambda more: squares(step + more), 6, 1e-3), 6, 1e-3)
    assert np.linalg.eigvalsh(second)[0] > 0


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("tilt", [0.0, 0.3, 0.8])
def test_a_pose_takes_few_images_of_discs(monkeypatch, camera, tilt):
    """They take most of the time, and scipy's least squares took 400 residuals: one for all parts, three for the fit of the
    pegs and one after it, one for the pegs' own places; one more of each if a step is just too long."""
    calls, images = [], DiscImages.of
    monkeypatch.setattr(DiscImages, "of", lambda *arguments: calls.append(1) or images(*arguments))
    observation = observe(RigidTransform.from_components([10, 0, 300], Rotation.from_rotvec([tilt, 0, 1])), camera)
    observation.peg_centers = observation.peg_centers + np.random.default_rng(0).normal(0, SIGMA, (4, 2))
    calls.clear()
    estimate_pose(observation, camera, HUB)
    assert len(calls) <= 8


def test_pegs_far_from_where_the_pose_puts_them_are_placed_too():
    observation = observe(TRUTH, CAMERAS[0])
    observation.peg_centers[0] += [120, -160]
    pose = estimate_pose(observation, CAMERAS[0], HUB, plane=TRUTH)
    assert np.abs(pose.residuals).max() > observation.peg_radii.max()
    places = pose.cam_from_hub.inv().apply(pose.peg_centers)
    centers, radii = project_discs(CAMERAS[0], pose.cam_from_hub, places, pose.peg_radii)
    np.testing.assert_allclose(centers, observation.peg_centers, atol=1e-8)
    np.testing.assert_allclose(radii, observation.peg_radii, atol=1e-8)


# ---- derivatives ----


@settings(max_examples=40)
@given(cameras, poses)
def test_derivatives_of_images_of_discs(camera, truth):
    radii = np.array([10.1, 5.0, 18.0, 1.0])
    images = DiscImages.of(camera, pose_of(truth), HUB.peg_centers, radii)
    steps = np.repeat([1e-1, 1e-3], 3)
    by_pose = numerical(
        lambda step: np.column_stack(project_discs(camera, moved(truth, step), HUB.peg_centers, radii)), 6, steps
    )
    np.testing.assert_allclose(images.by_pose(), by_pose, rtol=1e-7, atol=1e-7 * np.abs(by_pose).max())

    def placed(step):
        centers, seen = project_discs(camera, truth, HUB.peg_centers + [*step[:2], 0], radii + step[2])
        return np.column_stack([centers, seen**2 / 2])

    by_place = numerical(placed, 3, 1e-2)
    by_place[:, 2] *= np.sign(images.areas)[:, None]
    np.testing.assert_allclose(images.by_place(), by_place, rtol=1e-7, atol=1e-7 * np.abs(by_place).max())


@settings(max_examples=40)
@given(poses, seeds)
def test_derivatives_of_directions(truth, rng):
    points = np.vstack([HUB.peg_centers, HUB.screw_centers])
    steps = np.repeat([1e-1, 1e-3], 3)

    def directions(step):
        return fit._directions(pose_of(moved(truth, step)), points)

    target = directions(np.zeros(6))[0] + np.random.default_rng(rng).normal(0, 0.1, (len(points), 2))
    jacobian = directions(np.zeros(6))[1]
    found = numerical(lambda step: directions(step)[0], 6, steps)
    np.testing.assert_allclose(jacobian, found, atol=1e-8 * np.abs(found).max())
    arms = truth.rotation.apply(points)
    pulls = np.einsum("nk,nkp->np", directions(np.zeros(6))[0] - target, jacobian)
    curvature = fit._curvature(arms, arms[:, 2] + truth.translation[2], pulls)

    def gradient(step):  # of the sum of the residuals' squares by a further step, which is none of the pose's own
        first = np.linalg.norm(step[3:])
        seen, by_pose = directions(step)
        left = np.eye(6)  # from a change of the step to one of the pose: to first order in the step
        left[3:, 3:] += np.cross(np.eye(3), step[3:]) / 2 if first else 0
        return np.einsum("nk,nkp->p", seen - target, by_pose) @ left

    flat = jacobian.reshape(-1, 6)
    found = numerical(gradient, 6, steps)
    np.testing.assert_allclose(curvature + flat.T @ flat, found, atol=1e-6 * np.abs(found).max())


def test_a_step_turns_about_the_object_and_shifts_it():
    pose, step = Pose(np.eye(3), np.array([1.0, 2.0, 300.0])), np.array([0.1, -0.2, 0.3, 0.01, 0.02, -0.03])
    expected = moved(RigidTransform.from_translation(pose.translation), step)
    rotation, translation = fit.moved(pose, step)
    np.testing.assert_allclose(rotation, expected.rotation.as_matrix(), atol=1e-15)
    np.testing.assert_allclose(translation, expected.translation, atol=1e-12)


# ---- covariance ----

TRIALS = 500


def scaled_distances(camera, plane, freedom, sigmas=(SIGMA, SIGMA)):
    """Squared Mahalanobis distances of estimates from the truth, in the subspace in which the estimate is free."""
    exact, found = observe(TRUTH, camera), []
    for rng in range(TRIALS):
        noise = sigmas * np.random.default_rng(rng).standard_normal((4, 2))
        observation = SimpleNamespace(
            **vars(exact) | {"peg_centers": exact.peg_centers + noise, "peg_sigmas": np.tile(sigmas, (4, 1))}
        )
        pose = estimate_pose(observation, camera, HUB, plane=plane)
        scale = np.repeat([1, 1e-2], 3)
        values, vectors = np.linalg.eigh(pose.covariance / np.outer(scale, scale))
        assert (values[-freedom:] > 1e-9 * values[-1]).all() and (np.abs(values[:-freedom]) < 1e-12 * values[-1]).all()
        free = (difference(pose.cam_from_hub, TRUTH) / scale) @ vectors[:, -freedom:]
        found.append(np.sum(free**2 / values[-freedom:]))
    return np.array(found)


@pytest.mark.parametrize("camera", CAMERAS[1:3] + [CAMERAS[3]])
@pytest.mark.parametrize("plane, freedom, quantile", [(None, 6, 12.592), (TRUTH, 3, 7.815)])
def test_covariance_is_that_of_the_errors(camera, plane, freedom, quantile):
    distances = scaled_distances(camera, plane, freedom, sigmas=(SIGMA, 2 * SIGMA))
    assert distances.mean() == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom / TRIALS))
    assert (distances < quantile).mean() == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / TRIALS))


def test_covariance_takes_covariances_of_the_pegs():
    observation = observe(TRUTH, CAMERAS[0], noise=SIGMA, rng=3)
    by_sigmas = estimate_pose(observation, CAMERAS[0], HUB).covariance
    del observation.peg_sigmas
    assert estimate_pose(observation, CAMERAS[0], HUB).covariance is None
    observation.peg_covariances = np.tile(SIGMA**2 * np.eye(2), (4, 1, 1))
    np.testing.assert_allclose(estimate_pose(observation, CAMERAS[0], HUB).covariance, by_sigmas, rtol=1e-12)
