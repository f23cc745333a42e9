"""Every detector on the same photographs with known discs.

The peers keep the settings of `peers.COMPARED`, which suit rendered hubs, and one of them, `cv2.HoughCircles`, is run in
two more ways: with OpenCV's own defaults, and with the threshold of votes that is best for a data set's known discs,
which no user could choose.  Every method gets the radius range, and images of dark discs as negatives.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import pandas as pd

from .. import study
from ..circles import find_circles
from ..discs import fit_discs
from ..files import MEASURED_FOLDER
from . import peers
from .detectors import Found, Method, _hough, _opencv_hough

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    Pictures = list[tuple[NDArray[np.uint8], tuple[float, float], NDArray[np.float64]]]

VOTES = (10, 15, 20, 30, 40, 60, 80, 100)
"""The thresholds of votes (param2) from which the best one is chosen for each data set; 100 is OpenCV's default."""


def _find_and_measure(image, radius_range):
    """The circles of `find_circles` without those that `fit_discs` rejects."""
    circles = find_circles(image, radius_range)
    keep = fit_discs(image, circles).usable
    return Found(circles.centers[keep], circles.radii[keep])


def _hough_with(votes):
    return Method("", _opencv_hough, "", options={"method": cv2.HOUGH_GRADIENT, "dp": 1, "edge": 100, "votes": votes})


def count_by_methods() -> pd.DataFrame:
    """Known discs that each method finds, and its false circles, in the data sets of `study.pictures_of_discs`.

    Returns
    -------
    DataFrame
        A row for each data set and method: dataset, method, pictures, known, found (off by `study`'s tenth of the radius
        at most, in centre and radius), false (all other circles).

    Raises
    ------
    ValueError, FileNotFoundError
        If the photographs are not found.
    """
    sets: dict[str, Pictures] = {}
    for name, _, image, radii, polarity, known in study.pictures_of_discs():
        sets.setdefault(name, []).append((image if polarity == "bright" else 255 - image, radii, known))
    methods = {
        "find_circles, default": Method("", _hough, "", options={"method": "multiscale"}),
        "find_circles, then measured or partial by fit_discs": Method("", _find_and_measure, ""),
        "HoughCircles, OpenCV's defaults": _hough_with(100),
    }
    methods |= {
        name: method
        for name, method in peers.COMPARED.items()
        if method.package != "pegpose_lab" and not peers.missing(method)
    }
    rows = []
    for name, pictures in sets.items():
        known = sum(len(places) for *_, places in pictures)
        counts = {method: _count(pictures, run) for method, run in methods.items()}
        tuned = [_count(pictures, _hough_with(votes)) for votes in VOTES]
        counts["HoughCircles, OpenCV's defaults, best votes"] = max(tuned, key=lambda count: count[0] - count[1])
        rows += [(name, method, len(pictures), known, *count) for method, count in counts.items()]
    return pd.DataFrame(rows, columns=["dataset", "method", "pictures", "known", "found", "false"])


def _count(pictures: Pictures, method: Method) -> tuple[int, int]:
    """Discs found and false circles in all pictures."""
    found = false = 0
    for image, radii, known in pictures:
        circles = peers.run(method, image, radii)[0]
        there = int((study.match_circles(circles, known) >= 0).sum())
        found, false = found + there, false + len(circles) - there
    return found, false


def write_peer_counts(folder: Path = MEASURED_FOLDER) -> None:
    """Write the table of `count_by_methods` into `folder`; raises as it does."""
    what, name = "known discs found, and false circles, in photographs, by all detectors", "peer_counts"
    study.write_measured(folder, name, count_by_methods(), f"{what}; {study.made_by(name)}")
