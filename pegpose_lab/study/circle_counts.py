"""Discs found and missed in photographs whose discs are known."""

import cv2
import numpy as np
import pandas as pd

from .. import paper
from ..calibration import calibrate_joint
from ..camera import TsaiCamera
from ..checks import DetectionError
from ..circles import find_circles
from ..corners import find_corners
from ..discs import fit_discs
from ..files import PROJECT_FOLDER, replacing
from ..render import true_disc
from ..segmentation import segment
from ..targets import Checkerboard
from .datasets import dataset, read_corners, write_corners
from .held_out import sensitivity

FOLDER = PROJECT_FOLDER / "data" / "measured"
CORNERS_FILE = "opencv_left_corners.csv"
LEFT_BOARD = Checkerboard(columns=9, rows=6, square=30.0)
LEFT_SIZE = (640, 480)
COMMAND = "python3 -m pegpose_lab.study.circle_counts"
COUNTS_FILE, KNOWN_FILE = "circle_counts.csv", "known_circles.csv"
SCREWS = ("screws4-a", "*.jpg", (38, 62), "dark")
SEARCHES = (  # data set, its pictures, radius range (px), polarity; all else is the default
    ("visp-mire2-a", "*.png", (5, 35), "bright"),
    ("visp-grid36-a", "*.png", (5, 30), "dark"),
    ("skimage-coins", "*.png", (12, 35), "bright"),
    ("conrods-a", "*.bmp", (6, 20), "bright"),
    SCREWS,
    ("opencv-samples", "smarties.png", (15, 45), "dark"),
    ("opencv-samples", "coins.jpg", (18, 32), "dark"),
)
MISSED_FILE = "missed_circles.csv"
RIM, RIM_STEP = np.arange(2.0, 6.0), 10.0  # px on either side of a rim, and the step (grey values) that counts as one
SENSITIVITY_FILE, WINDOWS = "opencv_left_detectors.csv", (5, 11)  # px, half widths as cv2.cornerSubPix takes them
GRID_FILE = "visp_circles_centers.csv"
GRID_PITCH, GRID_SIZE = 34.0, (320, 240)  # mm, px
GRID_RADIUS = GRID_PITCH / 3  # mm, of a disc
# How far a circle may be from the disc it stands for, in centre and radius, as a part of the radius: as in the
# benchmark, for all data sets alike.  Marks by eye are good to half of it, and that an outline is an ellipse (mire2,
# conrods, grid36: ratio of axes up to 1.65) asks for no more: `KNOWN_FILE` has its centroid and the radius of its area.
NEAR = 0.1
OFF = 0.8  # of the radius, 40 px for the screws' heads: a circle whose centre is no further off was meant for the disc
ALONE = 1.6  # of the radius: half the side of the cut-out in which a disc is searched by itself
BITS_FILE = "screw_bits.csv"
PARTS_FILE, PART_OFF, PART_AREA = "segmented_parts.csv", 0.3, 0.3  # of a disc's radius, and of its area
HUB_COLUMNS, LIGHTS = (40, 680), (1, 2, 4, 8)  # px, where the rendered hub is; how many times lighter its right side


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
    camera = TsaiCamera(1.0, (1.0, 1.0), ((width - 1) / 2, (height - 1) / 2), LEFT_SIZE)
    return sensitivity(lambda *views: calibrate_joint(*views, camera), object_points, images)


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


def count_circles():
    """Circles that `find_circles` finds in photographs with known counts, with its defaults.

    Returns
    -------
    counts : DataFrame
        A row for each picture: dataset, picture, r_min, r_max, polarity; known: how many discs there are; found:
        how many of them; false: circles that fit none, those that are off, too; measured: how many of those found
        `fit_discs` accepts, which models an even disc on even ground and says of every other why not; rim: the mean
        `rim_share` of those found.
    missed : DataFrame
        A row for each disc that is not found: dataset, picture, x, y, r (px), its rim's share, and `why`:

        * "off": a circle is there, but it is off by more than `NEAR` (and by no more than `OFF`);
        * "shared": the disc is found if it is searched alone, in a cut-out around it;
        * "score": only a higher sensitivity finds it;
        * "no candidate": not even the highest does, in the picture or in the cut-out.

        The order of trying: default sensitivity alone ("shared"), highest sensitivity in the picture ("score") and
        alone ("shared").

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    """
    places, counts, missed = load_known().query("present == 1"), [], []
    for name, pattern, radii, polarity in SEARCHES:
        for path in sorted(dataset(name).glob(pattern)):
            image = _grey(path)
            circles = find_circles(image, radii, polarity=polarity)
            known = places[(places["dataset"] == name) & (places["picture"] == path.name)]
            known = known[["x", "y", "r"]].to_numpy(float)
            match = _match(circles, known)
            there, found = match >= 0, match[match >= 0]
            accepted = int(fit_discs(image, circles).accepted[found].sum())
            shares = [rim_share(image, *place, polarity) for place in known]
            rim = np.mean(shares, where=there) if there.any() else np.nan
            number = len(known), len(found), len(circles) - len(found), accepted, np.round(rim, 3)
            counts.append((name, path.name, *radii, polarity, *number))
            for i in np.flatnonzero(~there):
                why = _why(image, known[i], radii, polarity, circles)
                missed.append((name, path.name, *known[i], shares[i], why))
    columns = ["dataset", "picture", "r_min", "r_max", "polarity", "known", "found", "false", "measured", "rim"]
    missed = pd.DataFrame(missed, columns=["dataset", "picture", "x", "y", "r", "rim", "why"])
    return pd.DataFrame(counts, columns=columns), missed


def _match(circles, places, near=NEAR):
    """For each place (x, y, r) the index of the circle nearest to it, if near enough and free, or -1."""
    match = np.full(len(places), -1)
    for i, (x, y, r) in enumerate(places):
        apart = np.maximum(np.hypot(*(circles.centers - (x, y)).T), np.abs(circles.radii - r))
        apart[match[:i][match[:i] >= 0]] = np.inf
        if len(apart) and apart.min() <= near * r:
            match[i] = apart.argmin()
    return match


def _why(image, place, radii, polarity, circles):
    """Why a disc (x, y, r) is not among `circles`, see `count_circles`."""
    if _match(circles, [place], OFF)[0] >= 0:
        return "off"
    x, y, r = place
    left, top = max(int(x - ALONE * r), 0), max(int(y - ALONE * r), 0)
    alone = image[top : int(y + ALONE * r) + 1, left : int(x + ALONE * r) + 1], (x - left, y - top, r)
    highest = {"sensitivity": 1.0}
    for why, (part, there), settings in (
        ("shared", alone, {}), ("score", (image, place), highest), ("shared", alone, highest),
    ):
        if _match(find_circles(part, radii, polarity=polarity, **settings), [there])[0] >= 0:
            return why
    return "no candidate"


def rim_share(image, x, y, r, polarity):
    """Part of a circle's rim, in 64 directions, where the picture steps by RIM_STEP at least, in `polarity`'s sense."""
    turn = np.arange(64) * (2 * np.pi / 64)
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    inside, outside = (
        cv2.remap(
            image, (x + cos * rho).astype(np.float32), (y + sin * rho).astype(np.float32), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ).mean(axis=1)
        for rho in (r - RIM, r + RIM)
    )
    step = (inside - outside) * (1 if polarity == "bright" else -1)
    return float(np.mean(step >= RIM_STEP))


def measure_bits():
    """Which of the four places in each photograph of screws4-a hold a screw, by `find_circles`.

    Returns
    -------
    DataFrame
        A row for each place: picture; position: 1 to 4, left to right, top to bottom; present: whether a screw is
        there; found: whether a circle's centre is no further from it than `OFF`; fits: whether a circle fits the
        head, as in `count_circles`; apart: px from the place to the nearest circle's centre, inf without circles.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    """
    (name, pattern, radii, polarity), known, rows = SCREWS, load_known(), []
    for path in sorted(dataset(name).glob(pattern)):
        circles = find_circles(_grey(path), radii, polarity=polarity)
        places = known[(known["dataset"] == name) & (known["picture"] == path.name)]
        fits = _match(circles, places[["x", "y", "r"]].to_numpy(float)) >= 0
        for position, place in enumerate(places.itertuples(), 1):
            apart = np.hypot(*(circles.centers - (place.x, place.y)).T).min(initial=np.inf)
            found, fitted = int(apart <= OFF * place.r), int(fits[position - 1])
            rows.append((path.name, position, place.present, found, fitted, np.round(apart, 1)))
    return pd.DataFrame(rows, columns=["picture", "position", "present", "found", "fits", "apart"])


def load_bits(path=FOLDER / BITS_FILE):
    """Read the table of `measure_bits`."""
    return pd.read_csv(path, comment="#")


def count_parts():
    """How many discs `segment` makes a part of its own, and how many Otsu's global threshold alone.

    In the photograph of skimage-coins, and, with the pegs as discs, in the rendered frame 1 of the paper's experiment
    in light that rises linearly across the hub.

    Returns
    -------
    DataFrame
        A row for each picture: picture, light (right over left), known, segment, otsu, levels: the thresholds of
        `segment`, Otsu's first.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photograph is not found.
    """
    rows, known = [], load_known().query("dataset == 'skimage-coins'")[["x", "y", "r"]].to_numpy(float)
    coins = _grey(dataset("skimage-coins") / "coins.png")
    for name, light, image, places in [("coins.png", np.nan, coins, known), *_hubs_in_uneven_light()]:
        parts = segment(image)
        plain = segment(image, threshold=parts.threshold)
        levels = " ".join(f"{level:.0f}" for level in parts.levels)
        rows.append((name, light, len(places), _own_parts(parts, places), _own_parts(plain, places), levels))
    return pd.DataFrame(rows, columns=["picture", "light", "known", "segment", "otsu", "levels"])


def _hubs_in_uneven_light():
    """Rendered frame 1 in each of LIGHTS: name, light, picture, and its pegs (4, 3) as x, y, r."""
    truth = paper.paper_experiment()
    pose, frame = truth.cam_from_hubs[0], truth.hub_frame(0)
    pegs = [true_disc(truth.camera, pose, center, truth.hub.peg_radius) for center in truth.hub.peg_centers]
    pegs = np.array([(*peg.centroid, peg.radius) for peg in pegs])
    for light in LIGHTS:
        ramp = np.interp(np.arange(frame.shape[1]), HUB_COLUMNS, (1 / light, 1))
        yield "hub frame 1", light, np.rint(frame * ramp).astype(np.uint8), pegs


def _own_parts(parts, places):
    """How many discs (x, y, r) are a part by themselves: centroid within PART_OFF, area within PART_AREA."""
    x, y, r = np.transpose(places)
    apart = np.hypot(parts.centroids[:, :1] - x, parts.centroids[:, 1:] - y)
    larger = parts.areas[:, None] / (np.pi * r**2) - 1
    return int(((apart < PART_OFF * r) & (np.abs(larger) < PART_AREA)).any(axis=0).sum())


def load_parts(path=FOLDER / PARTS_FILE):
    """Read the table of `count_parts`."""
    return pd.read_csv(path, comment="#", dtype={"levels": str})


def load_known(path=FOLDER / KNOWN_FILE):
    """Read where the discs are: dataset, picture, x, y, r (px), present (0: an empty place of screws4-a)."""
    return pd.read_csv(path, comment="#")


def load_missed(path=FOLDER / MISSED_FILE):
    """Read the discs that `count_circles` missed."""
    return pd.read_csv(path, comment="#")


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


def load_counts(path=FOLDER / COUNTS_FILE):
    """Read the first table of `count_circles`."""
    return pd.read_csv(path, comment="#")


def write_measured(folder=FOLDER):
    """Measure everything anew and write it below `folder`; errors as in `measure_corners` and `count_circles`."""
    counts, missed = count_circles()
    for name, table, what in (
        (COUNTS_FILE, counts, "circles found in photographs with known counts"),
        (SENSITIVITY_FILE, measure_sensitivity(), "joint calibration of opencv_left by three corner detectors"),
        (MISSED_FILE, missed.round(3), "discs not found in them (px), the share of their rim with a step, and why"),
        (BITS_FILE, measure_bits(), "the places of screws4-a: is a screw there, and is one found"),
        (PARTS_FILE, count_parts(), "discs that are a part of their own by segment and by Otsu's threshold alone"),
    ):
        with replacing(folder / name) as path:
            table = table.to_csv(index=False, lineterminator="\n")
            path.write_text(f"# {what}; made by: {COMMAND}\n{table}", encoding="utf-8")
    comment = (
        "centres of the discs' images by fit_discs in ViSP's circles-01..05.jpg (320 x 240 px), grid of 6 x 6 discs, "
        f"X Y in mm, u v in px; made by: {COMMAND}"
    )
    write_corners(folder / GRID_FILE, *measure_grid(), comment)
    comment = (
        f"corners by find_corners in OpenCV's left01..left14.jpg ({LEFT_SIZE[0]} x {LEFT_SIZE[1]} px), board of "
        f"{LEFT_BOARD.columns} x {LEFT_BOARD.rows} corners, X Y in mm, u v in px; made by: {COMMAND}"
    )
    write_corners(folder / CORNERS_FILE, *measure_corners(), comment)


if __name__ == "__main__":
    write_measured()
