"""Are the stated sigmas of discs honest on photographs?  Residuals over sigma against a joint model of each sheet.

A board and two sheets of discs whose places are known to follow one model: a board of large discs seen by one camera,
for which camera, poses and the discs' places are adjusted together (`board_residuals`), and two
sheets of many dots, whose image is a smooth function of the place on the sheet: the perspective of a plane times a
polynomial of third degree, which takes up lens and bend.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd

from ..circles import find_circles
from ..discs import fit_discs
from ..files import MEASURED_FOLDER
from .board_adjustment import board_residuals
from .datasets import dataset
from .measured import made_by, write_measured
from .photographs import _grey

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

DEGREE, OUTLYING = 3, 6.0  # of the polynomial; robust standard deviations from which a dot does not shape it
LEAST_DOTS = 25  # of a picture, for the polynomial


@dataclass(frozen=True)
class Sheet:
    """A sheet of discs: its photographs, its grid (columns, rows) and how to find its discs."""

    dataset: str
    grid: tuple[int, int]
    staggered: bool
    radii: tuple[float, float]
    polarity: str
    blob_area: tuple[float, float]


BOARD = Sheet("discocal-left", (4, 3), False, (30, 110), "dark", (500, 60_000))
SHEETS = (
    BOARD,
    Sheet("robot-dots-10x10", (10, 10), False, (2, 12), "dark", (15, 400)),
    Sheet("open3dv-dots", (7, 11), True, (6, 20), "bright", (40, 2000)),
)


def measure_pulls() -> pd.DataFrame:
    """Measure the discs of the sheets, and compare the residuals with the stated sigmas.

    Returns
    -------
    DataFrame
        A row for each sheet: dataset, pictures, discs; measured and partial of them; error (px, robust standard
        deviation per axis, corrected for the fitted unknowns), pull (robust standard deviation of residual over sigma),
        coverage (% of residuals within 1.96 sigma), others (circles off the sheet's discs that are measured).
    """
    rows = []
    for sheet in SHEETS:
        parts = [_measured(sheet, path) for path in sorted(dataset(sheet.dataset).glob("*.png"))]
        parts = [part for part in parts if part is not None]
        residuals = board_residuals([part.centers for part in parts]) if sheet is BOARD else None
        scaled, errors = [], []
        for number, part in enumerate(parts):
            usable = np.isfinite(part.centers[:, 0])
            if residuals is None and usable.sum() < LEAST_DOTS:
                continue
            some = (
                smooth_residuals(part.places[usable], part.centers[usable]) if residuals is None else residuals[number]
            )
            errors.append(some)
            scaled.append(some / part.sigmas[usable])
        errors, scaled = np.concatenate(errors), np.abs(np.concatenate(scaled))
        states = np.concatenate([part.states for part in parts])
        counts = len(parts), len(states), (states == "measured").sum(), (states == "partial").sum()
        pull, coverage = 1.4826 * np.median(scaled), 100 * (scaled < 1.96).mean()
        rows.append(
            (
                sheet.dataset,
                *counts,
                1.4826 * np.median(np.abs(errors)),
                pull,
                coverage,
                sum(part.others for part in parts),
            )
        )
    columns = ["dataset", "pictures", "discs", "measured", "partial", "error", "pull", "coverage", "others"]
    return pd.DataFrame(rows, columns=columns)


@dataclass(frozen=True, eq=False)
class _Measured:
    """A picture's discs in the order of the grid: places (n, 2), centres and sigmas (n, 2), NaN where none is usable."""

    places: np.ndarray
    centers: np.ndarray
    sigmas: np.ndarray
    states: np.ndarray
    others: int


def _measured(sheet, path):
    """The discs of one picture, or None where OpenCV does not see the whole grid."""
    image = _grey(path)
    grid = _grid(image, sheet)
    if grid is None:
        return None
    discs = fit_discs(image, find_circles(image, sheet.radii, polarity=sheet.polarity))
    apart = np.linalg.norm(discs.centers[:, None] - grid, axis=2)
    nearest = apart.argmin(axis=0)
    there = apart.min(axis=0) < 0.5 * discs.radii[nearest]
    states = np.where(there, discs.states[nearest], "missing")
    usable = ((states == "measured") | (states == "partial"))[:, None]
    others = discs.accepted & (apart.min(axis=1) > discs.radii)
    return _Measured(
        _places(sheet),
        np.where(usable, discs.centers[nearest], np.nan),
        np.where(usable, discs.sigmas[nearest, :2], np.nan),
        states,
        int(others.sum()),
    )


def _grid(image, sheet):
    """OpenCV's circle grid (n, 2), px, which tells the discs apart."""
    settings = cv2.SimpleBlobDetector_Params()
    settings.minArea, settings.maxArea = sheet.blob_area
    settings.blobColor = 255 if sheet.polarity == "bright" else 0
    settings.minDistBetweenBlobs, settings.minThreshold, settings.maxThreshold = 5, 10, 240
    settings.filterByInertia, settings.minInertiaRatio = True, 0.1
    flags = cv2.CALIB_CB_CLUSTERING | (cv2.CALIB_CB_ASYMMETRIC_GRID if sheet.staggered else cv2.CALIB_CB_SYMMETRIC_GRID)
    detector = cv2.SimpleBlobDetector_create(settings)
    found, centers = cv2.findCirclesGrid(image, sheet.grid, flags=flags, blobDetector=detector)
    return centers.reshape(-1, 2) if found else None


def _places(sheet):
    """The discs' places (n, 2) on the sheet, in pitches."""
    columns, rows = sheet.grid
    row, column = (axis.ravel() for axis in np.mgrid[:rows, :columns].astype(float))
    return np.column_stack([2 * column + row % 2 if sheet.staggered else column, row])


def smooth_residuals(places: NDArray[np.float64], centers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Residuals (n, 2) of centres (n, 2), px, from the smooth image of their places, corrected for the fitted unknowns.

    Each residual is divided by the root of 1 less its leverage: it then has the standard deviation of the errors.
    """
    perspective = cv2.findHomography(places, centers, cv2.LMEDS)[0]
    plane = cv2.perspectiveTransform(places[None], perspective)[0]
    u, v = ((plane - plane.mean(axis=0)) / plane.std(axis=0)).T
    terms = np.column_stack([u**i * v**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)])
    kept = np.ones(len(centers), bool)
    for _ in range(3):
        residuals = centers - terms @ np.linalg.lstsq(terms[kept], centers[kept])[0]
        size = np.abs(residuals).max(axis=1)
        kept = size < OUTLYING * 1.4826 * np.median(size)
    leverage = np.zeros(len(centers))
    leverage[kept] = (np.linalg.qr(terms[kept])[0] ** 2).sum(axis=1)
    return residuals / np.sqrt(1 - leverage)[:, None]


def write_disc_pulls(folder: Path = MEASURED_FOLDER) -> None:
    """Measure the sheets' discs and write the table into `folder`."""
    comment = (
        "discs of photographed sheets: states, residuals against a joint model of the sheet (px, robust sd per axis), over "
        f"the stated sigmas (pull), % within 1.96 sigma, other circles that are measured; {made_by('disc_pulls')}"
    )
    table = measure_pulls().round({"error": 3, "pull": 2, "coverage": 0})
    write_measured(folder, "disc_pulls", table, comment)
