"""Boards that are cut by the border of the image or hidden: true numbers, or refused."""

import cv2
import numpy as np
import pytest

from pegpose_lab.calibration import calibrate_joint
from pegpose_lab.checks import DetectionError
from pegpose_lab.corners import find_corners, locate_board
from pegpose_lab.corners.grow import grow_grid
from pegpose_lab.corners.seeds import blocks_of_nine
from pegpose_lab.render.board import BoardLook
from pegpose_lab.targets import Checkerboard
from pegpose_lab.tests.corners.boards import CAMERA, distances, pose_of, seen


def errors_of(corners, truth):
    """Distances from the truth, px, in the order that fits best of those that look the same."""
    order = np.arange(len(truth)).reshape(corners.board.rows, corners.board.columns)
    alike = (0, 2) if (corners.board.columns + corners.board.rows) % 2 == 0 else (0,)
    turned = [truth[np.rot90(order, turn).ravel()[corners.index]] for turn in alike]
    return min((distances(corners.image_points, points) for points in turned), key=np.median)


def hide(image, box, level):
    """The image with a box ((x, y), (width, height), degrees) of one grey value over it, with a blurred edge."""
    mask = np.zeros(image.shape, np.uint8)
    cv2.fillPoly(mask, [np.rint(cv2.boxPoints(box)).astype(np.int32)], 255)
    share = cv2.GaussianBlur(mask, (0, 0), 1.0) / 255
    return np.rint(image * (1 - share) + level * share).astype(np.uint8)


def attempt(image, board, truth):
    """The numbers of corners that are measured, 0 if the board is refused; a wrong number fails."""
    try:
        corners = locate_board(image, board)
    except DetectionError:
        return 0
    assert errors_of(corners, truth).max() < 0.4
    return len(corners.index)


def test_a_whole_board_is_that_of_find_corners():
    board = Checkerboard(7, 6, 25.0)
    image, _ = seen(board, pose_of(board, turn=30.0))
    corners = locate_board(image, board)
    assert corners.whole and (corners.index == np.arange(42)).all()
    np.testing.assert_array_equal(corners.image_points, find_corners(image, board))
    np.testing.assert_array_equal(corners.object_points, board.object_points)


@pytest.mark.parametrize("shape", [(9, 6), (8, 6)])
@pytest.mark.parametrize("lines", [1, 2])
def test_lines_cut_off_by_the_border(shape, lines):
    board = Checkerboard(*shape, 20.0)
    image, truth = seen(board, pose_of(board, turn=8.0, depth=800.0))
    grid = truth.reshape(board.rows, board.columns, 2)
    middle = int((grid[-lines].max(axis=0)[1] + grid[-lines - 1].max(axis=0)[1]) / 2)
    part = locate_board(image[:middle], board)
    assert not part.whole and len(part.index) >= (board.rows - lines) * board.columns
    assert errors_of(part, truth).max() < 0.1
    with pytest.raises(DetectionError, match=f"locate_board` measures the {len(part.index)} of"):
        find_corners(image[:middle], board)


def test_the_reason_names_what_was_seen():
    board = Checkerboard(6, 9, 25.0)
    image, truth = seen(board, pose_of(board, tilt=(0.0, 0.0), depth=800.0))
    top, bottom = (np.mean(truth.reshape(9, 6, 2)[rows, :, 1]) for rows in ((0, 1), (7, 8)))
    reason = "a part of 7 x 6 is seen, with its rim at the right and the left side, and 3 places"
    for find in (find_corners, locate_board):
        with pytest.raises(DetectionError, match=reason):
            find(image[int(top) : int(bottom)], board)


def test_covered_corners_are_left_out():
    board = Checkerboard(9, 6, 20.0)
    image, truth = seen(board, pose_of(board, depth=800.0))
    covered = hide(image, (tuple(truth[22]), (24.0, 20.0), 25.0), 250)
    corners = locate_board(covered, board)
    assert 22 not in corners.index and 40 <= len(corners.index) < 54
    assert errors_of(corners, truth).max() < 0.2


def test_random_cuts_and_covers_never_give_wrong_numbers():
    rng, found = np.random.default_rng(1), []
    for board, turn in (
        (Checkerboard(9, 6, 20.0), 10.0),
        (Checkerboard(8, 6, 22.0), -75.0),
        (Checkerboard(5, 5, 30.0), 40.0),
    ):
        image, truth = seen(board, pose_of(board, turn=turn), look=BoardLook(surroundings=rng.uniform(0, 255)))
        for _ in range(6):
            left, top = rng.integers(0, 240), rng.integers(0, 160)
            cut = image[top : top + 320, left : left + 400]
            found.append(attempt(cut, board, truth - [left, top]))
            box = (
                tuple(rng.uniform(100, 400, 2)),
                tuple(rng.uniform(80, 250, 2)),
                turn + rng.choice([0, rng.uniform(0, 90)]),
            )
            found.append(attempt(hide(image, box, rng.choice([0, 220, 255])), board, truth))
    assert np.count_nonzero(found) > len(found) / 4


def test_views_of_parts_calibrate():
    board = Checkerboard(9, 6, 20.0)
    views = []
    for tilt in ((25.0, 0.0), (0.0, 28.0), (-20.0, -20.0)):
        image, truth = seen(board, pose_of(board, tilt=tilt, depth=450.0))
        last = truth.reshape(6, 9, 2)[:, 7:, 0].mean()  # between the last two columns
        views.append(locate_board(image[:, : int(last)], board))
    assert [len(view.index) for view in views] == [48, 48, 47]
    found = calibrate_joint(
        [view.object_points for view in views], [view.image_points for view in views], CAMERA.sensor
    )
    assert found.rms < 0.05 and abs(found.camera.focal_length / 50.0 - 1) < 0.01


# ---- sigmas ----


@pytest.mark.parametrize("blur, noise", [(0.9, 2.0), (1.4, 6.0)])
def test_stated_sigmas_are_those_of_the_errors(blur, noise):
    board, ratios = Checkerboard(8, 6, 22.0), []
    for rng in range(3):  # 144 corners
        image, truth = seen(board, pose_of(board, turn=20.0), blur=blur, noise=noise, rng=rng)
        corners = locate_board(image, board)
        ratios.append(errors_of(corners, truth) ** 2 / (2 * corners.sigmas**2))
    assert 0.85 < np.sqrt(np.mean(ratios)) < 1.15


# ---- starts ----


def test_starts_are_neighbours():
    board = Checkerboard(7, 5, 24.0)
    image, truth = seen(board, pose_of(board, turn=35.0), noise=3.0)
    regular = 0
    for block in blocks_of_nine(image):
        number = [np.argmin(distances(truth, place)) for place in block.reshape(-1, 2)]
        row, column = np.divmod(np.reshape(number, (3, 3)), 7)
        regular += np.ptp(row) == 2 and np.ptp(column) == 2
    assert regular >= 15


def test_a_slanted_lattice_does_not_grow():
    board = Checkerboard(9, 6, 20.0)
    image, truth = seen(board, pose_of(board))
    grid = truth.reshape(6, 9, 2)
    straight = grow_grid(image, grid[1:4, 2:5], 9)[1]
    assert straight.all() and straight.shape == (6, 9)
    slanted = np.array([[grid[1 + row, 1 + column + 2 * row] for column in range(3)] for row in range(3)])
    assert not grow_grid(image, slanted, 9)[1].any()


def test_noise_has_no_parts():
    for seed in range(3):
        noise = np.random.default_rng(seed).integers(0, 256, (300, 400)).astype(np.uint8)
        with pytest.raises(DetectionError, match="no board of 5 x 4"):
            locate_board(noise, Checkerboard(5, 4))


def test_small_squares():
    board = Checkerboard(9, 6, 10.0)
    image, truth = seen(board, pose_of(board, tilt=(5.0, 5.0), turn=10.0, depth=1150.0))  # squares of 5.8 px
    assert errors_of(locate_board(image, board), truth).max() < 0.15
