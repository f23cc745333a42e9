"""Corners: order, accuracy on rendered boards, real photographs, errors."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pegpose_lab.checks import DetectionError
from pegpose_lab.corners import find_corners
from pegpose_lab.corners.fit import CornerFits
from pegpose_lab.corners.measure import check_corners, fit_grid
from pegpose_lab.files import MEASURED_FOLDER
from pegpose_lab.paper import paper_experiment
from pegpose_lab.render.board import BoardLook
from pegpose_lab.study import photographs
from pegpose_lab.targets import Checkerboard
from pegpose_lab.tests.corners.boards import distances, pose_of, seen


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


# ---- the image alone decides ----


def test_corners_do_not_depend_on_where_the_grid_was_found():
    board, rng = Checkerboard(7, 6, 25.0), np.random.default_rng(1)
    image, truth = seen(board, pose_of(board))
    grid = truth.reshape(6, 7, 2)
    found = [fit_grid(image, grid + rng.normal(0, 0.3, grid.shape))[0] for _ in range(3)]
    assert np.ptp(found, axis=0).max() < 2e-5


# ---- boards of another size ----


def test_nothing_found():
    with pytest.raises(DetectionError, match="no board of 8 x 6"):
        find_corners(np.full((480, 640), 77, np.uint8), Checkerboard())
    with pytest.raises(DetectionError, match="no board of 6 x 8"):
        find_corners(seen(Checkerboard(5, 4, 25.0), pose_of(Checkerboard(5, 4, 25.0)))[0], Checkerboard(6, 8))


def fits_of(amplitude, **changes):
    n = len(amplitude)
    parameters = np.zeros((n, 9))
    parameters[:, 6] = amplitude
    values = {
        "sigma": np.full(n, 0.02),
        "covariance": np.tile(4e-4 * np.eye(2), (n, 1, 1)),
        "misfit": np.full(n, 0.05),
        "converged": np.full(n, True),
    } | changes
    return CornerFits(parameters, **values)


def test_unclear_corners_are_counted():
    grid = 30.0 * np.stack(np.meshgrid(np.arange(3.0), np.arange(3.0)), axis=-1)
    start, amplitude = grid.reshape(-1, 2), 80.0 * (1 - 2 * (np.arange(9) % 2))
    check_corners(start + 0.5, fits_of(amplitude), grid)
    one = np.arange(9) == 4
    for changes in ({"sigma": 0.02 + one}, {"misfit": 0.05 + one}, {"converged": ~one}):
        with pytest.raises(DetectionError, match=r"1 of 9 corners .* near \(30, 30\)"):
            check_corners(start + 0.5, fits_of(amplitude, **changes), grid)
    for factor in (-1.0, 0.1):  # its neighbours' colours; faint
        with pytest.raises(DetectionError, match="1 of 9 corners"):
            check_corners(start + 0.5, fits_of(np.where(one, factor, 1.0) * amplitude), grid)
    with pytest.raises(DetectionError, match="9 of 9 corners"):
        check_corners(start + 8, fits_of(amplitude), grid)


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
    photographs.write_left_corners(tmp_path)
    file = f"{photographs.CORNERS}.csv"
    headers = [(folder / file).read_text().splitlines()[:2] for folder in (tmp_path, MEASURED_FOLDER)]
    assert headers[0] == headers[1]
    now, then = photographs.load_corners(tmp_path), photographs.load_corners()
    assert now[2:] == then[2:]
    np.testing.assert_array_equal(now[0], then[0])
    np.testing.assert_allclose(now[1], then[1], atol=1e-3)
