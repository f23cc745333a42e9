"""Repeated stage 1 on simulated views: the truth without noise, the bias and the scatter with it."""

from dataclasses import replace

import numpy as np
import pytest

from pegpose_lab.calibration import calibrate_tsai, solve_images
from pegpose_lab.paper import paper_experiment
from pegpose_lab.study import noisy_solutions, tilt_trials

TRUTH = paper_experiment()
WORLD = TRUTH.world_from_board.apply(TRUTH.board.object_points)
EXACT = TRUTH.camera.project(TRUTH.board.object_points, TRUTH.cam_from_boards[0])


def test_without_noise_a_pinhole_is_recovered():
    pinhole = replace(TRUTH.camera, kappa1=0.0)
    exact = pinhole.project(TRUTH.board.object_points, TRUTH.cam_from_boards[0])
    (found,) = noisy_solutions(WORLD, exact, pinhole, 0.0, trials=1)
    assert found[:2] == pytest.approx([47.95, 267.38], rel=1e-9) and found[2] < 1e-9


def test_each_trial_has_a_generator_of_its_own():
    many = noisy_solutions(WORLD, EXACT, TRUTH.camera, 0.1, trials=5, seed=[7])
    assert np.array_equal(noisy_solutions(WORLD, EXACT, TRUTH.camera, 0.1, trials=2, seed=[7]), many[:2])
    noise = np.random.default_rng([7, 4]).standard_normal(EXACT.shape)
    assert many[4, 0] == pytest.approx(calibrate_tsai(WORLD, EXACT + 0.1 * noise, TRUTH.camera).camera.focal_length)


def test_noise_in_the_matrix_biases_f_by_its_square():
    """With each noise taken with both signs, what is linear in it cancels."""
    clean = calibrate_tsai(WORLD, EXACT, TRUTH.camera).camera.focal_length
    means, errors = [], []
    for k, noise in enumerate((0.1, 0.3)):
        draws = np.array([np.random.default_rng([27, k, trial]).standard_normal(EXACT.shape) for trial in range(100)])
        pairs = [solve_images(WORLD, EXACT + sign * noise * draws, TRUTH.camera)[0] for sign in (1, -1)]
        shift = np.mean(pairs, axis=0) - clean
        means.append(shift.mean())
        errors.append(shift.std(ddof=1) / 10)
        assert means[k] < -10 * errors[k]
        assert abs(means[k]) < 0.25 * np.std(pairs[0])  # small beside the scatter
    relative = np.hypot(*np.divide(errors, means))
    assert means[1] / means[0] == pytest.approx(9, abs=3 * 9 * relative)


def test_little_tilt_is_refused_and_the_stated_scatter_is_that_of_f():
    table = tilt_trials([0.5, 20.0], trials=100, seed=3).set_index("tilt (deg)")
    assert table.loc[0.5, "refused (%)"] > 90 and table.loc[0.5, ["sd of f (%)", "predicted (%)"]].isna().all()
    assert table.loc[20.0, "refused (%)"] == 0
    assert table.loc[20.0, "sd of f (%)"] == pytest.approx(table.loc[20.0, "predicted (%)"], rel=3 / np.sqrt(2 * 99))


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: noisy_solutions(WORLD, EXACT, TRUTH.camera, -1.0), "noise"),
        (lambda: noisy_solutions(WORLD, EXACT, TRUTH.camera, 0.1, trials=0), "trials"),
        (lambda: tilt_trials([100.0]), "tilts"),
        (lambda: tilt_trials([10.0], trials=1), "trials"),
    ],
)
def test_unusable_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=named):
        call()
