"""The aims of the benchmark beside the measured values."""

from __future__ import annotations

import numpy as np
import pandas as pd

from . import peers
from .resources import exponent, growth
from .scenes import TARGET_NOISE

# scene: largest centre/bound, radius/bound, time ratio and false positives; least detection
_LIMITS = {
    "clean": (1.05, 1.2, 1.0, 0.0, 100.0),
    "tilt": (1.05, 1.2, 1.0, 0.0, 100.0),
    "highlights": (1.6, 2.0, 3.0, 0.0, 100.0),
    "clutter": (2.0, 2.5, 3.0, 0.01, 99.5),
}
_HONEST = {"clean": (0.9, 1.1), "tilt": (0.9, 1.1)}  # scene: range of the standard deviation of error / sigma
_ELSEWHERE = (0.0, 1.3)
_COVERAGE = (93.0, 97.0)  # %, of the 95 % intervals


def judge(
    circles: pd.DataFrame, methods: pd.DataFrame, sizes: pd.DataFrame, joint: pd.DataFrame, genetic: pd.DataFrame
) -> pd.DataFrame:
    """The aims beside the measured values: errors and times at the noise of the targets, and the honesty of the
    sigmas at the worst noise, in every scene.

    Returns
    -------
    DataFrame
        scene, quantity, low, high (the limits; NaN if there is none), measured, met.
    """
    ours = circles[circles["method"] == peers.OURS]
    rows = []
    for scene, cells in ours.groupby("scene", sort=False):
        if scene in _LIMITS:
            rows += _error_targets(cells[cells["noise"] == TARGET_NOISE].iloc[0], *_LIMITS[scene])
        rows += _honesty_targets(scene, cells)
        if scene == "strangers":
            rows.append((scene, "false positives per frame", np.nan, 0.0, cells["false_positives"].max()))
    worst = ours.loc[ours["scene"] == "clean", "center"].max()
    rows.append(("clean", "centre / bound, worst noise", np.nan, 1.1, worst))
    memory = methods.set_index("method").loc[peers.OURS, "memory_mb"]
    rows.append(("tilt", "memory, MB", np.nan, 100.0, memory))
    rows.append(("clean", "exponent of time over megapixels", np.nan, 1.1, growth(sizes)))
    thirteen = joint.loc[joint["views"] == 13, "ratio"].item()
    rows.append(("joint", "time / cv2.calibrateCamera, 13 views", np.nan, 3.0, thirteen))
    rows.append(("joint", "exponent of time over views", np.nan, 1.1, exponent(joint["views"], joint["ms"])))
    rows.append(("genetic", "time / differential evolution, worst view", np.nan, 3.0, genetic["ratio"].max()))
    rows.append(("genetic", "seeds at the optimum of the box, %", 100.0, np.nan, genetic["reached"].min()))
    table = pd.DataFrame(rows, columns=["scene", "quantity", "low", "high", "measured"])
    below, above = table["measured"] < table["low"], table["measured"] > table["high"]
    table["met"] = np.where(table["measured"].isna(), "not measured", np.where(below | above, "no", "yes"))
    return table


def _error_targets(row, center, radius, ratio, false_positives, detection):
    """A scene's rows of `judge` about errors and times."""
    return [
        (row.scene, "centre / bound", np.nan, center, row.center),
        (row.scene, "radius / bound", np.nan, radius, row.radius),
        (row.scene, f"time / {peers.REFERENCE}", np.nan, ratio, row.time_ratio),
        (row.scene, "detection, %", detection, np.nan, row.detection),
        (row.scene, "false positives per frame", np.nan, false_positives, row.false_positives),
    ]


def _honesty_targets(scene, cells):
    """A scene's rows of `judge` about the sigmas: whether they match the errors, at the worst noise."""
    low, high = _HONEST.get(scene, _ELSEWHERE)
    rows = []
    for quantity, name in (("centre", "center_sd"), ("radius", "radius_sd")):
        worst = cells[name].iloc[np.abs(np.log(cells[name].to_numpy())).argmax()]
        rows.append((scene, f"sd of {quantity} error / sigma, worst noise", low, high, worst))
    worst = cells["coverage"].iloc[np.abs(cells["coverage"].to_numpy() - 95).argmax()]
    return [*rows, (scene, "95 % intervals that hold the truth, %, worst noise", *_COVERAGE, worst)]
