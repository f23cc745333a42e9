"""Corners of the experiment's five boards by OpenCV's sector-based detector, as they were found once.

`cv2.findChessboardCornersSB` with its flags for accuracy takes a second per image, and another processor's rounding
moves single corners by up to 0.003 px, enough to count a point on the other side of a limit.  Notebooks that compare
corner detectors therefore read its corners from data/measured/sector_corners.csv.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..checks import DetectionError
from ..files import MEASURED_FOLDER
from ..paper import paper_experiment
from .datasets import read_corners, write_corners
from .measured import made_by

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

NAME = "sector_corners"


def find_sector_corners(index: int) -> NDArray[np.float64]:
    """Return the corners (48, 2), px, of board `index` (0 to 4) in the order of the board's points.

    Raises
    ------
    DetectionError
        If OpenCV does not find the board.
    """
    truth = paper_experiment()
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    pattern = truth.board.columns, truth.board.rows
    found, points = cv2.findChessboardCornersSB(truth.board_image(index), pattern, flags=flags)
    if not found:
        raise DetectionError(f"OpenCV's sector-based detector does not find board {index + 1} in its rendered image")
    points = points.reshape(-1, 2).astype(float)
    exact = truth.camera.project(truth.board.object_points, truth.cam_from_boards[index])
    return min((points, points[::-1]), key=lambda order: np.abs(order - exact).max())


def write_sector_corners(folder: Path = MEASURED_FOLDER) -> None:
    """Find the corners of all five boards anew and write them into `folder`; raises as `find_sector_corners`."""
    board = paper_experiment().board.object_points
    views = [find_sector_corners(index) for index in range(5)]
    comment = (
        "corners by cv2.findChessboardCornersSB (exhaustive, accurate) in the five rendered boards of the experiment, "
        f"X Y in mm, u v in px; {made_by(NAME)}"
    )
    write_corners(folder / f"{NAME}.csv", [str(index + 1) for index in range(5)], [board] * 5, views, comment)


def load_sector_corners(folder: Path = MEASURED_FOLDER) -> list[NDArray[np.float64]]:
    """Read what `write_sector_corners` wrote: a list of five (48, 2) arrays, px.

    Examples
    --------
    >>> [corners.shape for corners in load_sector_corners()]
    [(48, 2), (48, 2), (48, 2), (48, 2), (48, 2)]
    """
    return read_corners(folder / f"{NAME}.csv")[2]
