"""The search for a board's grid: bounded, in small and large images."""

import cv2
import numpy as np
import pytest

from pegpose_lab.camera import TsaiCamera
from pegpose_lab.checks import DetectionError
from pegpose_lab.corners import find_corners
from pegpose_lab.corners import grid as grid_file
from pegpose_lab.corners.grid import candidate_grids
from pegpose_lab.render import render_board
from pegpose_lab.targets import Checkerboard
from pegpose_lab.tests.corners.boards import distances, pose_of, seen


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
