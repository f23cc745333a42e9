"""How many discs are a part of their own in a segmented image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from .. import paper
from ..files import MEASURED_FOLDER
from ..render import true_disc
from ..segmentation import segment
from .circle_counts import load_known
from .datasets import dataset
from .measured import made_by, write_measured
from .photographs import _grey

if TYPE_CHECKING:
    from pathlib import Path

    from pandas import DataFrame

PART_OFF, PART_AREA = 0.3, 0.3  # of a disc's radius, and of its area
HUB_COLUMNS, LIGHTS = (40, 680), (1, 2, 4, 8)  # px, where the rendered hub is; how many times lighter its right side


def count_parts() -> DataFrame:
    """Count the discs that are a part of their own by `segment`, and by Otsu's global threshold alone.

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
    """Rendered frame 1 in each of LIGHTS: name, light, image, and its pegs (4, 3) as x, y, r."""
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


def write_parts(folder: Path = MEASURED_FOLDER) -> None:
    """Write the table of `count_parts` into `folder`; raises as it does."""
    what, name = "discs that are a part of their own by segment and by Otsu's threshold alone", "segmented_parts"
    write_measured(folder, name, count_parts(), f"{what}; {made_by(name)}")
