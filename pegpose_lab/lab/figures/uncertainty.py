"""The figures of notebook 09: intervals against the truth, tilt, one view, rings of residuals, halves, coverage."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import norm

from ..plotting import COLORS, SERIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

SYMBOLS = {"focal_length": "f", "c_x": "c_x", "c_y": "c_y", "kappa1": r"\kappa_1"}
CLASSICAL = SERIES[0]
"""Colour of classical standard deviations; the stated ones have that of the joint calibration."""

BINS = np.arange(-4, 4.01, 0.5)
BESIDE = 2.0
"""px by which the bars of two models at one ring are drawn apart."""


def plot_interval_errors(axes: Sequence[Axes], z: pd.DataFrame) -> None:
    """Draw a histogram of errors over their stated standard deviation for each column of `z`, with the normal density."""
    grid = np.linspace(-4, 4, 200)
    for ax, (name, errors) in zip(axes, z.items(), strict=True):
        ax.hist(errors, bins=BINS, density=True, color=COLORS["joint"], alpha=0.6, label="trials")
        ax.plot(grid, norm.pdf(grid), color=COLORS["paper"], label="standard normal")
        ax.set(title=f"${SYMBOLS[name]}$", xlabel=r"error / stated $\sigma$", xlim=(-4, 4))
    axes[0].set_ylabel("density")
    axes[0].figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)


def plot_tilt(axes: Sequence[Axes], sigma: pd.DataFrame, floor: pd.DataFrame, error: pd.DataFrame) -> None:
    """Draw the relative standard deviation of f (%), and beside it the residual over its expected value.

    Parameters
    ----------
    axes : two Axes
    sigma, floor, error : DataFrame
        A row for each number of views, a column for each tilt, deg: median of sigma of f (%), mean rms over its expected
        value, and the standard error of that mean.
    """
    left, right = axes
    for shift, color, number in zip(np.linspace(-0.6, 0.6, len(sigma)), SERIES, sigma.index, strict=False):
        left.plot(sigma.columns, sigma.loc[number], "o-", color=color, markersize=4, label=f"{number} views")
        right.errorbar(
            floor.columns + shift, floor.loc[number], error.loc[number], fmt="o", color=color, markersize=4, capsize=2
        )
    right.axhline(1, color=COLORS["truth"], linewidth=1, zorder=0)
    left.set(yscale="log", ylabel=r"$\sigma_f / f$ (%)", title="The uncertainty of f falls with the tilt")
    left.set_yticks([0.01, 0.02, 0.05, 0.1, 0.2, 0.5], ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5"])
    left.set_yticks([], minor=True)
    right.set(ylim=(0.9, 1.1), ylabel="rms / expected rms", title="The residual does not")
    for ax in axes:
        ax.set_xlabel("board tilt (deg)")
    left.legend()


def plot_single_view(ax: Axes, single: pd.DataFrame, truth: float) -> None:
    """Draw f of one view with its 95 % interval against the tilt, as the difference from the truth (mm) in per cent.

    `single` has the tilt (deg) as index and the columns "f (mm)", "low (mm)", "high (mm)".  The scale is linear within
    one per cent, logarithmic beyond.
    """
    low, f, high = (100 * (single[f"{name} (mm)"] / truth - 1) for name in ("low", "f", "high"))
    ax.errorbar(single.index, f, [f - low, high - f], fmt="o", color=COLORS["joint"], capsize=3, label="one view, 95 %")
    ax.axhline(0, color=COLORS["truth"], linewidth=1, zorder=0, label="truth")
    ax.set_yscale("symlog", linthresh=1.0)
    ax.set_yticks([-2, -1, 0, 1, 2, 5, 10, 20], ["−2", "−1", "0", "1", "2", "5", "10", "20"])
    ax.set_yticks([], minor=True)
    ax.set(xlabel="board tilt (deg)", ylabel="error of f (%)", ylim=(-3.5, 40))
    ax.legend()


def plot_profiles(
    ax: Axes, profiles: Mapping[str, pd.DataFrame], colors: Mapping[str, str], title: str | None = None
) -> None:
    """Draw mean radial residuals of rings (`study.radial_profile`) with bars of two standard errors, a colour a model."""
    for number, (name, rings) in enumerate(profiles.items()):
        radius = rings["radius"] + BESIDE * (number - (len(profiles) - 1) / 2)
        ax.errorbar(
            radius,
            rings["residual"],
            2 * rings["sigma"],
            fmt="o-",
            color=colors[name],
            markersize=4,
            capsize=2,
            label=_symbols(name),
        )
    ax.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    ax.set(xlabel="distance from the principal point (px)", ylabel="mean radial residual (px)", title=title)


def plot_halves(axes: Sequence[Axes], pooled: pd.DataFrame) -> None:
    """Draw the rms z of halves: a panel for each lens model, a row for each set, a colour for each kind of sigma.

    `pooled` is indexed by dataset and lens, with the columns ``rms_z`` (stated) and ``classical_rms_z``.
    """
    names = list(dict.fromkeys(pooled.index.get_level_values("dataset")))
    lenses = list(dict.fromkeys(pooled.index.get_level_values("lens")))
    rows = np.arange(len(names))
    for ax, lens in zip(axes, lenses, strict=True):
        part = pooled.xs(lens, level="lens").loc[names]
        ax.hlines(rows, part["rms_z"], part["classical_rms_z"], color="0.85", linewidth=1.5, zorder=0)
        ax.plot(part["classical_rms_z"], rows, "o", color=CLASSICAL, label=r"classical $\sigma$")
        ax.plot(part["rms_z"], rows, "o", color=COLORS["joint"], label=r"stated $\sigma$")
        ax.axvline(1, color=COLORS["truth"], linewidth=1, zorder=0, label="honest")
        ax.set(xscale="log", xlim=(0.7, 6.5), title=_symbols(lens), xlabel="rms of z")
        ax.set_xticks([1, 2, 5], ["1", "2", "5"])
        ax.set_xticks([], minor=True)
        ax.set(yticks=rows, yticklabels=names, ylim=(len(names) - 0.5, -0.5))
    axes[0].figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)


def _symbols(lens):
    """The parameters of a lens model in mathematical type: f_x as f with index x."""
    return re.sub(r"\bf\b", "$f$", re.sub(r"([a-z])_?([xy12])\b", r"$\1_\2$", lens))


def plot_coverage(ax: Axes, cells: NDArray[np.int_], image_size: tuple[int, int]) -> Any:
    """Draw the number of corners in each cell (rows, columns) of the image (width, height; px); empty ones stay white."""
    extent = (-0.5, image_size[0] - 0.5, image_size[1] - 0.5, -0.5)
    shown = ax.imshow(np.ma.masked_equal(cells, 0), extent=extent, cmap="Greens", vmin=0)
    ax.figure.colorbar(shown, ax=ax, label="corners in the cell", shrink=0.85)
    ax.set(xlabel="x (px)", ylabel="y (px)", title="Few corners near the edges (white: none)")
    return shown
