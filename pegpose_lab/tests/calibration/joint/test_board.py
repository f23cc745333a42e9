"""The board's shape: a bow is found, told and its sigma honest; what the views do not tell is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Calibration, Checkerboard, board_pose, calibrate_joint, calibrate_zhang
from pegpose_lab.calibration.board import UNKNOWNS, BoardUnknowns
from pegpose_lab.calibration.joint.calibrate import _board_shape
from pegpose_lab.calibration.joint.fitting import fit_views
from pegpose_lab.calibration.joint.models import lens_model
from pegpose_lab.calibration.joint.views import State, Views, evaluate
from pegpose_lab.paper import paper_camera
from pegpose_lab.study import trial_poses

CAMERA, BOARD = paper_camera(), Checkerboard(9, 7, 30.0)  # 240 x 180 mm
POINTS = BOARD.object_points
U, V = ((POINTS[:, :2] - BOARD.center[:2]) / [120, 90]).T


def bowed(bow):
    return POINTS + np.outer(bow * (1 - U**2), [0, 0, 1])


def scene(true_points, seed, noise=0.1, number=13):
    rng = np.random.default_rng([seed, 7])
    poses = trial_poses(BOARD, 30.0, number, rng)
    seen = [CAMERA.project(true_points, pose) for pose in poses]
    return [POINTS] * number, [image + noise * rng.standard_normal(image.shape) for image in seen]


def of_board(flags):
    return [flag for flag in flags if flag.code == "misfit-board"]


def test_a_bow_is_found_and_the_sigmas_are_honest():
    """30 trials of a bow of 0.1 mm: rms z of f and of the bow near 1 (their own spread is 0.13), no flag is left."""
    pulls = []
    for seed in range(30):
        run = calibrate_joint(*scene(bowed(0.1), seed), CAMERA.sensor, board=("warp",))
        errors = run.camera.focal_length - CAMERA.focal_length, run.board.values["warp_x"] - 0.1
        pulls.append([errors[0] / run.sigma("focal_length"), errors[1] / run.sigma("warp_x")])
        limit = (
            1e-9 if run.sigmas_from == "independent errors" else 1e-6
        )  # a scatter of 13 views has 12 degrees of freedom
        assert not of_board(run.flags) and run.board.probability < limit and abs(errors[1]) < 0.03
    assert np.sqrt(np.mean(np.square(pulls), axis=0)) == pytest.approx([1, 1], abs=0.35)


@pytest.mark.parametrize("calibrate", [calibrate_joint, lambda *given: calibrate_zhang(*given, coefficients=("k1",))])
def test_a_bow_that_is_not_fitted_is_flagged(calibrate):
    """0.1 mm on 240 mm moves f by several sigmas; the flag says how the board is bent."""
    for seed in range(5):
        (flag,) = of_board(calibrate(*scene(bowed(0.1), seed), CAMERA.sensor).flags)
        assert "with a bent board, warp_x = +0.1" in flag or "with a bent board, warp_x = +0.09" in flag


def test_a_flat_board_is_not_flagged():
    """1 % by design, of 40 sets no more than 3."""
    flagged = sum(bool(of_board(calibrate_joint(*scene(POINTS, seed), CAMERA.sensor).flags)) for seed in range(40))
    assert flagged <= 3


def test_a_flat_board_is_told_flat():
    told = str(calibrate_joint(*scene(POINTS, 1), CAMERA.sensor, board=("warp",)).board)
    assert "this board fits no better than an exact one" in told
    told = str(calibrate_joint(*scene(bowed(0.2), 1), CAMERA.sensor, board=("warp",)).board)
    assert "warp_x = +0.2" in told and "this board fits better than an exact one (F = " in told


def test_a_twist_is_named_beside_the_two_terms():
    twisted = bowed(0.1) + np.outer(0.1 * U * V, [0, 0, 1])
    points, images = scene(twisted, 0)
    (flag,) = of_board(calibrate_joint(points, images, CAMERA.sensor, board=("warp",)).flags)
    assert "with a board bent otherwise (five terms), warp_x = +0." in flag and "twist = +0." in flag
    run = calibrate_joint(points, images, CAMERA.sensor, board=("warp", "bend"))
    assert not of_board(run.flags) and run.board.values["twist"] == pytest.approx(0.1, abs=4 * run.sigma("twist"))


def test_the_aspect_ratio_is_found_and_its_lack_flagged():
    stretched = POINTS * [1, 1.002, 1]
    points, images = scene(stretched, 0)
    (flag,) = of_board(calibrate_joint(points, images, CAMERA.sensor).flags)
    assert "with a board of another aspect ratio, aspect = 1.00" in flag
    run = calibrate_joint(points, images, CAMERA.sensor, board=("aspect",))
    assert run.board.values["aspect"] == pytest.approx(1.002, abs=4 * run.sigma("aspect"))
    assert not of_board(run.flags)


def test_the_estimated_board_is_a_measured_board_for_any_method(tmp_path):
    """Its points give the same calibration, and the truth's pose; they are saved with the calibration."""
    points, images = scene(bowed(0.3), 3, noise=0.02)
    run = calibrate_joint(points, images, CAMERA.sensor, board=("warp",))
    measured = run.board.apply(POINTS)
    height = measured[:, 2] - measured[0, 2]  # of the corner, where u = v = -1
    assert height == pytest.approx(0.3 * (1 - U**2), abs=0.01)
    again = calibrate_joint([measured] * 13, images, CAMERA.sensor)
    assert again.camera.focal_length == pytest.approx(run.camera.focal_length, rel=1e-7)
    assert not of_board(again.flags)
    assert board_pose(measured, images[0], again.camera).as_matrix() == pytest.approx(
        again.cam_from_object[0].as_matrix(), abs=1e-4
    )
    run.save(tmp_path / "camera.yml")
    back = Calibration.load(tmp_path / "camera.yml")
    assert back.board.values == run.board.values and back.board.apply(POINTS) == pytest.approx(measured, abs=1e-12)
    assert str(back.board) == str(run.board) and list(back.covariance) == list(run.covariance)
    held = calibrate_joint(points, images, CAMERA.sensor, board={"warp": 0.5, "scale": 1e-3})
    held.save(tmp_path / "camera.yml")
    back = Calibration.load(tmp_path / "camera.yml")
    assert str(back.board) == str(held.board) and back.covariance.equals(held.covariance)
    assert vars(back.board.unknowns).keys() == vars(held.board.unknowns).keys()
    assert not held.board.unknowns.has_prior and back.board.unknowns.variance == held.board.unknowns.variance


def test_part_of_the_board_in_a_view_is_the_same_board():
    points, images = scene(bowed(0.2), 4, noise=0.0)
    kept = [slice(0, 63) if view % 2 else slice(9, 54) for view in range(13)]
    cut = ([part[k] for part, k in zip(parts, kept, strict=True)] for parts in (points, images))
    run = calibrate_joint(*cut, CAMERA.sensor, board=("warp",))
    assert run.board.values["warp_x"] == pytest.approx(0.2, abs=1e-6)
    assert run.camera.focal_length == pytest.approx(CAMERA.focal_length, rel=1e-7)


def test_a_prior_holds_what_the_views_leave_open():
    """The estimate is the mean of views and prior, weighted by their information: exactly so for one unknown."""
    points, images = scene(POINTS * [1, 1.0002, 1], 5, noise=0.3)
    free = calibrate_joint(points, images, CAMERA.sensor, board=("aspect",))
    sigma = free.sigma("aspect")
    held = calibrate_joint(points, images, CAMERA.sensor, board={"aspect": sigma})
    assert held.sigma("aspect") == pytest.approx(sigma / np.sqrt(2), rel=0.01)
    middle = 1 + (free.board.values["aspect"] - 1) / 2
    assert held.board.values["aspect"] == pytest.approx(middle, abs=0.02 * sigma)
    tight = calibrate_joint(points, images, CAMERA.sensor, board={"aspect": 1e-9})
    assert tight.board.values["aspect"] == pytest.approx(1, abs=1e-8)


def test_the_scale_needs_a_measured_length_and_widens_the_positions():
    points, images = scene(POINTS, 6)
    with pytest.raises(ValueError, match=r"the views do not tell the board's scale.*measure a length"):
        calibrate_joint(points, images, CAMERA.sensor, board=("scale",))
    plain = calibrate_joint(points, images, CAMERA.sensor)
    run = calibrate_joint(points, images, CAMERA.sensor, board={"scale": 1e-3})
    depth = plain.cam_from_object[0].translation[2]
    assert run.sigma("scale") == 1e-3 and run.n_parameters == plain.n_parameters
    assert run.sigma("tz_0") == pytest.approx(np.hypot(plain.sigma("tz_0"), 1e-3 * depth))
    assert run.sigma("focal_length") == plain.sigma("focal_length")
    assert np.linalg.eigvalsh(run.covariance / np.outer(*2 * [np.sqrt(np.diag(run.covariance))])).min() > -1e-9


@pytest.mark.parametrize(
    "board, points, named",
    [
        (("warp", "warp"), POINTS, "board"),
        (("bow",), POINTS, "board"),
        ("warp", POINTS, "board"),
        ({"warp": -1.0}, POINTS, r"board\['warp'\]"),
        (("warp",), POINTS + np.outer(20 * (U > 0), [0, 0, 1]), "object_points leave the plane"),
    ],
)
def test_unusable_boards_are_named(board, points, named):
    images = scene(points, 0)[1]
    with pytest.raises(ValueError, match=named):
        calibrate_joint([points] * 13, images, CAMERA.sensor, board=board)


@pytest.mark.parametrize(
    "coefficients, lens", [(None, "perspective"), (("k1", "k4"), "perspective"), (None, "equidistant")]
)
def test_derivatives_are_those_of_the_image(coefficients, lens):
    """Of the lens, of the board in any plane of the object's frame, and of the poses."""
    turn = RigidTransform.from_components([5.0, -3, 2], Rotation.from_rotvec([0.3, -0.2, 0.1]))
    points = [turn.apply(POINTS), turn.apply(POINTS[:40])]
    images = [
        CAMERA.project(POINTS, pose)[: len(part)]
        for pose, part in zip(trial_poses(BOARD, 30, 2, 0), points, strict=True)
    ]
    views = Views.stack(points, images)
    board = BoardUnknowns.of(points, [name for names in UNKNOWNS.values() for name in names])
    model = lens_model(CAMERA.sensor, True, True, coefficients, lens).on(board)
    rotations = np.array([(pose * turn.inv()).rotation.as_matrix() for pose in trial_poses(BOARD, 30, 2, 0)])
    positions = np.array([[3.0, 5, 300], [-4, 2, 320]])
    shared = model.start(48.0)
    shared[4:] += 0.01 if lens == "equidistant" or coefficients else 1e-5
    state = State(shared, rotations, positions)
    jacobian = evaluate(model, views, state)[1]
    for column in range(jacobian.shape[-1]):
        steps = [np.zeros(len(shared)), np.zeros((2, 3)), np.zeros((2, 3))]
        size = 1e-6 * max(1, abs(shared[column])) if column < len(shared) else 1e-6
        place = column - len(shared)
        if place < 0:
            steps[0][column] = size
        else:
            steps[1 + place // 3][:, place % 3] = size
        ends = [evaluate(model, views, state.moved(*(sign * step for step in steps)))[0] for sign in (1, -1)]
        numeric = (ends[0] - ends[1]) / (2 * size) * views.used[..., None]
        scale = np.abs(jacobian[..., column]).max()
        assert jacobian[..., column] * views.used[..., None] == pytest.approx(numeric, abs=1e-5 * scale)


def test_measured_relief_and_bow_add_up():
    """A board measured with a wrong bow is corrected by the rest."""
    images = scene(bowed(0.3), 8, noise=0.0)[1]
    run = calibrate_joint([bowed(0.1)] * 13, images, replace(CAMERA, focal_length=1.0), board=("warp",))
    assert run.board.values["warp_x"] == pytest.approx(0.2, abs=1e-4)


def test_an_exact_board_is_rarely_rejected_where_errors_are_alike_within_a_view():
    """Each of 8 views is bent in its own way by 0.3 px; 5 % by design, of 100 sets no more than 12 (p = 0.2 %)."""
    rng, rejected = np.random.default_rng(3), 0
    shapes = np.stack([U * U, V * V, U * V, U**3, V**3, U * U * V, U * V * V], axis=1)
    model = lens_model(CAMERA.sensor, True, False, ("k1", "k2")).on(BoardUnknowns.of([POINTS], UNKNOWNS["warp"]))
    for seed in range(100):
        boards, images = scene(POINTS, seed, number=8)
        fit = fit_views(model, boards, [image + 0.3 * shapes @ rng.standard_normal((7, 2)) for image in images])
        assert fit.clustered
        rejected += _board_shape(fit).probability < 0.05
    assert rejected <= 12
