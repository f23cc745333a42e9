"""Corners and disc centres in third-party photographs, and how calibrations depend on their detector."""

import cv2
import numpy as np
import pandas as pd

from ..calibration import calibrate_joint
from ..camera import Sensor
from ..checks import DetectionError
from ..circles import find_circles
from ..corners import find_corners
from ..discs import fit_discs
from ..files import PROJECT_FOLDER
from ..targets import Checkerboard
from .datasets import dataset, read_corners
from .held_out import sensitivity

FOLDER = PROJECT_FOLDER / "data" / "measured"
CORNERS_FILE = "opencv_left_corners.csv"
LEFT_BOARD = Checkerboard(columns=9, rows=6, square=30.0)
LEFT_SIZE = (640, 480)
SENSITIVITY_FILE, WINDOWS = "opencv_left_detectors.csv", (5, 11)  # px, half widths as cv2.cornerSubPix takes them
GRID_FILE = "visp_circles_centers.csv"
GRID_PITCH, GRID_SIZE = 34.0, (320, 240)  # mm, px
GRID_RADIUS = GRID_PITCH / 3  # mm, of a disc


def measure_corners():
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
    """The grey values of a photograph, None if it is no image; cv2.imread fails on some paths beyond ASCII (Windows)."""
    return cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_GRAYSCALE)


def _read(path):
    image = _grey(path)
    if image is None or image.shape[::-1] != LEFT_SIZE:
        raise ValueError(f"{path} is no picture of {LEFT_SIZE[0]} x {LEFT_SIZE[1]} px; get an unchanged copy")
    return image


def measure_sensitivity():
    """The joint calibration of opencv_left by three detectors, see `held_out.sensitivity`.

    This project's `find_corners`, and `cv2.cornerSubPix` from there with windows of 11 and 23 px.

    Raises
    ------
    ValueError, FileNotFoundError, DetectionError
        As `measure_corners`.
    """
    paths = sorted(dataset("opencv_left").glob("left[0-9][0-9].jpg"))
    _, object_points, corners = measure_corners()
    images, stop = {"find_corners": corners}, (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
    for half in WINDOWS:
        images[f"cornerSubPix, {2 * half + 1} px"] = [
            cv2.cornerSubPix(_read(path), seen.astype(np.float32), (half, half), (-1, -1), stop).reshape(-1, 2)
            for path, seen in zip(paths, corners, strict=True)
        ]
    width, height = LEFT_SIZE
    sensor = Sensor((1.0, 1.0), ((width - 1) / 2, (height - 1) / 2), LEFT_SIZE)
    return sensitivity(lambda *views: calibrate_joint(*views, sensor), object_points, images)


def load_sensitivity(path=FOLDER / SENSITIVITY_FILE):
    """Read the table of `measure_sensitivity`."""
    return pd.read_csv(path, comment="#")


def load_corners(path=FOLDER / CORNERS_FILE):
    """Read the measured corners of opencv_left.

    Returns
    -------
    object_points, image_points : list of (54, 3) and (54, 2) arrays
        mm and px, an entry for each view.
    image_size : tuple
        (width, height), px.
    names : list of str
    """
    names, object_points, image_points = read_corners(path)
    return object_points, image_points, LEFT_SIZE, names


def measure_grid():
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


def load_grid(path=FOLDER / GRID_FILE):
    """Read the measured discs of visp_circles; returns as `load_corners`."""
    names, object_points, image_points = read_corners(path)
    return object_points, image_points, GRID_SIZE, names
