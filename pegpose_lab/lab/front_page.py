"""Writes the numbers on the README's first page from data/results, so that none is typed by hand.

`write` updates two blocks of the README: ``findings``, six paragraphs, and ``quality``, a table of eight rows.  The
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
    clean, look = (_circles(folder).loc[(OURS, scene), "center"] for scene in ("clean", "default look"))
    rings, pulls = _table(folder, "10_real_rings"), _table(folder, "10_pulls")
    right = ((rings["measured"] > 0) & (rings["wrong"] == 0)).sum()
    exact, partly = (100 * pulls[state].sum() / pulls["discs"].sum() for state in ("measured", "partial"))
    ours = candidates.loc["find_corners", "two stages, Eq. 7"]
    rounded = _table(folder, "05_whole_pixel_errors").set_index("method")["mean distance (Eq. 7)"]
    printed_ga, printed_zhang = (paper.printed_numbers().at[name, "printed"] for name in ("E-rms", "E-zhang"))
    return [
        _verdicts(claims.claims_table(results.load_values(folder))),
        f"**Residuals.** The paper prints {printed_ga} px for its method and {printed_zhang} px for Zhang's. Such a residual "
        "measures the noise of the corners, not the quality of the calibration: the paper's two stages leave "
        f"{ours:.4f} px with our corners and {rounded['stages 1 + 2']:.2f} px with corners rounded to whole pixels, where "
        f"Zhang's method leaves {rounded['Zhang']:.2f} px (mean distances, Eq. 7). Several explanations of the printed gap are "
        "computed; none is proven. (05, 07, 08)",
        f"**The genetic algorithm** finds the optimum of its search box in {default:.0f} of 100 runs on the paper's "
        "view if its genes are magnification and depth; it succeeds in "
        f"{printed:.0f} of 100 with genes and operators as printed. (04)",
        "**A small residual does not mean that the camera is known well.** The joint calibration states 95 % intervals; with "
        f"simulated corners {intervals.min():.1f} to {intervals.max():.1f} % of them contain the truth. The usual standard "
        "deviations, which take the errors of all corners for independent, are "
        f"{_rms(halves['classical_rms_z']):.1f} times too small on photographs from {halves['dataset'].nunique()} cameras. "
        "There the joint calibration uses the scatter between views: differences between halves of the photographs are "
        f"{_rms(halves['rms_z']):.2f} times as large as it states (1 is honest). In simulations a bent board and a lens "
        "that does not follow the model are flagged. (09)",
        "**Circles** on renderings are measured with an error of "
        f"{clean:.2f} times the limit set by noise and blur on even ground, and of {look:.1f} times on the hub with turning "
        "marks and side walls; each has a stated standard deviation. In photographs of real parts, which served to "
        f"develop the method, the described ring is found in {right} of {len(rings)}. Of {pulls['discs'].sum()} discs on "
        f"photographed sheets {exact:.1f} % are measured and {partly:.1f} % in part; residuals are "
        f"{pulls['pull'].min():.1f} to {pulls['pull'].max():.1f} times the stated standard deviations. (11, 10)",
        "**The wheel.** With the joint calibration and an exact robot the wheel goes on in 99.9 % of the trials at a "
        f"clearance of {needed['joint']:.3f} mm. With circles in whole pixels the same calibration needs "
        f"{needed['joint, whole pixels']:.2f} mm, and one scale for the whole image, as in the paper's Table 2, needs "
        f"{needed.iloc[0]:.1f} mm. (12)",
    ]


def _verdicts(table):
    """The first finding: how many printed numbers have which verdict, and what the verdict means."""
    count = table["verdict"].value_counts()
    recovered, arithmetic, reproduced, contradicted, undecided, inputs = (
        count.get(verdict, 0) for verdict in claims.VERDICTS
    )
    return (
        f"**The paper** prints {len(table)} numbers. {inputs} are inputs, which were adopted; {recovered} were put into "
        f"the rendering and come out again; {arithmetic} follow from other printed numbers by arithmetic; {reproduced} are "
        f"reproduced independently; {undecided} cannot be decided, because they depend on what is not printed; and "
        f"{contradicted or 'none'} {'are' if contradicted > 1 else 'is'} contradicted by our measurements, but some do not "
        "fit each other: lens, distance, scale and resolution, and the tilts of Tables 1 and 2 (08). All are listed in "
        "data/results/README.md."
    )


def _rms(values):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def _circles(folder):
    """The circle benchmark at the noise of its tables, by method and scene."""
    circles = _table(folder, "bench_circles")
    return circles[circles["noise"] == TARGET_NOISE].set_index(["method", "scene"])


def _best_other(circles, scene):
    """Name and row of the foreign detector with the least error of the centre in a scene."""
    rows = circles.xs(scene, level="scene")
    rows = rows[(rows.index != OURS) & ~rows.index.str.startswith("find_circles")]
    return rows["center"].idxmin(), rows.loc[rows["center"].idxmin()]


def quality(folder: Path) -> list[list[str]]:
    """A header and eight rows: a quantity, our result, and that of peers or a bound."""
    circles = _circles(folder)
    intervals = _table(folder, "09_intervals")["95 % intervals that hold it (%)"]
    chain = _table(folder, "06_chain_errors").set_index("camera")["peg centres (mm)"]
    clean, clutter, look = (circles.loc[(OURS, name)] for name in ("clean", "clutter", "default look"))
    times, hidden = circles.loc[OURS, "time_ratio"], "strangers"  # the scene with things that look like pegs
    usual, slow, fast = times.drop(hidden), circles.loc[(OURS, hidden)], circles.loc[(REFERENCE, hidden)]
    (best, at_best), (best_swarf, at_swarf) = (_best_other(circles, scene) for scene in ("clean", "clutter"))
    hough, hough_swarf = (circles.loc[(REFERENCE, scene)] for scene in ("clean", "clutter"))
    return [
        [f"on renderings with a known truth; circles with noise of {TARGET_NOISE} grey values", "ours", "for comparison"],
        ["robust error of peg centres over the limit set by noise and blur, even ground", f"{clean['center']:.2f}",
         f"best other tool, {best}: {at_best['center']:.2f}; {REFERENCE}: {hough['center']:.0f}"],
        ["the same with highlights and swarf", f"{clutter['center']:.2f}",
         f"best other tool, {best_swarf}: {at_swarf['center']:.2f}; {REFERENCE}: {hough_swarf['center']:.0f}"],
        ["pegs found, and false circles per frame, with highlights and swarf", _found(clutter),
         f"{best_swarf}: {_found(at_swarf)}; {REFERENCE}: {_found(hough_swarf)}"],
        [f"time relative to {REFERENCE}: {len(usual)} scenes, and one with other discs, squares and bars",
         f"{usual.min():.2f} to {usual.max():.1f}, and {slow['time_ratio']:.1f}, where {slow['detection']:.0f} % are found",
         f"1; where {fast['detection']:g} % are found"],
        ["95 % intervals of discs that contain the truth, even ground", f"{clean['coverage']:.1f} %", "95 %"],
        ["the same with side walls and turning marks: these intervals are too narrow", f"{look['coverage']:.1f} %", "95 %"],
        ["95 % intervals of the camera that contain the truth, simulated corners",
         f"{intervals.min():.1f} to {intervals.max():.1f} %", "95 %"],
        ["rms error of peg centres after the whole chain, joint calibration", f"{chain['joint']:.4f} mm",
         f"the paper's two stages: {chain['stages 1 + 2']:.4f} mm"],
    ]  # fmt: skip


def _found(row):
    """Pegs found (%) and false circles per frame; a share below 100 is never rounded up to it."""
    share = row["detection"] if row["detection"] == 100 else min(round(row["detection"], 1), 99.9)
    return f"{share:g} %, {row['false_positives']:g}"
