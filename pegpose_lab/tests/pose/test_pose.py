"""Pose: discs in perspective, three and six degrees of freedom, the paper's formulas, the chain to the robot."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab.checks import CalibrationError
from pegpose_lab.paper import numbers, paper_experiment
from pegpose_lab.pose import (
    estimate_pose,
    hub_from_end_effector,
    line_angle,
    line_angle_printed,
    misalignment,
    project_discs,
    robot_from_end_effector,
    scale_coordinates,
)
from pegpose_lab.pose.discs import back_project_discs
from pegpose_lab.render import true_disc
from pegpose_lab.targets import Hub

EXPERIMENT = paper_experiment()
CAMERA, HUB, PLANE = EXPERIMENT.camera, EXPERIMENT.hub, EXPERIMENT.cam_from_plane


def observe(pose, hub=HUB, camera=CAMERA, noise=0.0, rng=None):
    """What a perfect detector would see, with Gaussian noise on the centres."""
    rng = np.random.default_rng(rng)

    def images(centers, radius):
        discs = [true_disc(camera, pose, center, radius) for center in centers]
        centers = np.array([disc.centroid for disc in discs])
        return centers + noise * rng.standard_normal(centers.shape), np.array([disc.radius for disc in discs])

    pegs, peg_radii = images(hub.peg_centers, hub.peg_radius)
    screws = images(hub.screw_centers, hub.screw_radius)[0]
    bore = images([hub.bore_center], hub.bore_radius)[0][0]
    return SimpleNamespace(peg_centers=pegs, peg_radii=peg_radii, screw_centers=screws, bore_center=bore)


def hub_pose(tilt, azimuth=0.0, turn=0.0, position=(10.0, -20.0, 300.0)):
    """Hub tilted by `tilt` about an axis at `azimuth`, turned about its own axis; degrees."""
    azimuth = np.deg2rad(azimuth)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0])
    rotation = Rotation.from_rotvec(np.deg2rad(tilt) * axis) * Rotation.from_euler("z", turn, degrees=True)
    return RigidTransform.from_components(position, rotation)


def angle_between(a, b):
    return (a.rotation * b.rotation.inv()).magnitude()


def assert_same_pose(a, b, mm=1e-4, rad=1e-6):
    np.testing.assert_allclose(a.translation, b.translation, atol=mm)
    assert angle_between(a, b) < rad


# ---- discs ----


def test_disc_images_are_exact():
    for pose in (EXPERIMENT.cam_from_hubs[0], hub_pose(50, 30, 20)):
        centers, radii = project_discs(CAMERA, pose, HUB.peg_centers, np.full(4, HUB.peg_radius))
        truth = [true_disc(CAMERA, pose, center, HUB.peg_radius) for center in HUB.peg_centers]
        np.testing.assert_allclose(centers, [disc.centroid for disc in truth], atol=1e-5)
        np.testing.assert_allclose(radii, [disc.radius for disc in truth], rtol=1e-5)


def test_a_disc_seen_edge_on_is_refused():
    edge_on = RigidTransform.from_components([0, 0, 300], Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]]))
    with pytest.raises(ValueError, match="seen edge-on"):
        project_discs(CAMERA, edge_on, [[0.0, 0.0, 0.0]], [10.0])


def test_image_of_a_disc_centre_is_not_the_centre_of_its_image():
    pose = EXPERIMENT.cam_from_hubs[0]
    shift = project_discs(CAMERA, pose, HUB.peg_centers, np.full(4, HUB.peg_radius))[0]
    shift = np.linalg.norm(shift - CAMERA.project(HUB.peg_centers, pose), axis=1)
    assert (shift > 0.3).all() and (shift < 0.5).all()


@settings(max_examples=40)
@given(
    st.floats(-60, 60), st.floats(-60, 60), st.floats(0.5, 25), st.floats(0, 50), st.floats(0, 360),
)  # fmt: skip
def test_back_projection_inverts_projection(x, y, radius, tilt, azimuth):
    pose = hub_pose(tilt, azimuth)
    image_centers, image_radii = project_discs(CAMERA, pose, [[x, y, 0.0]], [radius])
    centers, radii = back_project_discs(image_centers, image_radii, CAMERA, pose)
    np.testing.assert_allclose(centers, [[x, y, 0.0]], atol=1e-6)
    np.testing.assert_allclose(radii, [radius], rtol=1e-7)


def test_back_projection_of_a_large_slanted_disc_settles():
    pose = hub_pose(44.0, 0.0)
    images = project_discs(CAMERA, pose, [[0.0, 0.0, 0.0]], [25.0])
    centers, radii = back_project_discs(*images, CAMERA, pose)
    np.testing.assert_allclose(centers, [[0.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(radii, [25.0], rtol=1e-10)


# ---- pose ----


@pytest.mark.parametrize("index", [0, 20, 44])
def test_paper_degrees_of_freedom(index):
    truth = EXPERIMENT.cam_from_hubs[index]
    pose = estimate_pose(observe(truth), CAMERA, HUB, plane=PLANE)
    assert_same_pose(pose.cam_from_hub, truth)
    assert pose.x == pytest.approx(EXPERIMENT.shifts[index], abs=1e-4)
    assert pose.y == pytest.approx(0, abs=1e-4)
    assert np.exp(1j * pose.theta) == pytest.approx(np.exp(1j * EXPERIMENT.thetas[index]), abs=1e-6)
    np.testing.assert_allclose(pose.peg_centers, truth.apply(HUB.peg_centers), atol=1e-4)
    np.testing.assert_allclose(pose.peg_radii, HUB.peg_radius, atol=1e-4)
    assert pose.rms < 1e-4


def test_theta_is_the_line_angle_of_peg_1():
    pose = estimate_pose(observe(EXPERIMENT.cam_from_hubs[7]), CAMERA, HUB, plane=PLANE)
    in_plane = PLANE.inv().apply(np.vstack([pose.peg_centers[0], pose.cam_from_hub.translation]))
    assert line_angle(*in_plane[:, :2]) == pytest.approx(pose.theta, abs=1e-6)


def test_noise_of_the_pose_is_that_of_least_squares():
    """Standard deviations of x, y and theta: sigma / sqrt(n), and that over the pitch radius (mm)."""
    truth = EXPERIMENT.cam_from_hubs[12]
    poses = [estimate_pose(observe(truth, noise=0.05, rng=k), CAMERA, HUB, plane=PLANE) for k in range(60)]
    mm_per_px = np.mean([HUB.peg_radius / observe(truth).peg_radii])
    expected = 0.05 * mm_per_px / np.sqrt(4)
    assert 0.75 < np.std([pose.x for pose in poses]) / expected < 1.3
    theta = np.unwrap([pose.theta for pose in poses])
    assert 0.75 < np.std(theta) / (expected / (HUB.pitch_circle_diameter / 2)) < 1.3
    squares = [4 * pose.rms**2 for pose in poses]
    assert np.mean(squares) / 0.05**2 == pytest.approx(8 - 3, rel=0.25)  # eight numbers, three unknowns


@pytest.mark.parametrize("tilt", [0, 0.5, 12, 40, 60])
def test_six_degrees_of_freedom(tilt):
    for azimuth, turn in ((0, 10), (100, -120), (250, 179)):
        truth = hub_pose(tilt, azimuth, turn)
        pose = estimate_pose(observe(truth), CAMERA, HUB)
        assert_same_pose(pose.cam_from_hub, truth, mm=1e-3, rad=1e-5)
        np.testing.assert_allclose(pose.peg_centers, truth.apply(HUB.peg_centers), atol=1e-3)


def test_base_decides_between_mirror_solutions():
    """With this noise the pegs alone fit the mirrored tilt better in part of the pictures."""
    for seed in range(12):
        truth = hub_pose(6, 30 * seed, 40 * seed, position=(0.0, 0.0, 600.0))
        pose = estimate_pose(observe(truth, noise=0.3, rng=seed), CAMERA, HUB)
        assert angle_between(pose.cam_from_hub, truth) < np.deg2rad(6)


@pytest.mark.parametrize("n_pegs", [3, 5, 6])
def test_other_numbers_of_pegs(n_pegs):
    hub = Hub(n_pegs=n_pegs)
    truth = hub_pose(15, 40, 100)
    observation = observe(truth, hub)
    assert_same_pose(estimate_pose(observation, CAMERA, hub).cam_from_hub, truth, mm=1e-3, rad=1e-5)
    assert_same_pose(estimate_pose(observation, CAMERA, hub, plane=truth).cam_from_hub, truth)


def test_opencv_camera_gives_the_same_pose():
    truth = EXPERIMENT.cam_from_hubs[3]
    observation = observe(truth)
    pose = estimate_pose(observation, CAMERA.to_opencv(), HUB, plane=PLANE)
    assert_same_pose(pose.cam_from_hub, truth, mm=1e-3, rad=1e-5)


def test_unusable_observations():
    good = observe(EXPERIMENT.cam_from_hubs[0])
    with pytest.raises(ValueError, match="peg_centers has 3 rows"):
        estimate_pose(
            SimpleNamespace(**(vars(good) | dict(peg_centers=good.peg_centers[:3]))), CAMERA, HUB, plane=PLANE
        )
    with pytest.raises(ValueError, match="peg_radii"):
        estimate_pose(SimpleNamespace(**(vars(good) | dict(peg_radii=-good.peg_radii))), CAMERA, HUB, plane=PLANE)
    with pytest.raises(ValueError, match="NaN"):
        estimate_pose(SimpleNamespace(**(vars(good) | dict(peg_centers=np.full((4, 2), np.nan)))), CAMERA, HUB)
    with pytest.raises(ValueError, match="plane is seen from below"):
        flipped = PLANE * RigidTransform.from_rotation(Rotation.from_rotvec([np.pi, 0, 0]))
        estimate_pose(good, CAMERA, HUB, plane=flipped)
    with pytest.raises(ValueError, match="plane is int"):
        estimate_pose(good, CAMERA, HUB, plane=3)
    one_place = SimpleNamespace(**(vars(good) | dict(peg_centers=np.full((4, 2), 100.0))))
    for plane in (PLANE, None):
        with pytest.raises(CalibrationError):
            estimate_pose(one_place, CAMERA, HUB, plane=plane)


# ---- the paper's formulas ----


def test_table_2_is_a_pure_scale():
    table = numbers.table2()
    scaled = scale_coordinates(table[["x_px", "y_px"]].to_numpy(), numbers.mm_per_pixel())
    np.testing.assert_allclose(scaled, table[["x_mm", "y_mm"]].to_numpy(), atol=6e-4)


@settings(max_examples=60)
@given(st.floats(-np.pi, np.pi), st.floats(0.1, 1e3), st.floats(-500, 500), st.floats(-500, 500))
def test_line_angle_and_its_printed_form(angle, length, x, y):
    center = np.array([x, y])
    point = center + length * np.array([np.cos(angle), np.sin(angle)])
    theta = line_angle(point, center)
    assert np.exp(1j * theta) == pytest.approx(np.exp(1j * angle), abs=1e-9)
    if abs(np.cos(angle)) > 1e-3:  # a slope exists
        assert np.tan(line_angle_printed(point, center)) == pytest.approx(np.tan(theta), rel=1e-6, abs=1e-9)


def test_where_the_printed_form_fails():
    assert line_angle((1, 2), (0, 2)) == 0
    assert line_angle((-1, 2), (0, 2)) == pytest.approx(np.pi)
    assert line_angle_printed((-1, 2), (0, 2)) == line_angle_printed((1, 2), (0, 2))  # opposite directions
    assert line_angle((0, 5), (0, 2)) == pytest.approx(np.pi / 2)
    with pytest.raises(ValueError, match="vertical"):
        line_angle_printed((0, 5), (0, 2))
    assert line_angle_printed((1, 1), (0, 0), m2=np.tan(0.2)) == pytest.approx(np.pi / 4 - 0.2)
    for function in (line_angle, line_angle_printed):
        with pytest.raises(ValueError, match="coincide"):
            function((3, 3), (3, 3))


# ---- the chain to the robot ----


def random_pose(rng):
    return RigidTransform.from_components(rng.uniform(-500, 500, 3), Rotation.random(rng=rng))


def test_chain_to_the_robot():
    """Eqs. 1 and 2 in 4 x 4 matrices, and together: R_T_E = R_T_C C_T_E."""
    rng = np.random.default_rng(4)
    for _ in range(5):
        robot_from_cam, cam_from_hub, cam_from_tool = (random_pose(rng) for _ in range(3))
        hub_from_tool = hub_from_end_effector(cam_from_hub, cam_from_tool)
        expected = np.linalg.inv(cam_from_hub.as_matrix()) @ cam_from_tool.as_matrix()
        np.testing.assert_allclose(hub_from_tool.as_matrix(), expected, atol=1e-9)
        robot_from_tool = robot_from_end_effector(robot_from_cam, cam_from_hub, hub_from_tool)
        expected = robot_from_cam.as_matrix() @ cam_from_tool.as_matrix()
        np.testing.assert_allclose(robot_from_tool.as_matrix(), expected, atol=1e-9)
    with pytest.raises(ValueError, match="robot_from_cam is list"):
        robot_from_end_effector([1], cam_from_hub, hub_from_tool)


@settings(max_examples=40)
@given(
    st.floats(-5, 5), st.floats(-5, 5), st.floats(-80, 80), st.floats(0, 0.5), st.floats(-3, 3),
    st.floats(-0.75, 0.75), st.integers(0, 3),
)  # fmt: skip
def test_misalignment(x, y, z, tilt, azimuth, twist, quarter):
    cam_from_hub = hub_pose(20, 30, 40)
    tilted = Rotation.from_rotvec(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0]))
    turned = Rotation.from_rotvec([0, 0, twist + quarter * np.pi / 2])
    part = cam_from_hub * RigidTransform.from_components([x, y, z], tilted * turned)
    found = misalignment(cam_from_hub, part, 4)
    assert found.lateral == pytest.approx(np.hypot(x, y), abs=1e-9)
    assert found.axial == pytest.approx(z, abs=1e-9)
    assert found.tilt == pytest.approx(tilt, abs=1e-7)
    assert found.twist == pytest.approx(twist, abs=1e-9)
