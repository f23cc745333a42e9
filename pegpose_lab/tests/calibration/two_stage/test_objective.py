"""Eqs. 6 and 7 against a literal loop."""

import numpy as np
import pytest

from pegpose_lab import calibrate_genetic, calibrate_tsai
from pegpose_lab.calibration import TwoStageObjective
from pegpose_lab.calibration.two_stage.objective import kappa1_per_point, kappa1_shared
from pegpose_lab.tests.calibration.views import CAMERA, box_of, view


def literal_objective(points, image_points, linear, focal_length, t_z):
    """Eqs. 3, 6 and 7 written out a point at a time; one kappa1 by least squares of Eq. 6's y equation."""
    (d_x, d_y), (c_x, c_y) = CAMERA.pixel_pitch, CAMERA.principal_point
    (r1, r2, _), (r4, r5, _), (r7, r8, _) = linear.cam_from_object[0].rotation.as_matrix()
    t_x, t_y, _ = linear.cam_from_object[0].translation
    numerator = denominator = 0.0
    for (x_w, y_w, _), (x_i, y_i) in zip(points, image_points, strict=True):
        x_d, y_d = d_x * (x_i - c_x), d_y * (y_i - c_y)
        c1, c2, c3, c4 = y_d * (x_d**2 + y_d**2), r7 * x_w + r8 * y_w, r4 * x_w + r5 * y_w + t_y, y_d
        numerator += c1 * (c3 * focal_length / (c2 + t_z) - c4)
        denominator += c1**2
    kappa1 = numerator / denominator
    distances = []
    for (x_w, y_w, _), (x_i, y_i) in zip(points, image_points, strict=True):
        z = r7 * x_w + r8 * y_w + t_z
        x_u, y_u = focal_length * (r1 * x_w + r2 * y_w + t_x) / z, focal_length * (r4 * x_w + r5 * y_w + t_y) / z
        x_d, y_d = x_u, y_u
        for _ in range(200):  # x_d = x_u - D_x, iterated
            r = np.sqrt(x_d**2 + y_d**2)
            x_d, y_d = x_u / (1 + kappa1 * r**2), y_u / (1 + kappa1 * r**2)
        distances.append(np.sqrt((x_d / d_x + c_x - x_i) ** 2 + (y_d / d_y + c_y - y_i) ** 2))
    return np.mean(distances), kappa1


def test_objective_is_the_loop():
    points, image_points = view(noise=0.3)
    linear = calibrate_tsai(points, image_points, CAMERA)
    objective = TwoStageObjective(points, image_points, linear)
    chromosomes = np.array([[47.0, 262.0], [48.5, 270.0], [44.0, 230.0]])
    for value, kappa1, chromosome in zip(
        objective(chromosomes), objective.kappa1(chromosomes)[:, 0], chromosomes, strict=True
    ):
        expected, expected_kappa1 = literal_objective(points, image_points, linear, *chromosome)
        assert value == pytest.approx(expected, rel=1e-9)
        assert kappa1 == pytest.approx(expected_kappa1, rel=1e-9)


def test_eq_6_by_hand():
    assert kappa1_per_point(2.0, 3.0, np.array([4.0]), np.array([1.0]), np.array([8.0]), np.array([2.0])) == 0.5
    constants = np.array([[4.0, 2.0], [1.0, 1.0], [8.0, 4.0], [2.0, 1.0]])
    assert kappa1_shared(2.0, 3.0, *constants) == pytest.approx(0.5)
    assert kappa1_per_point(2.0, 3.0, *constants[:, :1] * [[0], [1], [1], [1]]) == 0  # y = 0: nothing to learn


def test_truth_has_the_smallest_objective_and_its_kappa1():
    points, image_points = view()
    linear = calibrate_tsai(points, image_points, CAMERA)
    objective = TwoStageObjective(points, image_points, linear)
    truth = np.array([[47.95, 267.38]])
    assert objective(truth) < 1e-9
    assert objective.kappa1(truth)[0, 0] == pytest.approx(1.097e-5, rel=1e-8)
    per_point = TwoStageObjective(points, image_points, linear, kappa1="per-point").kappa1(truth)
    assert per_point[0] == pytest.approx(np.full(48, 1.097e-5), rel=1e-6)


def test_eq_6_per_point_makes_the_objective_flat():
    """PAPER: with one kappa1 a point Eq. 7 is the same for all (f, T_z), the shared one is not."""
    points, image_points = view(noise=0.1)
    linear = calibrate_tsai(points, image_points, CAMERA)
    chromosomes = np.random.default_rng(0).uniform(*box_of(linear), (500, 2))
    flat = TwoStageObjective(points, image_points, linear, kappa1="per-point")
    assert np.ptp(flat(chromosomes)) < 1e-10
    assert np.abs(flat.residuals(chromosomes)[..., 1]).max() < 1e-9
    assert np.ptp(TwoStageObjective(points, image_points, linear)(chromosomes)) > 10
    calibration = calibrate_genetic(points, image_points, CAMERA, rng=0, kappa1="per-point", generations=5)
    assert calibration.flags[-1].code == "drawn-not-found" and "drawn, not found" in calibration.flags[-1]


def test_impossible_chromosomes_are_penalised_without_a_warning():
    """Behind the camera, in its plane, and beyond the range of a distortion with kappa1 < 0."""
    points, image_points = view()
    objective = TwoStageObjective(points, image_points, calibrate_tsai(points, image_points, CAMERA))
    chromosomes = np.array([[48, -300], [48, -objective.c2[7]], [48, -objective.c2.min()], [10, 300.0]])
    values = objective(chromosomes)
    assert np.isfinite(values).all() and np.all(values[:3] == 1e6)
    folded = np.column_stack([np.linspace(0.01, 47, 200), np.full(200, 267.38)])
    assert np.isfinite(objective(folded)).all() and np.isfinite(objective.residuals(folded)).all()
    assert np.any(objective(folded) == 1e6)
