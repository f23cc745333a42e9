"""Votes for circles, errors of centres, the profile of an edge, and hubs with labelled pegs (notebook 02)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib import patheffects
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle
from scipy.stats import norm

from ...discs import fit_discs
from ..plotting import COLORS, DETECTORS, SERIES, plot_circles, plot_ellipses, plot_image

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray
    from pandas import Series

    from ...discs import Discs
    from ...pegs import PegObservation

    Floats = NDArray[np.float64]

LOOKS = {name: DETECTORS[f"find_circles {name}"] for name in ("two-stage", "phase-code", "accumulator")} | {
    "centroid": (COLORS["measured"], "D", "-."),
    "fit": DETECTORS["ours"],
}
"""Colour, marker and line of each way to a centre."""

HALF = 75  # px, half the side of the square that is shown round a peg
NEAR_CENTER = (45, 107, 45, 107)  # px, the part of that square in which votes are shown


def crop(image: NDArray, center: ArrayLike) -> tuple[NDArray, NDArray[np.intp]]:
    """Return a square of 150 px round a centre (x, y), and the position (x, y) of its first pixel."""
    corner = np.floor(center).astype(int) - HALF
    return image[corner[1] : corner[1] + 2 * HALF, corner[0] : corner[0] + 2 * HALF], corner


def evolute(discs: Discs, index: int, n_points: int = 2000) -> Floats:
    """Return points (n_points, 2), px, of the curve of an ellipse's centres of curvature."""
    t = np.linspace(0, 2 * np.pi, n_points)
    (a, b), angle = discs.semi_axes[index], discs.angles[index]
    along, across = (a**2 - b**2) / a * np.cos(t) ** 3, -(a**2 - b**2) / b * np.sin(t) ** 3
    axes = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    return discs.centers[index] + np.column_stack([along, across]) @ axes


class EdgePixels(NamedTuple):
    """Pixels near an ellipse: distance to it (n,) px, positive inside; its curvature there (n,) 1/px; grey values (n,)."""

    distance: Floats
    curvature: Floats
    grey: Floats


def edge_pixels(image: NDArray, discs: Discs, index: int, reach: float = 6.0) -> EdgePixels:
    """Return the pixels within `reach` px of a fitted ellipse."""
    patch, corner = crop(image, discs.centers[index])
    (a, b), angle = discs.semi_axes[index], discs.angles[index]
    x, y = np.meshgrid(*(np.arange(2 * HALF) + corner[axis] - discs.centers[index, axis] for axis in (0, 1)))
    u, v = (x * np.cos(angle) + y * np.sin(angle)) / a, (y * np.cos(angle) - x * np.sin(angle)) / b
    slope = np.hypot(u / a, v / b) / np.maximum(np.hypot(u, v), 1e-9)
    distance, curvature = (1 - np.hypot(u, v)) / slope, 1 / (slope**3 * a**2 * b**2)
    near = np.abs(distance) < reach
    return EdgePixels(distance[near], curvature[near], patch[near].astype(float))


def plot_voting(
    axes: Sequence[Axes], patch: NDArray, center: Floats, radius: float, radius_range: tuple[float, float]
) -> None:
    """Draw how 16 points of a rim vote: circles of one radius (left), and pieces of their normals (right)."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    outwards = np.column_stack([np.cos(angles), np.sin(angles)])
    points = center + radius * outwards
    ends = points[:, None] - np.array(radius_range)[None, :, None] * outwards[:, None]
    left, right = axes
    plot_image(left, patch, "3-D accumulator: circles (here of one radius)")
    color = COLORS["genetic"]
    plot_circles(left, points, np.full(len(points), radius), color=color)
    plot_image(right, patch, "two-stage, phase coding: along the gradient")
    right.plot(*np.stack([points, ends[:, 0]]).transpose(2, 0, 1), color=color, linewidth=0.8, dashes=(2, 4))
    right.plot(*ends.transpose(2, 1, 0), color=color)
    for ax in axes:
        ax.plot(*points.T, "o", color=color, markersize=4)
        ax.set(xlim=(0, 2 * HALF - 1), ylim=(2 * HALF - 1, 0))
    right.set_ylabel(None)


def plot_votes(
    ax: Axes, votes: Floats, title: str, *, peak: ArrayLike, truth: ArrayLike, curve: Floats | None = None
) -> None:
    """Draw the square root of votes (150, 150), the place of their maximum, the true centre and a curve (n, 2), px."""
    plot_image(ax, np.sqrt(votes), title, limits=NEAR_CENTER)
    ax.set(ylabel=None, xticks=(50, 75, 100), yticks=(50, 75, 100))
    if curve is not None:
        ax.plot(*curve.T, color=COLORS["linear"], linewidth=1.2, label="evolute of the ellipse")
    style = {"linestyle": "", "fillstyle": "none", "markeredgewidth": 2.0}
    ax.plot(*peak, "o", color=COLORS["genetic"], markersize=13, label="highest count", **style)
    ax.plot(*truth, "+", color=COLORS["measured"], markersize=12, label="true centre", **style)


def mark_votes(ax: Axes) -> None:
    """Mark in the square of `crop` the part in which `plot_votes` shows the votes."""
    left, right, top, bottom = NEAR_CENTER
    ax.add_patch(Rectangle((left, top), right - left, bottom - top, fill=False, edgecolor="black", linewidth=1.2))


def plot_center_errors(ax: Axes, rms: Series) -> None:
    """Draw errors of centres (px) with the levels view, image, method of their index, a row for each view and image."""
    cases = list(dict.fromkeys(key[:2] for key in rms.index))
    for number, (method, (color, marker, _)) in enumerate(LOOKS.items()):
        rows = np.arange(len(cases)) + 0.15 * (number - 2)
        values = np.array([rms.get((*case, method), np.nan) for case in cases])
        ax.semilogx(values, rows, marker, color=color, markersize=7, label=method)
        for row in rows[np.isnan(values)] if method not in ("centroid", "fit") else ():
            ax.text(0.012, row, f"{method} finds none", color=color, fontsize=9, va="center")
    for line in np.arange(1, len(cases)) - 0.5:
        ax.axhline(line, color="0.9", linewidth=0.8, zorder=0)
    ticks = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.grid(axis="x", color="0.93", linewidth=0.8)
    ax.set(yticks=range(len(cases)), yticklabels=[", ".join(case) for case in cases], ylim=(len(cases) - 0.5, -0.5))
    ax.set(xlabel="centre error, rms per axis (px)", xlim=(0.006, 1.0))
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))


def plot_counts(axes: NDArray, sensitivities: ArrayLike, counts: Mapping[tuple[str, str], NDArray]) -> None:
    """Draw pegs found (upper row) and other circles (lower row) over the sensitivity, a column for each image.

    `counts` has for (method, image) an array (n sensitivities, 2).
    """
    images = list(dict.fromkeys(image for _, image in counts))
    for (method, image), numbers in counts.items():
        color, marker, _ = LOOKS[method]
        under = method == "two-stage"  # a wide line under a narrow one: both are seen where they are equal
        style = {"linewidth": 1.4, "color": color, "markersize": 5}
        if under:
            tint = 0.6 + 0.4 * np.array(to_rgb(color))
            style = {
                "linewidth": 6,
                "color": tint,
                "markersize": 10,
                "markerfacecolor": "white",
                "markeredgecolor": color,
            }
        for ax, values in zip(axes[:, images.index(image)], numbers.T, strict=True):
            ax.plot(sensitivities, values, marker=marker, label=method, **style)
    for ax, image in zip(axes[0], images, strict=True):
        ax.set(title=f"searched in the {image}", yticks=range(5))
    axes[0, 0].set_ylabel("pegs found (of 4)")
    axes[1, 0].set(ylabel="other circles found", yticks=range(0, 9, 2))
    for ax in axes[1]:
        ax.set_xlabel("sensitivity")
    axes[0, 0].figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)


def plot_edge_profile(axes: Sequence[Axes], pixels: EdgePixels, model: Floats, *, noise: float) -> None:
    """Draw grey values over the distance from an edge with the fitted step (left), and its residuals (right).

    `model` (n,) has the fitted grey values of the pixels, `noise` is the true standard deviation, grey values.
    """
    left, right = axes
    order = np.argsort(pixels.distance)
    left.plot(pixels.distance, pixels.grey, ".", color="0.7", markersize=3, label="pixels")
    left.plot(pixels.distance[order], model[order], color=LOOKS["fit"][0], linewidth=2, label="fit")
    left.set(xlabel="distance from the ellipse (px), positive inside", ylabel="grey value", xlim=(-6, 6))
    left.legend(loc="lower right")
    residuals, inside = pixels.grey - model, pixels.distance > 0
    sides = (("inside", inside, model.max(), SERIES[0]), ("outside", ~inside, model.min(), SERIES[1]))
    for name, part, level, color in sides:
        bins = np.arange(-9.5, 10, 1.0) - level % 1  # grey values are whole: the limits lie between them
        label = f"{name}: sd {residuals[part].std():.2f}"
        right.hist(residuals[part], bins=bins, density=True, histtype="step", color=color, linewidth=1.8, label=label)
    grid = np.linspace(-9, 9, 200)
    right.plot(grid, norm.pdf(grid, scale=noise), color=COLORS["paper"], linestyle="--", label=f"noise: sd {noise:.2f}")
    right.set(xlabel="residual (grey values)", ylabel="density", xlim=(-9, 9), ylim=(0, 0.29))
    right.legend(loc="upper left", fontsize=9, handlelength=1.4)


def plot_against_bound(
    axes: Sequence[Axes],
    noises: Sequence[float],
    spread: Mapping[str, Floats],
    bound: Floats,
    ratio: ArrayLike,
    ratio_error: float,
) -> None:
    """Draw errors of centres over the noise with their bound (left), and the fit's error over the bound (right).

    Parameters
    ----------
    axes : two Axes
    noises : sequence of float
        Grey values.
    spread : mapping of method to (n noises,) array
        Errors, px.
    bound : (n noises,) array
        px.
    ratio : (n noises,) array
        Error of the fit over the bound.
    ratio_error : float
        Its standard error.
    """
    left, right = axes
    for name, values in spread.items():
        color, marker, _ = LOOKS[name]
        left.loglog(noises, values, marker=marker, color=color, label=name)
    left.loglog(noises, bound, color=COLORS["paper"], linestyle=":", label="Cramér-Rao bound")
    left.set_yticks((0.001, 0.01, 0.1), ("0.001", "0.01", "0.1"))
    left.set(xlabel="noise (grey values)", ylabel="centre error, rms per axis (px)", ylim=(0.001, 0.5))
    left.figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    color, marker, _ = LOOKS["fit"]
    right.axhline(1, color=COLORS["paper"], linestyle=":")
    right.errorbar(noises, ratio, ratio_error, color=color, fmt=marker, capsize=4)
    right.set(xlabel="noise (grey values)", ylabel="error of the fit / bound", xscale="log", ylim=(0.85, 1.15))
    for ax in axes:
        ax.minorticks_off()
        ax.set_xticks(noises, [f"{noise:g}" for noise in noises])


def plot_labelled_hub(ax: Axes, image: NDArray, observation: PegObservation, title: str) -> None:
    """Draw the part of a frame with the hub, the fitted ellipses of pegs, screws and bore, the pegs' numbers, and the
    hub's centre with a line to peg 1."""
    left = int(observation.hub_center[0]) - 290
    plot_image(ax, image, title, limits=(left, left + 640, 0, 640))
    pegs, screws = observation.peg_centers, observation.screw_centers
    bore = np.array([observation.bore_center]), [observation.bore_radius]
    parts = {"pegs": (pegs, observation.peg_radii), "screws": (screws, observation.screw_radii), "bore": bore}
    colors = (COLORS["genetic"], COLORS["linear"], COLORS["measured"])
    for (name, (places, sizes)), color in zip(parts.items(), colors, strict=True):
        discs = fit_discs(image, SimpleNamespace(centers=places, radii=sizes))
        plot_ellipses(ax, discs.centers, discs.semi_axes, discs.angles, color=color)
        ax.plot([], [], "o", color=color, fillstyle="none", markersize=9, markeredgewidth=2, label=name)
    for patch in ax.patches:
        patch.set_linewidth(2.2)
    outline = [patheffects.withStroke(linewidth=3.5, foreground="white")]
    middle = observation.hub_center
    ax.plot(*np.stack([middle, pegs[0]]).T, color="black", linewidth=1.8, path_effects=outline)
    ax.plot(*middle, "o", color="black", markeredgecolor="white", markersize=10, markeredgewidth=2)
    ax.plot([], [], "o-", color="black", label="hub's centre (plane of the tops), line to peg 1")
    style = {"ha": "center", "va": "center", "weight": "bold"}
    for number, place in enumerate(pegs, 1):
        badge = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": colors[0], "linewidth": 1.8}
        ax.annotate(str(number), place, fontsize=15, bbox=badge, **style)
    for number, place in enumerate(screws, 1):
        ax.annotate(f"s{number}", place, (0, 21), textcoords="offset points", fontsize=12, color="white", **style)
