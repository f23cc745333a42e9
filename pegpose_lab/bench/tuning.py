"""The peers' settings: every setting of a grid is tried on separate frames, and one rule chooses the best.

``python3 -m pegpose_lab measure peer_settings`` prints the best five settings of each peer and writes all of them to
data/measured/peer_settings.csv, in about ten minutes on two idle cores.  `peers.COMPARED` uses the best setting of each
peer.  Peers that cannot be installed are left out.

Frames
------
`FRAMES` frames of each of the scenes `scenes.MAIN`, with the noise of the benchmark's tables, numbered from
`FIRST_FRAME`.  The benchmark does not use their poses, blur and noise.  They are scored as in the benchmark.

Rule
----
The criteria are applied one after the other; settings that tie with the best remain for the next criterion:

1. missed pegs.  Counts tie if they differ by at most one standard deviation of a difference of counts,
   |a - b| <= sqrt(a + b).
2. false circles, with the same tie.
3. error: the geometric mean, over the scenes and over centre and radius, of the median error over its bound.  The
   radius is included because the centre alone would prefer thresholds that make every radius 2 px too small.  Errors
   tie within 5 %, the standard deviation of a quotient of two such means.
4. time: the median over the frames.  Times tie within 25 %, the variation on a busy machine.
5. position in the grid, which is ordered from fast to slow.

The choice has rank 1; rank 2 is the choice among the remaining settings, and so on.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from tqdm import tqdm

from .. import study
from ..files import MEASURED_FOLDER
from ..render import expose
from . import peers
from .scenes import MAIN, RADIUS_RANGE, SEED, TARGET_NOISE, draw_frame
from .score import DISC_COLUMNS, WORKERS, one_thread, score

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import Any

    from .detectors import Method
    from .scenes import Scene

NAME = "peer_settings"
FIRST_FRAME, FRAMES = 20_000, 20
ERROR_TIE, TIME_TIE = 1.05, 1.25
SHOWN = 5  # ranks on the screen

# peer: option of its function in `detectors` or `contrib`: values, from fast to slow
GRIDS: dict[str, dict[str, tuple[Any, ...]]] = {
    "HoughCircles GRADIENT": {"dp": (2, 1.5, 1), "edge": (300, 200, 100), "votes": (60, 50, 40, 30)},
    "HoughCircles GRADIENT, smoothed": {
        "smoothing": (1, 1.5),
        "dp": (1.5, 1),
        "edge": (200, 150, 100),
        "votes": (50, 40, 30),
    },
    "HoughCircles GRADIENT_ALT": {"smoothing": (0, 1, 1.5), "dp": (3, 2, 1.5), "edge": (600, 300), "votes": (0.9, 0.8)},
    "skimage hough_circle": {"sigma": (2, 3), "threshold": (0.5, 0.4, 0.3)},
    "SimpleBlobDetector": {  # the first levels lie above the bright spots on the base, the last are the defaults
        "smoothing": (0, 1),
        "levels": ((110, 160, 10), (90, 140, 10), (80, 150, 20), (80, 150, 10), (70, 150, 10), (50, 220, 10)),
        "circularity": (0.6, 0.4, 0.1),
    },
    "contours + fitEllipse": {"smoothing": (0, 1, 1.5), "threshold": (113, 100, "Otsu"), "ratio": (0.8, 0.9)},
    "EdgeDrawing": {"operator": ("PREWITT", "SOBEL"), "gradient": (80, 40, 20), "sigma": (1.0, 1.5)},
}


def candidates(name: str) -> list[Method]:
    """A peer with each setting of its grid, as a list of `detectors.Method`."""
    grid = GRIDS[name]
    options = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    return [replace(peers.COMPARED[name], options=some) for some in options]


def try_settings(
    names: Sequence[str] = tuple(GRIDS),
    *,
    scenes: Sequence[Scene] = MAIN,
    frames: int = FRAMES,
    workers: int = WORKERS,
) -> pd.DataFrame:
    """Try every setting in the grids of some peers on the same frames.

    Parameters
    ----------
    names : sequence of str
        Keys of `GRIDS`.
    scenes : sequence of Scene
    frames : int
        Number of frames of each scene.
    workers : int
        Number of processes; only the times depend on it.

    Returns
    -------
    DataFrame
        A row for each setting, in the order of the grids: peer, settings; frames, pegs, missed, false (counts over all
        frames); error, and its parts center and radius (over the bound); ms.
    """
    methods = [method for name in names for method in candidates(name)]
    numbers = range(FIRST_FRAME, FIRST_FRAME + frames)
    tasks = [delayed(_try_frame)(scene, number, methods) for number in numbers for scene in scenes]
    done = Parallel(workers, return_as="generator")(tasks)
    tried = list(tqdm(done, total=len(tasks), unit="frame", desc="frames", disable=None))
    return pd.DataFrame([_summary(method, runs) for method, *runs in zip(methods, *tried, strict=True)])


def _try_frame(scene, number, methods):
    """Run all methods on one frame; scene, seconds, false circles and disc rows (`score.score`) of each method."""
    frame = draw_frame(scene, number)
    image = expose(frame.picture, TARGET_NOISE, [SEED, *scene.name.encode(), number])
    runs = []
    with one_thread():
        for method in methods:
            found, seconds = peers.run(method, image, RADIUS_RANGE)
            rows, false_circles = score(frame, found, TARGET_NOISE)
            runs.append((scene.name, seconds, false_circles, rows))
    return runs


_ROW = DISC_COLUMNS[4:]  # columns of a disc after the key


def _summary(method, runs):
    """A row of `try_settings`."""
    discs = pd.DataFrame([(scene, *row) for scene, _, _, rows in runs for row in rows], columns=["scene", *_ROW])
    parts = [part[part["found"]] for _, part in discs.groupby("scene")]
    center, radius = (_mean_error(parts, columns) for columns in (["x", "y"], ["r"]))
    return {
        "peer": method.name,
        "settings": method.settings,
        "frames": len(runs),
        "pegs": len(discs),
        "missed": int((~discs["found"]).sum()),
        "false": sum(false_circles for _, _, false_circles, _ in runs),
        "error": np.sqrt(center * radius),
        "center": center,
        "radius": radius,
        "ms": 1e3 * np.median([seconds for _, seconds, _, _ in runs]),
    }


def _mean_error(parts, columns):
    """The geometric mean, over scenes, of 1.4826 times the median error over its bound; infinite if none is found."""
    medians = [1.4826 * np.median(np.abs(part[columns])) if len(part) else np.inf for part in parts]
    return float(np.exp(np.mean(np.log(medians))))


# ---- the rule ----


def _counts_tie(counts, least):
    return counts - least <= np.sqrt(counts + least)


RULE = {
    "missed": _counts_tie,
    "false": _counts_tie,
    "error": lambda errors, least: errors <= ERROR_TIE * least,
    "ms": lambda times, least: times <= TIME_TIE * least,
}
"""For each column, in order: which values tie with the smallest (the module's docstring gives the reasons)."""


def rank(table: pd.DataFrame) -> pd.DataFrame:
    """Rank the settings of each peer.

    Parameters
    ----------
    table : DataFrame
        As returned by `try_settings`.

    Returns
    -------
    DataFrame
        The same rows, peer by peer, best first, with a column `rank` (1, 2, ...) after `peer`.
    """
    ranked = pd.concat([_in_order(part) for _, part in table.groupby("peer", sort=False)], ignore_index=True)
    ranked.insert(1, "rank", ranked.groupby("peer").cumcount() + 1)
    return ranked


def _in_order(table):
    """The rows of one peer, each the best among itself and the following ones."""
    order, rest = [], table
    while len(rest):
        order.append(_best(rest))
        rest = rest.drop(index=order[-1])
    return table.loc[order]


def _best(table):
    """The index of the row that the rule chooses."""
    for column, tie in RULE.items():
        table = table[tie(table[column], table[column].min())]
    return table.index[0]


# ---- the file ----


def write_settings(table: pd.DataFrame, folder: Path) -> None:
    """Write a ranking into `folder`."""
    scenes = ", ".join(scene.name for scene in MAIN)
    comment = (
        f"the peers' settings on frames of their own ({scenes}; noise {TARGET_NOISE}), error, center and radius over "
        f"the bound; {study.made_by(NAME)}"
    )
    study.write_measured(folder, NAME, table.round({"error": 3, "center": 3, "radius": 3, "ms": 2}), comment)


def write_peer_settings(folder: Path = MEASURED_FOLDER) -> None:
    """Try all settings of the installed peers, print the best of each and write the ranking into `folder`."""
    reasons = {name: peers.missing(peers.COMPARED[name]) for name in GRIDS}
    table = rank(try_settings([name for name, reason in reasons.items() if not reason]))
    write_settings(table, folder)
    print(table[table["rank"] <= SHOWN].to_string(index=False, float_format="%.4g"))
    for name, reason in reasons.items():
        if reason:
            print(f"{name}: left out, {reason}.")
