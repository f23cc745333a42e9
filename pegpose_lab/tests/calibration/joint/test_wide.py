"""Wide lenses: the start finds them, f is right to its sigma, and a model that is too poor is told the right one."""

import numpy as np
import pytest

from pegpose_lab import CalibrationError, Checkerboard, FisheyeCamera, OpenCVCamera, Sensor, calibrate_joint
from pegpose_lab.calibration.joint.models import RATIONAL
from pegpose_lab.study import views_over_image

SIZE, BOARD = (1600, 1200), Checkerboard(9, 7, 30.0)
SENSOR = Sensor((1, 1), (799.5, 599.5), SIZE)
FISHEYE = FisheyeCamera([[500, 0, 802], [0, 500, 597], [0, 0, 1]], [0.02, -0.005, 0.002, -0.0005], SIZE)
ACTION = OpenCVCamera([[870, 0, 802], [0, 870, 597], [0, 0, 1]], [-0.35, 0.15, 0, 0, -0.03], SIZE)
RATIO = OpenCVCamera([[800, 0, 802], [0, 800, 597], [0, 0, 1]], [0.3, -0.08, 0, 0, 0.02, 0.7, 0, 0], SIZE)
LENSES = [
    (FISHEYE, 78, {"lens": "equidistant"}, "with an equidistant (fisheye) lens they fit better"),
    (ACTION, 52, {"coefficients": ("k1", "k2", "k3")}, "with distortion by k1, k2, k3 they fit better"),
    (RATIO, 52, {"coefficients": ("k1", "k2", "k3", "k4")}, "with rational distortion by k1, k2, k3, k4 they fit"),
]


def scene(camera, widest, seed, number=13, noise=0.1):
    return views_over_image(camera, BOARD, widest=widest, number=number, noise=noise, rng=seed)


@pytest.mark.parametrize("camera, widest, options, words", LENSES, ids=["fisheye", "k1 k2 k3", "rational"])
def test_wide_lenses_are_found_and_the_paper_s_model_is_told_so(camera, widest, options, words):
    pulls = []
    for seed in range(5):
        points, images = scene(camera, widest, seed)
        run = calibrate_joint(points, images, SENSOR, **options)
        assert type(run.camera) is type(camera)
        freedom = 2 * sum(map(len, points)) - run.n_parameters
        assert np.sqrt(np.sum(np.concatenate(run.residuals) ** 2) / freedom) == pytest.approx(0.1, abs=0.006)
        truth = camera.parameters
        pulls.append([(run.camera.parameters[name] - truth[name]) / run.sigma(name) for name in ("f_x", "c_x", "c_y")])
        if seed < 2:
            flags = [flag for flag in calibrate_joint(points, images, SENSOR).flags if flag.code == "misfit-lens"]
            assert len(flags) == 1 and words in flags[0]
    assert np.abs(pulls).max() < 4 and np.sqrt(np.mean(np.square(pulls))) < 1.6


def test_the_paper_s_model_is_not_told_to_change_where_it_suffices():
    camera = Sensor((1, 1), (802, 597), SIZE).camera(1300.0, kappa1=4e-8)
    for seed in range(5):
        run = calibrate_joint(*scene(camera, 40, seed), SENSOR)
        assert not [flag for flag in run.flags if flag.code.startswith("misfit")]


def test_a_fisheye_model_on_a_perspective_lens_is_told_so():
    points, images = scene(ACTION, 52, 0)
    (flag,) = [
        flag for flag in calibrate_joint(points, images, SENSOR, lens="equidistant").flags if "misfit" in flag.code
    ]
    assert "with a perspective lens with k1, k2, k3 they fit better" in flag


def test_a_fisheye_model_on_a_perspective_lens_with_tangential_distortion_is_told_so():
    camera = OpenCVCamera(ACTION.camera_matrix, [-0.1, 0.02, 0.003, -0.002, 0], SIZE)
    points, images = scene(camera, 45, 0)
    flags = calibrate_joint(points, images, SENSOR, lens="equidistant").flags
    (flag,) = [flag for flag in flags if flag.code == "misfit-lens"]
    assert "with a perspective lens with k1, k2, p1, p2 they fit better" in flag


def test_a_fisheye_of_fewer_coefficients_is_told_the_others():
    points, images = scene(FISHEYE, 78, 0)
    poor = calibrate_joint(points, images, SENSOR, lens="equidistant", coefficients=())
    (flag,) = [flag for flag in poor.flags if flag.code == "misfit-lens"]
    assert "with an equidistant lens with k1, k2, k3, k4 they fit better" in flag


def test_a_principal_point_and_two_focal_lengths_of_a_fisheye():
    camera = FisheyeCamera([[505, 0, 799.5], [0, 500, 599.5], [0, 0, 1]], [0.02, -0.005, 0.002, -0.0005], SIZE)
    points, images = scene(camera, 75, 2, noise=0.0)
    run = calibrate_joint(points, images, SENSOR, lens="equidistant", focal="two", principal_point="fixed")
    assert run.camera.parameters == pytest.approx(camera.parameters, rel=1e-6)


def test_more_coefficients_than_the_views_determine_are_refused():
    """Without distortion numerator and denominator cancel: k1 and k4 do the same."""
    camera = Sensor((1, 1), (802, 597), SIZE).camera(1300.0)
    with pytest.raises(CalibrationError, match=r"k1, .*k4.* and .* trade off"):
        calibrate_joint(*scene(camera, 40, 0), SENSOR, coefficients=RATIONAL)


@pytest.mark.parametrize(
    "options, named",
    [
        ({"lens": "stereographic"}, "lens"),
        ({"lens": "equidistant", "coefficients": ("p1",)}, "coefficients"),
        ({"coefficients": ("k7",)}, "coefficients"),
    ],
)
def test_unusable_lenses_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        calibrate_joint(*scene(RATIO, 52, 0), SENSOR, **options)
