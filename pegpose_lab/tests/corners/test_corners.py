"""Corners: order, accuracy on rendered boards, real photographs, errors."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab.camera import TsaiCamera
from pegpose_lab.checks import DetectionError
from pegpose_lab.corners import find_corners
from pegpose_lab.corners import grid as grid_file
from pegpose_lab.corners.find import _check, _fit
from pegpose_lab.corners.fit import CornerFits, edge_crossing, fit_corners
from pegpose_lab.corners.grid import candidate_grids
from pegpose_lab.corners.whole_board import check_ends, check_fields
from pegpose_lab.paper import paper_experiment
from pegpose_lab.render import render_board
from pegpose_lab.render.board import BoardLook
from pegpose_lab.study import measured, photographs
from pegpose_lab.targets import Checkerboard

CAMERA = TsaiCamera(50.0, (0.075, 0.075), (319.5, 239.5), (640, 480), kappa1=1e-5)


def pose_of(board, tilt=(8.0, -12.0), turn=0.0, depth=700.0):
    """A board in the middle of the picture, turned about the viewing direction (degrees)."""
    rotation = Rotation.from_euler("z", turn, degrees=True) * Rotation.from_euler("xy", tilt, degrees=True)
    return RigidTransform.from_components([0, 0, depth] - rotation.apply(board.center), rotation)


def seen(board, pose, **scene):
    return render_board(CAMERA, pose, board, **({"rng": 3} | scene)), CAMERA.project(board.object_points, pose)


def distances(corners, truth):
    return np.linalg.norm(corners - truth, axis=1)


def test_paper_boards_are_measured_to_hundredths_of_a_pixel():
    experiment = paper_experiment()
    for index in (0, 4):
        truth = experiment.camera.project(experiment.board.object_points, experiment.cam_from_boards[index])
        error = find_corners(experiment.board_image(index), experiment.board) - truth
        assert np.linalg.norm(error, axis=1).mean() < 0.012
        assert np.abs(error.mean(axis=0)).max() < 0.005  # no common shift


def test_accuracy_beats_opencv():
    board = Checkerboard(7, 5, 25.0)
    image, truth = seen(board, pose_of(board))
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    theirs = cv2.findChessboardCornersSB(image, (7, 5), flags=flags)[1].reshape(-1, 2)
    theirs = min(theirs, theirs[::-1], key=lambda corners: distances(corners, truth).mean())
    assert distances(find_corners(image, board), truth).mean() < 0.7 * distances(theirs, truth).mean()


def test_error_scales_with_noise():
    board = Checkerboard(6, 5, 25.0)
    errors = []
    for noise in (1.0, 4.0):
        per_seed = [
            np.subtract(find_corners(image, board), truth)
            for image, truth in (seen(board, pose_of(board), noise=noise, rng=rng) for rng in range(3))
        ]
        errors.append(np.std(per_seed))
    assert 2.5 < errors[1] / errors[0] < 5.5


@pytest.mark.parametrize("turn", [0, 60, 130, 180, 250])
def test_colours_decide_where_they_differ(turn):
    board = Checkerboard(7, 6, 25.0)  # columns + rows odd: one order only, whatever the turn
    image, truth = seen(board, pose_of(board, turn=turn))
    assert distances(find_corners(image, board), truth).max() < 0.2


@pytest.mark.parametrize("turn", [0, 40, 100, 180, 220, 300])
def test_symmetric_board_starts_nearest_to_the_top_left(turn):
    board = Checkerboard(8, 6, 22.0)
    image, truth = seen(board, pose_of(board, turn=turn))
    expected = min(truth, truth[::-1], key=lambda corners: np.hypot(*corners[0]))
    assert distances(find_corners(image, board), expected).max() < 0.2


@pytest.mark.parametrize("shape, same_colours", [((5, 5), (0, 2)), ((6, 6), (0, 1, 2, 3))])
def test_square_board(shape, same_colours):
    board = Checkerboard(*shape, 25.0)
    for turn in (10, 100, 190, 280):
        image, truth = seen(board, pose_of(board, turn=turn))
        grid = truth.reshape(*shape, 2)
        candidates = [np.rot90(grid, k).reshape(-1, 2) for k in same_colours]
        expected = min(candidates, key=lambda corners: np.hypot(*corners[0]))
        assert distances(find_corners(image, board), expected).max() < 0.2


def test_odd_square_board_keeps_black_outside_the_first_corner():
    board = Checkerboard(5, 5, 25.0)
    light_first = BoardLook(black=220, white=30)
    image, truth = seen(board, pose_of(board, tilt=(0.0, 0.0)), look=light_first)
    corners = find_corners(image, board).reshape(5, 5, 2)
    x, y = np.rint(corners[0, 0] - 0.5 * (corners[1, 1] - corners[0, 0])).astype(int)
    assert image[y, x] < 128
    assert distances(np.sort(corners.reshape(-1, 2), axis=0), np.sort(truth, axis=0)).max() < 0.2


def test_never_mirrored():
    board = Checkerboard(7, 6, 25.0)
    for turn in (0, 90, 200):
        corners = find_corners(seen(board, pose_of(board, turn=turn))[0], board).reshape(6, 7, 2)
        right, down = corners[0, -1] - corners[0, 0], corners[-1, 0] - corners[0, 0]
        assert right[0] * down[1] - right[1] * down[0] > 0


def test_uneven_light_does_not_pull_corners():
    board = Checkerboard(7, 6, 25.0)
    image, truth = seen(board, pose_of(board), noise=0)
    even = distances(find_corners(image, board), truth).mean()
    shade = np.linspace(-15, 15, 640)[None] + np.linspace(-15, 15, 480)[:, None]
    uneven = np.clip(np.rint(image + shade), 0, 255).astype(np.uint8)
    assert distances(find_corners(uneven, board), truth).mean() < even + 0.004


VARIANCES = 1.2, 0.6, 0.15, 0.05, -0.08, -0.3, -1.0  # blurred, in between, sharpened


@pytest.mark.parametrize("variance", VARIANCES)
def test_derivatives_of_the_model(variance):
    lattice = np.indices((9, 9)).reshape(2, -1)[::-1] - 4.0
    parameters = np.array([[0.3, -0.2, 0.2, 1.9, variance, 120.0, -80.0, 0.4, -0.3]])
    jacobian = edge_crossing(parameters, lattice)[1][0]
    for k in range(9):
        step = np.zeros(9)
        step[k] = 1e-6
        ahead, behind = (edge_crossing(parameters + sign * step, lattice)[0][0] for sign in (1, -1))
        np.testing.assert_allclose(jacobian[:, k], (ahead - behind) / 2e-6, atol=1e-5)


@pytest.mark.parametrize("variance", VARIANCES)
def test_fit_recovers_the_model_exactly(variance):
    lattice = np.indices((17, 17)).reshape(2, -1)[::-1] - 8.0
    truth = np.array([[0.31, -0.27, 0.1, 1.75, variance, 120.0, -90.0, 0.5, -0.2]])
    values = edge_crossing(truth, lattice)[0]
    fits = fit_corners(values, np.ones_like(values), lattice, np.array([[0.0, 0.0, 0.0, np.pi / 2]]))
    assert fits.converged.all()
    np.testing.assert_allclose(fits.parameters, truth, atol=1e-5)


def test_stated_sigma_is_that_of_the_errors():
    lattice, rng = np.indices((17, 17)).reshape(2, -1)[::-1] - 8.0, np.random.default_rng(5)
    truth = np.tile([0.31, -0.27, 0.1, 1.75, 0.8, 120.0, -90.0, 0.5, -0.2], (400, 1))
    values = edge_crossing(truth, lattice)[0] + rng.normal(0, 5, (400, lattice.shape[1]))
    fits = fit_corners(values, np.ones_like(values), lattice, np.tile([0.0, 0.0, 0.1, 1.75], (400, 1)))
    assert fits.converged.all()
    errors = fits.parameters[:, :2] - truth[:, :2]
    assert abs(np.linalg.eigvalsh(np.cov(errors.T))[1] ** 0.5 / np.median(fits.sigma) - 1) < 0.12
    assert abs(np.median(fits.misfit) / (5 / 90) - 1) < 0.05


# ---- sharp edges ----


def upright(degrees):
    """A sharp board of 8 x 6 inner corners, face on, turned by some degrees, seen by square pixels; its corners."""
    camera, board = TsaiCamera(50.0, (0.05, 0.05), (199.5, 159.5), (400, 320)), Checkerboard(8, 6, 20.0)
    rotation = Rotation.from_euler("z", degrees, degrees=True)
    pose = RigidTransform.from_components([0.13, 0.07, 625.0] - rotation.apply(board.center), rotation)
    look = BoardLook(black=40, white=200, surroundings=200)
    image = render_board(camera, pose, board, look=look, blur=0.0, noise=0.0)
    return image, camera.project(board.object_points, pose)


def sharpen(image, amount):
    image = image.astype(np.float32)
    image = image + amount * (image - cv2.GaussianBlur(image, (0, 0), 0.8))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def nearest_order(corners, truth):
    return min(corners, corners[::-1], key=lambda order: distances(order, truth).mean())


@pytest.mark.parametrize("degrees, amount, bound", [
    (0.0, 0.0, 0.01), (0.7, 0.0, 0.01), (1.5, 0.0, 0.01), (3.0, 0.0, 0.005), (10.0, 0.0, 0.005),
    (0.0, 1.0, 0.02), (0.7, 1.0, 0.01), (1.5, 1.0, 0.01), (3.0, 1.0, 0.01), (10.0, 1.0, 0.005),
])  # fmt: skip
def test_edges_sharper_than_a_pixel(degrees, amount, bound):
    image, truth = upright(degrees)
    corners = find_corners(sharpen(image, amount), Checkerboard())
    assert distances(nearest_order(corners, truth), truth).mean() < bound


def test_sharpened_and_noisy():
    image, truth = upright(1.0)
    noisy = sharpen(image, 1.0) + np.random.default_rng(2).normal(0, 5, image.shape)
    corners = find_corners(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), Checkerboard())
    assert distances(nearest_order(corners, truth), truth).mean() < 0.03


@pytest.mark.parametrize("levels", [(50, 180), (0, 255)])
def test_two_levels_and_drawn_boards(levels):
    image, truth = upright(2.0)
    corners = find_corners(np.where(image > 120, levels[1], levels[0]).astype(np.uint8), Checkerboard())
    assert distances(nearest_order(corners, truth), truth).max() < 0.2
    squares = np.pad(np.kron(np.indices((7, 9)).sum(axis=0) % 2, np.ones((40, 40))), 40, constant_values=1)
    drawn = np.where(squares, levels[1], levels[0]).astype(np.uint8)
    truth = np.stack(np.meshgrid(np.arange(80, 400, 40), np.arange(80, 320, 40)), axis=-1).reshape(-1, 2) - 0.5
    np.testing.assert_allclose(nearest_order(find_corners(drawn, Checkerboard()), truth), truth, atol=0.005)


# ---- the image alone decides ----


def test_corners_do_not_depend_on_where_the_grid_was_found():
    board, rng = Checkerboard(7, 6, 25.0), np.random.default_rng(1)
    image, truth = seen(board, pose_of(board))
    grid = truth.reshape(6, 7, 2)
    found = [_fit(image, grid + rng.normal(0, 0.3, grid.shape))[0] for _ in range(3)]
    assert np.ptp(found, axis=0).max() < 2e-5


# ---- small, large, absent boards ----


def pixels_searched(monkeypatch, image, board):
    """How many pixels OpenCV's detectors are shown in all until `find_corners` gives up."""
    shown = []

    def counting(detect):
        def wrapper(view, *args, **kwargs):
            shown.append(view.size)
            return detect(view, *args, **kwargs)

        return wrapper

    for name in ("findChessboardCorners", "findChessboardCornersSB", "findChessboardCornersSBWithMeta"):
        monkeypatch.setattr(grid_file.cv2, name, counting(getattr(cv2, name)))
    with pytest.raises(DetectionError, match="no board"):
        find_corners(image, board)
    monkeypatch.undo()
    assert shown
    return sum(shown)


@pytest.mark.parametrize("shape", [(480, 640), (1500, 2000), (3000, 4000)])
def test_search_is_bounded_by_construction(monkeypatch, shape):
    lens_cap = np.clip(np.random.default_rng(0).normal(3, 2, shape), 0, 255).astype(np.uint8)
    assert pixels_searched(monkeypatch, lens_cap, Checkerboard()) < 2.5e6


def test_large_image():
    board = Checkerboard(7, 6, 25.0)
    camera = TsaiCamera(50.0, (0.0125, 0.0125), (1919.5, 1439.5), (3840, 2880), kappa1=1e-5)
    pose = pose_of(board)
    image = render_board(camera, pose, board, blur=2.0, rng=4)
    assert distances(find_corners(image, board), camera.project(board.object_points, pose)).max() < 0.05


def test_small_board_in_a_large_image():
    board = Checkerboard(8, 6, 8.0)
    image, truth = seen(board, pose_of(board, turn=15.0))  # squares of 7.6 px
    large = np.full((1500, 2000), 120, np.uint8)
    large[900:1380, 1300:1940] = image
    assert distances(find_corners(large, board), truth + [1300, 900]).max() < 0.2


# ---- boards of another size ----


def test_a_part_of_a_board_is_refused():
    board = Checkerboard(9, 7, 18.0)
    image, truth = seen(board, pose_of(board, turn=20.0))
    grid = truth.reshape(7, 9, 2)
    check_ends(image, grid)
    parts = {"left": grid[:, 1:], "right": grid[:, :-1], "upper": grid[1:], "lower": grid[:-1]}
    for side, part in parts.items():
        with pytest.raises(DetectionError, match=f"goes on beyond the grid of .* at its {side} side"):
            check_ends(image, part)


@pytest.mark.parametrize("margin", [0.1, 0.5, 2.0])
def test_what_surrounds_a_whole_board_is_no_pattern(margin):
    board = Checkerboard(6, 5, 20.0)
    pose = pose_of(board, turn=33.0)
    image, truth = seen(board, pose, look=BoardLook(margin=margin))
    assert distances(find_corners(image, board), truth).max() < 0.2
    stripes = image.copy()
    stripes[:, :60:12] = 20  # something regular beside it
    assert distances(find_corners(stripes, board), truth).max() < 0.2


def test_longer_outer_squares_are_no_further_squares():
    squares = np.kron(np.indices((7, 9)).sum(axis=0) % 2, np.ones((40, 40)))
    longer = np.pad(np.pad(squares, 40, mode="edge"), 50, constant_values=1)  # the outer squares twice as long
    image = cv2.GaussianBlur(np.where(longer, 200, 40).astype(np.uint8), (0, 0), 0.8)
    corners = find_corners(image, Checkerboard())
    np.testing.assert_allclose(corners[0], [129.5, 129.5], atol=0.01)


def test_the_size_of_another_board_is_named():
    board = Checkerboard(9, 7, 18.0)
    image, _ = seen(board, pose_of(board))
    for asked in (Checkerboard(8, 6), Checkerboard(9, 6), Checkerboard(10, 7)):
        with pytest.raises(DetectionError, match="a board of 9 x 7 is seen"):
            find_corners(image, asked)


def test_a_board_partly_outside_gives_the_same_error_each_time():
    board = Checkerboard(8, 6, 22.0)
    image = seen(board, pose_of(board, turn=40.0))[0][:, 250:]
    messages = set()
    for _ in range(5):
        with pytest.raises(DetectionError) as error:
            find_corners(image, board)
        messages.add(str(error.value))
    assert len(messages) == 1


@pytest.mark.parametrize("turn", [0.0, 25.0, 90.0])
def test_interlaced_images_of_a_moving_board_are_refused(turn):
    board = Checkerboard(7, 6, 25.0)
    image, truth = seen(board, pose_of(board, turn=turn), noise=10.0)
    check_fields(image, truth.reshape(6, 7, 2))
    for shift in (3, 6):
        combed = image.copy()
        combed[1::2] = np.roll(image[1::2], shift, axis=1)
        with pytest.raises(DetectionError, match="odd and even lines"):
            check_fields(combed, truth.reshape(6, 7, 2))
        with pytest.raises(DetectionError):
            find_corners(combed, board)


@pytest.mark.parametrize("outside", [(-0.5, 20.0), (20.0, 99.6), (500.0, 20.0)])
def test_grids_outside_of_the_image_are_no_candidates(monkeypatch, outside):
    image = np.zeros((100, 100), np.uint8)
    grid = np.stack(np.meshgrid(np.arange(20.0, 80, 15), np.arange(20.0, 80, 15)), axis=-1)
    monkeypatch.setattr(grid_file, "_views", lambda image: [(image, 1.0, np.zeros(2), [(found, 0)])])

    def found(view, size, flags):
        return True, grid.reshape(-1, 1, 2).astype(np.float32)

    assert len(list(candidate_grids(image, 4, 4))) == 1
    grid[0, 0] = outside
    assert not list(candidate_grids(image, 4, 4))


def test_nothing_found():
    with pytest.raises(DetectionError, match="no board of 8 x 6"):
        find_corners(np.full((480, 640), 77, np.uint8), Checkerboard())
    with pytest.raises(DetectionError, match="no board of 6 x 8"):
        find_corners(seen(Checkerboard(5, 4, 25.0), pose_of(Checkerboard(5, 4, 25.0)))[0], Checkerboard(6, 8))


def fits_of(amplitude, **changes):
    n = len(amplitude)
    parameters = np.zeros((n, 9))
    parameters[:, 6] = amplitude
    values = {"sigma": np.full(n, 0.02), "misfit": np.full(n, 0.05), "converged": np.full(n, True)} | changes
    return CornerFits(parameters, **values)


def test_unclear_corners_are_counted():
    grid = 30.0 * np.stack(np.meshgrid(np.arange(3.0), np.arange(3.0)), axis=-1)
    start, amplitude = grid.reshape(-1, 2), 80.0 * (1 - 2 * (np.arange(9) % 2))
    _check(start + 0.5, fits_of(amplitude), grid)
    one = np.arange(9) == 4
    for changes in ({"sigma": 0.02 + one}, {"misfit": 0.05 + one}, {"converged": ~one}):
        with pytest.raises(DetectionError, match=r"1 of 9 corners .* near \(30, 30\)"):
            _check(start + 0.5, fits_of(amplitude, **changes), grid)
    for factor in (-1.0, 0.1):  # its neighbours' colours; faint
        with pytest.raises(DetectionError, match="1 of 9 corners"):
            _check(start + 0.5, fits_of(np.where(one, factor, 1.0) * amplitude), grid)
    with pytest.raises(DetectionError, match="9 of 9 corners"):
        _check(start + 8, fits_of(amplitude), grid)


def test_a_covered_corner_is_not_invented():
    board = Checkerboard(7, 6, 25.0)
    image, truth = seen(board, pose_of(board))
    x, y = np.rint(truth[24]).astype(int)
    image[y - 9 : y + 10, x - 9 : x + 10] = 128
    with pytest.raises(DetectionError):
        find_corners(image, board)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((0, 5), np.uint8),
        np.zeros((50, 50)),
        np.zeros((50, 50, 3), np.uint8),
        np.zeros((9, 9), np.uint16),
        None,
    ],
)
def test_unusable_images(image):
    with pytest.raises(ValueError, match="image is None.*not read" if image is None else "image"):
        find_corners(image, Checkerboard())


def test_too_small_boards():
    with pytest.raises(ValueError, match="board has 2 columns"):
        find_corners(np.zeros((50, 50), np.uint8), Checkerboard(2, 5))


@settings(max_examples=15)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_noise_gives_no_board(height, width, seed):
    image = np.random.default_rng(seed).integers(0, 256, (height, width)).astype(np.uint8)
    with pytest.raises(DetectionError):
        find_corners(image, Checkerboard(5, 4))


# ---- measured corners of real photographs ----


def test_committed_corners_calibrate_well():
    object_points, image_points, size, names = photographs.load_corners()
    assert len(names) == 13 and size == (640, 480) and names[0] == "left01"
    assert all(len(points) == 54 for points in object_points + image_points)
    objects = [points.astype(np.float32) for points in object_points]
    images = [points.astype(np.float32).reshape(-1, 1, 2) for points in image_points]
    rms, matrix = cv2.calibrateCamera(objects, images, size, None, None)[:2]
    assert rms < 0.17  # 0.195 with cornerSubPix in a 5 px window, 0.239 with OpenCV's sector-based detector
    assert abs(matrix[0, 0] - 533.0) < 2  # the MATLAB toolbox's published focal length


def test_committed_corners_are_current(pegpose_data, tmp_path):
    measured.write_measured(tmp_path)
    committed = photographs.FOLDER / photographs.CORNERS_FILE
    headers = [path.read_text().splitlines()[:2] for path in (tmp_path / photographs.CORNERS_FILE, committed)]
    assert headers[0] == headers[1]
    now, then = photographs.load_corners(tmp_path / photographs.CORNERS_FILE), photographs.load_corners()
    assert now[2:] == then[2:]
    np.testing.assert_array_equal(now[0], then[0])
    np.testing.assert_allclose(now[1], then[1], atol=1e-3)
