"""The joint solution: real views, honest sigmas, what is not determined."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from pegpose_lab import CalibrationError, TsaiCamera, calibrate_dlt, calibrate_joint
from pegpose_lab.calibration.joint.bundle import Equations
from pegpose_lab.calibration.joint.covariance import covariance_of
from pegpose_lab.calibration.joint.models import COEFFICIENTS, lens_model
from pegpose_lab.calibration.joint.views import State, Views, evaluate
from pegpose_lab.calibration.result import judge_focal_length
from pegpose_lab.study import trial_poses
from pegpose_lab.study.datasets import load_points, read_corners
from pegpose_lab.tests.calibration.joint.boards import BOARD, CAMERA, EXPERIMENT, five_views


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
    "default_5": {"coefficients": COEFFICIENTS},
    "k1k2p1p2": {"coefficients": ("k1", "k2", "p1", "p2")},
    "k1k2": {"coefficients": ("k1", "k2")},
    "k1_ppfree": {"coefficients": ("k1",)},
    "k1_ppfree_fxeqfy": {"coefficients": ("k1",), "focal": "one"},
    "k1_ppfixed": {"coefficients": ("k1",), "principal_point": "fixed"},
    "k1_ppfixed_fxeqfy": {"coefficients": ("k1",), "focal": "one", "principal_point": "fixed"},
    "nodist_ppfree": {"coefficients": ()},
}


@pytest.mark.parametrize("name", CONFIGURATIONS)
@pytest.mark.parametrize("data", ["opencv_left", "zhang_msr_5view", "visp_circles"])
def test_real_views_end_where_opencv_ends(pegpose_data, data, name):
    """Published reference runs: rms to 1e-4 px, f to a tenth of its sigma, and the same classical sigma."""
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
    sigma = np.sqrt(run.classical_covariance.loc["f_x", "f_x"])
    assert run.camera.camera_matrix[0, 0] == pytest.approx(reference["fx"], abs=0.1 * sigma)
    stated = reference["sd_fx_fy_cx_cy_k1"][0]
    if stated:
        assert sigma == pytest.approx(stated, rel=0.02)


def test_the_horizontal_scale_is_recovered():
    camera = replace(CAMERA, scale_x=1.02)
    run = calibrate_joint(*five_views(0.0, camera=camera), CAMERA, focal="two")
    assert run.camera.scale_x == pytest.approx(1.02, rel=1e-8)
    assert run.camera.focal_length == pytest.approx(CAMERA.focal_length, rel=1e-8)


def test_views_with_different_numbers_of_points():
    points, images = five_views(0.0)
    kept = [slice(0, 48 - 7 * view) for view in range(5)]
    seen = ([view[k] for view, k in zip(views, kept, strict=False)] for views in (points, images))
    run = calibrate_joint(*seen, CAMERA)
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


def test_a_principal_point_that_is_hardly_known_is_flagged():
    points, images = five_views(0.1)
    assert calibrate_joint(points, images, CAMERA).flags == ()
    flags = calibrate_joint(points[1:2], images[1:2], CAMERA).flags
    assert "loose-principal-point" in [flag.code for flag in flags]
    assert calibrate_joint(points[1:2], images[1:2], CAMERA, principal_point="fixed").flags == ()


def test_intervals_are_those_of_students_t():
    """Of few degrees of freedom the interval is wider: 3.18 sigma of three, 1.96 of many."""
    table = pd.DataFrame([[1.0]], ["f_x"], ["f_x"])
    assert judge_focal_length(table, "f_x", 10.0, "px", 1000) == ()
    assert "6.818 to 13.18 px" in judge_focal_length(table, "f_x", 10.0, "px", 3)[0]
    with pytest.raises(CalibrationError, match="do not determine f"):
        judge_focal_length(table, "f_x", 3.0, "px", 3)


# --- little tilt: refused, flagged, or right ---------------------------------------------------------------


def test_direct_linear_transform_is_exact_without_distortion():
    camera = replace(CAMERA, kappa1=0.0)
    run = calibrate_dlt(BOARD, camera.project(BOARD, EXPERIMENT.cam_from_boards[1]), CAMERA)
    assert run.camera.focal_length == pytest.approx(CAMERA.focal_length, rel=1e-9) and run.rms < 1e-8
    with pytest.raises(ValueError, match="plane"):
        calibrate_dlt(BOARD + (np.arange(48) % 3)[:, None] * [0, 0, 20.0], run.residuals[0], CAMERA)


@pytest.mark.parametrize(
    "options, named",
    [
        ({"focal": "three"}, "focal"),
        ({"loss": "l1"}, "loss"),
        ({"coefficients": ("k9",)}, "coefficients"),
        ({"coefficients": ("k1", "k1")}, "coefficients"),
        ({"principal_point": "middle"}, "principal_point"),
        ({"coefficients": 3}, "coefficients"),
    ],
)
def test_unusable_options_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        calibrate_joint(*five_views(0.1), CAMERA, **options)
