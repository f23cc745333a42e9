"""What the package's own methods measured in third-party photographs: data/measured/.

``python3 -m pegpose_lab.measured`` finds the photographs (see `datasets.dataset`) and writes every file anew;
notebooks read the files, so that they do not need the photographs.
"""

import cv2

from .corners import find_corners
from .datasets import dataset, read_corners, write_corners
from .results import PROJECT_FOLDER
from .targets import Checkerboard

FOLDER = PROJECT_FOLDER / "data" / "measured"
CORNERS_FILE = "opencv_left_corners.csv"
LEFT_BOARD = Checkerboard(columns=9, rows=6, square=30.0)
LEFT_SIZE = (640, 480)
COMMAND = "python3 -m pegpose_lab.measured"


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


def _read(path):
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None or image.shape[::-1] != LEFT_SIZE:
        raise ValueError(f"{path} is no picture of {LEFT_SIZE[0]} x {LEFT_SIZE[1]} px; get an unchanged copy")
    return image


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


def write_measured(folder=FOLDER):
    """Measure everything anew and write it below `folder`; see `measure_corners` for the errors."""
    comment = (
        f"corners by find_corners in OpenCV's left01..left14.jpg ({LEFT_SIZE[0]} x {LEFT_SIZE[1]} px), board of "
        f"{LEFT_BOARD.columns} x {LEFT_BOARD.rows} corners, X Y in mm, u v in px; made by: {COMMAND}"
    )
    write_corners(folder / CORNERS_FILE, *measure_corners(), comment)


if __name__ == "__main__":
    write_measured()
