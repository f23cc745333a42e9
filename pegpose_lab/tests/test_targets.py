"""Geometry of board and hub."""

import numpy as np
import pytest

from pegpose_lab import Checkerboard, Hub


def test_board_runs_row_by_row():
    board = Checkerboard(8, 6, 29.0)
    assert board.object_points.shape == (48, 3)
    assert board.object_points[1].tolist() == [29, 0, 0]
    assert board.object_points[8].tolist() == [0, 29, 0]
    assert board.object_points[-1].tolist() == [7 * 29, 5 * 29, 0]
    assert board.center.tolist() == [101.5, 72.5, 0]


def test_pegs_stand_at_equal_angles_from_the_x_axis():
    hub = Hub()
    assert hub.peg_centers == pytest.approx(
        97.05 / 2 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]), abs=1e-12
    )


def test_screws_stand_between_pegs_1_and_4_and_pegs_2_and_3():
    hub = Hub()
    assert hub.screw_angles == pytest.approx((-np.pi / 4, 3 * np.pi / 4))
    squared = np.sum((hub.screw_centers[:, None, :2] - hub.peg_centers[None, :, :2]) ** 2, axis=2)
    nearest = np.sort(np.argsort(squared, axis=1)[:, :2] + 1, axis=1)
    assert nearest.tolist() == [[1, 4], [2, 3]]
    assert np.all(hub.screw_centers[:, 2] == hub.peg_height) and hub.bore_center[2] == hub.peg_height


@pytest.mark.parametrize(
    "change",
    [
        {"n_pegs": 2},
        {"n_pegs": 4.5},
        {"n_pegs": "4"},
        {"n_pegs": True},
        {"n_pegs": 15},
        {"peg_radius": 0},
        {"peg_radius": 40},
        {"peg_radius": "10"},
        {"peg_height": -1},
        {"radius": 10},
        {"screw_angles": ()},
        {"screw_angles": []},
        {"screw_angles": 0.7},
        {"screw_angles": ("0.7",)},
        {"screw_angles": (0.7, np.nan)},
    ],
)
def test_impossible_hubs_are_refused(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        Hub(**change)


@pytest.mark.parametrize("number", [4.0, np.int64(4), np.uint8(4), np.float32(4)])
def test_whole_numbers_are_stored_as_ints(number):
    board, hub = Checkerboard(number, number), Hub(n_pegs=number)
    assert [type(value) for value in (board.columns, board.rows, hub.n_pegs)] == [int] * 3
    assert board == Checkerboard(4, 4) and hub == Hub(n_pegs=4) and hash(hub) == hash(Hub())
    assert board.object_points.shape == (16, 3) and hub.peg_centers.shape == (4, 3)


def test_screw_angles_may_be_an_array_and_a_single_one():
    hub = Hub(screw_angles=np.array([0.5]))
    assert hub.screw_angles == (0.5,) and hub.screw_centers.shape == (1, 3)


@pytest.mark.parametrize(
    "change",
    [
        {"columns": 1},
        {"rows": 2.5},
        {"columns": "8"},
        {"rows": True},
        {"square": -29},
        {"square": np.nan},
        {"square": "29"},
    ],
)
def test_impossible_boards_are_refused(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        Checkerboard(**change)
