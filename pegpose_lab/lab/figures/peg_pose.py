"""The figures of the notebook on the pose of the pegs: angles, sides of the square, frames, ellipses, errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patheffects import withStroke

from ...render import disc_outline
from ..plotting import COLORS, SERIES, plot_profiles, plot_quadrilateral

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ...camera import TsaiCamera
    from ...targets import Hub

    Floats = NDArray[np.float64]

QUANTITIES = ("x", "y", r"$\theta$")
WITH_DEPTH = (*QUANTITIES, "depth")
CHI2_95 = 5.991  # 95 % of chi squared with two degrees of freedom
LONGER, KEY = 90, 0.2  # the shifts' arrows are so many times longer than the shifts; length of the key's arrow, px
OUTWARDS = 0.09  # a peg's number stands beyond its centre, by so much of the distance from the hub's
_LIGHT: dict[str, Any] = {"color": "0.85", "linewidth": 0.8, "zorder": 0}


def plot_equation11(
    axes: Sequence[Axes], directions: ArrayLike, angles: Mapping[str, ArrayLike], frames: Floats
) -> None:
    """Draw the angle found against the true direction of peg 1, deg, one of the axes for each formula of `angles`.

    Where a formula has no value (NaN) there is a dotted line, where it is off by half a turn the ground is shaded.
    The ticks on the lower edge are the directions in the `frames`.
    """
    ticks, directions = np.arange(-180, 181, 90), np.asarray(directions, float)
    for ax, (name, found), color in zip(axes, angles.items(), (COLORS["joint"], COLORS["paper"]), strict=True):
        found = np.asarray(found, float)
        off = ~(np.abs((found - directions + 180) % 360 - 180) < 90)  # also where there is no value
        ax.fill_between(
            directions, 0, 1, where=off, color="0.92", linewidth=0, zorder=0, transform=ax.get_xaxis_transform()
        )
        for lost in directions[np.isnan(found)]:
            ax.axvline(lost, color=SERIES[1], linestyle=":")
        ax.plot(directions, np.where(np.abs(directions) < 180, found, np.nan), color=color)
        ax.plot(frames, np.full(len(frames), 0.03), "|", color=SERIES[0], transform=ax.get_xaxis_transform())
        ax.set(xlabel="true direction of peg 1 (deg)", title=name, xlim=(-182, 182), ylim=(-215, 190))
        ax.set(xticks=ticks, yticks=ticks)
    axes[0].set_ylabel("angle found (deg)")


def plot_square(ax: Axes, corners: Floats, lengths: Floats, title: str, *, color: str) -> None:
    """Draw four pegs (4, 2) px with their numbers, and the length of each side, mm, on it."""
    plot_quadrilateral(ax, corners, color=color)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 2}
    for number, (corner, following, length) in enumerate(
        zip(corners, np.roll(corners, -1, axis=0), lengths, strict=True), 1
    ):
        ax.annotate(str(number), corner, xytext=(7, 5), textcoords="offset points", color=color, weight="bold")
        ax.text(*((corner + following) / 2), f"{length:.1f} mm", color=color, ha="center", va="center", bbox=box)
    ax.set_title(title)
    ax.margins(0.12)


def plot_hub_pose(
    ax: Axes,
    camera: TsaiCamera,
    cam_from_hub: RigidTransform,
    hub: Hub,
    *,
    color: str = COLORS["genetic"],
    size: float = 10,
) -> None:
    """Draw a pose into an image of the hub: rims and numbers of the pegs, the hub's centre, and line 1 from it to peg 1."""
    middle, end = camera.project([[0, 0, 0], hub.peg_centers[0]], cam_from_hub)
    for number, center in enumerate(hub.peg_centers, 1):
        rim = disc_outline(camera, cam_from_hub, center, hub.peg_radius)
        ax.plot(*np.vstack([rim, rim[:1]]).T, color=color)
        place = (1 + OUTWARDS) * rim.mean(axis=0) - OUTWARDS * middle  # line 1 ends at the centre of peg 1
        ax.text(*place, str(number), color=color, ha="center", va="center", weight="bold", fontsize=size)
    rimmed: dict[str, Any] = {"color": SERIES[4], "path_effects": [withStroke(linewidth=3.0, foreground="black")]}
    ax.plot(*np.transpose([middle, end]), linewidth=1.6, **rimmed)
    ax.plot(*middle, "o", markersize=4.5, markeredgecolor="black", **rimmed)


def plot_pose_ellipses(ax: Axes, errors: Floats, covariances: Mapping[str, Floats]) -> None:
    """Draw errors of x and y (k, 2), µm, with the 95 % ellipses of two covariances (2, 2), µm².

    The first is about zero, the second about the mean of the errors.
    """
    color, around = COLORS["joint"], np.linspace(0, 2 * np.pi, 100)
    middles, styles = (np.zeros(2), errors.mean(axis=0)), ("-", "--")
    for (label, covariance), middle, style in zip(covariances.items(), middles, styles, strict=True):
        rim = np.sqrt(CHI2_95) * np.linalg.cholesky(covariance) @ [np.cos(around), np.sin(around)]
        ax.plot(*(middle[:, None] + rim), style, color=color, label=label)
    ax.plot(*errors.T, "o", color=COLORS["truth"], markersize=3, label="errors of the frames")
    ax.axhline(0, **_LIGHT)
    ax.axvline(0, **_LIGHT)
    ax.set(xlabel="error of x (µm)", ylabel="error of y (µm)", aspect="equal")
    ax.figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center")


def plot_trajectory(axes: Sequence[Axes], frames: ArrayLike, errors: Mapping[str, tuple[Floats, str]]) -> None:
    """Draw how far each method is off in x (mm), y (mm) and theta (deg) over the frames, on a logarithmic axis.

    `errors` maps a method to its errors (k, 3) and its colour.  An error of zero has no logarithm and is left out.  The
    legend is left to the caller.
    """
    for column, (ax, name, unit) in enumerate(zip(axes, QUANTITIES, ("mm", "mm", "deg"), strict=True)):
        for method, (off, color) in errors.items():
            ax.semilogy(frames, np.where(off[:, column] == 0, np.nan, np.abs(off[:, column])), ".-", color=color,
                        linewidth=0.8, markersize=4, label=method)  # fmt: skip
        ax.set(xlabel="frame", ylabel=f"|error| of {name} ({unit})")


def plot_pose_errors(axes: NDArray, frames: ArrayLike, rows: Sequence[tuple[str, Floats, str, Sequence[str]]]) -> None:
    """Draw errors of x, y, theta and depth over the frames in the columns of `axes` (n, 4), one row for each of `rows`.

    A row is (title, values (k, 4), colour, units of the four).  A quantity that a method does not give (all NaN) has an
    empty axes that says so.
    """
    for row, (title, values, color, units) in zip(axes, rows, strict=True):
        for ax, name, column, unit in zip(row, WITH_DEPTH, np.transpose(values), units, strict=True):
            if np.isnan(column).all():
                ax.set_axis_off()
                ax.text(0.5, 0.5, f"no {name}", transform=ax.transAxes, color=color, ha="center", va="center")
                continue
            plot_profiles(ax, frames, {title: column}, colors={title: color}, xlabel="", ylabel=f"{name} ({unit})")
            ax.axhline(0, **_LIGHT)
        row[0].set_title(title, color=color, loc="left")
    for row in axes[:-1]:
        for ax in row:
            ax.tick_params(labelbottom=False)
    for ax, above in zip(axes[-1], axes[-2], strict=True):
        (ax if ax.axison else above).set_xlabel("frame")
        (ax if ax.axison else above).tick_params(labelbottom=True)


def plot_center_shifts(
    axes: NDArray,
    centers: Sequence[Floats],
    shifts: Sequence[Floats],
    radii: Sequence[Floats],
    tilts: Sequence[float],
    size: tuple[int, int],
) -> None:
    """Draw how far ellipse centres (k, 2) px lie from the images of the discs' centres, enlarged, one of the axes a view.

    The arrows of all views have one scale, and each panel has its key.  The last of `axes` has the length of each shift
    against the disc's radius in the image (k,), px, with the views' numbers and tilts, deg.
    """
    *panels, last = np.ravel(axes)
    style = {"angles": "xy", "scale_units": "xy", "scale": 1 / LONGER, "color": SERIES[1], "width": 0.006}
    for number, (ax, seen, shift) in enumerate(zip(panels, centers, shifts, strict=True), 1):
        arrows = ax.quiver(*seen.T, *shift.T, **style)
        ax.plot(*seen.T, ".", color="0.6", markersize=3)
        ax.quiverkey(arrows, 0.81, 1.06, KEY, f"{KEY:g} px", labelpos="E", labelsep=0.05)
        ax.set(
            xlim=(0, size[0]), ylim=(size[1], 0), aspect="equal", title=f"view {number}, tilt {tilts[number - 1]:.0f}°"
        )
        ax.set(xticks=np.arange(0, size[0], 100), yticks=np.arange(0, size[1], 100))
        ax.set(xlabel="x (px)" if number > 3 else None, ylabel="y (px)" if number in (1, 4) else None)
    for number, (radius, shift, tilt) in enumerate(zip(radii, shifts, tilts, strict=True), 1):
        length, color = np.hypot(*shift.T), SERIES[(0, 1, 2, 3, 5)[number - 1]]
        last.plot(radius, length, ".", color=color, markersize=5, label=f"{number}, {tilt:.0f}°")
    last.legend(title="view, tilt", loc="upper left", fontsize=8, title_fontsize=8, labelspacing=0.2, handletextpad=0.1)
    last.set(ylim=(0, None), box_aspect=size[1] / size[0])
    last.set(xlabel="radius of the disc's image (px)", ylabel="shift (px)", title="each disc, by view and tilt")
