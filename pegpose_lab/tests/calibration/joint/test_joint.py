"""The joint solution: real views, honest sigmas, what is not determined."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import (
    CalibrationError,
    TsaiCamera,
    calibrate_dlt,
    calibrate_joint,
    calibrate_tsai,
    profile_focal_length,
    weakest_direction,
)
from pegpose_lab.calibration.joint.bundle import Equations, minimise, robust_weights
from pegpose_lab.calibration.joint.covariance import covariance_of
from pegpose_lab.calibration.joint.models import COEFFICIENTS, lens_model
from pegpose_lab.calibration.joint.starts import find_start
from pegpose_lab.calibration.joint.views import State, Views, evaluate
from pegpose_lab.calibration.result import judge_focal_length
from pegpose_lab.paper import paper_experiment
from pegpose_lab.study import trial_poses
from pegpose_lab.study.datasets import load_points, read_corners

EXPERIMENT = paper_experiment()
CAMERA, BOARD = EXPERIMENT.camera, EXPERIMENT.board.object_points
MODELS = [(False, None), (True, None), (False, ("k1",)), (True, COEFFICIENTS)]


def five_views(noise, seed=0, camera=CAMERA):
    rng = np.random.default_rng(seed)
    seen = [camera.project(BOARD, pose) for pose in EXPERIMENT.cam_from_boards]
    return [BOARD] * 5, [points + noise * rng.standard_normal(points.shape) for points in seen]


def started(two, coefficients, points=None):
    points = points or five_views(0.1)
    model = lens_model(CAMERA, True, two, coefficients)
    views = Views.stack(*points)
    return model, views, find_start(model, views, *points)


@pytest.mark.parametrize("two, coefficients", MODELS)
def test_derivatives_are_exact(two, coefficients):
    model, views, state = started(two, coefficients)
    rng = np.random.default_rng(1)
    sizes = {"kappa1": 1e-5, "focal_length": 0.5, "scale_x": 0.01}
    start = np.array([sizes.get(name, 0.02 if name in COEFFICIENTS else 3.0) for name in model.names])
    state = state.moved(start, 0.2 * rng.standard_normal((5, 3)), rng.standard_normal((5, 3)))
    exact = evaluate(model, views, state)[1]
    k = len(model.names)
    for column in range(k + 6):
        step = 1e-6 * (start[column] if column < k else 1.0)
        change = np.zeros(k + 6)
        change[column] = step
        moved = [
            evaluate(model, views, state.moved(
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
    residuals, jacobian = evaluate(model, views, state)
    equations = Equations.of(residuals, jacobian, views.used)
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
    state, equations = minimise(model, views, state, views.used)
    found = covariance_of(model, views, state, equations, np.sum(evaluate(model, views, state)[0] ** 2) / 100)
    residuals, jacobian = evaluate(model, views, state)
    whole = dense(jacobian)
    scale = np.linalg.norm(whole, axis=0)
    expected = np.linalg.inv((whole / scale).T @ (whole / scale)) / np.outer(scale, scale)
    expected *= np.sum(residuals**2) / 100
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-12 * expected.max())


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


def test_robust_losses_have_the_stated_efficiency():
    """Asymptotic, for errors normal in x and y: (mean of psi's half trace)^2 over the mean of psi^2 / 2."""
    r = (np.arange(400_000) + 0.5) * 1e-4
    density = r * np.exp(-(r**2) / 2) * 1e-4
    for loss in ("huber", "cauchy"):
        weights, slopes = robust_weights(r, loss)
        efficiency = np.sum(density * (weights + slopes / 2)) ** 2 / np.sum(density * (weights * r) ** 2 / 2)
        assert efficiency == pytest.approx(0.95, abs=1e-4)
        near, beyond = (robust_weights(np.array([x]), loss)[0][0] for x in (0.5, 20.0))
        assert near > 0.9 and beyond < 0.1


def with_outliers(seed, share):
    """The five views with some of their corners wrong by 2 to 15 px."""
    points, images = five_views(0.1, seed)
    rng = np.random.default_rng([seed, 1])
    for image in images:
        wrong = rng.random(48) < share
        angle, length = rng.uniform(0, 2 * np.pi, 48), rng.uniform(2, 15, 48)
        image[wrong] += (length * [np.cos(angle), np.sin(angle)]).T[wrong]
    return points, images


def scaled_errors(loss, share, trials):
    """Errors of f, c_x, c_y and kappa1 (trials, 4), and the stated sigmas."""
    errors, sigmas = [], []
    for seed in range(trials):
        run = calibrate_joint(*with_outliers(seed, share), CAMERA, loss=loss)
        found, true = ([c.focal_length, *c.principal_point, c.kappa1] for c in (run.camera, CAMERA))
        errors.append(np.subtract(found, true))
        sigmas.append([run.sigma(name) for name in ("focal_length", "c_x", "c_y", "kappa1")])
    return np.array(errors), np.array(sigmas)


@pytest.mark.parametrize("share", [0.0, 0.05])
@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_sigmas_of_robust_losses_are_honest(loss, share):
    errors, sigmas = scaled_errors(loss, share, 60)
    scaled = errors / sigmas
    assert np.sqrt(np.mean(scaled**2)) == pytest.approx(1, abs=0.15)
    assert np.mean(np.abs(scaled) < 1.96) == pytest.approx(0.95, abs=0.04)


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_robust_losses_survive_wrong_corners(loss):
    points, images = five_views(0.1, 3)
    images[1][7] += (15, -9)
    images[3][[2, 30]] += (-12, 5)
    plain, robust = (calibrate_joint(points, images, CAMERA, loss=kind) for kind in ("linear", loss))
    clean = calibrate_joint(*five_views(0.1, 3), CAMERA)
    error = abs(robust.camera.focal_length - clean.camera.focal_length)
    assert error < clean.sigma("focal_length") < abs(plain.camera.focal_length - clean.camera.focal_length)
    assert robust.sigma("focal_length") < 1.2 * clean.sigma("focal_length") < plain.sigma("focal_length")


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_robust_loss_costs_little_without_wrong_corners(loss):
    """5 % of the variance: the difference to least squares has a variance of about 5 % of it, too."""
    (plain, sigmas), (robust, _) = (scaled_errors(kind, 0.0, 40) for kind in ("linear", loss))
    assert np.sqrt(np.mean(((robust - plain) / sigmas) ** 2)) == pytest.approx(np.sqrt(0.05), rel=0.3)


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


def test_every_direction_that_is_not_determined_is_named():
    """Of one fronto-parallel board without distortion: each on its own, f_x, f_y and the principal point."""
    pose = trial_poses(EXPERIMENT.board, 0.0, 1, 1)[0]
    image = replace(CAMERA, kappa1=0.0).project(BOARD, pose)
    model = lens_model(CAMERA, True, True, ())
    views = Views.stack([BOARD], [image])
    state = State(model.start(CAMERA.focal_length), pose.rotation.as_matrix()[None], pose.apply(views.centroids))
    equations = Equations.of(*evaluate(model, views, state), views.used)
    with pytest.raises(CalibrationError, match="trade off; .*trade off.*change together"):
        covariance_of(model, views, state, equations, 1.0)


def test_the_weakest_direction_is_that_of_f_and_depth():
    eigenvalue, words = weakest_direction(calibrate_joint(*five_views(0.1), CAMERA, principal_point="fixed"))
    assert 0 < eigenvalue < 0.1 and words == "focal_length and T_z trade off"
    poses = trial_poses(EXPERIMENT.board, 12.0, 6, 2)
    rng = np.random.default_rng(0)
    images = [CAMERA.project(BOARD, pose) + 0.02 * rng.standard_normal((48, 2)) for pose in poses]
    assert weakest_direction(calibrate_joint([BOARD] * 6, images, CAMERA, principal_point="fixed"))[0] < eigenvalue
    with pytest.raises(ValueError, match="covariance"):
        weakest_direction(calibrate_tsai(BOARD, five_views(0.1)[1][1], CAMERA))


def test_a_principal_point_that_is_hardly_known_is_flagged():
    points, images = five_views(0.1)
    assert calibrate_joint(points, images, CAMERA).flags == ()
    flags = calibrate_joint(points[1:2], images[1:2], CAMERA).flags
    assert any("principal point" in flag for flag in flags)
    assert calibrate_joint(points[1:2], images[1:2], CAMERA, principal_point="fixed").flags == ()


def test_intervals_are_those_of_students_t():
    """Of few degrees of freedom the interval is wider: 3.18 sigma of three, 1.96 of many."""
    table = pd.DataFrame([[1.0]], ["f_x"], ["f_x"])
    assert judge_focal_length(table, "f_x", 10.0, "px", 1000) == ()
    assert "6.818 to 13.18 px" in judge_focal_length(table, "f_x", 10.0, "px", 3)[0]
    with pytest.raises(CalibrationError, match="do not determine f"):
        judge_focal_length(table, "f_x", 3.0, "px", 3)


# --- little tilt: refused, flagged, or right ---------------------------------------------------------------


OPTIONS = {
    "default": {}, "fixed": {"principal_point": "fixed"}, "k1k2": {"coefficients": ("k1", "k2")},
    "two": {"focal": "two"}, "two_k1k2": {"focal": "two", "coefficients": ("k1", "k2")}, "huber": {"loss": "huber"},
}


def little_tilted(rng, tilt, number, one_axis):
    """Boards tilted alike about one axis of the camera, or evenly spread ones, and turned, shifted, at other depths."""
    first, poses = rng.uniform(0, 2 * np.pi), []
    for view in range(number):
        angle = first + (0 if one_axis else 2 * np.pi * view / number)
        rotation = Rotation.from_rotvec(np.deg2rad(tilt) * np.array([np.cos(angle), np.sin(angle), 0]))
        rotation = rotation * Rotation.from_rotvec([0, 0, rng.uniform(-0.3, 0.3)])
        middle = np.array([*rng.uniform(-25, 25, 2), 310 * rng.uniform(1, 1.3)])
        poses.append(RigidTransform.from_components(middle - rotation.apply(EXPERIMENT.board.center), rotation))
    return poses


def outcome(seed, options, tilts, numbers, noises):
    """|error| / sigma of f of one random set and whether it is flagged; None where it is refused."""
    rng = np.random.default_rng([seed, 4])
    number, noise = int(rng.choice(numbers)), rng.choice(noises)
    poses = little_tilted(rng, rng.choice(tilts), number, rng.random() < 0.5)
    images = [CAMERA.project(BOARD, pose) + noise * rng.standard_normal((48, 2)) for pose in poses]
    try:
        run = calibrate_joint([BOARD] * number, images, replace(CAMERA, focal_length=1.0, kappa1=0.0), **options)
    except CalibrationError:
        return None
    name, true = run.covariance.index[0], CAMERA.focal_length
    found = getattr(run.camera, "focal_length", None) or run.camera.camera_matrix[0, 0] * CAMERA.pixel_pitch[0]
    unit = 1.0 if name == "focal_length" else CAMERA.pixel_pitch[0]
    return abs(found - true) / (unit * run.sigma(name)), bool(run.flags)


@pytest.mark.parametrize("name", OPTIONS)
def test_boards_with_little_tilt_are_refused_or_flagged(name):
    """No f is further from the truth than 5 of its sigmas; all below 10 degrees are flagged."""
    tilts, numbers, noises = (0.0, 0.3, 0.5, 1.0, 2.0, 5.0), (2, 3, 10, 30), (0.05, 0.1, 0.5)
    found = [outcome(seed, OPTIONS[name], tilts, numbers, noises) for seed in range(25)]
    answered = [pair for pair in found if pair is not None]
    assert 2 <= len(answered) < 23
    assert all(flagged for _, flagged in answered) and max(error for error, _ in answered) < 5


@pytest.mark.parametrize("name", ["default", "k1k2", "huber"])
def test_well_tilted_boards_are_neither_refused_nor_flagged(name):
    found = [outcome(seed, OPTIONS[name], (15.0, 20.0, 30.0), (5, 10), (0.05, 0.1)) for seed in range(15)]
    assert None not in found and max(error for error, _ in found) < 4
    assert sum(flagged for _, flagged in found) <= 2


@pytest.mark.parametrize(
    "options, number, tilt, noise",
    [
        ({}, 30, 0.3, 0.5), ({}, 3, 0.5, 0.5), ({"focal": "two"}, 30, 0.3, 0.1),
        ({"focal": "two", "coefficients": ("k1", "k2")}, 20, 0.5, 0.1),
    ],
)
def test_many_noisy_views_of_fronto_parallel_boards_know_nothing(options, number, tilt, noise):
    """The noise alone gives f a small sigma there, a tenth of it, at up to a hundred times its value."""
    for seed in range(5):
        assert outcome(seed, options, (tilt,), (number,), (noise,)) is None


@pytest.mark.parametrize("seed", [22, 335, 619])
def test_two_focal_lengths_of_a_wrong_valley_are_refused(seed):
    """A least squares of its own at f_y = 0.9 f_x, boards of 24 deg and f = 4000 mm, far above the least."""
    rng = np.random.default_rng([seed, 9])
    images = [
        CAMERA.project(BOARD, pose) + 0.2 * rng.standard_normal((48, 2)) for pose in little_tilted(rng, 0.5, 30, True)
    ]
    with pytest.raises(CalibrationError, match="f is not determined.*better"):
        calibrate_joint([BOARD] * 30, images, CAMERA, focal="two", coefficients=("k1", "k2"))


def test_a_search_that_runs_out_of_steps_is_refused():
    """Without noise the sum of squares is a valley with a level floor: it is not followed to its end."""
    poses = little_tilted(np.random.default_rng([5, 20, 100]), 0.1, 20, False)
    images = [CAMERA.project(BOARD, pose) for pose in poses]
    with pytest.raises(CalibrationError, match="no minimum in 200 steps.*trade off"):
        calibrate_joint([BOARD] * 20, images, CAMERA, focal="two", coefficients=("k1", "k2"))


def test_steps_that_promise_nothing_are_rejected():
    """On exactly fronto-parallel boards a step's promise can be rounding; it was divided by."""
    for seed in range(10):
        assert outcome(seed, {}, (0.0,), (10,), (0.1,)) is None


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
    best = run.camera.focal_length
    assert (low, high) == pytest.approx((best - half, best + half), abs=0.05 * half)
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
    narrow = profile_focal_length([BOARD], [images], CAMERA, principal_point="fixed", level=0.01)
    best = np.sqrt(np.prod(narrow))
    assert best / low > 1.3 * high / best
    assert profile_focal_length([BOARD], [images], CAMERA, principal_point="fixed", level=0.9999)[0] == 0
    with pytest.raises(CalibrationError, match="explains the points nearly as well"):
        calibrate_joint([BOARD], [images], CAMERA, principal_point="fixed")


def test_direct_linear_transform_is_exact_without_distortion():
    camera = replace(CAMERA, kappa1=0.0)
    run = calibrate_dlt(BOARD, camera.project(BOARD, EXPERIMENT.cam_from_boards[1]), CAMERA)
    assert run.camera.focal_length == pytest.approx(CAMERA.focal_length, rel=1e-9) and run.rms < 1e-8
    with pytest.raises(ValueError, match="plane"):
        calibrate_dlt(BOARD + (np.arange(48) % 3)[:, None] * [0, 0, 20.0], run.residuals[0], CAMERA)


@pytest.mark.parametrize(
    "options, named",
    [
        ({"focal": "three"}, "focal"), ({"loss": "l1"}, "loss"), ({"coefficients": ("k9",)}, "coefficients"),
        ({"coefficients": ("k1", "k1")}, "coefficients"), ({"principal_point": "middle"}, "principal_point"),
        ({"coefficients": 3}, "coefficients"),
    ],
)
def test_unusable_options_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        calibrate_joint(*five_views(0.1), CAMERA, **options)
