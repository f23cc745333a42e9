"""Circle measurement for the benchmark: ours beside the peers' and beside the physical limit, in one run.

Frames of a hub with four pegs are rendered with known truth: once without noise for each pose, to which noise of each
level is added.  Every method gets the same frames, one method after the other, in a rotating order.  All random
numbers are seeded.

Definitions
-----------
truth
    centroid and radius sqrt(area/pi) of a disc's exact image (`render.true_disc`).
expected
    the hub's bright discs (pegs, bore, screws) whose true radius lies in the radius range that every method is
    given.  Only pegs are scored for accuracy.
detected
    an expected disc for which a circle is reported whose centre and radius are both wrong by at most 10 % of the
    radius.  A circle counts for one disc only.
false positive
    any other reported circle with a radius in the range, also a second one on the same disc.
bound
    the Cramer-Rao bound of a whole disc's edge: per axis (sigma/A) sqrt(2 s/(sqrt(pi) r)) for the centre, and
    that over sqrt(2) for the radius, with s^2 = blur^2 + 1/12, sigma^2 = noise^2 + 1/12, A the pegs' grey value
    minus the base's.
bound of the visible arc
    the same information summed over the part of the edge where the noise-free image shows a clean edge: within
    3 s of the rim it differs from B + A Phi(d/s) by less than 5 % of A.  Unknowns: centre, radius and the
    ellipse's shape.
error / bound
    the median of |error| / bound over axes, pegs and frames, times 1.4826.  For a normal distribution this is the
    rms, but it ignores rare large errors.  The tables therefore also have the plain rms.
honesty
    the standard deviation of (estimate - truth) / stated sigma, and the share of these ratios within +-1.96.
time
    processor time of one thread; the ratio to `peers.REFERENCE` is the median over frames of the ratio in the
    same frame.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from tqdm import tqdm

from ..render import expose
from . import peers
from .bounds import center_bound
from .scenes import MAIN, RADIUS_RANGE, SEED, draw_frame

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from .scenes import Frame, Scene

TOLERANCE = 0.1  # of the radius: largest error of a detected disc
WORKERS = 2


# ---- one frame ----


_KEY = ("scene", "noise", "frame", "method")
FRAME_COLUMNS = (*_KEY, "seconds", "false_positives")
_ERRORS = ("x", "y", "r", "arc_x", "arc_y", "arc_r", "z_x", "z_y", "z_r")  # over bound, arc bound, stated sigma
DISC_COLUMNS = (*_KEY, "peg", "found", "visible", "arc", *_ERRORS)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenCV work on one thread."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def measure_frame(
    scene: Scene, number: int, noises: Sequence[float], methods: Sequence[str]
) -> tuple[list[tuple[Any, ...]], list[tuple[Any, ...]]]:
    """Give one frame, with each level of noise, to each method.

    Parameters
    ----------
    scene : Scene
    number : int
    noises : sequence of float
    methods : sequence of str
        Keys of `peers.COMPARED`.

    Returns
    -------
    frames, discs : lists of tuples
        With the columns `FRAME_COLUMNS` and `DISC_COLUMNS`; a row for each method and noise (and expected disc).
    """
    frame, frames, discs = draw_frame(scene, number), [], []
    with one_thread():
        _warm_up(tuple(methods))
        for noise in noises:
            image = expose(frame.picture, noise, [SEED, *scene.name.encode(), number, int(1000 * noise)])
            for name in np.roll(methods, number).tolist():
                found, seconds = peers.run(peers.COMPARED[name], image, RADIUS_RANGE)
                key = (scene.name, noise, number, name)
                rows, false_positives = score(frame, found, noise)
                frames.append((*key, seconds, false_positives))
                discs += [(*key, *row) for row in rows]
    return frames, discs


@cache
def _warm_up(methods):
    """Run each method once in this process, on a part of a frame, so that no first call is timed."""
    image = np.ascontiguousarray(expose(draw_frame(MAIN[0], 10**6).picture, 5, 0)[300:900, 500:1100])
    for name in methods:
        peers.run(peers.COMPARED[name], image, RADIUS_RANGE)


def score(frame: Frame, found: peers.Found, noise: float) -> tuple[list[tuple[Any, ...]], int]:
    """Compare a method's circles with a frame's discs, by the definitions in this module's docstring.

    Parameters
    ----------
    frame : Frame
    found : peers.Found
    noise : float
        Of the image, grey values.

    Returns
    -------
    rows : list of tuples
        The columns of `DISC_COLUMNS` after the key; a row for each expected disc.
    false_positives : int
    """
    low, high = RADIUS_RANGE
    expected = [disc for disc in frame.discs if low <= disc.truth.radius <= high]
    free, rows = np.ones(len(found), bool), []
    for disc in expected:
        index = _match(disc.truth, found, free)
        if index is None:
            rows.append((disc.peg, False, disc.visible, np.nan, *[np.nan] * 9))
            continue
        free[index] = False
        rows.append((disc.peg, True, *_errors(frame, disc, found, index, noise)))
    return rows, int(free.sum())


def _match(truth, found, free):
    """Index of the free circle nearest to a disc, or None if none is near enough."""
    apart = np.hypot(*(found.centers - truth.centroid).T)
    reach = TOLERANCE * truth.radius
    usable = free & (apart <= reach) & (np.abs(found.radii - truth.radius) <= reach)
    return int(np.where(usable, apart, np.inf).argmin()) if usable.any() else None


def _errors(frame, disc, found, index, noise):
    """Visible share, arc bound over bound, and errors of x, y, r over bound, arc bound and stated sigma."""
    error = np.array([*(found.centers[index] - disc.truth.centroid), found.radii[index] - disc.truth.radius])
    bound = center_bound(disc.truth.radius, frame.contrast, frame.edge_width, noise) * np.sqrt([1, 1, 0.5])
    arc = np.full(3, np.inf) if disc.arc is None else disc.arc
    sigmas = np.full(3, np.nan) if found.sigmas is None else found.sigmas[index]
    larger = np.sqrt((arc[0] ** 2 + arc[1] ** 2) / 2)
    return disc.visible, larger, *error / bound, *error / bound / arc, *error / sigmas


# ---- many frames ----


def measure(
    cells: dict[Scene, tuple[int, Sequence[float]]], methods: Sequence[str], *, workers: int = WORKERS
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Measure frames in parallel processes.

    Parameters
    ----------
    cells : dict
        Scene: (number of frames, levels of noise).
    methods : sequence of str
        Keys of `peers.COMPARED`.
    workers : int

    Returns
    -------
    frames, discs : DataFrames
        As in `measure_frame`.
    """
    tasks = [
        (scene, number, noises, _methods_for(methods, number, frames))
        for scene, (frames, noises) in cells.items()
        for number in range(frames)
    ]
    done = Parallel(n_jobs=workers, return_as="generator")(delayed(measure_frame)(*task) for task in tasks)
    pairs = list(tqdm(done, total=len(tasks), unit="frame", desc="frames", disable=None))
    columns = (FRAME_COLUMNS, DISC_COLUMNS)
    return tuple(pd.DataFrame([row for pair in pairs for row in pair[part]], columns=columns[part]) for part in (0, 1))


def _methods_for(methods, number, frames):
    """The methods that get frame `number`; slow ones get only the first few frames (`Method.share`), at least one."""
    return [
        name
        for name in methods
        if not peers.missing(peers.COMPARED[name]) and number < max(1, round(peers.COMPARED[name].share * frames))
    ]
