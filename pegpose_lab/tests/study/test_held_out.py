"""What validation finds on simulated boards: the noise where all is well, and a wrong model where it is not."""

import numpy as np
import pytest

from pegpose_lab import Calibration, calibrate_joint, calibrate_zhang
from pegpose_lab.paper import paper_experiment
from pegpose_lab.study import coverage, leave_one_out, radial_profile, trial_poses
from pegpose_lab.study.held_out import held_out_distances, sensitivity

TRUTH = paper_experiment()
CAMERA, BOARD = TRUTH.camera, TRUTH.board.object_points
POSES = trial_poses(TRUTH.board, 30.0, 10, 4)


def views(noise, seed=0):
    rng = np.random.default_rng(seed)
    return [BOARD] * 10, [CAMERA.project(BOARD, pose) + noise * rng.standard_normal((48, 2)) for pose in POSES]


def joint(object_points, image_points):
    return calibrate_joint(object_points, image_points, CAMERA)


def test_error_on_a_view_left_out_is_the_noise():
    table = leave_one_out(joint, *views(0.1))
    assert len(table) == 10 and table["rms"].mean() == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert (table["mean_distance"] <= table["rms"]).all()
    assert table["focal_length"].between(CAMERA.focal_length * 0.999, CAMERA.focal_length * 1.001).all()
    with pytest.raises(ValueError, match="three"):
        leave_one_out(joint, *(part[:2] for part in views(0.1)))


def test_coverage_counts_corners_by_cells():
    corners = [np.array([[0.0, 0.0], [99.0, 0.0], [99.4, 79.4]]), np.array([[10.0, 70.0]])]
    assert coverage(corners, (100, 80), (2, 2)).tolist() == [[1, 1], [1, 1]]
    assert coverage(views(0.1)[1], CAMERA.image_size).sum() == 480
    outside = [np.array([[-0.6, 3.0], [50.0, 3.0], [50.0, 79.6]])]
    assert coverage(outside, (100, 80), (2, 2)).tolist() == [[0, 1], [0, 0]]
    with pytest.raises(ValueError, match="all 1 lie outside"):
        coverage([outside[0][:1]], (100, 80), (2, 2))
    for cells in ((0, 2), (2.5, 2), (2, 2, 2), 3):
        with pytest.raises(ValueError, match="cells"):
            coverage(corners, (100, 80), cells)
    with pytest.raises(ValueError, match="image_points"):
        coverage([], (100, 80))


def test_rings_that_are_not_filled_are_refused():
    points, images = views(0.1)
    found = joint(points, images)
    for rings in (0, 2.5, -1, 200):
        with pytest.raises(ValueError, match="rings"):
            radial_profile(found, images, rings)
    angles = np.linspace(0, 2 * np.pi, 50)
    circle = found.camera.principal_point + 100 * np.column_stack([np.cos(angles), np.sin(angles)])
    squares = np.tile([[sx * 100.0, sy * 100.0] for sx in (1, -1) for sy in (1, -1)], (20, 1))
    for places in (circle, found.camera.principal_point + squares):
        one = Calibration(found.camera, found.cam_from_object[:1], [np.zeros_like(places)])
        with pytest.raises(ValueError, match="radii"):
            radial_profile(one, [places])
    with pytest.raises(ValueError, match="no residuals"):
        radial_profile(Calibration(found.camera, [], []), images)


def test_a_view_through_the_true_camera_is_the_noise_away():
    points, images = views(0.1)
    distances = np.concatenate([held_out_distances(CAMERA, *view) for view in zip(points, images, strict=False)])
    assert distances.shape == (480,) and np.sqrt(np.mean(distances**2)) == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert held_out_distances(CAMERA, BOARD, CAMERA.project(BOARD, POSES[0])).max() < 1e-9


def test_radial_profile_is_flat_for_the_right_model_and_bent_for_a_wrong_one():
    points, images = views(0.1)
    right = radial_profile(joint(points, images), images)
    assert np.all(np.abs(right["residual"]) < 4 * right["sigma"]) and right["count"].sum() == 480
    wrong = radial_profile(calibrate_joint(points, images, CAMERA, coefficients=()), images)
    assert np.abs(wrong["residual"] / wrong["sigma"]).max() > 10
    assert wrong["radius"].is_monotonic_increasing
    with pytest.raises(ValueError, match="points"):
        radial_profile(joint(points, images), images[:3])


@pytest.mark.parametrize(
    "calibrate", [joint, lambda *both: calibrate_zhang(*both, CAMERA.image_size, coefficients=("k1",))]
)
def test_sensitivity_compares_detectors_in_sigmas(calibrate):
    points, images = views(0.1)
    shifted = [corners + (0.5, 0.0) for corners in images]
    table = sensitivity(calibrate, points, {"first": images, "again": images, "shifted": shifted}).set_index("detector")
    moved = table.filter(like=" moved")
    assert (moved.loc["first"] == 0).all()
    assert (moved.loc["again"].abs() < 1e-6).all()  # OpenCV's threads add in another order each time
    assert table.loc["shifted", "c_x"] - table.loc["first", "c_x"] == pytest.approx(0.5, abs=1e-3)
    assert abs(moved.loc["shifted", "c_y moved"]) < 1e-3
