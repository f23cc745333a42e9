"""Sigmas by the scatter between the views: tests against oracles, right where errors are correlated, silent where not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from pegpose_lab import (
    Calibration,
    CalibrationError,
    calibrate_joint,
    calibrate_zhang,
    profile_focal_length,
    weakest_direction,
)
from pegpose_lab.calibration.joint import clustered
from pegpose_lab.calibration.joint.fitting import fit_views
from pegpose_lab.calibration.joint.models import lens_model
from pegpose_lab.calibration.joint.views import evaluate
from pegpose_lab.study import correlated_noise, trial_poses
from pegpose_lab.tests.calibration.joint.boards import BOARD, CAMERA, EXPERIMENT, five_views

MODEL = lens_model(CAMERA.sensor, True, False, None)
COEFFICIENTS = ("k1", "k2", "p1", "p2")


def boards(number, length, seed, tilt=30.0, noise=0.1, camera=CAMERA):
    """Views of boards with noise that is correlated over `length` px, and the boards' poses."""
    poses, rng = trial_poses(EXPERIMENT.board, tilt, number, 1), np.random.default_rng([seed, number])
    exact = [camera.project(BOARD, pose) for pose in poses]
    return ([BOARD] * number, [points + noise * correlated_noise(points, length, rng) for points in exact]), poses


def codes(run):
    return [flag.code for flag in run.flags]


def test_the_jackknife_is_that_of_refits_without_a_view():
    points, images = boards(8, 200.0, 0)[0]
    fit = fit_views(MODEL, points, images)
    without = [[k for k in range(8) if k != view] for view in range(8)]
    refits = [fit_views(MODEL, [BOARD] * 7, [images[k] for k in kept]).state.shared for kept in without]
    moves = np.subtract(refits, fit.state.shared)
    expected = 7 / 8 * np.diag(moves.T @ moves)
    stated = np.diag(fit.covariance)[:4]
    assert (stated > 0.9 * expected).all() and stated == pytest.approx(expected, rel=0.25)


def test_both_tests_are_those_of_the_whole_projection():
    """Mean, variance and degrees of freedom against the dense matrices of all coordinates."""
    points, images = boards(3, 0.0, 0)[0]
    images[1], points[1] = images[1][:-5], points[1][:-5]  # views of unequal numbers
    fit = fit_views(MODEL, points, images)
    used = fit.views.used.ravel() > 0
    errors, jacobian = evaluate(MODEL, fit.views, fit.state)
    k, whole = 4, np.repeat(used, 2)
    rows = jacobian.reshape(3, -1, 10)
    of_poses = block_diag(*rows[:, :, k:])[whole]
    shared = rows[:, :, :k].reshape(-1, k)[whole]
    root = np.linalg.qr(of_poses)[0]
    own = shared - root @ (root.T @ shared)
    scale = np.linalg.norm(own, axis=0)
    basis = np.linalg.qr(np.hstack([root, own / scale]))[0]
    projection = np.eye(len(basis)) - basis @ basis.T
    weights = clustered._neighbours(fit.views).toarray()[np.ix_(used, used)]
    assert (weights == weights.T).all() and set(np.unique(weights)) == {0, 1, 2} and (np.diag(weights) == 0).all()
    product = projection @ np.kron(weights, np.eye(2))
    first, second, n = np.trace(product), np.trace(product @ product), fit.freedom
    e = errors.ravel()[whole]
    statistic = e @ np.kron(weights, np.eye(2)) @ e / (e @ e)
    expected = (statistic - first / n) / np.sqrt(2 * (n * second - first**2) / (n**2 * (n + 2)))

    values, vectors = np.linalg.eigh(own.T @ own / np.outer(scale, scale))
    white = np.zeros((errors.size, k))
    white[whole] = own @ (vectors / np.sqrt(values) / scale[:, None])
    parts = white.reshape(3, -1, k)
    all_poses = np.zeros((errors.size, 18))
    all_poses[whole] = root
    by_view = np.array([all_poses.reshape(3, -1, 18)[v][:, 6 * v : 6 * v + 6] for v in range(3)])
    unit = (errors * fit.views.used[..., None]).reshape(3, -1, 1) / np.sqrt(fit.variance)
    assert clustered._neighbour_test(fit.views, unit, by_view, parts, n)[1] == pytest.approx(expected, rel=1e-6)

    scores, shares = (parts.transpose(0, 2, 1) @ unit)[:, :, 0], parts.transpose(0, 2, 1) @ parts
    stacked = np.hstack(shares)
    of_scores = block_diag(*shares) - stacked.T @ stacked
    ratio, degrees = clustered._score_ratio(scores, shares)
    assert ratio == pytest.approx(np.sum(scores**2) / np.trace(of_scores), rel=1e-9)
    assert degrees == pytest.approx(np.trace(of_scores) ** 2 / np.sum(of_scores**2), rel=1e-9)


def test_independent_errors_keep_the_classical_sigmas():
    """The tests have their level and the mean that they state; so the sigmas are at most 2 % wider on average."""
    fits = [fit_views(MODEL, *boards(6, 0.0, seed)[0]) for seed in range(150)]
    stated = [fit for fit in fits if fit.clustered]
    assert len(stated) <= 5  # 1.5 expected
    wider = [np.sqrt(fit.covariance.iloc[0, 0] / fit.classical_covariance.iloc[0, 0]) for fit in fits]
    assert min(wider) >= 1 and np.mean(wider) < 1.03
    assert np.mean([fit.scatter.ratio for fit in fits]) == pytest.approx(1, abs=0.1)
    assert np.mean([fit.scatter.correlation for fit in fits]) == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("length", [60.0, 200.0])
def test_correlated_errors_are_flagged_and_intervals_hold(length):
    held, f, sigmas, classical = [], [], [], []
    for seed in range(100):
        fit = fit_views(MODEL, *boards(8, length, seed)[0])
        assert fit.clustered or length == 60.0
        run = Calibration(MODEL.camera(fit.state.shared), fit.state.poses(fit.views), [], **fit.stated())
        low, high = run.interval("focal_length")
        held.append(low < CAMERA.focal_length < high and fit.clustered)
        f.append(run.camera.focal_length)
        sigmas.append(run.sigma("focal_length"))
        classical.append(np.sqrt(fit.classical_covariance.iloc[0, 0]))
    assert np.mean(held) >= 0.9
    assert np.mean(sigmas) == pytest.approx(np.std(f), rel=0.2) and np.mean(classical) < 0.9 * np.std(f)


def test_the_poses_go_with_it():
    """Positions and turns lie within their sigmas as often as f does; the whole matrix remains a covariance."""
    scaled = []
    for seed in range(25):
        views, poses = boards(8, 200.0, seed)
        run = calibrate_joint(*views, CAMERA)
        assert "clustered-sigmas" in codes(run) and run.sigmas_from == "scatter between views" and run.freedom == 7
        for view in (0, 5):
            turn = (run.cam_from_object[view].rotation * poses[view].rotation.inv()).as_rotvec()
            shift = run.cam_from_object[view].translation - poses[view].translation
            names = [f"{name}_{view}" for name in ("rx", "ry", "rz", "tx", "ty", "tz")]
            scaled.append(np.concatenate([turn, shift]) / [run.sigma(name) for name in names])
    assert np.sqrt(np.mean(np.square(scaled), axis=0)) == pytest.approx(np.ones(6), abs=0.4)
    stated, classical = run.covariance.to_numpy(), run.classical_covariance.to_numpy()
    scale = np.sqrt(np.diag(classical))
    assert list(run.covariance.columns) == list(run.classical_covariance.index)
    assert np.linalg.eigvalsh(stated / np.outer(scale, scale))[0] > 0
    assert (
        np.linalg.eigvalsh((stated - classical) / np.outer(scale, scale))[0] > -1e-9
    )  # nowhere below the classical one
    text = next(flag for flag in run.flags if flag.code == "clustered-sigmas")
    assert (
        f"focal_length is {scale[0] ** -1 * run.sigma('focal_length'):.2g} times" in text and "t of 7 degrees" in text
    )


def test_too_few_views_say_so():
    """A flag if their errors are not independent; if nothing contradicts that, the words of `sigmas_from`."""
    run = calibrate_joint(*boards(4, 200.0, 0)[0], CAMERA)
    assert "correlated-corners" in codes(run) and "4 of the 5 views" in " ".join(run.flags)
    assert run.covariance.equals(run.classical_covariance) and run.freedom == 2 * 4 * 48 - len(run.covariance)
    assert run.sigmas_from == "independent errors, not checked: 4 views, at least 5 are needed"
    calm = calibrate_joint(*boards(4, 0.0, 0)[0], CAMERA)
    assert calm.flags == () and calm.sigmas_from == run.sigmas_from
    assert calibrate_joint(*five_views(0.1), CAMERA).sigmas_from == "independent errors"
    assert "clustered-sigmas" in codes(calibrate_joint(*boards(5, 200.0, 0)[0], CAMERA))


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_robust_losses_have_the_same_form(loss):
    views = boards(8, 200.0, 3)[0]
    plain, robust = (calibrate_joint(*views, CAMERA, loss=loss) for loss in ("linear", loss))
    assert "clustered-sigmas" in codes(robust)
    assert robust.sigma("focal_length") == pytest.approx(plain.sigma("focal_length"), rel=0.3)
    views[1][2][7] += 8.0  # a wrong corner has no part in the scatter
    assert calibrate_joint(*views, CAMERA, loss=loss).sigma("c_x") == pytest.approx(robust.sigma("c_x"), rel=0.2)
    assert calibrate_joint(*boards(8, 0.0, 3)[0], CAMERA, loss=loss).sigmas_from == "independent errors"


def test_the_profile_is_the_interval_of_the_stated_sigma():
    views = boards(8, 200.0, 4)[0]
    run = calibrate_joint(*views, CAMERA)
    low, high = run.interval("focal_length")
    assert profile_focal_length(*views, CAMERA) == pytest.approx((low, high), abs=0.02 * (high - low))


def test_zhang_states_the_same_and_exact_views_none():
    views = boards(8, 200.0, 5)[0]
    joint = calibrate_joint(*views, CAMERA, focal="two", coefficients=("k1", "k2"))
    zhang = calibrate_zhang(*views, CAMERA.image_size)
    assert "clustered-sigmas" in codes(zhang) and zhang.freedom == 7
    assert [zhang.sigma(name) for name in ("f_x", "c_y")] == pytest.approx(
        [joint.sigma(name) for name in ("f_x", "c_y")], rel=0.02
    )
    exact = boards(6, 0.0, 0, noise=0.0, camera=replace(CAMERA, kappa1=0.0))[0]
    for run in (calibrate_joint(*exact, CAMERA), calibrate_zhang(*exact, CAMERA.image_size)):
        assert not {"clustered-sigmas", "correlated-corners"} & set(codes(run))


def test_one_view_that_alone_knows_f_does_not_inflate_it():
    """Seven boards tilted by 3 degrees and one by 35: without that one f is hardly known, so the pure jackknife states
    nine times the true error; with `MOST_LEVERAGE` it stays near it."""
    poses = [*trial_poses(EXPERIMENT.board, 3.0, 7, 1), *trial_poses(EXPERIMENT.board, 35.0, 1, 2)]
    exact, found = [CAMERA.project(BOARD, pose) for pose in poses], []
    for seed in range(30):
        rng = np.random.default_rng([seed, 3])
        fit = fit_views(MODEL, [BOARD] * 8, [points + 0.1 * correlated_noise(points, 200.0, rng) for points in exact])
        found.append((fit.state.shared[0], np.sqrt(fit.covariance.iloc[0, 0])))
    f, sigma = np.transpose(found)
    assert 0.8 < np.mean(sigma) / np.std(f) < 2.5


def test_few_views_of_many_parameters_give_a_covariance():
    """Five views, eight parameters: the views' five moves do not span them, and the classical sigmas fill the rest."""
    run = calibrate_joint(*boards(5, 200.0, 6)[0], CAMERA, focal="two", coefficients=COEFFICIENTS)
    scale = np.sqrt(np.diag(run.covariance))
    assert "clustered-sigmas" in codes(run) and np.isfinite(scale).all()
    assert np.linalg.eigvalsh(run.covariance.to_numpy() / np.outer(scale, scale))[0] > 0


def test_an_interval_names_what_it_needs(tmp_path):
    run = calibrate_joint(*five_views(0.1), CAMERA)
    narrow, wide = run.interval("c_x", 0.5), run.interval("c_x")
    assert wide[0] < narrow[0] < run.camera.principal_point[0] < narrow[1] < wide[1]
    for name, level in (("tx_0", 0.95), ("c_x", 1.0), ("c_x", 0.0)):
        with pytest.raises(ValueError, match="name|level"):
            run.interval(name, level)
    run.save(tmp_path / "camera.yml", "ros")
    with pytest.raises(ValueError, match="covariance"):
        Calibration.load(tmp_path / "camera.yml").interval("f_x")


def test_singular_covariances_raise_calibrationerror():
    run = calibrate_joint(*five_views(0.1), CAMERA)
    with pytest.raises(CalibrationError, match="do not determine"):
        weakest_direction(replace(run, covariance=0 * run.covariance))
