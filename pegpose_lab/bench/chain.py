"""From a frame to the hub's pose: time and errors, searched and tracked, beside a plain OpenCV pipeline."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd

from ..paper import paper_experiment
from ..pegs import locate_pegs
from ..pose import estimate_pose
from .score import one_thread

if TYPE_CHECKING:
    from numpy.typing import NDArray

SEARCHED, TRACKED, PLAIN = "pegpose_lab, searched", "pegpose_lab, tracked", "OpenCV, plain"
COLUMNS = ["method", "frames", "ms", "frames_per_second", "xy_mm", "z_mm", "pull"]
ROUND = 1.6  # largest ratio of the axes of a peg's ellipse
RADII = (30.0, 65.0)  # px, of the paper's pegs


def measure_chain(frames: int = 45, *, repeats: int = 3) -> pd.DataFrame:
    """Time and errors from the frames of the paper's experiment to poses in six degrees of freedom.

    The plain pipeline is that of many tutorials: Otsu's threshold, another one among the bright pixels, contours,
    `cv2.fitEllipse` and `cv2.solvePnP`; it is told which peg is which.  The other two locate the pegs with
    `locate_pegs`, with and without the observation of the frame before, and have covariances from `estimate_pose`.

    Parameters
    ----------
    frames : int
        The first ones of the 45.
    repeats : int
        Of each timed call; the fastest counts.

    Returns
    -------
    DataFrame
        method, frames (with a pose), ms (median, processor time on one thread), frames_per_second, xy_mm and z_mm (rms
        errors of the hub's position), pull (rms of the errors of x, y and z over their sigmas; NaN without sigmas).
    """
    experiment, rows, before = paper_experiment(), [], None
    with one_thread():
        for index in range(frames):
            picture, truth = experiment.hub_frame(index), experiment.cam_from_hubs[index]
            methods = {
                SEARCHED: lambda picture=picture: _measured(experiment, picture, None),
                TRACKED: lambda picture=picture, before=before: _measured(experiment, picture, before),
                PLAIN: lambda picture=picture, truth=truth: _plain(experiment, picture, truth),
            }
            for name, method in methods.items() if before is not None else ():
                found, seconds = _timed(method, repeats)
                if found is not None:
                    error = found[0] - truth.translation
                    rows.append((name, seconds, *error, *(error / found[1])))
            before = _measured(experiment, picture, before)[2]
    table = pd.DataFrame(rows, columns=["method", "seconds", *"xyz", *"uvw"])
    return pd.DataFrame(
        [_row(name, part) for name, part in table.groupby("method", sort=False)],
        columns=COLUMNS,
    )


def _row(name, part):
    """A method's row of `measure_chain`."""
    ms = 1e3 * part["seconds"].median()
    rms = (float(np.sqrt(np.mean(part[list(names)].to_numpy() ** 2))) for names in ("xy", "z", "uvw"))
    return name, len(part), ms, 1e3 / ms, *rms


def _timed(method, repeats):
    """What a method returns, and the least of its times, s."""
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        found = method()
        seconds.append(time.process_time() - start)
    return found, min(seconds)


def _measured(experiment, picture, before):
    """Position (3,) and its sigmas (3,), mm, and the observation."""
    observation = locate_pegs(picture, experiment.hub, previous=before)
    pose = estimate_pose(observation, experiment.camera, experiment.hub)
    return pose.cam_from_hub.translation, np.sqrt(np.diag(pose.covariance)[:3]), observation


def _plain(experiment, picture, truth):
    """Position (3,), mm, by OpenCV alone, and no sigmas; None where it does not see the pegs."""
    centers = plain_pegs(picture)
    if len(centers) < experiment.hub.n_pegs:
        return None
    camera = experiment.camera.to_opencv()
    places = camera.project(experiment.hub.peg_centers, truth)
    apart = np.linalg.norm(places[:, None] - centers, axis=2)
    labelled = np.ascontiguousarray(centers[apart.argmin(axis=1)])
    arguments = experiment.hub.peg_centers, labelled, camera.camera_matrix, camera.dist_coeffs
    count, _, translations, _ = cv2.solvePnPGeneric(*arguments, flags=cv2.SOLVEPNP_IPPE)
    return None if count == 0 else (translations[0].ravel(), np.full(3, np.nan))


def plain_pegs(picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Centres (k, 2) of bright discs as wide as pegs, px, by two thresholds, contours and `cv2.fitEllipse`."""
    level = cv2.threshold(picture, 0, 255, cv2.THRESH_OTSU)[0]
    bright = picture[picture > level].reshape(1, -1)
    level = cv2.threshold(bright, 0, 255, cv2.THRESH_OTSU)[0] if bright.size else level
    mask = cv2.compare(picture, level, cv2.CMP_GT)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    centers = [np.empty((0, 2))]
    for contour in contours:
        if len(contour) > RADII[0]:
            center, sides, _ = cv2.fitEllipse(contour)
            radius = np.sqrt(sides[0] * sides[1]) / 2
            if RADII[0] < radius < RADII[1] and max(sides) < ROUND * min(sides):
                centers.append(np.array([center]))
    return np.vstack(centers)
