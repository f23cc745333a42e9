"""Corners and disc centres in third-party photographs, and how calibrations depend on their detector."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..calibration import calibrate_joint
from ..camera import Sensor
from ..checks import DetectionError
from ..circles import find_circles
from ..corners import find_corners
from ..discs import fit_discs
from ..files import MEASURED_FOLDER
from ..targets import Checkerboard
from .datasets import dataset, read_corners, write_corners
from .held_out import sensitivity
from .measured import made_by, write_measured
from .opencv_corners import sub_pixel_corners

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from pandas import DataFrame

CORNERS = "opencv_left_corners"
LEFT_BOARD = Checkerboard(columns=9, rows=6, square=30.0)
LEFT_SIZE = (640, 480)
WINDOWS = (5, 11)  # px, half widths as cv2.cornerSubPix takes them
GRID = "visp_circles_centers"
GRID_PITCH, GRID_SIZE = 34.0, (320, 240)  # mm, px
GRID_RADIUS = GRID_PITCH / 3  # mm, of a disc


def measure_corners() -> tuple[list[str], list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Find the corners in the 13 photographs of opencv_left.

    Returns
    -------
    names : list of str
        The photographs' file names without ending.
    object_points, image_points : list of (54, 3) and (54, 2) arrays
        mm and px, an entry for each view.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found, or do not have the size `LEFT_SIZE`.
    DetectionError
        If a board is not found.
    """
    paths = sorted(dataset("opencv_left").glob("left[0-9][0-9].jpg"))
    image_points = [find_corners(_read(path), LEFT_BOARD) for path in paths]
    return [path.stem for path in paths], [LEFT_BOARD.object_points for _ in paths], image_points


def _grey(path):
    """The grey values of a photograph, None if it is not an image; cv2.imread fails on some paths beyond ASCII (Windows)."""
    return cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_GRAYSCALE)


def _read(path):
    image = _grey(path)
    if image is None or image.shape[::-1] != LEFT_SIZE:
        raise ValueError(f"{path} is not an image of {LEFT_SIZE[0]} x {LEFT_SIZE[1]} px; get an unchanged copy")
    return image


def measure_sensitivity() -> DataFrame:
    """The joint calibration of opencv_left by three detectors, see `held_out.sensitivity`.

    This project's `find_corners`, and `cv2.cornerSubPix` from there with windows of 11 and 23 px.

    Raises
    ------
    ValueError, FileNotFoundError, DetectionError
        As `measure_corners`.
    """
    paths = sorted(dataset("opencv_left").glob("left[0-9][0-9].jpg"))
    _, object_points, corners = measure_corners()
    images = {"find_corners": corners}
    for half in WINDOWS:
        images[f"cornerSubPix, {2 * half + 1} px"] = [
            sub_pixel_corners(_read(path), seen, half) for path, seen in zip(paths, corners, strict=True)
        ]
    width, height = LEFT_SIZE
    sensor = Sensor((1.0, 1.0), ((width - 1) / 2, (height - 1) / 2), LEFT_SIZE)
    return sensitivity(lambda *views: calibrate_joint(*views, sensor), object_points, images)


def write_sensitivity(folder: Path = MEASURED_FOLDER) -> None:
    """Write the table of `measure_sensitivity` into `folder`; raises as it does."""
    what, name = "joint calibration of opencv_left by three corner detectors", "opencv_left_detectors"
    write_measured(folder, name, measure_sensitivity(), f"{what}; {made_by(name)}")


def write_left_corners(folder: Path = MEASURED_FOLDER) -> None:
    """Write what `measure_corners` finds into `folder`; raises as it does."""
    comment = (
        f"corners by find_corners in OpenCV's left01..left14.jpg ({LEFT_SIZE[0]} x {LEFT_SIZE[1]} px), board of "
        f"{LEFT_BOARD.columns} x {LEFT_BOARD.rows} corners, X Y in mm, u v in px; {made_by(CORNERS)}"
    )
    write_corners(folder / f"{CORNERS}.csv", *measure_corners(), comment)


def load_corners(
    folder: Path = MEASURED_FOLDER,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]], tuple[int, int], list[str]]:
    """Read the measured corners of opencv_left.

    Returns
    -------
    object_points, image_points : list of (54, 3) and (54, 2) arrays
        mm and px, an entry for each view.
    image_size : tuple
        (width, height), px.
    names : list of str

    Examples
    --------
    >>> object_points, image_points, image_size, names = load_corners()
    >>> len(names), image_points[0].shape, image_size
    (13, (54, 2), (640, 480))
    """
    names, object_points, image_points = read_corners(folder / f"{CORNERS}.csv")
    return object_points, image_points, LEFT_SIZE, names


def measure_grid() -> tuple[list[str], list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Measure the discs of the 6 x 6 grid in the five photographs of visp_circles by `fit_discs`.

    `cv2.findCirclesGrid` says only which disc is which.

    Returns
    -------
    names, object_points, image_points
        As `measure_corners`; the centres of the discs' images, which are not the images of the discs' centres.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    DetectionError
        If one of the discs is not found or its fit is rejected.
    """
    paths = sorted(dataset("visp_circles").glob("*.jpg"))
    x, y = np.meshgrid(np.arange(6) * GRID_PITCH, np.arange(6) * GRID_PITCH)
    object_points = np.column_stack([x.ravel(), y.ravel(), np.zeros(36)])
    return [path.stem for path in paths], [object_points] * len(paths), [_grid_centers(path) for path in paths]


def _grid_centers(path):
    """Centres (36, 2) of one photograph's discs."""
    image = _grey(path)
    discs = fit_discs(image, find_circles(image, (4, 25), polarity="dark"))
    complete, order = cv2.findCirclesGrid(image, (6, 6))
    apart = np.hypot(*(discs.centers[:, None] - np.reshape(order, (1, -1, 2))).transpose(2, 0, 1))
    nearest = apart.argmin(axis=0) if complete else []
    if len(set(nearest)) != 36 or not discs.accepted[nearest].all():
        raise DetectionError(f"{path} does not show all 36 discs of the grid; get an unchanged copy")
    return discs.centers[nearest]


def write_grid(folder: Path = MEASURED_FOLDER) -> None:
    """Write what `measure_grid` finds into `folder`; raises as it does."""
    comment = (
        "centres of the discs' images by fit_discs in ViSP's circles-01..05.jpg (320 x 240 px), grid of 6 x 6 discs, "
        f"X Y in mm, u v in px; {made_by(GRID)}"
    )
    write_corners(folder / f"{GRID}.csv", *measure_grid(), comment)


def load_grid(
    folder: Path = MEASURED_FOLDER,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]], tuple[int, int], list[str]]:
    """Read the measured discs of visp_circles; returns as `load_corners`.

    Examples
    --------
    >>> object_points, image_points, image_size, names = load_grid()
    >>> len(names), image_points[0].shape
    (5, (36, 2))
    """
    names, object_points, image_points = read_corners(folder / f"{GRID}.csv")
    return object_points, image_points, GRID_SIZE, names
