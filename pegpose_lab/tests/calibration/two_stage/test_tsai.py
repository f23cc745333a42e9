"""Stage 1: known cameras recovered, the 1995 log of Tsai's reference program reproduced, each guard tried."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import CalibrationError, Checkerboard, TsaiCamera
from pegpose_lab.calibration.two_stage import tsai
from pegpose_lab.calibration.two_stage.estimate import _sign_of_ty, _solve_ratios
from pegpose_lab.calibration.two_stage.tsai import solve_coplanar, solve_noncoplanar
from pegpose_lab.paper import paper_camera, paper_experiment, paper_pose

PIN_HOLE = replace(paper_camera(), kappa1=0.0)
BOARD = Checkerboard().object_points - Checkerboard().center


def world_board():
    return paper_experiment().world_from_board.apply(Checkerboard().object_points)


def sensor(camera, points, pose, noise=0.0, seed=0):
    noise = noise * np.random.default_rng(seed).standard_normal((len(points), 2))
    return camera.to_sensor(camera.project(points, pose) + noise)


def tilted(tilt, about=0.0, roll=0.0, position=(0.0, 0.0, 400.0)):
    """Pose whose z axis leans by `tilt` degrees, the board's middle at `position`."""
    axis = [np.cos(np.radians(about)), np.sin(np.radians(about)), 0]
    rotation = Rotation.from_rotvec(np.radians(tilt) * np.array(axis)) * Rotation.from_rotvec([0, 0, np.radians(roll)])
    return RigidTransform.from_components(position, rotation)


def body(seed=0):
    return np.random.default_rng(seed).uniform(-80, 80, (30, 3))


def angle(solution, pose):
    return (solution.rotation * pose.rotation.inv()).magnitude()


def test_1995_log_of_the_reference_program(pegpose_data):
    """R, T_x, T_y of Willson's run to the last printed digit, and the linear f of the README."""
    data = np.loadtxt(pegpose_data / "willson_coplanar" / "cc_cd.dat")
    camera = TsaiCamera(1.0, (0.023, 0.023), (258, 204), (576, 384))
    solution = solve_coplanar(data[:, :3], camera.to_sensor(data[:, 3:]))
    printed = [[0.034658, -0.937689, 0.345743], [0.995289, 0.063727, 0.073063], [-0.090543, 0.341582, 0.935481]]
    assert np.array_equal(np.round(solution.rotation.as_matrix(), 6), printed)
    assert np.array_equal(np.round(solution.translation[:2], 6), [152.194102, -70.609515])
    assert round(solution.focal_length, 1) == 64.9
    assert solution.translation[2] == pytest.approx(1545.1604, abs=1e-4)


def test_paper_camera_without_distortion_is_recovered():
    """Table 1's pose, whose world origin lies 1.2 m off the axis."""
    points = world_board()
    solution = solve_coplanar(points, sensor(PIN_HOLE, points, paper_pose()))
    assert solution.focal_length == pytest.approx(47.95, rel=1e-9)
    assert solution.translation == pytest.approx([-945.2, 663.51, 267.38], rel=1e-9)
    assert angle(solution, paper_pose()) < 1e-10
    assert solution.tilt == pytest.approx(11.873, abs=1e-3) and solution.flags == ()


def test_distortion_changes_neither_rotation_nor_tx_ty():
    points = world_board()
    solution = solve_coplanar(points, sensor(paper_camera(), points, paper_pose()))
    assert solution.translation[:2] == pytest.approx([-945.2, 663.51], rel=1e-9)
    assert angle(solution, paper_pose()) < 1e-10
    assert solution.focal_length == pytest.approx(48.02, abs=0.005)  # f does change: it neglects distortion


@given(*[st.floats(*limits) for limits in ((3, 60), (0, 360), (0, 360), (-60, 60), (-60, 60), (-300, 300))])
def test_any_tilted_plane_is_recovered(tilt, about, roll, x, y, z):
    pose = tilted(tilt, about, roll, (x, y, 600.0)) * RigidTransform.from_translation([0, 0, -z])
    points = BOARD + [0, 0, z]
    solution = solve_coplanar(points, sensor(PIN_HOLE, points, pose))
    assert solution.focal_length == pytest.approx(47.95, rel=1e-7)
    assert solution.translation == pytest.approx(pose.translation, abs=1e-4)
    assert angle(solution, pose) < 1e-8


@given(st.integers(0, 10**6), st.floats(0.9, 1.1))
def test_any_body_is_recovered_with_its_horizontal_scale(seed, scale_x):
    rng = np.random.default_rng(seed)
    pose = RigidTransform.from_components([*rng.uniform(-40, 40, 2), 700.0], Rotation.random(rng=rng))
    points = body(seed)
    solution = solve_noncoplanar(points, sensor(PIN_HOLE, points, pose) * [scale_x, 1])
    assert solution.focal_length == pytest.approx(47.95, rel=1e-6)
    assert solution.scale_x == pytest.approx(scale_x, rel=1e-6)
    assert solution.translation == pytest.approx(pose.translation, abs=1e-4)
    assert angle(solution, pose) < 1e-7
    assert solution.flags == ()


@pytest.mark.parametrize("y", [0.0, 1e-9, -1e-4, 0.5])
def test_origin_on_the_cameras_x_axis(y):
    """T_y = 0: the origin is moved and moved back, for planes and bodies."""
    pose = tilted(25, 30, 10, (20.0, y, 500.0))
    plane = solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, pose))
    solid = solve_noncoplanar(body(), sensor(PIN_HOLE, body(), pose))
    for solution in (plane, solid):
        assert solution.focal_length == pytest.approx(47.95, rel=1e-8)
        assert solution.translation == pytest.approx(pose.translation, abs=1e-6)


def errors_of_f(images, origin):
    """Relative errors of f with the world's origin elsewhere, infinite where refused."""
    errors = []
    for image in images:
        try:
            errors.append(abs(solve_coplanar(world_board() - origin, image).focal_length / 47.95 - 1))
        except CalibrationError:
            errors.append(np.inf)
    return np.array(errors)


@pytest.mark.parametrize("ty", [0.0, 0.03, -10.0])
def test_the_origin_s_place_costs_no_accuracy(monkeypatch, ty):
    """Without the guard, T_y = 0 loses many trials and T_y = 0.03 mm accuracy; with it f is the same wherever it lies."""
    images = [sensor(PIN_HOLE, world_board(), paper_pose(), 0.1, [41, trial]) for trial in range(100)]
    origin = [*np.linalg.solve(paper_pose().rotation.as_matrix()[:2, :2], [60, ty] - paper_pose().translation[:2]), 0]
    assert np.percentile(errors_of_f(images, origin), 90) == pytest.approx(0.0070, abs=0.0003)
    monkeypatch.setattr(tsai, "SMALLEST_TY", 0.0)
    unguarded = errors_of_f(images, origin)
    if ty == 0:
        assert np.mean(np.isinf(unguarded)) > 0.1
    else:
        bound = np.percentile(unguarded, 90)
        assert bound > 0.015 if ty == 0.03 else bound < 1.25 * 0.0070


def test_a_zero_in_r3_or_r6_keeps_all_digits():
    """Tilts about the camera's own axes: the square root of what should be 0 would leave 1e-8."""
    for about in (0, 90):
        pose = tilted(3, about, 0, (5.0, 10.0, 600.0))
        solution = solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, pose))
        assert angle(solution, pose) < 1e-11
        assert solution.focal_length == pytest.approx(47.95, rel=1e-9)


def test_small_d_is_no_cancellation():
    """A plane seen nearly edge-on: D = r9 / T_y^2 is small; the stable form of T_y^2 keeps its digits."""
    pose = tilted(89.9, 0, 0, (10.0, 30.0, 900.0))
    solution = solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, pose))
    assert solution.translation == pytest.approx(pose.translation, rel=1e-6)


@pytest.mark.parametrize("ty", [60.0, -60.0])
def test_sign_of_ty_is_a_vote(ty):
    """The farthest point measured on the wrong side does not turn the camera round."""
    pose = tilted(30, 20, 0, (40.0, ty, 500.0))
    measured = sensor(PIN_HOLE, BOARD, pose)
    ratios = _solve_ratios(BOARD[:, :2], measured)
    measured[np.argmax(np.linalg.norm(measured, axis=1))] *= -1
    assert _sign_of_ty(BOARD[:, :2], measured, ratios) == np.sign(ty)


def test_rotation_is_a_rotation_under_noise():
    for seed in range(20):
        plane = solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, tilted(30, 40, 5, (10, 20, 500)), 0.5, seed))
        solid = solve_noncoplanar(body(), sensor(PIN_HOLE, body(), tilted(30, 40, 5, (10, 20, 500)), 0.5, seed))
        for solution in (plane, solid):
            matrix = solution.rotation.as_matrix()
            assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
            assert np.linalg.det(matrix) == pytest.approx(1)


@pytest.mark.parametrize("tilt", [12.0, 30.0])
def test_stated_sigma_of_f_is_the_scatter_of_f(tilt):
    pose = tilted(tilt, 35, 0, (15.0, -25.0, 450.0))
    runs = [solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, pose, 0.1, seed)) for seed in range(200)]
    errors = np.array([run.focal_length for run in runs]) - 47.95
    stated = np.array([run.focal_length_sigma for run in runs])
    assert np.mean(np.abs(errors) < 1.96 * stated) == pytest.approx(0.95, abs=0.045)
    assert stated.mean() == pytest.approx(errors.std(), rel=0.2)


def test_sigma_of_f_of_a_body():
    pose = tilted(20, 35, 0, (15.0, -25.0, 450.0))
    runs = [solve_noncoplanar(body(), sensor(PIN_HOLE, body(), pose, 0.1, seed)) for seed in range(100)]
    errors = np.array([run.focal_length for run in runs]) - 47.95
    assert np.mean([run.focal_length_sigma for run in runs]) == pytest.approx(errors.std(), rel=0.25)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.025, 0.3])
def test_a_fronto_parallel_plane_is_refused(noise):
    for seed in range(20):
        pose = tilted(0, 0, 17 * seed, (30.0, 20.0, 400.0))
        with pytest.raises(CalibrationError, match="straight ahead.*tilt the board"):
            solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, pose, noise, seed))


def test_a_small_tilt_is_flagged_with_an_interval_and_a_large_one_is_not():
    small = solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, tilted(6), 0.05))
    assert [flag.code for flag in small.flags] == ["little-tilt"]
    assert "tilted by only 5.9 deg" in small.flags[0] and "interval" in small.flags[0]
    assert solve_coplanar(BOARD, sensor(PIN_HOLE, BOARD, tilted(12), 0.05)).flags == ()


def test_mirrored_order_of_a_body_is_refused():
    pose = tilted(20, 35, 0, (15.0, -25.0, 450.0))
    with pytest.raises(CalibrationError, match="right-handed"):
        solve_noncoplanar(body() * [1, 1, -1], sensor(PIN_HOLE, body(), pose))


LINE = np.column_stack([np.arange(8.0), 2 * np.arange(8.0), np.zeros(8)])


@pytest.mark.parametrize(
    ("solve", "points", "image", "named"),
    [
        (solve_coplanar, [], [], "object_points"),
        (solve_coplanar, BOARD[:4], BOARD[:4, :2], "n >= 5"),
        (solve_noncoplanar, body()[:6], body()[:6, :2], "n >= 7"),
        (solve_coplanar, BOARD, BOARD[:-1, :2], "one image point for each"),
        (solve_coplanar, BOARD[:, :2], BOARD[:, :2], "object_points"),
        (solve_coplanar, BOARD, BOARD, "image_points"),
        (solve_coplanar, "points", BOARD[:, :2], "object_points"),
        (solve_coplanar, np.where(BOARD[3] == BOARD, np.nan, BOARD), BOARD[:, :2], "NaN"),
        (solve_coplanar, LINE, BOARD[:8, :2], "object_points.*one line"),
        (solve_coplanar, BOARD[:12], LINE[:, :2].repeat(2, axis=0)[:12], "image_points.*one line"),
        (solve_coplanar, body(), body()[:, :2], "leave the plane through them"),
        (solve_noncoplanar, BOARD, BOARD[:, :2], "one plane"),
        (solve_noncoplanar, np.ones((9, 3)), BOARD[:9, :2], "one plane"),
    ],
)
def test_unusable_input_is_named(solve, points, image, named):
    with pytest.raises(ValueError, match=named):
        solve(points, image)
