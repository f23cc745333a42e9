"""What a calibration says, and that its files give it back."""

import json
import re
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.optimize import differential_evolution
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import (
    Calibration,
    CalibrationError,
    Checkerboard,
    OpenCVCamera,
    TsaiCamera,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    calibrate_zhang,
    optimum_in_box,
)
from pegpose_lab.calibration import TwoStageObjective, repeat_calibration
from pegpose_lab.calibration.two_stage.objective import kappa1_per_point, kappa1_shared
from pegpose_lab.paper import paper_experiment, paper_pose
from pegpose_lab.study import load_corners

EXPERIMENT = paper_experiment()
CAMERA = EXPERIMENT.camera
BOARD = EXPERIMENT.board.object_points
WORLD_BOARD = EXPERIMENT.world_from_board.apply(BOARD)
BODY = np.random.default_rng(4).uniform(-80, 80, (40, 3))


def view(points=WORLD_BOARD, pose=None, noise=0.0, seed=0, camera=CAMERA):
    image_points = camera.project(points, paper_pose() if pose is None else pose)
    return points, image_points + noise * np.random.default_rng(seed).standard_normal(image_points.shape)


def five_views(noise, seed=0):
    rng = np.random.default_rng(seed)
    image_points = [CAMERA.project(BOARD, pose) for pose in EXPERIMENT.cam_from_boards]
    return [BOARD] * 5, [points + noise * rng.standard_normal(points.shape) for points in image_points]


def fronto_parallel(noise=0.1, seed=0, count=5):
    rng = np.random.default_rng(seed)
    board = BOARD - BOARD.mean(axis=0)
    poses = [
        RigidTransform.from_components([*rng.uniform(-40, 40, 2), 350 + 30 * k], Rotation.from_rotvec([0, 0, k]))
        for k in range(count)
    ]
    return [board] * count, [CAMERA.project(board, pose) + noise * rng.standard_normal((48, 2)) for pose in poses]


def table_views(path, split="view"):
    views = [group for _, group in pd.read_csv(path, comment="#").groupby(split)]
    object_points = [group[["X", "Y"]].assign(Z=0.0).to_numpy() for group in views]
    return object_points, [group[["u", "v"]].to_numpy() for group in views]


def zhang_views(folder):
    model = 25.4 * np.loadtxt(folder / "Model.txt").reshape(-1, 2)
    image_points = [np.loadtxt(folder / f"data{number}.txt").reshape(-1, 2) for number in range(1, 6)]
    return [np.column_stack([model, np.zeros(len(model))])] * 5, image_points


def best_in_box(objective, lower, upper):
    """The oracle: a dense scan over T_z, for each T_z over f, then ever finer scans round the best."""

    def best_f(t_z):
        f = np.linspace(lower[0], upper[0], 101)
        for _ in range(9):
            values = objective(np.column_stack([f, np.full(len(f), t_z)]))
            best = np.argmin(values)
            f = np.linspace(f[max(best - 1, 0)], f[min(best + 1, len(f) - 1)], 21)
        return values[best]

    t_z = np.linspace(lower[1], upper[1], 81)
    for _ in range(8):
        values = [best_f(value) for value in t_z]
        best = np.argmin(values)
        t_z = np.linspace(t_z[max(best - 1, 0)], t_z[min(best + 1, len(t_z) - 1)], 9)
    return values[best]


def box_of(linear):
    centre = np.array([linear.camera.focal_length, linear.cam_from_object[0].translation[2]])
    return 0.75 * centre, 1.25 * centre


# --- stage 1 -------------------------------------------------------------------------------------------


def test_stage_1_on_the_paper_camera():
    calibration = calibrate_tsai(*view(), CAMERA)
    assert calibration.camera.focal_length == pytest.approx(48.02, abs=0.005)
    assert calibration.mean_distance == pytest.approx(0.177, abs=0.001)
    assert calibration.camera.kappa1 == 0 and calibration.history is None


def test_stage_1_recovers_a_body_and_the_horizontal_scale():
    camera = replace(CAMERA, kappa1=0.0, scale_x=1.03)
    pose = RigidTransform.from_components([20.0, -10.0, 500.0], Rotation.from_rotvec([0.3, -0.2, 0.5]))
    calibration = calibrate_tsai(*view(BODY, pose, camera=camera), replace(camera, focal_length=1.0, scale_x=0.98))
    assert calibration.camera.scale_x == pytest.approx(1.03, rel=1e-9)
    assert calibration.camera.focal_length == pytest.approx(47.95, rel=1e-8)
    assert calibration.rms < 1e-8


def test_f_and_kappa1_of_the_given_camera_are_not_used():
    other = replace(CAMERA, focal_length=3.0, kappa1=-0.1)
    assert calibrate_tsai(*view(), other).camera == calibrate_tsai(*view(), CAMERA).camera


# --- stage 2 -------------------------------------------------------------------------------------------


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
    assert "drawn, not found" in calibration.flags[-1]


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


def test_genetic_finds_the_paper_camera_from_any_seed():
    for seed in range(25):
        calibration = calibrate_genetic(*view(), CAMERA, rng=seed)
        assert calibration.camera.focal_length == pytest.approx(47.95, rel=1e-6)
        assert calibration.cam_from_object[0].translation == pytest.approx([-945.2, 663.51, 267.38], rel=1e-6)
        assert calibration.camera.kappa1 == pytest.approx(1.097e-5, rel=1e-4)
        assert calibration.mean_distance < 1e-6 and calibration.flags == ()


@pytest.mark.parametrize("options", [{}, {"genes": "printed", "generations": 30}])
def test_runs_side_by_side_are_those_one_after_the_other(options):
    points, _ = view()
    images = [view(noise=0.1, seed=seed)[1] for seed in range(10)]  # more than are evaluated together
    many = repeat_calibration(points, images, CAMERA, range(10), **options)
    for run, (seed, image) in zip(many, enumerate(images), strict=True):
        one = calibrate_genetic(points, image, CAMERA, rng=seed, **options)
        assert run.mean_distance == pytest.approx(one.mean_distance, rel=1e-9)
        assert run.camera.focal_length == pytest.approx(one.camera.focal_length, rel=1e-6)
        assert run.residuals[0].shape == image.shape and run.flags == one.flags
    again = repeat_calibration(points, images[0], CAMERA, [0, 1], **options)
    assert again[0].mean_distance == pytest.approx(many[0].mean_distance, rel=1e-9)
    with pytest.raises(ValueError, match="image_points has 10 images for 3 rngs"):
        repeat_calibration(points, images, CAMERA, range(3))


def test_genetic_with_corner_noise_has_the_printed_residual():
    """0.025 px per axis: mean distance 0.031 px on average, f within 0.5 % every time."""
    runs = [calibrate_genetic(*view(noise=0.025, seed=seed), CAMERA, rng=seed) for seed in range(20)]
    distances = np.array([run.mean_distance for run in runs])
    assert distances.mean() == pytest.approx(0.031, abs=0.005)
    assert distances.std() < 0.006  # one view of 48 corners; R, T_x and T_y stay as noisy as stage 1 left them
    assert np.array([run.camera.focal_length for run in runs]) == pytest.approx(np.full(20, 47.95), rel=0.005)


@pytest.mark.parametrize("board", range(5))
def test_genetic_reaches_the_oracle(board):
    points, image_points = view(BOARD, EXPERIMENT.cam_from_boards[board], noise=0.1, seed=board)
    linear = calibrate_tsai(points, image_points, CAMERA)
    best = best_in_box(TwoStageObjective(points, image_points, linear), *box_of(linear))
    found = [calibrate_genetic(points, image_points, CAMERA, rng=seed).mean_distance for seed in range(4)]
    assert max(found) - best < 1e-4
    assert min(found) - best > -1e-6  # the oracle is one
    optimum = optimum_in_box(points, image_points, CAMERA)
    assert -1e-8 < optimum.mean_distance - best < 1e-10  # and the package's is as good, or better by a scan's last step
    assert optimum.mean_distance <= min(found) + 1e-12


def test_genetic_reaches_the_oracle_from_20_seeds():
    points, image_points = view(noise=0.025)
    linear = calibrate_tsai(points, image_points, CAMERA)
    best = best_in_box(TwoStageObjective(points, image_points, linear), *box_of(linear))
    found = [calibrate_genetic(points, image_points, CAMERA, rng=seed).mean_distance for seed in range(20)]
    assert np.max(found) - best < 1e-4


def test_printed_genes_stall_in_the_valley():
    """What the magnification genes are for: the raw (f, T_z) end above the optimum."""
    points, image_points = view()
    printed = [calibrate_genetic(points, image_points, CAMERA, rng=seed, genes="printed") for seed in range(10)]
    assert np.median([run.mean_distance for run in printed]) > 1e-3


def test_the_box_is_a_quarter_of_the_linear_solution():
    points, image_points = view(noise=0.1)
    linear = calibrate_tsai(points, image_points, CAMERA)
    lower, upper = box_of(linear)
    for genes in ("printed", "magnification"):
        run = calibrate_genetic(
            points, image_points, CAMERA, rng=1, genes=genes, population_size=3000, generations=1
        )
        first = run.populations[0]
        assert np.all(first >= lower * (1 - 1e-12)) and np.all(first <= upper * (1 + 1e-12))
        assert first.min(axis=0) == pytest.approx(lower, rel=0.005)
        assert first.max(axis=0) == pytest.approx(upper, rel=0.005)


def test_eq_4_starts_at_the_linear_solution_in_both_codings():
    points, image_points = view(noise=0.1)
    linear = calibrate_tsai(points, image_points, CAMERA)
    for genes in ("printed", "magnification"):
        run = calibrate_genetic(
            points, image_points, CAMERA, rng=1, genes=genes, initialisation="equal", generations=1
        )
        start = [linear.camera.focal_length, linear.cam_from_object[0].translation[2]]
        assert run.populations[0] == pytest.approx(np.tile(start, (60, 1)))


def test_history_and_populations_belong_to_the_result():
    run = calibrate_genetic(*view(noise=0.1), CAMERA, rng=2, generations=30)
    last = run.history.iloc[-1]
    assert len(run.history) == 31 and run.populations.shape == (31, 60, 2)
    assert last["best"] == pytest.approx(run.mean_distance, rel=1e-9)
    assert (last["focal_length"], last["kappa1"]) == (run.camera.focal_length, run.camera.kappa1)
    assert np.array_equal(run.populations[-1, 0], [run.camera.focal_length, run.cam_from_object[0].translation[2]])


def test_residuals_are_projected_minus_measured():
    points, image_points = view(noise=0.1)
    linear, genetic = calibrate_tsai(points, image_points, CAMERA), calibrate_genetic(points, image_points, CAMERA)
    joint = calibrate_joint([points], [image_points], CAMERA, principal_point="fixed")
    for run in (linear, genetic, joint):
        projected = run.camera.project(points, run.cam_from_object[0])
        assert run.residuals[0] == pytest.approx(projected - image_points, abs=1e-8)


def test_genetic_recovers_a_distorted_body():
    camera = replace(CAMERA, scale_x=1.02)
    pose = RigidTransform.from_components([20.0, -10.0, 500.0], Rotation.from_rotvec([0.3, -0.2, 0.5]))
    run = calibrate_genetic(*view(BODY, pose, camera=camera), CAMERA, rng=0)
    assert run.camera.focal_length == pytest.approx(47.95, rel=1e-6)
    assert run.camera.scale_x == pytest.approx(1.02, rel=1e-6)


def test_solution_on_the_edge_of_its_box_is_flagged():
    narrow = calibrate_genetic(*view(), CAMERA, rng=0, box=0.001)
    assert len(narrow.flags) == 1 and "sits on the edge of its box in T_z (box: f 47.97 to" in narrow.flags[0]
    assert "widen the box" in narrow.flags[0]


def stated_intervals(flag):
    """The two intervals of f in the flag of an edge: with the principal point held and free."""
    number = r"([\d.]+) to ([\d.]+) mm"
    found = re.search(f"f is {number} with this principal point, and {number} with the principal point free", flag)
    return np.array(found.groups(), float).reshape(2, 2)


def test_willsons_file_is_flagged(pegpose_data):
    """Linear f 64.9 mm, truth 270 mm: the box does not hold it."""
    data = np.loadtxt(pegpose_data / "willson_coplanar" / "cc_cd.dat")
    camera = TsaiCamera(1.0, (0.023, 0.023), (258, 204), (576, 384))
    run = calibrate_genetic(data[:, :3], data[:, 3:], camera, rng=0)
    assert run.camera.focal_length < 1.25 * 64.93
    assert "sits on the edge" in run.flags[-1] and "profile likelihood" in run.flags[-1]
    held, free = stated_intervals(run.flags[-1])
    assert held[1] < 270 and free[0] < 270 < free[1]


def test_real_single_views_get_the_right_flags(pegpose_data):
    """The box misses one of opencv_left's views, and Zhang's first board is hardly tilted; the others are not flagged."""
    object_points, image_points, (width, height), names = load_corners()
    camera = TsaiCamera(1.0, (1, 1), ((width - 1) / 2, (height - 1) / 2), (width, height))
    runs = [calibrate_genetic(*view, camera, rng=0) for view in zip(object_points, image_points, strict=True)]
    assert [name for name, run in zip(names, runs, strict=True) if run.flags] == ["left06"]
    held, free = stated_intervals(runs[names.index("left06")].flags[0])
    f = calibrate_joint(object_points, image_points, camera).camera.focal_length
    assert f < held[0] and free[0] < f < free[1]
    camera = replace(camera, principal_point=(319.5, 239.5), image_size=(640, 480))
    zhang = [calibrate_genetic(*view, camera, rng=0) for view in zip(*zhang_views(pegpose_data / "zhang_msr_5view"))]
    assert ["trade off" in " ".join(run.flags) for run in zhang] == [True, False, False, False, False]


def test_the_oracle_finds_the_truth_and_flags_the_edge_of_its_box():
    exact = optimum_in_box(*view(), CAMERA)
    assert exact.camera.focal_length == pytest.approx(47.95, rel=1e-8) and exact.mean_distance < 1e-9
    assert exact.camera.kappa1 == pytest.approx(1.097e-5, rel=1e-6) and exact.flags == ()
    narrow = optimum_in_box(*view(), CAMERA, box=1e-5)
    assert any("edge of its box" in flag for flag in narrow.flags)
    with pytest.raises(ValueError, match="box"):
        optimum_in_box(*view(), CAMERA, box=1.5)


@pytest.mark.parametrize(("low", "high", "words"), [
    (40.0, 50.0, "40 to 50 mm"),
    (0.0, np.inf, "not determined"),
    (40.0, np.inf, "not determined, above 40 mm"),
    (0.0, 50.0, "not determined, below 50 mm"),
])
def test_an_interval_that_does_not_end_is_told_in_words(monkeypatch, low, high, words):
    monkeypatch.setattr("pegpose_lab.calibration.two_stage.flags.profile_focal_length", lambda *_, **__: (low, high))
    flag = calibrate_genetic(*view(), CAMERA, rng=0, box=0.001).flags[0]
    assert f"f is {words} with this principal point, and {words} with the principal point free" in flag


def far_view(seed, noise):
    """A board somewhere in the picture, by a lens that may distort so strongly that the linear f is off."""
    rng = np.random.default_rng(seed)
    tilt, axis = rng.uniform(3, 50), rng.uniform(0, 2 * np.pi)
    tilted = Rotation.from_rotvec(np.deg2rad(tilt) * np.array([np.cos(axis), np.sin(axis), 0]))
    rotation = tilted * Rotation.from_rotvec([0, 0, rng.uniform(-3, 3)])
    middle = np.array([*rng.uniform(-120, 120, 2), rng.uniform(330, 700)])
    pose = RigidTransform.from_components(middle - rotation.apply(EXPERIMENT.board.center), rotation)
    camera = replace(CAMERA, kappa1=rng.choice([-1, 1]) * 10 ** rng.uniform(-6, -3.3))
    return view(BOARD, pose, noise, seed, camera)


@pytest.mark.parametrize(("seed", "noise", "edge"), [
    (25, 0.0, "in f (box"), (75, 0.3, "in f (box"), (228, 0.03, "in f (box"), (16, 0.0, "in T_z (box"),
    (192, 0.0, None),
])
def test_nothing_in_the_box_is_better_than_the_oracle(seed, noise, edge):
    """On the box's edges, which an oblique valley meets, and at a truth without noise."""
    points, image_points = far_view(seed, noise)
    optimum = optimum_in_box(points, image_points, CAMERA)
    linear = calibrate_tsai(points, image_points, CAMERA)
    objective, bounds = TwoStageObjective(points, image_points, linear), np.transpose(box_of(linear))
    everywhere = np.stack(np.meshgrid(*(np.linspace(*ends, 400) for ends in bounds)), axis=-1).reshape(-1, 2)
    found = [
        differential_evolution(
            lambda x: objective(x.T), bounds, rng=rng, vectorized=True, updating="deferred", tol=1e-12, maxiter=500,
            polish=False,
        ).fun
        for rng in range(2)
    ]
    assert optimum.mean_distance <= min(objective(everywhere).min(), *found) + 1e-9
    assert optimum.flags == () if edge is None else any(edge in flag for flag in optimum.flags)


def test_corners_of_the_box_are_no_trap(pegpose_data):
    """A view tilted by 6 deg, optimum within the box: clipping f without a penalty ends in its corner at times."""
    points, image_points = (views[0] for views in zhang_views(pegpose_data / "zhang_msr_5view"))
    camera = TsaiCamera(1.0, (1, 1), (319.5, 239.5), (640, 480))
    found = [calibrate_genetic(points, image_points, camera, rng=seed).mean_distance for seed in range(12)]
    assert np.ptp(found) < 1e-6


# --- many views ----------------------------------------------------------------------------------------


def test_joint_without_noise_is_exact():
    run = calibrate_joint(*five_views(0.0), CAMERA)
    assert run.camera.focal_length == pytest.approx(47.95, rel=1e-9)
    assert run.camera.kappa1 == pytest.approx(1.097e-5, rel=1e-6)
    assert run.camera.principal_point == pytest.approx((799.5, 599.5), abs=1e-5)
    assert run.rms < 1e-7
    for found, truth in zip(run.cam_from_object, EXPERIMENT.cam_from_boards, strict=True):
        assert (found.inv() * truth).as_matrix() == pytest.approx(np.eye(4), abs=1e-6)


@pytest.mark.parametrize("principal_point", ["free", "fixed"])
def test_joint_ends_at_the_noise_floor_with_honest_sigmas(principal_point):
    sigma, ratios, errors = 0.1, [], []
    for seed in range(40):
        run = calibrate_joint(*five_views(sigma, seed), CAMERA, principal_point=principal_point)
        parameters, coordinates = len(run.covariance), 2 * 5 * 48
        ratios.append(run.rms / (sigma * np.sqrt(2 * (1 - parameters / coordinates))))
        truth = {"focal_length": 47.95, "kappa1": 1.097e-5, "c_x": 799.5, "c_y": 599.5, "tx_0": None, "rz_3": None}
        found = {"focal_length": run.camera.focal_length, "kappa1": run.camera.kappa1}
        found |= dict(zip(("c_x", "c_y"), run.camera.principal_point, strict=True))
        names = [name for name in ("focal_length", "kappa1", "c_x", "c_y") if name in run.covariance]
        truth |= {"tx_0": EXPERIMENT.cam_from_boards[0].translation[0], "rz_3": 0.0}
        turn = run.cam_from_object[3].rotation * EXPERIMENT.cam_from_boards[3].rotation.inv()
        found |= {"tx_0": run.cam_from_object[0].translation[0], "rz_3": turn.as_rotvec()[2]}
        errors.append([(found[name] - truth[name]) / run.sigma(name) for name in [*names, "tx_0", "rz_3"]])
    assert np.mean(ratios) == pytest.approx(1, abs=0.02)
    assert np.std(ratios) == pytest.approx(1 / np.sqrt(2 * (coordinates - parameters)), rel=0.35)
    assert np.sqrt(np.mean(np.square(errors), axis=0)) == pytest.approx(np.ones(len(errors[0])), abs=0.35)


def test_joint_and_zhang_agree_on_the_same_model():
    """Hardly any distortion: Eq. 3 and OpenCV's k1 are the same then."""
    views = five_views(0.05)
    joint, zhang = calibrate_joint(*views, CAMERA), calibrate_zhang(*views, CAMERA.image_size, radial=1)
    assert zhang.camera.camera_matrix[0, 0] * CAMERA.pixel_pitch[0] == pytest.approx(
        joint.camera.focal_length, abs=3 * joint.sigma("focal_length")
    )
    assert zhang.camera.camera_matrix[:2, 2] == pytest.approx(joint.camera.principal_point, abs=0.5)
    assert zhang.camera.dist_coeffs[0] == pytest.approx(-1.097e-5 * 47.95**2, rel=0.1)
    assert zhang.sigma("c_x") == pytest.approx(joint.sigma("c_x"), rel=0.1)
    assert zhang.sigma("rx_2") == pytest.approx(joint.sigma("rx_2"), rel=0.2)


def test_joint_survives_strong_distortion_and_a_far_start():
    camera = replace(CAMERA, kappa1=4e-4, principal_point=(780.0, 620.0))
    image_points = [camera.project(BOARD, pose) for pose in EXPERIMENT.cam_from_boards]
    for start in (CAMERA, replace(CAMERA, focal_length=500.0)):
        run = calibrate_joint([BOARD] * 5, image_points, start)
        assert run.camera.focal_length == pytest.approx(47.95, rel=1e-7)
        assert run.camera.kappa1 == pytest.approx(4e-4, rel=1e-6)


def test_the_order_of_arrays_in_memory_does_not_matter():
    points, image_points = five_views(0.1)
    fortran = [np.asfortranarray(array) for array in points], [np.asfortranarray(array) for array in image_points]
    for method, setting in ((calibrate_joint, CAMERA), (calibrate_zhang, CAMERA.image_size)):
        assert method(*fortran, setting).rms == pytest.approx(method(points, image_points, setting).rms, rel=1e-9)


def test_zhangs_published_result(pegpose_data):
    run = calibrate_zhang(*zhang_views(pegpose_data / "zhang_msr_5view"), (640, 480))
    matrix = run.camera.camera_matrix
    found = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
    assert found == pytest.approx([832.5, 832.53, 303.959, 206.585], abs=0.5)
    assert run.camera.dist_coeffs[:2] == pytest.approx([-0.228601, 0.190353], abs=0.002)
    assert np.all(run.camera.dist_coeffs[2:] == 0)


@pytest.mark.parametrize("points", ["subpix5", "subpix11"])
def test_opencv_left_has_the_reference_residuals(pegpose_data, points):
    folder = pegpose_data / "opencv_left"
    views = table_views(folder / f"points_cv2_{points}.csv")
    reference = json.loads((folder / "reference.json").read_text())[points]["cv2_4.14.0"]["configs"]
    for name, options in {
        "k1_ppfree": {"radial": 1},
        "k1k2": {},
        "k1k2p1p2": {"tangential": True},
        "default_5": {"radial": 3, "tangential": True},
    }.items():
        run = calibrate_zhang(*views, (640, 480), **options)
        assert run.rms == pytest.approx(reference[name]["rms_cv2"], abs=2e-5)
        assert run.camera.camera_matrix[0, 0] == pytest.approx(reference[name]["fx"], abs=0.02)
        stated = [run.sigma(parameter) for parameter in ("f_x", "f_y", "c_x", "c_y", "k1")]
        assert stated == pytest.approx(reference[name]["sd_fx_fy_cx_cy_k1"], rel=0.01)


def test_joint_on_real_views_is_where_opencv_is(pegpose_data):
    """f = f_x = f_y and one coefficient: OpenCV's with the same freedom, but for the distortion's direction."""
    folder = pegpose_data / "opencv_left"
    views = table_views(folder / "points_cv2_subpix5.csv")
    reference = json.loads((folder / "reference.json").read_text())["subpix5"]["cv2_4.14.0"]["configs"]
    run = calibrate_joint(*views, TsaiCamera(1.0, (1, 1), (319.5, 239.5), (640, 480)))
    assert run.rms < reference["k1_ppfree_fxeqfy"]["rms_cv2"] + 1e-4
    assert run.camera.focal_length == pytest.approx(reference["k1k2"]["fx"], abs=2.0)


def test_willsons_full_optimisation(pegpose_data):
    """One view, principal point free: not above the sum of squares at which Willson's program stops."""
    data = np.loadtxt(pegpose_data / "willson_coplanar" / "cc_cd.dat")
    camera = TsaiCamera(1.0, (0.023, 0.023), (258, 204), (576, 384))
    reference = json.loads((pegpose_data / "willson_coplanar" / "reference.json").read_text())
    full = reference["rebuilt_same_source_gcc_Cx258_Cy204"]["full"]
    run = calibrate_joint([data[:, :3]], [data[:, 3:]], camera)
    assert np.sum(run.residuals[0] ** 2) <= full["err_dist_px"]["sse"] + 1e-6
    assert run.camera.focal_length == pytest.approx(full["f"], abs=0.1 * run.sigma("focal_length"))
    assert run.camera.principal_point == pytest.approx((full["Cx"], full["Cy"]), abs=0.1)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_fronto_parallel_sets_are_refused(noise):
    views = fronto_parallel(noise)
    with pytest.raises(CalibrationError, match="straight ahead"):
        calibrate_joint(*views, CAMERA)
    for method in (calibrate_tsai, calibrate_genetic):
        with pytest.raises(CalibrationError, match="straight ahead"):
            method(views[0][0], views[1][0], CAMERA)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_zhang_refuses_or_flags_views_of_one_tilt(noise):
    for seed in range(5):
        try:
            run = calibrate_zhang(*fronto_parallel(noise, seed), CAMERA.image_size)
        except CalibrationError as error:
            assert "tilt" in str(error)
        else:
            assert "hardly determine f" in run.flags[0]


def test_one_view_is_not_enough_for_zhang():
    with pytest.raises(CalibrationError, match="one view"):
        calibrate_zhang([BOARD], [view()[1]], CAMERA.image_size)


# --- what a calibration says ---------------------------------------------------------------------------


def test_error_definitions():
    residuals = [np.array([[3.0, 4.0], [0.0, 0.0]]), np.array([[-3.0, 0.0]])]
    calibration = Calibration(CAMERA, [paper_pose()] * 2, residuals)
    assert calibration.mean_distance == pytest.approx(8 / 3)
    assert calibration.rms == pytest.approx(np.sqrt(34 / 3))
    assert calibration.axis_std == pytest.approx([3.0, np.sqrt(16 / 3)])


@pytest.mark.parametrize("method", ["tsai", "genetic", "joint", "zhang"])
def test_saved_calibrations_come_back(tmp_path, method):
    run = {
        "tsai": lambda: calibrate_tsai(*view(noise=0.1), CAMERA),
        "genetic": lambda: calibrate_genetic(*view(noise=0.1), CAMERA, rng=0, box=0.001, generations=3),
        "joint": lambda: calibrate_joint(*five_views(0.1), CAMERA),
        "zhang": lambda: calibrate_zhang(*five_views(0.1), CAMERA.image_size),
    }[method]()
    run.save(tmp_path / "camera.yml")
    back = Calibration.load(tmp_path / "camera.yml")
    assert back.flags == run.flags and len(back.cam_from_object) == len(run.cam_from_object)
    assert type(back.camera) is type(run.camera)
    for ours, theirs in zip(run.cam_from_object, back.cam_from_object, strict=True):
        assert theirs.as_matrix() == pytest.approx(ours.as_matrix(), rel=1e-12, abs=1e-12)
        points = BOARD if method in ("joint", "zhang") else WORLD_BOARD
        assert back.camera.project(points, theirs) == pytest.approx(run.camera.project(points, ours), abs=1e-8)
    for ours, theirs in zip(run.residuals, back.residuals, strict=True):
        assert np.array_equal(ours, theirs)
    for name in ("history", "covariance"):
        ours, theirs = getattr(run, name), getattr(back, name)
        assert (ours is None) == (theirs is None)
        if ours is not None:
            pd.testing.assert_frame_equal(ours, theirs, check_exact=True, check_names=False)
    assert [path.name for path in tmp_path.iterdir()] == ["camera.yml"]


@pytest.mark.parametrize(
    "flags",
    [
        ("trail ", " lead", " ", "", "  "), ("a" * 5000, "b"), ("95 % interval", "100%", "%25", "%", "%%", "50 %ab"),
        ('He said: "no"', '"', "a\\", "'", "it's"),
        ("line 1\nline 2", "tab\t", "\x00", "\x1b"), ("ünï €", "\udc80"),
        ("- a", "~", "12", "# no", "%YAML", "[1, 2]", "a: b", "!!x"), (("é %" * 1500), " " * 2500, "%" * 1200),
    ],
)
def test_any_flag_comes_back(tmp_path, flags):
    Calibration(CAMERA, [paper_pose()], [np.ones((3, 2))], flags).save(tmp_path / "camera.yml")
    assert Calibration.load(tmp_path / "camera.yml").flags == flags


def test_what_there_is_of_a_calibration_is_saved(tmp_path):
    """A camera alone, as a ROS file gives it, and poses without residuals."""
    calibrate_tsai(*view(), CAMERA).save(tmp_path / "camera.yaml", form="ros")
    Calibration.load(tmp_path / "camera.yaml").save(tmp_path / "camera.yml")
    again = Calibration.load(tmp_path / "camera.yml")
    assert again.residuals == [] and again.cam_from_object == [] and again.camera.image_size == CAMERA.image_size
    Calibration(CAMERA, [paper_pose()], []).save(tmp_path / "camera.yml")
    again = Calibration.load(tmp_path / "camera.yml")
    assert again.cam_from_object[0].as_matrix() == pytest.approx(paper_pose().as_matrix()) and again.residuals == []


def test_opencvs_own_calibration_files_give_the_camera(tmp_path, pegpose_data):
    found = Calibration.load(pegpose_data / "opencv_left" / "left_intrinsics.yml")
    assert found.camera.image_size == (640, 480) and found.residuals == [] and found.flags == ()
    assert found.camera.camera_matrix[:2, 2] == pytest.approx([342.28315473308373, 235.57082909788173], rel=1e-15)
    assert found.camera.dist_coeffs[[0, 4]] == pytest.approx([-0.26637260909660682, 0.23839153080878486], rel=1e-15)
    text = (pegpose_data / "opencv_left" / "left_intrinsics.yml").read_text()
    damages = ("flags: 2", "fisheye_model: 1"), ("image_width: 640", "image_width: 640.5"), ("cols: 1", "cols: 2")
    for old, new in damages:
        (tmp_path / "bad.yml").write_text(text.replace(old, new, 1))
        with pytest.raises(ValueError, match=r"bad\.yml"):
            Calibration.load(tmp_path / "bad.yml")


@pytest.mark.parametrize("count", [3, 4, 5, 8, 12])
@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_ros_models_have_their_number_of_coefficients(tmp_path, model, count):
    calibrate_tsai(*view(), CAMERA).save(tmp_path / "camera.yaml", form="ros")
    info = yaml.safe_load((tmp_path / "camera.yaml").read_text())
    info |= {"distortion_model": model, "distortion_coefficients": {"rows": 1, "cols": count, "data": [0.0] * count}}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(info))
    if (model, count) in (("plumb_bob", 4), ("plumb_bob", 5), ("rational_polynomial", 8)):
        assert Calibration.load(tmp_path / "camera.yaml").camera.dist_coeffs.size == count
    else:
        with pytest.raises(ValueError, match=r"camera\.yaml"):
            Calibration.load(tmp_path / "camera.yaml")


@pytest.mark.parametrize("counts", ["-3., 99.", "1e9, 48.", "47.5, 48.5", "0., 96.", "48., 47.", "96."])
def test_a_wrong_number_of_points_is_refused(tmp_path, counts):
    Calibration(CAMERA, [paper_pose()] * 2, [np.ones((48, 2))] * 2).save(tmp_path / "camera.yml")
    text = (tmp_path / "camera.yml").read_text()
    assert "data: [ 48., 48. ]" in text
    text = text.replace("data: [ 48., 48. ]", f"data: [ {counts} ]")
    one_count = "cols: {}\n   dt: d\n   data: [ 96"
    (tmp_path / "bad.yml").write_text(text.replace(one_count.format(2), one_count.format(1)))
    with pytest.raises(ValueError, match=r"bad\.yml"):
        Calibration.load(tmp_path / "bad.yml")


def test_opencv_can_read_a_saved_camera(tmp_path):
    run = calibrate_genetic(*view(), CAMERA, rng=0)
    run.save(tmp_path / "camera.yml")
    storage = cv2.FileStorage(str(tmp_path / "camera.yml"), cv2.FileStorage_READ)
    matrix, coefficients = (storage.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients"))
    pose = storage.getNode("extrinsic_parameters").mat()[0]
    points = np.ascontiguousarray(WORLD_BOARD)
    projected = cv2.projectPoints(points, pose[:3], pose[3:], matrix, coefficients)[0].reshape(-1, 2)
    assert projected == pytest.approx(CAMERA.project(WORLD_BOARD, paper_pose()), abs=1e-4)


@pytest.mark.parametrize("method", ["tsai", "zhang"])
def test_ros_camera_info_comes_back(tmp_path, method):
    run = calibrate_tsai(*view(noise=0.1), CAMERA) if method == "tsai" else calibrate_zhang(
        *five_views(0.1), CAMERA.image_size, radial=3, tangential=True
    )
    run.save(tmp_path / "camera.yaml", form="ros")
    info = yaml.safe_load((tmp_path / "camera.yaml").read_text())
    assert (info["image_width"], info["image_height"]) == CAMERA.image_size
    assert info["distortion_model"] == "plumb_bob" and info["projection_matrix"]["cols"] == 4
    back = Calibration.load(tmp_path / "camera.yaml")
    pose = EXPERIMENT.cam_from_boards[1]
    assert back.camera.project(BOARD, pose) == pytest.approx(run.camera.project(BOARD, pose), abs=1e-3)
    with pytest.raises(ValueError, match="no residuals"):
        back.rms  # noqa: B018


def test_a_form_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(ValueError, match="form"):
        calibrate_tsai(*view(), CAMERA).save(tmp_path / "camera.json", form="json")
    assert not list(tmp_path.iterdir())


def test_loading_executes_nothing(tmp_path):
    marker = tmp_path / "executed"
    text = f"!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{marker}']]"
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(ValueError, match="bad.yaml"):
        Calibration.load(tmp_path / "bad.yaml")
    assert not marker.exists()


def test_an_interrupted_save_leaves_the_old_file(tmp_path, monkeypatch):
    run = calibrate_tsai(*view(), CAMERA)
    run.save(tmp_path / "camera.yml")
    before = (tmp_path / "camera.yml").read_bytes()

    def full_disk(*_args, **_options):
        raise OSError("no space left")

    monkeypatch.setattr("pathlib.Path.write_text", full_disk)
    with pytest.raises(OSError, match="no space"):
        run.save(tmp_path / "camera.yml")
    assert (tmp_path / "camera.yml").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hello",
        "%YAML:1.0\n---\nfoo: [1,",
        "%YAML:1.0\n---\nformat: other\n",
        "\0\1\2",
        "!!python/object/apply:os.system",
        "[" * 3000,
        "%YAML:1.0\n---\nformat: " + "[" * 3000,
    ],
)
def test_files_that_are_no_calibration_are_refused(tmp_path, text):
    (tmp_path / "bad.yml").write_text(text)
    with pytest.raises(ValueError, match=r"bad\.yml|format"):
        Calibration.load(tmp_path / "bad.yml")


def test_damaged_files_are_refused(tmp_path):
    calibrate_joint(*five_views(0.1), CAMERA).save(tmp_path / "good.yml")
    lines = (tmp_path / "good.yml").read_text().splitlines(keepends=True)
    tops = [index for index, line in enumerate(lines) if line[0].isalpha()]
    required = ("format", "camera_model", "image_width", "image_height", "focal_length", "kappa1", "scale_x",
                "pixel_pitch", "principal_point", "extrinsic_parameters", "points_per_view", "residuals")
    for start, end in zip(tops, [*tops[1:], len(lines)], strict=True):
        name = lines[start].split(":")[0]
        for damaged in (lines[:start] + lines[end:], [*lines[:start], f"{name}: nonsense\n", *lines[end:]]):
            if name in required:
                (tmp_path / "bad.yml").write_text("".join(damaged))
                with pytest.raises(ValueError, match=r"bad\.yml|format"):
                    Calibration.load(tmp_path / "bad.yml")


# --- unusable input ------------------------------------------------------------------------------------


POINTS, IMAGE = view()
SIX = [0, 7, 18, 29, 40, 47]
LINE = np.column_stack([np.arange(48.0), 2 * np.arange(48.0), np.zeros(48)])


@pytest.mark.parametrize("method", [calibrate_tsai, calibrate_genetic])
@pytest.mark.parametrize(
    ("points", "image", "camera", "named"),
    [
        ([], [], CAMERA, "object_points"),
        (POINTS[:4], IMAGE[:4], CAMERA, "n >= 5"),
        (POINTS[:, :2], IMAGE, CAMERA, "object_points"),
        (POINTS, IMAGE[:-1], CAMERA, "one image point for each"),
        (POINTS, np.full((48, 2), np.nan), CAMERA, "image_points.*NaN"),
        (POINTS, "corners", CAMERA, "image_points"),
        (LINE, IMAGE, CAMERA, "one line"),
        (POINTS, LINE[:, :2], CAMERA, "one line"),
        (POINTS, IMAGE, None, "camera"),
        (POINTS, IMAGE, CAMERA.to_opencv(), "camera"),
        (POINTS[SIX] + np.outer([0, 40, 0, 0, 40, 0], [0, 0, 1.0]), IMAGE[SIX], CAMERA, "n >= 7"),
    ],
)
def test_unusable_views_are_named(method, points, image, camera, named):
    with pytest.raises(ValueError, match=named):
        method(points, image, camera)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"box": 0}, "box"),
        ({"box": 1}, "box"),
        ({"kappa1": "none"}, "kappa1"),
        ({"genes": "none"}, "genes"),
        ({"population_size": 0}, "population_size"),
    ],
)
def test_unusable_options_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        calibrate_genetic(POINTS, IMAGE, CAMERA, **options)


def test_swapped_axes_are_no_silent_success():
    """y measured upwards is a mirrored picture: no camera sees that, so the residual must be large or refused."""
    mirrored = IMAGE * [1, -1] + [0, 1199]
    try:
        run = calibrate_genetic(POINTS, mirrored, CAMERA, rng=0)
    except CalibrationError:
        return
    assert run.cam_from_object[0].rotation.as_matrix()[2, 2] < 0  # the board would be seen from behind


@pytest.mark.parametrize(
    ("points", "image", "named"),
    [
        ([], [], "object_points"),
        (POINTS, IMAGE, "object_points"),
        ([BOARD] * 2, [IMAGE], "2 views and image_points 1"),
        ([BOARD] * 2, [IMAGE, IMAGE[:-1]], "one image point for each"),
        ([BOARD] * 2, [IMAGE, np.full((48, 2), np.inf)], "image_points"),
        ([LINE] * 2, [IMAGE] * 2, "one line"),
        ("views", [IMAGE], "object_points"),
        ([BOARD], 3, "image_points"),
    ],
)
def test_unusable_lists_are_named(points, image, named):
    with pytest.raises(ValueError, match=named):
        calibrate_joint(points, image, CAMERA)
    with pytest.raises(ValueError, match=named):
        calibrate_zhang(points, image, CAMERA.image_size)


def test_unusable_options_of_many_views_are_named():
    views = five_views(0.0)
    with pytest.raises(ValueError, match="principal_point"):
        calibrate_joint(*views, CAMERA, principal_point="centre")
    with pytest.raises(ValueError, match="camera"):
        calibrate_joint(*views, CAMERA.to_opencv())
    with pytest.raises(ValueError, match="radial"):
        calibrate_zhang(*views, CAMERA.image_size, radial=4)
    with pytest.raises(ValueError, match="image_size"):
        calibrate_zhang(*views, (0, 1200))
    bowl = BOARD + (np.sum((BOARD - BOARD.mean(axis=0)) ** 2, axis=1) / 500)[:, None] * [0, 0, 1.0]
    with pytest.raises(ValueError, match=r"object_points\[1\] leave the plane"):
        calibrate_zhang([BOARD, bowl, *[BOARD] * 3], views[1], CAMERA.image_size)
    with pytest.raises(ValueError, match="name"):
        calibrate_joint(*views, CAMERA).sigma("k9")
    with pytest.raises(ValueError, match="no covariance"):
        calibrate_tsai(*view(), CAMERA).sigma("focal_length")


@pytest.mark.parametrize("calibrate", [
    lambda boards, images: calibrate_joint(boards, images, CAMERA),
    lambda boards, images: calibrate_zhang(boards, images, CAMERA.image_size),
    lambda boards, images: calibrate_tsai(boards[0], images[0], CAMERA),
])
def test_rows_and_columns_mixed_up_are_told(calibrate):
    boards, images = five_views(0.1)
    with pytest.raises(CalibrationError, match="order of object_points.*columns and rows"):
        calibrate([Checkerboard(6, 8, 29.0).object_points] * len(boards), images)


def test_the_view_in_another_order_is_named():
    boards, images = five_views(0.1)
    images[3] = images[3].reshape(6, 8, 2).transpose(1, 0, 2).reshape(-1, 2)
    with pytest.raises(CalibrationError, match="points of view 3 are no image of the plane"):
        calibrate_joint(boards, images, CAMERA)


def test_a_wrong_image_size_is_told():
    boards, images = five_views(0.1)
    with pytest.raises(ValueError, match=r"image_points\[0\] reach from .* all outside of the image of width 100"):
        calibrate_zhang(boards, images, (100, 80))
    assert any("swapped" in flag for flag in calibrate_zhang(boards, images, CAMERA.image_size[::-1]).flags)
    cut = calibrate_joint(boards, images, replace(CAMERA, image_size=(1000, 760))).flags
    assert any("lie outside of the image of 1000 x 760 px" in flag for flag in cut)
    assert calibrate_zhang(boards, images, CAMERA.image_size).flags == ()
    assert calibrate_joint(boards, images, replace(CAMERA, image_size=(1, 1))).flags[1:] == ()


@pytest.mark.parametrize("options", [
    {}, {"loss": "huber"}, {"coefficients": ("k1", "k2", "p1", "p2", "k3"), "focal": "two"},
])
def test_folded_lenses_raise_no_linalgerror(options):
    """k1 = -0.4 at f = 500 px folds the image at 0.9 focal lengths from its centre; boards reach beyond."""
    camera, answered = OpenCVCamera([[500, 0, 799.5], [0, 500, 599.5], [0, 0, 1]], [-0.4, 0, 0, 0], (1600, 1200)), 0
    for seed in (0, *range(30, 40)):
        rng, images = np.random.default_rng(seed), []
        while len(images) < 7:
            turn = Rotation.from_rotvec(rng.normal(0, 0.45, 3))
            middle = np.array([rng.uniform(-110, 110), rng.uniform(-80, 80), rng.uniform(120, 300)])
            pose = RigidTransform.from_components(middle - turn.apply(BOARD.mean(axis=0)), turn)
            if pose.apply(BOARD)[:, 2].min() > 20:
                images.append(camera.project(BOARD, pose) + rng.normal(0, 0.1, (48, 2)))
        try:
            calibrate_joint([BOARD] * 7, images, replace(CAMERA, principal_point=(799.5, 599.5)), **options)
        except (CalibrationError, ValueError):
            continue
        answered += 1
    assert answered
