"""Boards of another size, cut, or moving are refused."""

import cv2
import numpy as np
import pytest

from pegpose_lab.checks import DetectionError
from pegpose_lab.corners import find_corners
from pegpose_lab.corners.whole_board import check_ends, check_fields
from pegpose_lab.render.board import BoardLook
from pegpose_lab.targets import Checkerboard
from pegpose_lab.tests.corners.boards import distances, pose_of, seen


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
