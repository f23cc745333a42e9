"""Joint and Zhang's calibration: known cameras, noise floors, real data."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pegpose_lab import (
    CalibrationError,
    TsaiCamera,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    calibrate_zhang,
)
from pegpose_lab.calibration.joint.models import COEFFICIENTS
from pegpose_lab.tests.calibration.views import (
    BOARD,
    CAMERA,
    EXPERIMENT,
    five_views,
    fronto_parallel,
    table_views,
    view,
    zhang_views,
)


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
    joint, zhang = calibrate_joint(*views, CAMERA), calibrate_zhang(*views, CAMERA.image_size, coefficients=("k1",))
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
    for name, coefficients in {
        "k1_ppfree": ("k1",),
        "k1k2": ("k1", "k2"),
        "k1k2p1p2": ("k1", "k2", "p1", "p2"),
        "default_5": ("k1", "k2", "p1", "p2", "k3"),
    }.items():
        run = calibrate_zhang(*views, (640, 480), coefficients=coefficients)
        assert run.rms == pytest.approx(reference[name]["rms_cv2"], abs=2e-5)
        assert run.camera.camera_matrix[0, 0] == pytest.approx(reference[name]["fx"], abs=0.02)
        parameters = ["f_x", "f_y", "c_x", "c_y", "k1"]
        assert np.sqrt(np.diag(run.classical_covariance.loc[parameters, parameters])) == pytest.approx(
            reference[name]["sd_fx_fy_cx_cy_k1"], rel=0.01
        )


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
    assert run.camera.focal_length == pytest.approx(full["f"], abs=0.1 * np.sqrt(run.classical_covariance.iloc[0, 0]))
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
            assert run.flags[0].code == "loose-focal-length"


def test_one_view_is_not_enough_for_zhang():
    with pytest.raises(CalibrationError, match="one view"):
        calibrate_zhang([BOARD], [view()[1]], CAMERA.image_size)


@pytest.mark.parametrize("camera", [CAMERA.sensor, CAMERA, CAMERA.to_opencv()])
def test_zhang_takes_the_image_size_of_any_camera(camera):
    views = five_views(0.1)
    ours, theirs = calibrate_zhang(*views, camera), calibrate_zhang(*views, CAMERA.image_size)
    assert ours.camera.image_size == theirs.camera.image_size == CAMERA.image_size
    assert ours.camera.camera_matrix == pytest.approx(theirs.camera.camera_matrix, rel=1e-9)


@pytest.mark.parametrize("coefficients", [(), ("k1",), ("k2", "k1"), ("p1", "p2"), ("k1", "k2", "p1", "p2", "k3")])
def test_zhang_frees_the_coefficients_that_are_named(coefficients):
    run = calibrate_zhang(*five_views(0.1), CAMERA, coefficients=coefficients)
    freed = {name for name in COEFFICIENTS if run.camera.parameters[name] != 0}
    assert freed == set(coefficients) == set(run.covariance.index) & set(COEFFICIENTS)
    assert run.n_parameters == 4 + len(coefficients) + 6 * 5


@pytest.mark.parametrize(
    "coefficients", [("k2",), ("k1", "k3"), ("p1",), ("k1", "k1"), ("k4",), ("k1", ["k2"]), "k1x", 1]
)
def test_zhang_refuses_coefficients_that_opencv_cannot_free(coefficients):
    with pytest.raises(ValueError, match="coefficients is"):
        calibrate_zhang(*five_views(0.1), CAMERA, coefficients=coefficients)


@pytest.mark.parametrize("coefficients", [("k1", "k1"), ("k7",), ("k1", ["k2"]), "k1", 1])
def test_unknown_coefficients_are_refused(coefficients):
    with pytest.raises(ValueError, match="coefficients is"):
        calibrate_joint(*five_views(0.1), CAMERA, coefficients=coefficients)


def test_a_calibration_knows_how_many_numbers_it_fitted():
    """The residuals of many experiments have the squares that so many parameters leave."""
    views = five_views(0.1)
    assert calibrate_joint(*views, CAMERA.sensor).n_parameters == 4 + 6 * 5
    assert calibrate_joint(*views, CAMERA.sensor, principal_point="fixed").n_parameters == 2 + 6 * 5
    squares = []
    for seed in range(20):
        run = calibrate_joint(*five_views(0.1, seed), CAMERA.sensor)
        squares.append(np.sum(np.square(run.residuals)) / 0.1**2)
    freedom = 2 * 5 * 48 - run.n_parameters
    assert abs(np.mean(squares) - freedom) < 4 * np.sqrt(2 * freedom / 20)
    one = views[0][0], views[1][0], CAMERA.sensor
    assert calibrate_tsai(*one).n_parameters == 7 and calibrate_genetic(*one, rng=0, generations=1).n_parameters == 8
