"""Writes the numbers on the README's first page from data/results, so that none is typed by hand.

`write` updates two blocks of the README: ``findings``, six sentences, and ``quality``, a table of eight rows.  The
full tables are in data/results/README.md (`claims.update_readme`, `bench.write`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import paper
from ..bench import OURS, REFERENCE, TARGET_NOISE
from ..paper import claims
from . import results


def write(readme: Path, folder: Path) -> None:
    """Update both blocks of a README from the results in a folder.

    Raises
    ------
    ValueError
        If a block does not have exactly one pair of markers.
    """
    for name, text in _blocks(Path(folder)).items():
        results.update_block(readme, name, text)


def is_current(readme: Path, folder: Path) -> bool:
    """Return whether `write` would leave the README unchanged; raises like `write`."""
    return all(results.block_is_current(readme, name, text) for name, text in _blocks(Path(folder)).items())


def _blocks(folder):
    numbered = "\n".join(f"{number}. {line}" for number, line in enumerate(findings(folder), 1))
    return {"findings": numbered, "quality": results.markdown(quality(folder), "lrr")}


def _table(folder, name):
    return results.read_csv(folder / f"{name}.csv")


def findings(folder: Path) -> list[str]:
    """The findings, each with the notebooks that show it, as Markdown."""
    needed = _table(folder, "12_clearances").set_index("way to the pose").iloc[:, 0]  # of an exact robot
    candidates = _table(folder, "08_candidates").set_index("corners, variant")
    success = _table(folder, "04_success_100")
    default, printed = success["paper's view"].iloc[[0, -1]]  # the first row has no printed form, the last row has all
    intervals = _table(folder, "09_intervals")["95 % intervals that hold it (%)"]
    halves = _table(folder, "09_halves")
    clean = _circles(folder).loc[(OURS, "clean")]
    rings, pulls = _table(folder, "10_real_rings"), _table(folder, "10_pulls")
    right = ((rings["measured"] > 0) & (rings["wrong"] == 0)).sum()
    seen = 100 * (pulls["measured"] + pulls["partial"]).sum() / pulls["discs"].sum()
    ours, whole = (candidates.loc[name, "two stages, Eq. 7"] for name in ("find_corners", "whole pixels"))
    zhang = candidates.loc["whole pixels", "Zhang, rms"]
    printed_ga, printed_zhang = (paper.printed_numbers().at[name, "printed"] for name in ("E-rms", "E-zhang"))
    return [
        f"**The paper.** {claims.summary(claims.claims_table(results.load_values(folder)))} (08)",
        f"**{printed_ga} px against {printed_zhang} px.** The residual tells of the corners, not of the calibration: "
        "the two stages leave "
        f"{ours:.4f} px with our corners and {whole:.2f} px with corners rounded to whole pixels, where Zhang's method "
        f"leaves {zhang:.2f} px. Several explanations of the printed gap are computed; none is proven. (05, 07, 08)",
        f"**The genetic algorithm** finds the optimum of its box in {default:.0f} of 100 runs on the paper's "
        f"view once its genes are magnification and depth; with genes and operators as printed in "
        f"{printed:.0f}. (04)",
        "**A small residual is no sign of a good camera.** The joint calibration states intervals; on simulated "
        f"experiments {intervals.min():.1f} to {intervals.max():.1f} % of its 95 % intervals hold the truth. On the "
        f"photographs of {halves['dataset'].nunique()} cameras classical sigmas are "
        f"{_rms(halves['classical_rms_z']):.1f} times too small; those that it states there, by the scatter between "
        f"views, have an rms z of {_rms(halves['rms_z']):.2f}. A bent board, a lens that is not the model and wrong views "
        "are flagged. (09)",
        f"**Circles** on renderings are measured at {clean['center']:.2f} times the physical limit of noise and blur, "
        f"with a sigma for each. In photographs of real parts the described ring is found in {right} of "
        f"{len(rings)}; of {pulls['discs'].sum()} discs on photographed sheets {seen:.1f} % are measured, and residuals are "
        f"{pulls['pull'].min():.1f} to {pulls['pull'].max():.1f} times the stated sigmas. (02, 10)",
        f"**The wheel** of an exact robot goes on in 99.9 % of the trials with a clearance of {needed['joint']:.3f} mm, where "
        f"the same camera with whole-pixel circles needs {needed['joint, whole pixels']:.2f} mm, and one scale for the image "
        f"{needed.iloc[0]:.1f} mm. (12)",
    ]


def _rms(values):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def _circles(folder):
    """The circle benchmark at the noise of its tables, by method and scene."""
    circles = _table(folder, "bench_circles")
    return circles[circles["noise"] == TARGET_NOISE].set_index(["method", "scene"])


def quality(folder: Path) -> list[list[str]]:
    """A header and eight rows: a quantity, our result, and that of a peer or a bound."""
    circles = _circles(folder)
    intervals = _table(folder, "09_intervals")["95 % intervals that hold it (%)"]
    chain = _table(folder, "06_chain_errors").set_index("camera")["peg centres (mm)"]
    clean, clutter, look = (circles.loc[(OURS, name)] for name in ("clean", "clutter", "default look"))
    hough = circles.loc[(REFERENCE, "clean")], circles.loc[(REFERENCE, "clutter")]
    return [
        ["on renderings with a known truth", "ours", "compared with"],
        ["peg centre: error over the physical limit, clean", f"{clean['center']:.2f}",
         f"{REFERENCE} {hough[0]['center']:.0f}"],
        ["the same with highlights and swarf", f"{clutter['center']:.2f}", f"{REFERENCE} {hough[1]['center']:.0f}"],
        [f"its time, divided by that of {REFERENCE}", f"{clean['time_ratio']:.2f} to {clutter['time_ratio']:.2f}", "1"],
        ["pegs found, false circles per frame, swarf", f"{clutter['detection']:.0f} %, {clutter['false_positives']:g}",
         f"{hough[1]['detection']:.1f} %, {hough[1]['false_positives']:g}"],
        ["95 % intervals of discs that hold the truth, clean", f"{clean['coverage']:.1f} %", "95 %"],
        ["the same with side walls and turning marks", f"{look['coverage']:.1f} %", "95 %"],
        ["95 % intervals of the camera that hold the truth", f"{intervals.min():.1f} to {intervals.max():.1f} %",
         "95 %"],
        ["peg centres of the whole chain, rms: joint calibration", f"{chain['joint']:.4f} mm",
         f"two stages {chain['stages 1 + 2']:.4f} mm"],
    ]  # fmt: skip
