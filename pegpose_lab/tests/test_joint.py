"""The joint solution: exact derivatives, the Schur complement against a dense solution, OpenCV's results, outliers."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pegpose_lab import CalibrationError, TsaiCamera, board_pose, calibrate_dlt, calibrate_joint, profile_focal_length
from pegpose_lab.calibration import covariance_table, pose_names
from pegpose_lab.datasets import load_points, read_corners
from pegpose_lab.experiment import paper_experiment, trial_poses
from pegpose_lab.joint import COEFFICIENTS, _covariance, _Equations, _evaluate, _minimise, _model, _start, _Views

EXPERIMENT = paper_experiment()
CAMERA, BOARD = EXPERIMENT.camera, EXPERIMENT.board.object_points
MODELS = [(False, None), (True, None), (False, ("k1",)), (True, COEFFICIENTS)]


def five_views(noise, seed=0, camera=CAMERA):
    rng = np.random.default_rng(seed)
    seen = [camera.project(BOARD, pose) for pose in EXPERIMENT.cam_from_boards]
    return [BOARD] * 5, [points + noise * rng.standard_normal(points.shape) for points in seen]


def started(two, coefficients, points=None):
    points = points or five_views(0.1)
    model = _model(CAMERA, True, two, coefficients)
    views = _Views.stack(*points)
    return model, views, _start(model, views, *points)


@pytest.mark.parametrize("two, coefficients", MODELS)
def test_derivatives_are_exact(two, coefficients):
    model, views, state = started(two, coefficients)
    rng = np.random.default_rng(1)
    sizes = {"kappa1": 1e-5, "focal_length": 0.5, "scale_x": 0.01}
    start = np.array([sizes.get(name, 0.02 if name in COEFFICIENTS else 3.0) for name in model.names])
    state = state.moved(start, 0.2 * rng.standard_normal((5, 3)), rng.standard_normal((5, 3)))
    exact = _evaluate(model, views, state)[1]
    k = len(model.names)
    for column in range(k + 6):
        step = 1e-6 * (start[column] if column < k else 1.0)
        change = np.zeros(k + 6)
        change[column] = step
        moved = [
            _evaluate(model, views, state.moved(
                sign * change[:k], np.tile(sign * change[k : k + 3], (5, 1)), np.tile(sign * change[k + 3 :], (5, 1))
            ))[0]
            for sign in (1, -1)
        ]
        numeric = (moved[0] - moved[1]) / (2 * step)
        assert np.linalg.norm(exact[..., column] - numeric) < 1e-6 * np.linalg.norm(numeric)


def dense(jacobian):
    """The whole Jacobian of views with (V, m, 2, k + 6) derivatives."""
    v, m, _, columns = jacobian.shape
    k, whole = columns - 6, np.zeros((v, 2 * m, columns - 6 + 6 * v))
    for view in range(v):
        whole[view, :, :k] = jacobian[view, ..., :k].reshape(2 * m, k)
        whole[view, :, k + 6 * view : k + 6 * view + 6] = jacobian[view, ..., k:].reshape(2 * m, 6)
    return whole.reshape(-1, k + 6 * v)


def test_steps_by_the_schur_complement_are_those_of_the_whole_system():
    model, views, state = started(True, ("k1", "k2"))
    residuals, jacobian = _evaluate(model, views, state)
    equations = _Equations.of(residuals, jacobian, views.used)
    shared, turns, shifts, promised = equations.step(0.0)
    expected = np.linalg.lstsq(dense(jacobian), -residuals.ravel(), rcond=None)[0]
    k = len(shared)
    np.testing.assert_allclose(shared, expected[:k], rtol=1e-6)
    np.testing.assert_allclose(np.hstack([turns, shifts]).ravel(), expected[k:], rtol=1e-5, atol=1e-9)
    left = dense(jacobian) @ expected + residuals.ravel()
    assert promised == pytest.approx(np.sum(residuals**2) - np.sum(left**2))


def test_covariance_is_that_of_the_whole_system():
    """Written for the centroids, so it is compared where these are the objects' own origins."""
    centred = BOARD - BOARD.mean(axis=0)
    points, images = five_views(0.1)
    model, views, state = started(False, None, ([centred] * 5, images))
    state, equations = _minimise(model, views, state, views.used)
    found = _covariance(model, views, state, equations, 100)
    residuals, jacobian = _evaluate(model, views, state)
    expected = covariance_table(dense(jacobian), 1.0, model.names + pose_names(5))
    rows, columns = dense(jacobian).shape
    expected = expected * (rows - columns) * np.sum(residuals**2) / 100
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-12 * expected.to_numpy().max())


def test_sigmas_of_the_origins_are_honest():
    """Translations are the origin's, far from the centroid here: their errors over 60 trials have the stated sigmas."""
    origin = np.array([300.0, -200.0, 0.0])
    errors = []
    for seed in range(60):
        _, images = five_views(0.1, seed)
        run = calibrate_joint([BOARD + origin] * 5, images, CAMERA)
        for view, truth in enumerate(EXPERIMENT.cam_from_boards):
            expected = truth.apply(-origin)
            sigmas = [run.sigma(f"{name}_{view}") for name in ("tx", "ty", "tz")]
            errors.append((run.cam_from_object[view].translation - expected) / sigmas)
    assert np.sqrt(np.mean(np.square(errors), axis=0)) == pytest.approx(np.ones(3), abs=0.2)


CONFIGURATIONS = {
    "default_5": {"coefficients": COEFFICIENTS}, "k1k2p1p2": {"coefficients": ("k1", "k2", "p1", "p2")},
    "k1k2": {"coefficients": ("k1", "k2")}, "k1_ppfree": {"coefficients": ("k1",)},
    "k1_ppfree_fxeqfy": {"coefficients": ("k1",), "focal": "one"},
    "k1_ppfixed": {"coefficients": ("k1",), "principal_point": "fixed"},
    "k1_ppfixed_fxeqfy": {"coefficients": ("k1",), "focal": "one", "principal_point": "fixed"},
    "nodist_ppfree": {"coefficients": ()},
}


@pytest.mark.parametrize("name", CONFIGURATIONS)
@pytest.mark.parametrize("data", ["opencv_left", "zhang_msr_5view", "visp_circles"])
def test_real_views_end_where_opencv_ends(pegpose_data, data, name):
    """Published reference runs: rms to 1e-4 px, f to a tenth of its sigma, and the same sigma."""
    if data == "visp_circles":
        _, points, images = read_corners(pegpose_data / data / "points_cv2_findCirclesGrid.csv")
        size = (320, 240)
    else:
        points, images, size, *_ = load_points(data)
    text = json.loads((pegpose_data / data / "reference.json").read_text())
    reference = next(iter(run for key, run in text.items() if key[0] != "_" and key != "subpix11"))
    if data == "opencv_left":
        reference = text["subpix5"]
    reference = reference["cv2_4.14.0"]["configs"][name]
    camera = TsaiCamera(1.0, (1, 1), ((size[0] - 1) / 2, (size[1] - 1) / 2), size)
    run = calibrate_joint(points, images, camera, **({"focal": "two"} | CONFIGURATIONS[name]))
    assert run.rms < reference["rms_cv2"] + 1e-4
    assert run.camera.camera_matrix[0, 0] == pytest.approx(reference["fx"], abs=0.1 * run.sigma("f_x"))
    stated = reference["sd_fx_fy_cx_cy_k1"][0]
    if stated:
        assert run.sigma("f_x") == pytest.approx(stated, rel=0.02)


def test_the_horizontal_scale_is_recovered():
    camera = replace(CAMERA, scale_x=1.02)
    run = calibrate_joint(*five_views(0.0, camera=camera), CAMERA, focal="two")
    assert run.camera.scale_x == pytest.approx(1.02, rel=1e-8)
    assert run.camera.focal_length == pytest.approx(CAMERA.focal_length, rel=1e-8)


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_robust_losses_survive_wrong_corners(loss):
    points, images = five_views(0.1, 3)
    images[1][7] += (15, -9)
    images[3][[2, 30]] += (-12, 5)
    plain, robust = (calibrate_joint(points, images, CAMERA, loss=kind) for kind in ("linear", loss))
    clean = calibrate_joint(*five_views(0.1, 3), CAMERA)
    error = abs(robust.camera.focal_length - clean.camera.focal_length)
    assert error < clean.sigma("focal_length") < abs(plain.camera.focal_length - clean.camera.focal_length)
    assert robust.sigma("focal_length") < 2 * clean.sigma("focal_length") < plain.sigma("focal_length")


def test_a_robust_loss_costs_little_without_wrong_corners():
    plain, robust = (calibrate_joint(*five_views(0.1), CAMERA, loss=loss) for loss in ("linear", "huber"))
    assert abs(plain.camera.focal_length - robust.camera.focal_length) < 0.5 * plain.sigma("focal_length")


def test_views_with_different_numbers_of_points():
    points, images = five_views(0.0)
    kept = [slice(0, 48 - 7 * view) for view in range(5)]
    run = calibrate_joint([p[k] for p, k in zip(points, kept)], [q[k] for q, k in zip(images, kept)], CAMERA)
    assert run.camera.focal_length == pytest.approx(CAMERA.focal_length, rel=1e-8)
    assert [len(residuals) for residuals in run.residuals] == [48 - 7 * view for view in range(5)]


def test_many_views_with_little_tilt_end_at_the_truth():
    poses = trial_poses(EXPERIMENT.board, 30.0, 60, 5)
    rng = np.random.default_rng(0)
    images = [CAMERA.project(BOARD, pose) + 0.1 * rng.standard_normal((48, 2)) for pose in poses]
    run = calibrate_joint([BOARD] * 60, images, CAMERA)
    assert abs(run.camera.focal_length - CAMERA.focal_length) < 4 * run.sigma("focal_length")
    assert run.rms / (0.1 * np.sqrt(2 * (1 - 364 / (2 * 48 * 60)))) == pytest.approx(1, abs=0.05)


def test_what_is_not_determined_is_named():
    """Boards in parallel planes: some combination of f, the principal point and T_z moves no point."""
    tilted = Rotation.from_rotvec([np.deg2rad(30), 0, 0])
    poses = [
        type(EXPERIMENT.cam_from_boards[0]).from_components(
            np.array([10.0 * k, -5.0 * k, 290.0 + 5 * k]) - tilted.apply(EXPERIMENT.board.center), tilted
        )
        for k in range(3)
    ]
    camera = replace(CAMERA, kappa1=0.0)
    images = [camera.project(BOARD, pose) for pose in poses]
    with pytest.raises(CalibrationError, match="trade off.*other tilts"):
        calibrate_joint([BOARD] * 3, images, CAMERA, focal="two", coefficients=())


def test_correlation_of_f_and_depth():
    """Of a board that is little tilted f and T_z are nearly one unknown; tilted boards part them."""
    correlations = []
    for tilt in (5.0, 30.0):
        poses = trial_poses(EXPERIMENT.board, tilt, 6, 2)
        images = [CAMERA.project(BOARD, pose) for pose in poses]
        images = [points + 0.02 * np.random.default_rng(k).standard_normal((48, 2)) for k, points in enumerate(images)]
        run = calibrate_joint([BOARD] * 6, images, CAMERA, principal_point="fixed")
        correlations.append(run.correlation("focal_length", "tz_0"))
    assert correlations[0] > 0.98 and correlations[1] < correlations[0]


def test_profile_is_the_interval_by_sigma_where_the_views_are_good():
    points, images = five_views(0.1, 2)
    run = calibrate_joint(points, images, CAMERA)
    half = 1.97 * run.sigma("focal_length")
    low, high = profile_focal_length(points, images, CAMERA)
    assert (low, high) == pytest.approx((run.camera.focal_length - half, run.camera.focal_length + half), abs=0.05 * half)
    wider = profile_focal_length(points, images, CAMERA, level=0.99)
    assert wider[0] < low and wider[1] > high


def test_profile_of_a_single_view_holds_the_truth_as_often_as_it_says():
    inside = 0
    for seed in range(60):
        points, images = five_views(0.1, seed)
        low, high = profile_focal_length(points[1:2], images[1:2], CAMERA, principal_point="fixed")
        inside += low < CAMERA.focal_length < high
    assert 52 <= inside <= 60


def test_profile_follows_the_trade_off_and_says_where_it_has_no_end():
    """A board of 3 degrees: a smaller f at a smaller T_z explains it nearly as well, a larger one does not."""
    pose = trial_poses(EXPERIMENT.board, 3.0, 1, 1)[0]
    images = CAMERA.project(BOARD, pose) + 0.5 * np.random.default_rng(0).standard_normal((48, 2))
    low, high = profile_focal_length([BOARD], [images], CAMERA, principal_point="fixed")
    assert low < 0.5 * CAMERA.focal_length < CAMERA.focal_length < high
    best = calibrate_joint([BOARD], [images], CAMERA, principal_point="fixed").camera.focal_length
    assert best / low > 1.3 * high / best
    assert profile_focal_length([BOARD], [images], CAMERA, principal_point="fixed", level=0.9999)[0] == 0


def test_direct_linear_transform_is_exact_without_distortion():
    camera = replace(CAMERA, kappa1=0.0)
    run = calibrate_dlt(BOARD, camera.project(BOARD, EXPERIMENT.cam_from_boards[1]), CAMERA)
    assert run.camera.focal_length == pytest.approx(CAMERA.focal_length, rel=1e-9) and run.rms < 1e-8
    with pytest.raises(ValueError, match="plane"):
        calibrate_dlt(BOARD + np.arange(48)[:, None] * [0, 0, 1.0], run.residuals[0], CAMERA)


@pytest.mark.parametrize("camera", [CAMERA, CAMERA.to_opencv()])
def test_board_pose_recovers_the_pose(camera):
    for pose in EXPERIMENT.cam_from_boards:
        found = board_pose(BOARD, camera.project(BOARD, pose), camera)
        assert (found.inv() * pose).as_matrix() == pytest.approx(np.eye(4), abs=1e-5)


@pytest.mark.parametrize(
    "options, named",
    [
        ({"focal": "three"}, "focal"), ({"loss": "l1"}, "loss"), ({"coefficients": ("k9",)}, "coefficients"),
        ({"coefficients": ("k1", "k1")}, "coefficients"), ({"principal_point": "middle"}, "principal_point"),
    ],
)
def test_unusable_options_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        calibrate_joint(*five_views(0.1), CAMERA, **options)
