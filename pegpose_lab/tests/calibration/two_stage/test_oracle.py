"""The edges of the box, and the optimum in it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import differential_evolution
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import (
    TsaiCamera,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    edge_intervals,
    optimum_in_box,
)
from pegpose_lab.calibration import TwoStageObjective
from pegpose_lab.study import load_corners
from pegpose_lab.tests.calibration.views import BOARD, CAMERA, EXPERIMENT, box_of, view, zhang_views


def test_solution_on_the_edge_of_its_box_is_flagged():
    narrow = calibrate_genetic(*view(), CAMERA, rng=0, box=0.001)
    assert [flag.code for flag in narrow.flags] == ["edge-of-box"]
    assert "sits on the edge of its box in T_z (box: f 47.97 to" in narrow.flags[0]
    assert "widen the box" in narrow.flags[0]


def test_the_genetic_algorithm_does_not_run_the_joint_solver(monkeypatch):
    """What the view knows without a box is another question, which the caller asks."""

    def refused(*_, **__):
        raise AssertionError("the profile likelihood was run")

    monkeypatch.setattr("pegpose_lab.calibration.two_stage.flags.profile_focal_length", refused)
    for run in (calibrate_genetic(*view(), CAMERA, rng=0, box=0.001), optimum_in_box(*view(), CAMERA, box=0.001)):
        assert [flag.code for flag in run.flags] == ["edge-of-box"] and "profile" not in run.flags[0]
    with pytest.raises(AssertionError, match="was run"):
        edge_intervals(*view(), CAMERA)


def stated_intervals(flag):
    """The two intervals of f in the words of `edge_intervals`: with the principal point held and free."""
    number = r"([\d.]+) to ([\d.]+) mm"
    found = re.search(f"f is {number} with this principal point, and {number} with the principal point free", flag)
    return np.array(found.groups(), float).reshape(2, 2)


def test_willsons_file_is_flagged(pegpose_data):
    """Linear f 64.9 mm, truth 270 mm: the box does not hold it."""
    data = np.loadtxt(pegpose_data / "willson_coplanar" / "cc_cd.dat")
    camera = TsaiCamera(1.0, (0.023, 0.023), (258, 204), (576, 384))
    run = calibrate_genetic(data[:, :3], data[:, 3:], camera, rng=0)
    assert run.camera.focal_length < 1.25 * 64.93
    assert run.flags[-1].code == "edge-of-box"
    held, free = stated_intervals(edge_intervals(data[:, :3], data[:, 3:], camera))
    assert held[1] < 270 and free[0] < 270 < free[1]


def test_real_single_views_get_the_right_flags(pegpose_data):
    """The box misses one of opencv_left's views, and Zhang's first board is hardly tilted; the others are not flagged."""
    object_points, image_points, (width, height), names = load_corners()
    camera = TsaiCamera(1.0, (1, 1), ((width - 1) / 2, (height - 1) / 2), (width, height))
    runs = [calibrate_genetic(*view, camera, rng=0) for view in zip(object_points, image_points, strict=True)]
    assert [name for name, run in zip(names, runs, strict=True) if run.flags] == ["left06"]
    left06 = names.index("left06")
    held, free = stated_intervals(edge_intervals(object_points[left06], image_points[left06], camera))
    f = calibrate_joint(object_points, image_points, camera).camera.focal_length
    assert f < held[0] and free[0] < f < free[1]
    camera = replace(camera, principal_point=(319.5, 239.5), image_size=(640, 480))
    views = zip(*zhang_views(pegpose_data / "zhang_msr_5view"), strict=False)
    zhang = [calibrate_genetic(*view, camera, rng=0) for view in views]
    assert [[flag.code for flag in run.flags] for run in zhang] == [["little-tilt"], [], [], [], []]


def test_the_oracle_finds_the_truth_and_flags_the_edge_of_its_box():
    exact = optimum_in_box(*view(), CAMERA)
    assert exact.camera.focal_length == pytest.approx(47.95, rel=1e-8) and exact.mean_distance < 1e-9
    assert exact.camera.kappa1 == pytest.approx(1.097e-5, rel=1e-6) and exact.flags == ()
    narrow = optimum_in_box(*view(), CAMERA, box=1e-5)
    assert [flag.code for flag in narrow.flags] == ["edge-of-box"]
    with pytest.raises(ValueError, match="box"):
        optimum_in_box(*view(), CAMERA, box=1.5)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (40.0, 50.0, "40 to 50 mm"),
        (0.0, np.inf, "not determined"),
        (40.0, np.inf, "not determined, above 40 mm"),
        (0.0, 50.0, "not determined, below 50 mm"),
    ],
)
def test_an_interval_that_does_not_end_is_told_in_words(monkeypatch, low, high, words):
    monkeypatch.setattr("pegpose_lab.calibration.two_stage.flags.profile_focal_length", lambda *_, **__: (low, high))
    flag = edge_intervals(*view(), CAMERA)
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


@pytest.mark.parametrize(
    ("seed", "noise", "edge"),
    [
        (25, 0.0, "in f (box"),
        (75, 0.3, "in f (box"),
        (228, 0.03, "in f (box"),
        (16, 0.0, "in T_z (box"),
        (192, 0.0, None),
    ],
)
def test_nothing_in_the_box_is_better_than_the_oracle(seed, noise, edge):
    """On the box's edges, which an oblique valley meets, and at a truth without noise."""
    points, image_points = far_view(seed, noise)
    optimum = optimum_in_box(points, image_points, CAMERA)
    linear = calibrate_tsai(points, image_points, CAMERA)
    objective, bounds = TwoStageObjective(points, image_points, linear), np.transpose(box_of(linear))
    everywhere = np.stack(np.meshgrid(*(np.linspace(*ends, 400) for ends in bounds)), axis=-1).reshape(-1, 2)
    found = [
        differential_evolution(
            lambda x: objective(x.T),
            bounds,
            rng=rng,
            vectorized=True,
            updating="deferred",
            tol=1e-12,
            maxiter=500,
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
