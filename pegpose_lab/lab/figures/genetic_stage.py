"""Figures of the genetic stage: its objective's valley, its operators, and how often it reaches the optimum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import LogNorm
from scipy.stats import binomtest

from ..style import COLORS, SERIES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from numpy.typing import ArrayLike, NDArray

    from ...calibration import Calibration

    Floats = NDArray[np.float64]

PRINTED, CORRECTED, DEFAULT = COLORS["paper"], SERIES[0], COLORS["genetic"]
"""Colours of the algorithm as printed, with corrected operators, and with the genes (m, T_z), too."""

CORNERS = {
    "find_corners": (COLORS["joint"], "o"),
    "OpenCV sectors": (COLORS["zhang"], "^"),
    "cornerSubPix": (COLORS["measured"], "s"),
    "whole pixels": (COLORS["oracle"], "D"),
}
"""Colour and marker of each source of corners."""

VALLEY = LogNorm(0.01, 100.0)
"""px, the range of colours of the objective."""

CELLS = 160
"""Number of cells of the valley's map along each axis."""

FINER = 12
"""Number of places in each cell of the valley's map, of which the lowest is shown: the floor is narrower than a cell."""


def lowest_in_cells(
    objective: Callable[[Floats], Floats], x: ArrayLike, t_z: ArrayLike, f_of: Callable[[Floats, Floats], Floats]
) -> Floats:
    """The smallest objective in each cell of a grid, (len(t_z) - 1, len(x) - 1), px.

    `x` and `t_z` (mm) are the edges of the cells and ``f_of(x, t_z)`` (mm) is the focal length of the first gene `x`.
    Each cell is looked at in `FINER` places along `x`, at the middle of its T_z.
    """
    x, t_z = np.asarray(x, float), np.asarray(t_z, float)
    columns = len(x) - 1
    places = np.linspace(x[0], x[-1], columns * FINER + 1)[:-1] + (x[-1] - x[0]) / (2 * columns * FINER)
    rows = [
        objective(np.column_stack([f_of(places, middle), np.full(len(places), middle)]))
        for middle in (t_z[:-1] + t_z[1:]) / 2
    ]
    return np.min(np.reshape(rows, (len(rows), columns, FINER)), axis=2)


def plot_valley(ax: Axes, x: ArrayLike, t_z: ArrayLike, values: Floats) -> AxesImage:
    """Draw the map of `lowest_in_cells` over the same edges, in colours of equal ratios; returns it for a colour bar."""
    extent = (x[0], x[-1], t_z[0], t_z[-1])
    return ax.imshow(values, origin="lower", extent=extent, aspect="auto", cmap="magma", norm=VALLEY)


def plot_population(ax: Axes, chromosomes: Floats, optimum: ArrayLike) -> None:
    """Draw chromosomes (n, 2) as dots, and a ring round the optimum (2,), which it leaves visible."""
    style = {"linestyle": "", "color": COLORS["measured"], "markeredgecolor": "black", "markeredgewidth": 0.5}
    ax.plot(*chromosomes.T, marker="o", markersize=5, label="population", **style)
    ring = {"linestyle": "", "color": "white", "markersize": 17, "markeredgewidth": 1.5, "fillstyle": "none"}
    ax.plot(*np.reshape(optimum, (2, 1)), marker="o", label="optimum", **ring)


def plot_run(
    axes: Sequence[Axes],
    objective: Callable[[Floats], Floats],
    run: Calibration,
    box: Floats,
    optimum: Floats,
    *,
    mean_c2: float | None = None,
    generations: Sequence[int] = (0, 5, 25),
    enlarged: Sequence[float] = (1, 1, 20),
) -> AxesImage:
    """Draw the population of a run in some generations on maps of the objective, in axes of its genes, named on the left.

    Parameters
    ----------
    axes, generations, enlarged
        An entry for each panel; a panel that is enlarged shows that part of the box about the optimum.
    objective : callable
        Maps chromosomes (n, 2), columns f and T_z in mm, to px.
    run : Calibration
        Of `calibrate_genetic`.
    box : (2, 2) ndarray
        Lower and upper end of f, and of T_z, mm.
    optimum : (2,) ndarray
        f and T_z, mm.
    mean_c2 : float, optional
        mm; with it the first gene is m = f / (T_z + mean_c2), otherwise f.

    Returns
    -------
    AxesImage
        The last map, for a colour bar.
    """
    f_range, t_z_range = box
    whole, name = f_range, "f (mm)"
    if mean_c2 is not None:
        whole, name = f_range / (t_z_range[::-1] + mean_c2), r"$m = f/(T_z + \bar{c}_2)$"

    def first(f, t_z):
        return f if mean_c2 is None else f / (t_z + mean_c2)

    best, maps = np.array([first(*optimum), optimum[1]]), {}
    for ax, generation, factor in zip(axes, generations, enlarged, strict=True):
        ranges = [whole, t_z_range]
        if factor > 1:
            ranges = [np.ptp(ends) / factor * np.array([-0.5, 0.5]) + at for ends, at in zip(ranges, best, strict=True)]
        x, t_z = (np.linspace(*ends, CELLS + 1) for ends in ranges)
        if factor not in maps:
            maps[factor] = lowest_in_cells(
                objective, x, t_z, lambda x, t_z: x if mean_c2 is None else x * (t_z + mean_c2)
            )
        image = plot_valley(ax, x, t_z, maps[factor])
        if mean_c2 is not None:
            ax.plot(first(f_range[:, None], t_z).T, t_z, color="black", linestyle="--", linewidth=1)
        f, depth = run.populations[generation].T
        plot_population(ax, np.column_stack([first(f, depth), depth]), best)
        part = f" (enlarged {factor:g} times)" if factor > 1 else ""
        title = f"generation {generation}{part}\nbest {run.history['best'][generation]:.3f} px"
        ax.set(xlim=ranges[0], ylim=ranges[1], xlabel=name, title=title)
    axes[0].set_ylabel("$T_z$ (mm)")
    genes = "genes (f, $T_z$)" if mean_c2 is None else "genes (m, $T_z$)"
    place = {"xycoords": "axes fraction", "rotation": 90, "ha": "center", "va": "center"}
    axes[0].annotate(genes, (-0.32, 0.5), fontweight="bold", **place)
    return image


def plot_spread(ax: Axes, histories: Mapping[str, pd.DataFrame], colors: Sequence[str], *, generations: int) -> None:
    """Draw the spread of f (% of the box) over the first generations, a line with its name for each of three histories.

    The name of the last one stands below its line, those of the others above.
    """
    for (name, history), color, above in zip(histories.items(), colors, (True, True, False), strict=True):
        first = history[: generations + 1]
        ax.plot(first["generation"], 100 * first["spread_0"], color=color, label=name)
        at = generations // 3, 100 * first["spread_0"][generations // 3]
        shift = {"xytext": (0, 7 if above else -14), "textcoords": "offset points"}
        ax.annotate(name, at, color=color, **shift)
    ax.set_yscale("symlog", linthresh=0.01)
    ax.set(xlabel="generation", ylabel="spread of f (% of the box)", ylim=(-0.01, 100))
    ax.set_title("Eq. 4: spread of the population")


def plot_children(ax: Axes, children: Mapping[tuple[str, str], Floats], parents: Sequence[float]) -> None:
    """Draw a row with the histogram of the children for each (form, order of the parents); the parents are dotted."""
    bins = np.linspace(0.2, 0.8, 61)
    for row, ((form, _), values) in enumerate(children.items()):
        shares = np.histogram(values, bins)[0] / len(values)
        color = PRINTED if form == "printed" else CORRECTED
        ax.fill_between(bins[:-1], -row, 8.5 * shares - row, step="post", color=color, alpha=0.75, linewidth=0)
    for parent in parents:
        ax.axvline(parent, color=COLORS["truth"], linestyle=":", linewidth=1)
    names = [f"{form}\n{order}" for form, order in children]
    ax.set(yticks=0.1 - np.arange(len(names)), yticklabels=names, ylim=(0.8 - len(names), 1))
    ax.tick_params(axis="y", length=0, labelsize=9)
    ax.set(xlabel="gene (fraction of the box)", title="Eq. 9: children of two parents (dotted)")


def plot_mutants(ax: Axes, mutants: Mapping[str, Floats], *, lowest: float = -2.5) -> None:
    """Draw the density of the mutants of each form on a logarithmic scale, with the box from 0 to 1 in grey."""
    bins = np.linspace(lowest, 1.1, 37) + 1e-9
    ax.axvspan(0, 1, color="0.92", zorder=0, label="box")
    for form, color in (("printed", PRINTED), ("corrected", CORRECTED)):
        ax.hist(mutants[form], bins, density=True, histtype="step", linewidth=1.5, color=color, label=form)
    ax.set(xlabel="gene (fraction of the box)", ylabel="density", yscale="log", title="Eq. 10: mutants of 0.5")


def plot_success(
    ax: Axes, names: Sequence[str], rows: Mapping[str, tuple[ArrayLike, ArrayLike]], colors: Mapping[str, Any]
) -> None:
    """Draw horizontal bars: the share of runs that reach the optimum, with its binomial 95 % interval (Wilson).

    `names` are the lines of the figure; `rows` maps each series to the runs that reach the optimum and to all runs, a
    number for each name; `colors` maps it to one colour, or to one for each name.
    """
    height = 0.8 / len(rows)
    for number, (series, counts) in enumerate(rows.items()):
        places = np.arange(len(names)) + height * (number - (len(rows) - 1) / 2)
        reached, runs = np.broadcast_arrays(*counts)
        share = 100 * reached / runs
        pairs = zip(reached.tolist(), runs.tolist(), strict=True)
        ends = 100 * np.array([binomtest(*pair).proportion_ci(method="wilson") for pair in pairs]).T
        style = {"error_kw": {"linewidth": 1.2, "capsize": 2.5, "ecolor": "0.35"}, "color": colors[series]}
        ax.barh(places, share, 0.9 * height, xerr=np.abs(ends - share), label=series, **style)
    ax.set(yticks=np.arange(len(names)), yticklabels=names, ylim=(len(names) - 0.4, -0.6))
    ax.tick_params(axis="y", length=0)
    ax.set(xlim=(0, 101), xlabel="runs that reach the optimum (%)")


def plot_success_of_view(ax: Axes, counts: pd.Series, rivals: Mapping[str, int], seeds: int) -> None:
    """Draw `plot_success` for one view: `counts` by (genes, as printed), eight rows, and of rivals that search (f, T_z)."""
    names = [_named(*row) for row in counts.index] + [f"(f, $T_z$): {name}" for name in rivals]
    each = {"Eqs. 4, 9, 10": PRINTED, "none": CORRECTED}
    colors = [each.get(name, "0.65") for _, name in counts.index][:-1] + [DEFAULT] + [SERIES[2]] * len(rivals)
    plot_success(ax, names, {"": (np.array([*counts, *rivals.values()]), seeds)}, {"": colors})


def plot_success_of_views(ax: Axes, shares: pd.DataFrame, labels: Mapping[str, tuple[str, str]]) -> None:
    """Draw `plot_success` for groups of views (`study.success_shares`); `labels` are genes and equations of each variant."""
    counted = {
        name: group.set_index("variant").loc[list(labels)] for name, group in shares.groupby("views", sort=False)
    }
    rows = {name: (group["reached"].to_numpy(), group["runs"].to_numpy()) for name, group in counted.items()}
    names = [_named(*row) for row in labels.values()]
    plot_success(ax, names, rows, dict(zip(rows, (SERIES[3], SERIES[4], SERIES[1]), strict=True)))


def _named(genes, as_printed):
    equations = "corrected" if as_printed.startswith("none") else f"{as_printed} printed"
    return f"{genes.replace('T_z', '$T_z$')}: {equations}"


def places_across(f_range: ArrayLike, bottom: float) -> Floats:
    """f, mm, over a range, ever denser towards `bottom`, which is one of them."""
    near = bottom + np.outer([-1, 1], np.logspace(-6, 0, 61)).ravel()
    return np.sort(np.concatenate([np.linspace(*f_range, 201), near, [bottom]]))


def plot_across_valley(ax: Axes, f: Floats, values: Mapping[str, Floats]) -> None:
    """Draw the objective (px) over f (mm) at one T_z, shared k_1 first, then per point; cut at 100 px."""
    for (name, curve), color in zip(values.items(), (COLORS["genetic"], SERIES[1]), strict=True):
        ax.semilogy(f, np.minimum(curve, VALLEY.vmax), color=color, label=name)
    ax.set(xlabel="f (mm), at the optimum's $T_z$", ylabel="E (px)", title="Eq. 7 across the valley (cut at 100 px)")
    ax.legend(loc="upper right")


def plot_own_kappa1(ax: Axes, radius: Floats, values: Mapping[str, Floats], truth: float) -> None:
    """Draw each point's own k_1 (mm^-2) over its distance from the principal point, mm, and the true one as a line."""
    for (name, kappa1), color, marker in zip(values.items(), SERIES, "o^", strict=False):
        ax.plot(radius, 1e5 * kappa1, marker, color=color, markersize=4.5, fillstyle="none", label=name)
    ax.axhline(1e5 * truth, color=COLORS["truth"], linewidth=1, zorder=0, label="true $k_1$")
    ax.set_yscale("symlog", linthresh=1.0)
    ax.set(xlabel="distance from the principal point (mm)", ylabel="$k_1$ ($10^{-5}$ mm$^{-2}$)", ylim=(-3, 3000))
    ax.set_title("Eq. 6, each point's own $k_1$")
    ax.legend(loc="upper right")


def plot_noise(
    ax: Axes, ratio: Axes, levels: pd.DataFrame, sources: pd.DataFrame, *, printed: Mapping[str, str]
) -> None:
    """Draw E (px) over the noise of the corners (px per axis), and beside it E over that noise.

    `levels` has the columns of the table 04_over_noise, `sources` those of 04_detectors; `printed` are the paper's values
    of E, px, as texts, drawn as dotted lines with the name of their method.  The bars are two standard errors.
    """
    noise, trials = levels["noise (px)"], levels["trials"]
    for stage, color in (("linear", "linear"), ("two-stage", "genetic")):
        ax.loglog(noise, levels[f"{stage} E (px)"], ".-", color=COLORS[color], label=f"{stage}, simulated noise")
    mean, sd = levels["two-stage E (px)"] / noise, levels["sd of two-stage E (px)"] / noise
    ratio.errorbar(noise, mean, 2 * sd / np.sqrt(trials), fmt=".-", color=COLORS["genetic"], capsize=3)
    for row in sources.to_dict("records"):
        color, marker = CORNERS[row["corners"]]
        style = {"color": color, "marker": marker, "markersize": 8, "linestyle": "", "label": row["corners"]}
        x, y = row["noise (px per axis)"], row["E (px)"]
        ax.plot(x, y, markeredgecolor="black", markeredgewidth=0.6, **style)
        ratio.plot(x, y / x, markeredgecolor="black", markeredgewidth=0.6, **style)
    for name, text in printed.items():
        ax.axhline(float(text), color=COLORS["paper"], linestyle=":", linewidth=1)
        ax.annotate(f"printed: {name}, {text} px", (0.0036, 1.07 * float(text)), fontsize=8)
    ax.set(xlabel="corner noise (px per axis)", ylabel="E, Eq. 7 (px)")
    ratio.set(xlabel="corner noise (px per axis)", ylabel="E / noise, two stages", xscale="log")
