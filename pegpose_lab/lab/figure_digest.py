"""Describes the content of a figure as text, which a test can compare.

nbval does not compare images.  `figure_digest` reads a finished matplotlib figure and lists, for each of its axes, the
labels, scales and limits, every line, patch, collection, image and text with its colour, and the legend.
Positions are fractions of the axes (0 at the left and lower edge, 1 at the right and upper), to three digits, so
differences that are invisible in the figure do not change the digest.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.contour import ContourSet
from matplotlib.image import AxesImage
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.quiver import Quiver
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter
from matplotlib.transforms import IdentityTransform

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FAR = 2.0
"""Positions outside the axes are clipped at this many widths of the axes: a reader sees only that they are outside."""

SAMPLES = 5
"""Number of points listed for each artist, from its first to its last, besides mean and standard deviation of all."""

_KINDS = {
    Text: "text",
    Line2D: "line",
    Quiver: "arrows",
    ContourSet: "contours",
    Collection: "collection",
    AxesImage: "image",
    Patch: "patch",
}


def figure_digest(fig: Figure) -> str:
    """Return a description of a figure's content, with several lines of text for each of its axes.

    Parameters
    ----------
    fig : Figure
        With its final layout (``fig.draw_without_rendering()``).

    Returns
    -------
    str

    Examples
    --------
    >>> from pegpose_lab.lab import plotting
    >>> fig, ax = plotting.figure()
    >>> lines = ax.plot([0, 1, 2], [0, 1, 4], label="square")
    >>> labels = ax.set(xlabel="x (mm)", ylabel="y (mm)", xlim=(0, 2), ylim=(0, 4))
    >>> print(figure_digest(fig))
    figure: 7 x 3.6 in
    axes 1
      x 'x (mm)' 0.00e+00 to 2.00e+00
      y 'y (mm)' 0.00e+00 to 4.00e+00
      line 'square' #1f77b4 -
        x of 3: mean 0.500 sd 0.408: 0.000 0.000 0.500 1.000 1.000
        y of 3: mean 0.417 sd 0.425: 0.000 0.000 0.250 1.000 1.000
    """
    width, height = fig.get_size_inches()
    lines = [f"figure: {width:g} x {height:g} in"]
    lines += [f"  text {text.get_text()!r}" for text in fig.texts if text.get_text()]
    lines += [line for legend in fig.legends for line in _legend(legend)]
    for number, ax in enumerate(fig.axes, 1):
        if ax.get_visible():
            lines += [f"axes {number}", *_axes(ax)]
    return "\n".join(lines)


# --- axes ---------------------------------------------------------------------------------------


def _axes(ax):
    """Lines for the titles, axes, artists and legend."""
    titles = [ax.get_title(place) for place in ("left", "center", "right")]
    lines = [f"  title {title!r}" for title in titles if title]
    if ax.axison:
        lines += [f"  {name} {_axis(axis)}" for name, axis in (("x", ax.xaxis), ("y", ax.yaxis))]
    frame = {ax.patch, ax.title, ax._left_title, ax._right_title, *ax.spines.values()}
    artists = [child for child in ax.get_children() if child.get_visible() and child not in frame and _kind(child)]
    for (kind, look), group in itertools.groupby(artists, key=lambda artist: (_kind(artist), _look(artist))):
        lines += _group(ax, kind, look, list(group))
    return lines + _legend(ax.get_legend())


def _axis(axis):
    """Label, scale, limits, and those tick labels that do not follow from the data."""
    low, high = axis.get_view_interval()
    scale = "" if axis.get_scale() == "linear" else f" {axis.get_scale()}"
    ticks = [text.get_text() for text in axis.get_ticklabels()]
    fixed = (
        f" {ticks}" if isinstance(axis.get_major_formatter(), (FixedFormatter, FuncFormatter)) and any(ticks) else ""
    )
    return f"{axis.get_label_text()!r}{scale} {_limits(low, high, bool(scale))}{fixed}"


def _limits(low, high, nonlinear):
    """Both limits of an axis: to a hundredth to a thousandth of its length on a linear scale, otherwise to three
    digits."""
    if nonlinear:
        return f"{low:.2e} to {high:.2e}"
    decimals = 2 - _magnitude(high - low)
    rounded = [round(float(limit), decimals) + 0.0 for limit in (low, high)]
    return " to ".join(f"{limit:.{max(_magnitude(limit) + decimals, 1)}e}" for limit in rounded)


def _magnitude(value):
    """The power of ten of a value's first digit; 0 for zero."""
    return int(np.floor(np.log10(abs(value)) + 1e-9)) if value else 0


def _legend(legend):
    """The legend's entries with the look of their handles."""
    if legend is None or not legend.get_visible():
        return []
    pairs = zip(legend.legend_handles, legend.get_texts(), strict=True)
    return [f"  legend {text.get_text()!r} {'' if handle is None else _look(handle)}" for handle, text in pairs]


# --- artists ------------------------------------------------------------------------------------


def _kind(artist):
    """The word for an artist that draws something, or None."""
    if isinstance(artist, Legend) or (isinstance(artist, Text) and not artist.get_text()):
        return None
    return next((word for kind, word in _KINDS.items() if isinstance(artist, kind)), None)


def _look(artist):
    """Colour of an artist (or its colour map and range); for a line also marker and style."""
    if isinstance(artist, Line2D):
        parts = (to_hex(artist.get_color()), artist.get_marker(), artist.get_linestyle())
        return " ".join(str(part) for part in parts if part not in ("None", "", " ", None))
    if isinstance(artist, (Collection, AxesImage)) and (
        artist.get_array() is not None or isinstance(artist, ContourSet)
    ):
        return f"{artist.get_cmap().name} {' to '.join(f'{limit:.3e}' for limit in artist.get_clim())}"
    if isinstance(artist, (Collection, Patch)):
        faces, edges = (np.reshape(color, (-1, 4)) for color in (artist.get_facecolor(), artist.get_edgecolor()))
        shown = [color for color in (*faces[:1], *edges[:1]) if color[3] > 0]
        return to_hex(shown[0]) if shown else "transparent"
    return ""


def _group(ax, kind, look, artists):
    """The lines for neighbouring artists of one kind and look, such as the bars of a histogram."""
    if kind == "contours":
        return [line for contours in artists for line in (f"  contours {look}", *_contours(ax, contours))]
    if kind == "text":
        return [f"  text {text.get_text()!r} at {_numbers(_positions(ax, text).ravel())}" for text in artists]
    labels = [artist.get_label() for artist in artists if not artist.get_label().startswith("_")]
    head = " ".join(["  " + kind, *map(repr, labels[:1]), look, *([f"({len(artists)})"] if len(artists) > 1 else [])])
    positions = np.clip(np.concatenate([_positions(ax, artist) for artist in artists]), -FAR, 1 + FAR)
    lines = [head.rstrip(), *_summary("xy", positions)]
    for artist in artists:
        lines += _values(kind, artist)
    return lines


def _values(kind, artist):
    """What an artist shows besides its position: directions of arrows, grey levels and other mapped values."""
    if kind == "arrows":
        arrows = np.column_stack([artist.U, artist.V])
        longest = np.hypot(*arrows.T).max()
        return [f"    longest {longest:.2e} scale {artist.scale:.3e}", *_summary("uv", arrows / longest)]
    if kind == "image" or (kind == "collection" and artist.get_array() is not None):
        return [f"    values {_numbers(_parts(artist))}"]
    return []


def _parts(artist):
    """Means over the four quarters of an array of values, as fractions of the colour range, for each colour channel."""
    values = np.ma.filled(np.ma.asarray(artist.get_array(), dtype=float), 0.0)
    if values.ndim == 3:
        values = values / (values.max() if values.max() > 1 else 1.0)
    else:
        low, high = artist.get_clim()
        values = np.clip((values - low) / ((high - low) or 1.0), 0, 1)
    halves = [
        part for half in np.array_split(values, 2) for part in np.array_split(half, 2, axis=min(1, values.ndim - 1))
    ]
    return np.concatenate(
        [np.atleast_1d(part.mean(axis=tuple(range(min(2, part.ndim))))) for part in halves if part.size]
    )


def _positions(ax, artist):
    """Points (n, 2) of an artist as fractions of the axes, without those that are not finite."""
    if isinstance(artist, Text):
        display = artist.get_transform().transform([artist.get_unitless_position()])
    elif isinstance(artist, Line2D):
        display = artist.get_transform().transform(artist.get_xydata())
    elif isinstance(artist, Patch):
        display = artist.get_transform().transform(artist.get_path().vertices)
    elif isinstance(artist, AxesImage):
        left, right, lower, upper = artist.get_extent()
        display = artist.get_transform().transform([[left, lower], [right, upper]])
    else:
        display = _collection_positions(artist)
    points = ax.transAxes.inverted().transform(np.ma.filled(np.ma.asarray(display, dtype=float), np.nan))
    return points[np.isfinite(points).all(axis=1)]


def _collection_positions(collection):
    """Positions of a collection: of its markers and arrows, or of its paths if they have no offsets."""
    if not isinstance(collection.get_offset_transform(), IdentityTransform):
        return collection.get_offset_transform().transform(np.ma.reshape(collection.get_offsets(), (-1, 2)))
    vertices = [path.vertices for path in collection.get_paths()]
    return collection.get_transform().transform(np.concatenate(vertices)) if vertices else np.empty((0, 2))


def _summary(names, points):
    """Mean, standard deviation and some values of each column."""
    if not len(points):
        return ["    nothing"]
    chosen = points[np.linspace(0, len(points) - 1, SAMPLES).round().astype(int)]
    return [
        f"    {name} of {len(points)}: mean {column.mean():.3f} sd {column.std():.3f}: {_numbers(values)}"
        for name, column, values in zip(names, points.T, chosen.T, strict=True)
    ]


def _contours(ax, contours):
    """Levels, and the centre of all lines weighted by length, which does not depend on the number of vertices."""
    to_axes = contours.get_transform() - ax.transAxes
    outlines = [line for path in contours.get_paths() for line in path.to_polygons(to_axes, closed_only=False)]
    if not outlines:
        return ["    nothing"]
    starts, ends = (np.concatenate([line[part] for line in outlines]) for part in (slice(-1), slice(1, None)))
    lengths = np.hypot(*(ends - starts).T)
    centre = lengths @ (starts + ends) / (2 * lengths.sum())
    return [f"    levels {' '.join(f'{level:.3e}' for level in contours.levels)}", f"    centre {_numbers(centre)}"]


def _numbers(values):
    """Numbers to three digits, without a minus sign before zero."""
    return " ".join(f"{round(value, 3) + 0.0:.3f}" for value in values)
