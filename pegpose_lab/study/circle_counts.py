"""Discs found and missed in photographs whose discs are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd

from ..circles import find_circles
from ..discs import fit_discs
from ..files import MEASURED_FOLDER
from .datasets import dataset
from .measured import load_measured, made_by, write_measured
from .photographs import _grey

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

    from ..circles import Circles

SCREWS = ("screws4-a", "*.jpg", (38, 62), "dark")
SEARCHES = (  # data set, its images, radius range (px), polarity; all else is the default
    ("visp-mire2-a", "*.png", (5, 35), "bright"),
    ("visp-grid36-a", "*.png", (5, 30), "dark"),
    ("skimage-coins", "*.png", (12, 35), "bright"),
    ("conrods-a", "*.bmp", (6, 20), "bright"),
    SCREWS,
    ("opencv-samples", "smarties.png", (15, 45), "dark"),
    ("opencv-samples", "coins.jpg", (18, 32), "dark"),
)
RIM, RIM_STEP = np.arange(2.0, 6.0), 10.0  # px on either side of a rim, and the step (grey values) that counts as one
# How far a circle may be from its disc, in centre and radius, as a fraction of the radius: as in the
# benchmark, for all data sets alike.  Marks by eye are good to half of it, and that an outline is an ellipse (mire2,
# conrods, grid36: ratio of axes up to 1.65) asks for no more: known_circles.csv has its centroid and the radius of its area.
NEAR = 0.1
OFF = 0.8  # of the radius, 40 px for the screws' heads: a circle whose centre is no further off was meant for the disc
ALONE = 1.6  # of the radius: half the side of the cut-out in which a disc is searched by itself


def count_circles() -> tuple[DataFrame, DataFrame]:
    """Circles that `find_circles` finds in photographs with known counts, with its defaults.

    Returns
    -------
    counts : DataFrame
        A row for each picture: dataset, picture, r_min, r_max, polarity; known: how many discs there are; found:
        how many of them; false: circles that fit none, those that are off, too; measured, partial: how many of those
        found are so for `fit_discs`; false_measured: how many of the false ones it measures; rim: the mean `rim_share`
        of those found.
    missed : DataFrame
        A row for each disc that is not found: dataset, picture, x, y, r (px), its rim's share, and `why`:

        * "off": a circle is there, but it is off by more than `NEAR` (and by no more than `OFF`);
        * "shared": the disc is found if it is searched alone, in a cut-out around it;
        * "score": only a higher sensitivity finds it;
        * "no candidate": not even the highest does, in the image or in the cut-out.

        The order of trying: default sensitivity alone ("shared"), highest sensitivity in the image ("score") and
        alone ("shared").

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    """
    counts, missed = [], []
    for name, picture, image, radii, polarity, known in pictures_of_discs():
        circles = find_circles(image, radii, polarity=polarity)
        match = match_circles(circles, known)
        there, found = match >= 0, match[match >= 0]
        states = fit_discs(image, circles).states
        measured, partial = (int((states[found] == state).sum()) for state in ("measured", "partial"))
        wrong = int((np.delete(states, found) == "measured").sum())
        shares = [rim_share(image, *place, polarity) for place in known]
        rim = np.mean(shares, where=there) if there.any() else np.nan
        number = len(known), len(found), len(circles) - len(found), measured, partial, wrong, np.round(rim, 3)
        counts.append((name, picture, *radii, polarity, *number))
        for i in np.flatnonzero(~there):
            missed.append((name, picture, *known[i], shares[i], _why(image, known[i], radii, polarity, circles)))
    columns = [
        "dataset",
        "picture",
        "r_min",
        "r_max",
        "polarity",
        "known",
        "found",
        "false",
        "measured",
        "partial",
        "false_measured",
        "rim",
    ]
    missed = pd.DataFrame(missed, columns=["dataset", "picture", "x", "y", "r", "rim", "why"])
    return pd.DataFrame(counts, columns=columns), missed


def pictures_of_discs() -> Iterator[tuple[str, str, NDArray[np.uint8], tuple[int, int], str, NDArray[np.float64]]]:
    """Photographs with known discs: dataset, picture, the grey image, radius range (px), polarity, and x, y, r (n, 3)
    of the discs that are there.

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.

    Examples
    --------
    >>> for dataset, picture, image, radii, polarity, known in pictures_of_discs():  # doctest: +SKIP
    ...     print(picture, len(find_circles(image, radii, polarity=polarity)), len(known))
    """
    places = load_known().query("present == 1")
    for name, pattern, radii, polarity in SEARCHES:
        for path in sorted(dataset(name).glob(pattern)):
            known = places[(places["dataset"] == name) & (places["picture"] == path.name)]
            yield name, path.name, _grey(path), radii, polarity, known[["x", "y", "r"]].to_numpy(float)


def match_circles(circles: Circles, places: ArrayLike, near: float = NEAR) -> NDArray[np.int_]:
    """For each place (x, y, r) the index of the circle nearest to it, if near enough and free, or -1.

    Parameters
    ----------
    circles : Circles
        Anything with `centers` (n, 2) and `radii` (n,), px.
    places : (m, 3) array_like
        px.
    near : float
        The largest error of the centre and of the radius, as a fraction of the radius.

    Returns
    -------
    (m,) ndarray of int

    Examples
    --------
    >>> from pegpose_lab.circles import Circles
    >>> found = Circles(np.array([[40.0, 30.0]]), np.array([10.0]), np.array([1.0]))
    >>> match_circles(found, [(40.5, 30, 10), (60, 30, 10)]).tolist()
    [0, -1]
    """
    match = np.full(len(places), -1)
    for i, (x, y, r) in enumerate(places):
        apart = np.maximum(np.hypot(*(circles.centers - (x, y)).T), np.abs(circles.radii - r))
        apart[match[:i][match[:i] >= 0]] = np.inf
        if len(apart) and apart.min() <= near * r:
            match[i] = apart.argmin()
    return match


def _why(image, place, radii, polarity, circles):
    """Why a disc (x, y, r) is not among `circles` (see `count_circles`)."""
    if match_circles(circles, [place], OFF)[0] >= 0:
        return "off"
    x, y, r = place
    left, top = max(int(x - ALONE * r), 0), max(int(y - ALONE * r), 0)
    alone = image[top : int(y + ALONE * r) + 1, left : int(x + ALONE * r) + 1], (x - left, y - top, r)
    highest = {"sensitivity": 1.0}
    for why, (part, there), settings in (
        ("shared", alone, {}),
        ("score", (image, place), highest),
        ("shared", alone, highest),
    ):
        if match_circles(find_circles(part, radii, polarity=polarity, **settings), [there])[0] >= 0:
            return why
    return "no candidate"


def rim_share(image: NDArray[np.uint8], x: float, y: float, r: float, polarity: str) -> float:
    """Fraction of a circle's rim, in 64 directions, where the image steps by at least RIM_STEP, in `polarity`'s sense."""
    turn = np.arange(64) * (2 * np.pi / 64)
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    inside, outside = (
        cv2.remap(
            image,
            (x + cos * rho).astype(np.float32),
            (y + sin * rho).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ).mean(axis=1)
        for rho in (r - RIM, r + RIM)
    )
    step = (inside - outside) * (1 if polarity == "bright" else -1)
    return float(np.mean(step >= RIM_STEP))


def measure_bits() -> DataFrame:
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
        fits = match_circles(circles, places[["x", "y", "r"]].to_numpy(float)) >= 0
        for position, place in enumerate(places.itertuples(), 1):
            apart = np.hypot(*(circles.centers - (place.x, place.y)).T).min(initial=np.inf)
            found, fitted = int(apart <= OFF * place.r), int(fits[position - 1])
            rows.append((path.name, position, place.present, found, fitted, np.round(apart, 1)))
    return pd.DataFrame(rows, columns=["picture", "position", "present", "found", "fits", "apart"])


def load_known() -> DataFrame:
    """Read where the discs are: dataset, picture, x, y, r (px), present (0: an empty place of screws4-a)."""
    return load_measured("known_circles")


def write_circle_counts(folder: Path = MEASURED_FOLDER) -> None:
    """Write both tables of `count_circles` into `folder`; raises as it does."""
    counts, missed = count_circles()
    for file, table, what in (
        ("circle_counts", counts, "circles found in photographs with known counts"),
        (
            "missed_circles",
            missed.round(3),
            "discs not found in them (px), the share of their rim with a step, and why",
        ),
    ):
        write_measured(folder, file, table, f"{what}; {made_by('circle_counts')}")


def write_screw_bits(folder: Path = MEASURED_FOLDER) -> None:
    """Write the table of `measure_bits` into `folder`; raises as it does."""
    what, name = "the places of screws4-a: is a screw there, and is one found", "screw_bits"
    write_measured(folder, name, measure_bits(), f"{what}; {made_by(name)}")
