"""The peers' settings: a grid for each, tried on frames of its own, and the best by one rule.

``python3 -m pegpose_lab measure peer_settings`` prints each peer's best five and writes all to
data/measured/peer_settings.csv, in about ten minutes on two idle cores; `peers.COMPARED` has each peer's first.  Peers
that cannot be installed are left out.

Frames
------
`FRAMES` of each of the scenes `scenes.MAIN`, with the noise of the benchmark's tables, numbered from
`FIRST_FRAME`: poses, blur and noise that the benchmark does not use.  All are scored as there.

Rule
----
One after the other, each among those that the last has left; settings that tie with the best stay:

1. pegs missed.  Counts tie where they differ by one standard deviation of a difference of counts at most,
   |a - b| <= sqrt(a + b).
2. false circles, likewise.
3. error: the geometric mean, over the scenes and over centre and radius, of the median error over its bound.  Both,
   because a centre alone would prefer thresholds that make every radius 2 px too small.  Errors tie within 5 %, the
   standard deviation of a quotient of two such means.
4. time, as the median over the frames.  Times tie within 25 %, what a busy machine changes in them.
5. place in the grid, which goes from the fast to the slow.

Its choice has rank 1; rank 2 is its choice among the rest, and so on.
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

# peer: option of its function in `bench.methods`: values, from the fast to the slow
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
    "SimpleBlobDetector": {  # the first levels lie above the bright spots on the base, the last are its own
        "smoothing": (0, 1),
        "levels": ((110, 160, 10), (90, 140, 10), (80, 150, 20), (80, 150, 10), (70, 150, 10), (50, 220, 10)),
        "circularity": (0.6, 0.4, 0.1),
    },
    "contours + fitEllipse": {"smoothing": (0, 1, 1.5), "threshold": (113, 100, "Otsu"), "ratio": (0.8, 0.9)},
    "EdgeDrawing": {"operator": ("PREWITT", "SOBEL"), "gradient": (80, 40, 20), "sigma": (1.0, 1.5)},
}


def candidates(name: str) -> list[Method]:
    """A peer with each setting of its grid, a list of `detectors.Method`."""
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
    """Try every setting of peers' grids on the same frames.

    Parameters
    ----------
    names : sequence of str
        Keys of `GRIDS`.
    scenes : sequence of bench_circles.Scene
    frames : int
        Of each scene.
    workers : int
        Processes; only the times depend on them.

    Returns
    -------
    DataFrame
        A row for each setting, in the grids' order: peer, settings; frames, pegs, missed, false (counts of all frames);
        error, and its parts center and radius (over the bound); ms.
    """
    methods = [method for name in names for method in candidates(name)]
    numbers = range(FIRST_FRAME, FIRST_FRAME + frames)
    tasks = [delayed(_try_frame)(scene, number, methods) for number in numbers for scene in scenes]
    done = Parallel(workers, return_as="generator")(tasks)
    tried = list(tqdm(done, total=len(tasks), unit="frame", desc="frames", disable=None))
    return pd.DataFrame([_summary(method, runs) for method, *runs in zip(methods, *tried, strict=True)])


def _try_frame(scene, number, methods):
    """One frame for all methods: scene, seconds, false circles and rows of discs (`score.score`) of each."""
    frame = draw_frame(scene, number)
    image = expose(frame.picture, TARGET_NOISE, [SEED, *scene.name.encode(), number])
    runs = []
    with one_thread():
        for method in methods:
            found, seconds = peers.run(method, image, RADIUS_RANGE)
            rows, false_circles = score(frame, found, TARGET_NOISE)
            runs.append((scene.name, seconds, false_circles, rows))
    return runs


_ROW = DISC_COLUMNS[4:]  # of a disc, after the key


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
    """The geometric mean, over scenes, of 1.4826 times the median error over its bound; infinite where none is found."""
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
"""Column: which of its values tie with the least.  In order; the module's text gives the reasons."""


def rank(table: pd.DataFrame) -> pd.DataFrame:
    """Rank the settings of each peer.

    Parameters
    ----------
    table : DataFrame
        As `try_settings` returns.

    Returns
    -------
    DataFrame
        The same rows, peer by peer, the best first, with a column `rank` (1, 2, ...) after `peer`.
    """
    ranked = pd.concat([_in_order(part) for _, part in table.groupby("peer", sort=False)], ignore_index=True)
    ranked.insert(1, "rank", ranked.groupby("peer").cumcount() + 1)
    return ranked


def _in_order(table):
    """One peer's rows, each the best of those from it on."""
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
        f"the peers' settings on frames of their own ({scenes}; noise {TARGET_NOISE}), error, center and radius over the "
        f"bound; {study.made_by(NAME)}"
    )
    study.write_measured(folder, NAME, table.round({"error": 3, "center": 3, "radius": 3, "ms": 2}), comment)


def write_peer_settings(folder: Path = MEASURED_FOLDER) -> None:
    """Try all settings of the peers that are installed, print each one's best and write the ranking into `folder`."""
    reasons = {name: peers.missing(peers.COMPARED[name]) for name in GRIDS}
    table = rank(try_settings([name for name, reason in reasons.items() if not reason]))
    write_settings(table, folder)
    print(table[table["rank"] <= SHOWN].to_string(index=False, float_format="%.4g"))
    for name, reason in reasons.items():
        if reason:
            print(f"{name}: left out, {reason}.")
