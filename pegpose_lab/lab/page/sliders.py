"""What the page's sliders move through: states read from data/results and data/measured, each with its text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...study import load_measured
from .. import results
from ..style import COLORS, SERIES, WHOLE_PIXELS

if TYPE_CHECKING:
    from pathlib import Path

    from pandas import DataFrame

MARGIN = 20  # px, round the pegs


@dataclass(frozen=True)
class Slider:
    """A slider of the page.

    Attributes
    ----------
    name, title : str
        Its name in the page, and what is read above it.
    kind : str
        "bars" or "circles": how its states are drawn.
    states : list of dict
        Of each: ``text``, and what the drawing needs (see ``page.js``).
    source : str
        The notebook, and the files that its states are read from.
    start : int
        The state shown first.
    """

    name: str
    title: str
    kind: str
    states: list[dict[str, Any]]
    source: str
    start: int = 0


def sliders(folder: Path) -> list[Slider]:
    """All sliders of the page, from the results in a folder."""

    def table(name: str) -> DataFrame:
        return results.read_csv(folder / f"{name}.csv")

    return [
        _frames(table("06_pegs"), table("06_trajectory")),
        _clearances(load_measured("chain_clearances")),
        _tilts(table("09_sigma_over_tilt")),
        _noises(table("04_over_noise")),
        _backgrounds(table("01_backgrounds")),
        _blurs(load_measured("moving_hub")),
        _servo(load_measured("servo_steps")),
    ]


def _frames(pegs, trajectory):
    """The pegs of the 45 frames, in the part of the image that they pass, and the pose's error by camera and by one scale."""
    reach = pegs["radius_px"].max() + MARGIN
    low = pegs[["x_px", "y_px"]].min() - reach
    width, height = (pegs[["x_px", "y_px"]].max() + reach - low).round().astype(int).tolist()
    pegs = pegs.assign(x_px=pegs["x_px"] - low["x_px"], y_px=pegs["y_px"] - low["y_px"])
    states = []
    for (frame, four), row in zip(pegs.groupby("frame"), trajectory.itertuples(index=False), strict=True):
        circles = [
            [round(x, 1), round(y, 1), round(r, 1), str(peg), COLORS["joint"]]
            for peg, x, y, r in four[["peg", "x_px", "y_px", "radius_px"]].itertuples(index=False)
        ]
        middle = four[["x_px", "y_px"]].mean().round(1).tolist()
        off = 1000 * np.hypot(row.dx_joint, row.dy_joint)
        scale = np.hypot(row.dx_scale, row.dy_scale)
        text = f"frame {frame}: error of the hub's centre {off:.1f} µm with the calibrated camera, "
        text += f"{scale:.2f} mm with one scale"
        text += " for the image" if frame > 1 else " (taught in this frame, so exact)"
        line = [[*middle, circles[0][0], circles[0][1], SERIES[1]]]
        states.append({"width": width, "height": height, "circles": circles, "lines": line, "text": text})
    source = "notebooks/06_peg_pose.ipynb; data/results/06_pegs.csv; data/results/06_trajectory.csv"
    return Slider(
        "frames",
        "The hub in 45 frames: its pegs (drawn as circles), and the line whose angle is θ",
        "circles",
        states,
        source,
        len(states) // 2,
    )


CHAINS = {
    "one scale": ("Table 2's scale", COLORS["paper"]), "stage 1": ("stage 1", COLORS["linear"]),
    "stages 1 + 2": ("stages 1 + 2", COLORS["genetic"]), "joint, whole pixels": ("joint, whole pixels", WHOLE_PIXELS),
    "Zhang": ("Zhang", COLORS["zhang"]), "joint": ("joint", COLORS["joint"]),
}  # fmt: skip
"""Of the chains those shown, with their names and colours in notebook 12."""


def _clearances(curves):
    """Insertions that go in freely, by clearance, for an exact robot."""
    exact = (
        curves[curves["cell"] == "exact robot"]
        .groupby("chain")
        .head(-1 + curves.groupby(["cell", "chain"]).size().max())
    )
    wide = exact.pivot(index="clearance", columns="chain", values="share")
    states = []
    for clearance, shares in wide.iterrows():
        bars = [
            [name, round(shares[chain], 4), f"{100 * shares[chain]:.1f} %", color]
            for chain, (name, color) in CHAINS.items()
        ]
        states.append(
            {"bars": bars, "text": f"clearance {clearance:.2g} mm: insertions that go in freely, with an exact robot"}
        )
    source = "notebooks/12_assembly.ipynb; data/measured/chain_clearances.csv"
    return Slider(
        "clearance",
        "Will the wheel go on? Share of insertions by clearance and chain (calibration, circles)",
        "bars",
        states,
        source,
        len(states) // 2,
    )


def _tilts(sigmas):
    """Relative sigma of f by the boards' tilt, for numbers of views."""
    states = []
    for tilt in sigmas.columns[1:]:
        bars = []
        for views, sigma in zip(sigmas["views"], sigmas[tilt], strict=True):
            bars.append([f"{views} views", min(float(sigma), 1.0), f"{sigma:.3f} %", COLORS["joint"]])
        states.append(
            {"bars": bars, "text": f"boards tilted by {float(tilt):.0f}°: standard deviation of the focal length"}
        )
    source = "notebooks/09_uncertainty.ipynb; data/results/09_sigma_over_tilt.csv"
    return Slider("tilt", "How well is f known? Tilt and number of the boards", "bars", states, source)


def _noises(table):
    """Mean distance of stage 1 and both stages by the corners' noise."""
    largest = table[["linear E (px)", "two-stage E (px)"]].to_numpy().max()
    states = []
    for _, row in table.iterrows():
        bars = [
            [name, row[column] / largest, f"{row[column]:.4f} px", COLORS[color]]
            for name, column, color in (
                ("stage 1", "linear E (px)", "linear"),
                ("stages 1 + 2", "two-stage E (px)", "genetic"),
            )
        ]
        f_1, f_2 = row["linear f (mm)"], row["two-stage f (mm)"]
        text = f"corner noise {row['noise (px)']:g} px: f = {f_1:.2f} mm by stage 1, {f_2:.2f} mm by both"
        states.append({"bars": bars, "text": text})
    source = "notebooks/04_genetic_stage.ipynb; data/results/04_over_noise.csv"
    return Slider(
        "noise",
        "Mean distance between corners and their re-projections (Eq. 7): with distortion in the model it is the corners' noise",
        "bars",
        states,
        source,
    )


def _backgrounds(table):
    """Pegs found by one threshold and by several, by the background's grey value."""
    states = []
    for _, row in table.iterrows():
        bars = [
            [name, row[column] / 4, f"{row[column]:.0f} of 4", COLORS[color]]
            for name, column, color in (
                ("Otsu's threshold", "pegs, Otsu", "paper"),
                ("segment", "pegs, segment", "joint"),
            )
        ]
        states.append(
            {
                "bars": bars,
                "text": f"grey values: background {row['background']:.0f}, hub 62, pegs 165; pegs that are separate parts",
            }
        )
    source = "notebooks/01_segmentation.ipynb; data/results/01_backgrounds.csv"
    return Slider(
        "background", "One threshold, or two: the background's brightness", "bars", states, source, len(states) // 3
    )


def _blurs(table):
    """Error of the pegs' centres by the motion during the exposure."""
    shifts = table[(table["kind"] == "shift") & (table["noise"] == table["noise"].min())]
    largest = shifts["rms"].max()
    states = []
    for _, row in shifts.iterrows():
        bars = [
            ["error of a centre", row["rms"] / largest, f"{row['rms']:.3f} px", COLORS["truth"]],
            ["stated sigma", row["sigma"] / largest, f"{row['sigma']:.3f} px", COLORS["joint"]],
            ["frames flagged", row["flagged"] / 100, f"{row['flagged']:.0f} %", COLORS["measured"]],
        ]
        states.append(
            {
                "bars": bars,
                "text": f"the hub moves by {row['blur']:.0f} px during the exposure (noise in grey values: {row['noise']:g})",
            }
        )
    source = "data/measured/moving_hub.csv, by: python3 -m pegpose_lab measure moving_hub"
    return Slider("blur", "A moving hub: blur, error, and the flag", "bars", states, source)


def _servo(steps):
    """What is left after each motion of a servo run, on a logarithmic scale."""
    low, high = np.log10(0.01), np.log10(max(steps["off"].max(), steps["off_turn"].max()))
    states = []
    for _, row in steps.iterrows():
        bars = []
        for name, column, unit, color in (
            ("distance left", "off", "mm", "truth"),
            ("angle left", "off_turn", "deg", "truth"),
        ):
            share = (np.log10(max(row[column], 0.01)) - low) / (high - low)
            bars.append([name, round(float(share), 4), f"{row[column]:.2g} {unit}", COLORS[color]])
        states.append({"bars": bars, "text": f"after {row['step']:.0f} motions (logarithmic scale)"})
    source = "notebooks/12_assembly.ipynb; data/measured/servo_steps.csv"
    return Slider(
        "servo", "A robot brings the hub to its place, with a new image after each motion", "bars", states, source
    )
