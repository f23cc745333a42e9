"""Summarises the scores of all frames in the table of results."""

from __future__ import annotations

import numpy as np
import pandas as pd

from . import peers
from .scenes import SCENES

HONEST = 1.959964  # half-width in sigmas of the interval with 95 % of a normal distribution


# ---- many frames ----


def summarize(frames: pd.DataFrame, discs: pd.DataFrame) -> pd.DataFrame:
    """The table of results: a row for each scene, noise and method (`score` defines the quantities)."""
    reference = frames[frames["method"] == peers.REFERENCE].set_index(["scene", "noise", "frame"])["seconds"]
    rows, key = [], ["scene", "noise", "method"]
    parts = dict(list(discs.groupby(key, sort=False)))
    for (scene, noise, method), part in frames.groupby(key, sort=False):
        cell = _cell(part, parts.get((scene, noise, method), discs[:0]), reference)
        rows.append({"scene": scene, "noise": noise, "method": method} | cell)
    table = pd.DataFrame(rows)
    order = table[["scene", "method"]].apply(lambda column: column.map(_ORDER))
    return table.iloc[np.lexsort((order["method"], table["noise"], order["scene"]))].reset_index(drop=True)


# scenes and methods in the order of the tables
_ORDER = {name: k for k, name in enumerate([*(scene.name for scene in SCENES), *peers.COMPARED])}


def _cell(frames, discs, reference):
    """One row's numbers."""
    seconds = frames.set_index(["scene", "noise", "frame"])["seconds"]
    ratio = seconds / reference.reindex(seconds.index)
    pegs = discs[(discs["peg"] > 0) & discs["found"]]
    center, radius = pegs[["x", "y"]].to_numpy().ravel(), pegs["r"].to_numpy()
    z_center, z_radius = pegs[["z_x", "z_y"]].to_numpy().ravel(), pegs["z_r"].to_numpy()
    return {
        "frames": len(frames),
        "ms": 1e3 * seconds.median(),
        "time_ratio": ratio.median(),
        "detection": 100 * discs["found"].mean(),
        "false_positives": frames["false_positives"].mean(),
        "center": _robust_rms(center),
        "center_rms": _rms(center),
        "radius": _robust_rms(radius),
        "radius_rms": _rms(radius),
        "visible": 100 * discs.loc[discs["peg"] > 0, "visible"].mean(),
        "arc_bound": _median(pegs["arc"]),
        "center_arc": _robust_rms(pegs[["arc_x", "arc_y"]].to_numpy().ravel()),
        "radius_arc": _robust_rms(pegs["arc_r"].to_numpy()),
        "center_sd": _spread(z_center),
        "radius_sd": _spread(z_radius),
        "coverage": _coverage(np.concatenate([z_center, z_radius])),
    }


def _median(values):
    return float(np.median(values)) if len(values) else np.nan


def _robust_rms(values):
    return 1.4826 * _median(np.abs(values))


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def _spread(values):
    """Standard deviation; NaN for methods that state no sigma."""
    return float(np.std(values)) if len(values) else np.nan


def _coverage(values):
    """Percentage of the values within +-1.96; NaN for methods that state no sigma."""
    return 100 * float(np.mean(np.abs(values) < HONEST)) if len(values) and np.isfinite(values).all() else np.nan
