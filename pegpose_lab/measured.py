"""What the package's own methods measured in third-party photographs: data/measured/.

``python3 -m pegpose_lab.measured`` finds the photographs (see `datasets.dataset`) and writes every file anew;
notebooks read the files, so that they do not need the photographs.
"""

import cv2
import numpy as np
import pandas as pd

from .circles import find_circles
from .corners import find_corners
from .datasets import dataset, read_corners, write_corners
from .edges import fit_discs
from .results import PROJECT_FOLDER, replacing
from .targets import Checkerboard

FOLDER = PROJECT_FOLDER / "data" / "measured"
CORNERS_FILE = "opencv_left_corners.csv"
LEFT_BOARD = Checkerboard(columns=9, rows=6, square=30.0)
LEFT_SIZE = (640, 480)
COMMAND = "python3 -m pegpose_lab.measured"
COUNTS_FILE, KNOWN_FILE = "circle_counts.csv", "known_circles.csv"
SEARCHES = (  # data set, its pictures, radius range (px), polarity; all else is the default
    ("visp-mire2-a", "*.png", (5, 35), "bright"),
    ("visp-grid36-a", "*.png", (5, 30), "dark"),
    ("skimage-coins", "*.png", (12, 35), "bright"),
    ("conrods-a", "*.bmp", (6, 20), "bright"),
    ("screws4-a", "*.jpg", (38, 62), "dark"),
)
SCREWS = "screws4-a"
NEAR = 0.5  # of the radius: how far a circle may be from the disc it stands for, in centre and radius


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


def count_circles():
    """Circles that `find_circles` finds in photographs with known counts, with its defaults.

    Returns
    -------
    DataFrame
        A row for each picture: dataset, picture, r_min, r_max, polarity; known: how many discs there are; found:
        how many of them; false: circles that belong to none; measured: how many of those found `fit_discs`
        accepts, which models an even disc on even ground and says of every other why not.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    """
    places, rows = pd.read_csv(FOLDER / KNOWN_FILE, comment="#"), []
    for name, pattern, radii, polarity in SEARCHES:
        for path in sorted(dataset(name).glob(pattern)):
            image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            circles = find_circles(image, radii, polarity=polarity)
            known = places[(places["dataset"] == name) & (places["picture"] == path.name)]
            match = _in_quarters if name == SCREWS else _at_places
            number, found = match(circles, known[["x", "y", "r"]].to_numpy(float), path.stem, image.shape)
            accepted = int(fit_discs(image, circles).accepted[found].sum())
            rows.append(
                (name, path.name, *radii, polarity, number, len(found), len(circles) - len(found), accepted)
            )
    columns = ["dataset", "picture", "r_min", "r_max", "polarity", "known", "found", "false", "measured"]
    return pd.DataFrame(rows, columns=columns)


def _at_places(circles, places, _name, _shape):
    """How many discs there are, and the indices of the circles nearest to each, if near enough."""
    found = []
    for x, y, r in places:
        apart = np.maximum(np.hypot(*(circles.centers - (x, y)).T), np.abs(circles.radii - r))
        apart[found] = np.inf
        if len(apart) and apart.min() < NEAR * r:
            found.append(int(apart.argmin()))
    return len(places), found


def _in_quarters(circles, _places, name, shape):
    """The same for screws: four bits at the end of the name say in which quarter of the picture there is one."""
    there = [bit == "1" for bit in name[-4:]]
    quarter = (circles.centers[:, 0] > shape[1] / 2) + 2 * (circles.centers[:, 1] > shape[0] / 2)
    found = [int(np.flatnonzero(quarter == q)[0]) for q in range(4) if there[q] and (quarter == q).any()]
    return sum(there), found


def load_counts(path=FOLDER / COUNTS_FILE):
    """Read the table of `count_circles`."""
    return pd.read_csv(path, comment="#")


def write_measured(folder=FOLDER):
    """Measure everything anew and write it below `folder`; errors as in `measure_corners` and `count_circles`."""
    with replacing(folder / COUNTS_FILE) as path:
        table = count_circles().to_csv(index=False, lineterminator="\n")
        comment = f"# circles found in photographs with known counts; made by: {COMMAND}\n"
        path.write_text(comment + table, encoding="utf-8")
    comment = (
        f"corners by find_corners in OpenCV's left01..left14.jpg ({LEFT_SIZE[0]} x {LEFT_SIZE[1]} px), board of "
        f"{LEFT_BOARD.columns} x {LEFT_BOARD.rows} corners, X Y in mm, u v in px; made by: {COMMAND}"
    )
    write_corners(folder / CORNERS_FILE, *measure_corners(), comment)


if __name__ == "__main__":
    write_measured()
