"""One style for every figure: ``plot_*(ax, ...)`` draws into given axes, `save_figure` writes the files.

A method has the same colour everywhere (`style.COLORS`, which notebooks can also import from here).  `show_figure`
also stores a description of the figure, because nbval does not compare images.
"""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import display

from ..files import output_folder, replacing
from .figure_digest import figure_digest
from .image_plots import plot_circles as plot_circles
from .image_plots import plot_ellipses as plot_ellipses
from .image_plots import plot_image as plot_image
from .image_plots import plot_mask as plot_mask
from .image_plots import plot_rims as plot_rims
from .style import COLORS, DPI, STYLE
from .style import DETECTORS as DETECTORS
from .style import SERIES as SERIES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]


def figure(
    width: float = 7.0, height: float = 3.6, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, Any]:
    """Return (figure, axes) in the project's style; width and height in inches."""
    plt.rcParams.update(STYLE)
    return plt.subplots(rows, columns, figsize=(width, height), **options)


def save_figure(fig: Figure, name: str) -> tuple[Path, str]:
    """Write `fig` as figures/<name>.png below the output folder; the paper's figures (``fig..``) also as .pdf.

    The same figure gives the same bytes.  The PNG has its content (`figure_digest`) as its description.

    Returns
    -------
    Path
        The PNG.
    str
        Its description.
    """
    fig.draw_without_rendering()  # computes the layout, once for all files and the digest
    fig.set_layout_engine("none")
    target, drawn = output_folder() / "figures" / f"{name}.png", figure_digest(fig)
    with replacing(target) as path:
        fig.savefig(path, format="png", dpi=DPI, metadata={"Software": None, "Description": drawn})
    if name.startswith("fig"):
        nothing = {"CreationDate": None, "Creator": None, "Producer": None}
        with replacing(target.with_suffix(".pdf")) as path:
            fig.savefig(path, format="pdf", dpi=DPI, metadata=nothing)
    return target, drawn


def show_figure(fig: Figure, name: str, alternative: str) -> None:
    """Save `fig` (see `save_figure`), show the saved file in the notebook and close the figure.

    It must be the last call in the cell that builds the figure.  `alternative` says in a sentence what is to be seen, for
    those who cannot see it.  The text of the output describes the figure (see `figure_digest`); nbval compares this text,
    and a reader sees only the image.
    """
    path, drawn = save_figure(fig, name)
    content = base64.b64encode(path.read_bytes()).decode("ascii")
    width, height = (round(side * STYLE["figure.dpi"]) for side in fig.get_size_inches())
    display(
        {"image/png": content, "text/plain": f"figures/{name}.png\n{drawn}"},
        metadata={"image/png": {"width": width, "height": height, "alt": alternative}},
        raw=True,
    )
    plt.close(fig)


def plot_residuals(
    ax: Axes,
    image_points: Floats,
    residuals: Floats,
    *,
    scale: float = 1000.0,
    color: str = COLORS["genetic"],
    image_size: tuple[int, int] | None = None,
) -> None:
    """Draw residuals as arrows, enlarged by `scale`; the arrow above the axes is as long as the longest of them, rounded."""
    style = {"angles": "xy", "scale_units": "xy", "scale": 1 / scale, "color": color, "width": 0.004}
    arrows = ax.quiver(*image_points.T, *residuals.T, **style)
    longest = np.hypot(*residuals.T).max()
    key = float(f"{longest:.1g}")
    ax.quiverkey(arrows, 0.9, 1.05, key, f"{key:g} px", coordinates="axes", labelpos="W")
    ax.set(xlabel="x (px)", ylabel="y (px)", title=f"residuals, longest {longest:.3f} px", aspect="equal")
    if image_size is not None:
        ax.set(xlim=(0, image_size[0]), ylim=(image_size[1], 0))


def plot_convergence(
    ax: Axes, histories: Iterable[pd.DataFrame], *, label: str, color: str, floor: float | None = None
) -> None:
    """Draw the best objective over the generations, one line for each history (seed)."""
    for number, history in enumerate(histories):
        ax.semilogy(
            history["generation"], history["best"], color=color, alpha=0.6, label=label if number == 0 else None
        )
    if floor is not None:
        ax.axhline(floor, color=COLORS["oracle"], linestyle="--", label="optimum in the box")
    ax.set(xlabel="generation", ylabel="best mean distance (px)")


def plot_map(ax: Axes, x: ArrayLike, y: ArrayLike, values: ArrayLike) -> Any:
    """Draw filled contours of `values` (len(y), len(x)); returns them for a colour bar."""
    filled = ax.contourf(x, y, values, levels=16, cmap="cividis")
    ax.set_aspect("equal")
    return filled


def plot_error_scatter(
    ax: Axes, residuals: Floats, *, color: str = COLORS["genetic"], label: str | None = None, limit: float | None = None
) -> None:
    """Draw reprojection errors in x and y (Fig. 7), with a circle at `limit`."""
    ax.plot(*residuals.T, ".", color=color, markersize=3, alpha=0.6, label=label)
    if limit is not None:
        ax.add_patch(plt.Circle((0, 0), limit, fill=False, color=COLORS["paper"], linestyle=":"))
    ax.axhline(0, color="0.85", zorder=0, linewidth=0.8)
    ax.axvline(0, color="0.85", zorder=0, linewidth=0.8)
    ax.set(xlabel="error in x (px)", ylabel="error in y (px)", aspect="equal")
    if label:
        ax.legend()


def plot_dots(
    ax: Axes,
    names: Sequence[str],
    values: Mapping[str, ArrayLike],
    *,
    colors: Mapping[str, str],
    unit: str,
    printed: Iterable[float] = (),
    logarithmic: bool = False,
) -> None:
    """Draw a row of dots for each name, one colour per method, and printed numbers as dotted vertical lines.

    `values` maps a method to one number for each of `names`, and `colors` maps it to its colour.
    """
    rows = np.arange(len(names))
    for method, (label, numbers) in enumerate(values.items()):
        dodge = 0.16 * (method - (len(values) - 1) / 2)
        ax.plot(numbers, rows + dodge, "o", color=colors[label], markersize=5, label=label)
    for number in printed:
        ax.axvline(number, color=COLORS["paper"], linestyle=":", linewidth=1.2)
        ax.annotate(
            f"{number:g}",
            (number, 1),
            xycoords=("data", "axes fraction"),
            xytext=(0, 2),
            textcoords="offset points",
            ha="center",
            fontsize=8,
        )
    for boundary in rows[1:] - 0.5:
        ax.axhline(boundary, color="0.92", linewidth=0.8, zorder=0)
    ax.set(yticks=rows, yticklabels=names, xlabel=unit, ylim=(len(rows) - 0.5, -0.5))
    if logarithmic:
        ax.set_xscale("log")


def plot_profiles(
    ax: Axes, x: ArrayLike, values: Mapping[str, ArrayLike], *, colors: Mapping[str, str], xlabel: str, ylabel: str
) -> None:
    """Draw one line over `x` for each label of `values`."""
    for label, numbers in values.items():
        ax.plot(x, numbers, color=colors[label], label=label)
    ax.set(xlabel=xlabel, ylabel=ylabel)


def plot_quadrilateral(
    ax: Axes, corners: Floats, *, color: str, label: str | None = None, lengths: Sequence[str] | None = None
) -> None:
    """Draw a closed outline of four or more corners (n, 2) px, with a text at the middle of each side (y down)."""
    ax.plot(*np.vstack([corners, corners[:1]]).T, "o-", color=color, markersize=5, label=label)
    middle = np.mean(corners, axis=0)
    for text, start, end in zip(lengths or (), corners, np.roll(corners, -1, axis=0), strict=False):
        side = (start + end) / 2
        ax.annotate(text, side + 0.22 * (middle - side), ha="center", va="center", color=color)
    ax.set(xlabel="x (px)", ylabel="y (px)", aspect="equal")
    if not ax.yaxis_inverted():
        ax.invert_yaxis()


def plot_block_means(ax: Axes, table: pd.DataFrame, *, color: str = COLORS["paper"], label: str = "paper") -> None:
    """Draw Table 3: the mean of each block of frames with its standard error sd / sqrt(frames) (`paper.table3`)."""
    count = table["last_frame"] - table["first_frame"] + 1
    middle = (table["first_frame"] + table["last_frame"]) / 2
    ax.errorbar(
        middle,
        table["mean_mm"],
        table["sd_mm"] / np.sqrt(count),
        (count - 1) / 2,
        fmt="s",
        color=color,
        markersize=5,
        capsize=3,
        label=label,
    )
    ax.set(xlabel="frame", ylabel="error of the radius (mm)")
