"""Exact derivatives, the Schur complement against the whole system, robust losses."""

import numpy as np
import pytest

from pegpose_lab import calibrate_joint
from pegpose_lab.calibration.joint.bundle import Equations, minimise, robust_weights
from pegpose_lab.calibration.joint.covariance import covariance_of
from pegpose_lab.calibration.joint.models import COEFFICIENTS
from pegpose_lab.calibration.joint.views import evaluate
from pegpose_lab.tests.calibration.joint.boards import BOARD, CAMERA, MODELS, five_views, started


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
            evaluate(
                model,
                views,
                state.moved(
                    sign * change[:k],
                    np.tile(sign * change[k : k + 3], (5, 1)),
                    np.tile(sign * change[k + 3 :], (5, 1)),
                ),
            )[0]
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
