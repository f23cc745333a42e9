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
    assert hub.peg_centers == pytest.approx(97.05 / 2 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]), abs=1e-12)


def test_screws_stand_between_pegs_1_and_4_and_pegs_2_and_3():
    hub = Hub()
    assert hub.screw_angles == pytest.approx((-np.pi / 4, 3 * np.pi / 4))
    squared = np.sum((hub.screw_centers[:, None, :2] - hub.peg_centers[None, :, :2]) ** 2, axis=2)
    nearest = np.sort(np.argsort(squared, axis=1)[:, :2] + 1, axis=1)
    assert nearest.tolist() == [[1, 4], [2, 3]]
    assert np.all(hub.screw_centers[:, 2] == hub.peg_height) and hub.bore_center[2] == hub.peg_height


@pytest.mark.parametrize(
    "change", [{"n_pegs": 2}, {"n_pegs": 4.5}, {"peg_radius": 0}, {"peg_radius": 40}, {"peg_height": -1}, {"radius": 10}]
)
def test_impossible_hubs_are_refused(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        Hub(**change)


@pytest.mark.parametrize("change", [{"columns": 1}, {"rows": 2.5}, {"square": -29}, {"square": np.nan}])
def test_impossible_boards_are_refused(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        Checkerboard(**change)
