"""The figures of notebook 03: radial alignment, the bias of f, its scatter over the tilt, and the principal point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plotting import COLORS, SERIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ...camera import TsaiCamera

    Floats = NDArray[np.float64]

ENLARGED = 60
"""Arrows of distortion are drawn this many times longer than they are."""

MARGIN = 0.07
"""Space round the corners, as a fraction of their extent."""


def plot_radial_alignment(
    axes: Sequence[Axes], camera: TsaiCamera, straight: Floats, along: Floats, across: Floats
) -> None:
    """Draw radial lines with what distortion does along them, then the corners' shifts along and across these lines.

    Parameters
    ----------
    axes : sequence of three Axes
    camera : TsaiCamera
    straight : (n, 2) ndarray
        The corners without distortion, px.
    along, across : (n,) ndarray
        Shifts of the measured corners from these, along the radial line (outwards) and across it, px.
    """
    center, left = np.array(camera.principal_point), axes[0]
    for corner in straight:
        left.plot(*np.transpose([center, corner]), color="0.88", linewidth=0.8, zorder=0)
    shift = camera.to_image(camera.distort(camera.to_sensor(straight))) - straight
    style = {"angles": "xy", "scale_units": "xy", "scale": 1 / ENLARGED, "width": 0.006}
    left.quiver(*straight.T, *shift.T, color=COLORS["truth"], zorder=2, **style)
    left.plot(*center, "+", color=COLORS["paper"], markersize=11, markeredgewidth=1.6)
    halo = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    text = {"textcoords": "offset points", "ha": "center", "va": "center", "bbox": halo}
    left.annotate("principal point", center, (0, -16), **text)
    low, high = straight.min(axis=0), straight.max(axis=0)
    (x_low, y_low), (x_high, y_high) = low - MARGIN * (high - low), high + MARGIN * (high - low)
    left.set(xlim=(x_low, x_high), ylim=(y_high, y_low), aspect="equal")
    left.set(xlabel="x (px)", ylabel="y (px)", title=f"shift by distortion, arrows × {ENLARGED}")
    _plot_shifts(axes[1], axes[2], camera, straight, along, across)


def _plot_shifts(middle, right, camera, straight, along, across):
    """Shifts of the corners over their distance from the principal point, along the line with Eq. 3, and across."""
    distance = np.hypot(*(straight - camera.principal_point).T)
    radius = np.linspace(0, 1.04 * distance.max(), 100)
    line = camera.to_sensor(np.array(camera.principal_point) + radius[:, None] * [1, 0])
    middle.plot(
        radius, camera.distort(line)[:, 0] / camera.pixel_pitch[0] - radius, color=COLORS["truth"], label="Eq. 3"
    )
    middle.plot(distance, along, "o", color=COLORS["measured"], markersize=4, label="detected corners")
    middle.set(title="along the radial line", ylabel="shift (px)")
    middle.legend(loc="lower left")
    right.axhline(0, color=COLORS["truth"])
    right.plot(distance, 1000 * across, "o", color=COLORS["measured"], markersize=4)
    right.set(title="across the radial line", ylabel="shift (0.001 px)", yticks=range(-10, 11, 5))
    for ax in (middle, right):
        ax.set(xlabel="radius $r$ (px)", xlim=(0, radius[-1]))


def plot_linear_bias(
    ax: Axes, kappas: Floats, biased: Mapping[int, Floats], camera: TsaiCamera, printed: float
) -> None:
    """Draw stage 1's f over k_1, one line for each view, with the true f and that of Table 1.

    Parameters
    ----------
    ax : Axes
    kappas : (n,) ndarray
        k_1, mm^-2.
    biased : mapping
        {number of the view: (n,) f, mm}.
    camera : TsaiCamera
        The truth; its kappa1 is that of Table 1.
    printed : float
        f of stage 1 in Table 1, mm.
    """
    x, unit = 1e5 * kappas, 1e5 * camera.kappa1
    for color, (view, values) in zip(SERIES, biased.items(), strict=False):
        ax.plot(x, values, color=color, linewidth=2, label=f"stage 1, view {view}")
    ax.axhline(camera.focal_length, color=COLORS["truth"], linewidth=1, label="true $f$")
    ax.axhline(printed, color=COLORS["paper"], linewidth=1.2, linestyle=":", label="$f$ in Table 1, stage 1")
    ax.axvline(unit, color=COLORS["paper"], linewidth=1, linestyle="-.", label="$k_1$ in Table 1, stage 2")
    ax.set(xlabel="$k_1$ ($10^{-5}$ mm$^{-2}$): barrel distortion if positive", ylabel="$f$ of stage 1 (mm)")
    ax.set(xlim=x[[0, -1]], xticks=(-10, -5, 0, 5, 10))
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))


def plot_tilt_scatter(left: Axes, right: Axes, table: pd.DataFrame, trials: int) -> None:
    """Draw the scatter of f over the board tilt with what stage 1 states, and their ratio with its standard error.

    Parameters
    ----------
    left, right : Axes
    table : DataFrame
        Of `study.tilt_trials`.
    trials : int
        At each tilt.
    """
    known = table.dropna()
    tilt, solved = known["tilt (deg)"], trials * (1 - known["refused (%)"] / 100)
    left.loglog(tilt, known["predicted (%)"], color=COLORS["truth"], label="stated by stage 1 (median)")
    left.loglog(tilt, known["sd of f (%)"], "o", color=COLORS["linear"], label=f"scatter of {trials} trials")
    left.set(ylabel="standard deviation of $f$ (%)", yticks=(0.1, 0.3, 1, 3, 10), yticklabels=(0.1, 0.3, 1, 3, 10))
    left.legend(loc="upper right")
    ratio = known["sd of f (%)"] / known["predicted (%)"]
    right.axhline(1, color=COLORS["truth"])
    right.errorbar(tilt, ratio, ratio / np.sqrt(2 * (solved - 1)), fmt="o", color=COLORS["linear"], capsize=3)
    right.set(ylabel="scatter / stated", xscale="log", ylim=(0.5, 1.3))
    for ax in (left, right):
        ax.set_xticks(tilt, [f"{value:g}" for value in tilt])
        ax.minorticks_off()
        ax.set_xlabel("board tilt (deg)")


def plot_principal_points(
    ax: Axes, shifts: Floats, maps: Floats, printed: Sequence[float], crossing: Sequence[float]
) -> Any:
    """Draw stage 1's f over the assumed principal point, the lines of the printed f and T_z, and where they cross.

    Parameters
    ----------
    ax : Axes
    shifts : (n,) ndarray
        Assumed minus true principal point, px, in x and in y.
    maps : (n, n, 2) ndarray
        f and T_z, mm; the first axis is y.
    printed : (float, float)
        f and T_z of Table 1, stage 1, mm.
    crossing : (float, float)
        Where both are as printed, px.

    Returns
    -------
    ContourSet
        The filled contours of f, for a colour bar.
    """
    low, high = np.floor(maps[..., 0].min() / 2) * 2, np.ceil(maps[..., 0].max() / 2) * 2
    filled = ax.contourf(shifts, shifts, maps[..., 0], levels=np.arange(low, high + 1, 2), cmap="cividis")
    for values, number, symbol, style in zip(
        np.moveaxis(maps, -1, 0), printed, ("$f$", "$T_z$"), ("-", "--"), strict=True
    ):
        ax.contour(shifts, shifts, values, levels=[number], colors="black", linestyles=style, linewidths=1.8)
        ax.plot([], [], color="black", linewidth=1.8, linestyle=style, label=f"{symbol} = {number:g} mm, as printed")
    marker = {"color": "black", "markerfacecolor": "white", "linestyle": ""}
    ax.plot(*crossing, "*", markersize=16, label="both as printed", **marker)
    ax.plot(0, 0, "P", markersize=11, label="true principal point", **marker)
    ax.set(xlim=shifts[[0, -1]], ylim=shifts[[-1, 0]], aspect="equal")
    ax.set(xlabel="assumed minus true principal point, x (px)", ylabel="assumed minus true principal point, y (px)")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.01), ncols=2)
    return filled
