"""The stored corners of OpenCV's sector-based detector."""

import numpy as np
import pytest

from pegpose_lab.checks import DetectionError
from pegpose_lab.files import MEASURED_FOLDER
from pegpose_lab.paper import paper_experiment
from pegpose_lab.study import sector_corners


def test_the_file_is_current():
    """To 0.02 px: so far may another processor's rounding move a corner."""
    stored = sector_corners.load_sector_corners()
    assert len(stored) == 5
    for index in (0, 4):
        assert np.abs(sector_corners.find_sector_corners(index) - stored[index]).max() < 0.02


def test_they_are_in_the_order_of_the_board():
    truth = paper_experiment()
    for points, pose in zip(sector_corners.load_sector_corners(), truth.cam_from_boards, strict=True):
        errors = points - truth.camera.project(truth.board.object_points, pose)
        assert np.abs(errors).max() < 0.15 and errors.std() < 0.02


def test_what_is_written_reads_back(tmp_path, monkeypatch):
    views = sector_corners.load_sector_corners()
    monkeypatch.setattr(sector_corners, "find_sector_corners", lambda index: views[index])
    sector_corners.write_sector_corners(tmp_path)
    assert (tmp_path / "sector_corners.csv").read_bytes() == (MEASURED_FOLDER / "sector_corners.csv").read_bytes()


def test_a_board_that_is_not_found_is_an_error(monkeypatch):
    monkeypatch.setattr(sector_corners.cv2, "findChessboardCornersSB", lambda *_, **__: (False, None))
    with pytest.raises(DetectionError, match="does not find board 3"):
        sector_corners.find_sector_corners(2)
