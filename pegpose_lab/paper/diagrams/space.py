"""Drawing three-dimensional scenes into flat axes: the pinhole projection and the look of all diagrams."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import FancyArrowPatch, Polygon
from scipy.spatial import ConvexHull
from scipy.spatial.transform import RigidTransform, Rotation

from ...camera import TsaiCamera
from ...lab.style import COLORS, SERIES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

AXIS_COLORS = (SERIES[1], SERIES[2], SERIES[0])  # x, y, z of every frame: red, green, blue
MARKED = SERIES[5]  # what a drawing is about: the pose sought in Fig. 1, peg 1 in Fig. 5
INK = COLORS["paper"]
BODY, SHADE, EDGE = "0.93", "0.80", "0.45"  # greys of solid bodies: lit faces, shaded faces, outlines
SMALL = 8.0  # pt
_CENTERED = {"ha": "center", "va": "center"}


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike) -> RigidTransform:
    """Return cam_from_world (RigidTransform) of a camera at `eye` that looks at `target`, `up` upwards."""
    forward = np.asarray(target, float) - eye
    right = np.cross(forward, up)
    axes = np.array([right, np.cross(forward, right), forward])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return RigidTransform.from_components(np.asarray(eye, float), Rotation.from_matrix(axes.T)).inv()


class _View:
    """Draws three-dimensional objects into axes, seen by a pinhole camera."""

    def __init__(self, ax, eye, target, up=(0.0, 0.0, 1.0)):
        self.ax = ax
        self.camera = TsaiCamera(1000.0)
        self.cam_from_world = look_at(eye, target, up)
        self.drawn = []

    def __call__(self, points):
        """Positions (n, 2) of scene points (n, 3)."""
        return self.camera.project(np.atleast_2d(points), self.cam_from_world)

    def at(self, point):
        """Position (2,) of one scene point."""
        return self(point)[0]

    def line(self, points, **style):
        places = self._note(self(points))
        return self.ax.plot(*places.T, **({"color": INK, "linewidth": 1.0, "solid_capstyle": "round"} | style))[0]

    def face(self, points, **style):
        """A flat polygon."""
        places = self._note(self(points))
        self.ax.add_patch(Polygon(places, **({"facecolor": BODY, "edgecolor": EDGE, "linewidth": 0.8} | style)))

    def solid(self, points, **style):
        """The outline of a convex body: the hull of its points' images."""
        places = self(points)
        self._note(places)
        outline = places[ConvexHull(places).vertices]
        self.ax.add_patch(Polygon(outline, **({"facecolor": BODY, "edgecolor": EDGE, "linewidth": 0.8} | style)))

    def cylinder(self, start, end, radius, *, zorder, shade=SHADE, cap=BODY):
        """A cylinder with the cap at `end` towards the viewer."""
        rings = [_ring(center, np.subtract(end, start), radius) for center in (start, end)]
        self.solid(np.vstack(rings), facecolor=shade, zorder=zorder)
        self.face(rings[1], facecolor=cap, zorder=zorder + 0.1)

    def capsule(self, start, end, radius, *, zorder):
        """A rounded link between two joints."""
        towards = self.cam_from_world.inv().translation
        rings = [_ring(center, towards - center, radius) for center in np.array([start, end], float)]
        self.solid(np.vstack(rings), zorder=zorder)
        for ring in rings:
            self.face(ring, facecolor=SHADE, zorder=zorder + 0.1)

    def arrow(self, start, end, **style):
        _arrow(self.ax, *self._note(self([start, end])), **({"linewidth": 1.2, "mutation_scale": 8} | style))

    def triad(self, world_from_frame, length, *, zorder, names=None, offsets=((0, 0),) * 3):
        """A frame's three axes in x, y, z colours."""
        ends = world_from_frame.apply(length * np.eye(3))
        for index, (end, color) in enumerate(zip(ends, AXIS_COLORS, strict=False)):
            self.arrow(world_from_frame.translation, end, color=color, zorder=zorder, linewidth=1.5)
            if names:
                self.label(end, names[index], offsets[index], color=color)

    def label(self, point, text, offset, **style):
        """Text at a scene point, moved by `offset` points (right, up)."""
        place = self._note(self(point))[0]
        defaults = {"fontsize": SMALL + 0.5, "ha": "center", "va": "center", "zorder": 40, "linespacing": 1.15}
        self.ax.annotate(text, place, xytext=offset, textcoords="offset points", **(defaults | style))

    def finish(self, caption, margin=0.04):
        """Frame what was drawn, y down as in any camera image, with a caption below."""
        low, high = np.min(self.drawn, axis=0), np.max(self.drawn, axis=0)
        left, top = low - margin * (high - low)
        right, bottom = high + margin * (high - low)
        _bare(self.ax, (left, right), (bottom, top), caption)

    def _note(self, places):
        self.drawn.extend(places)
        return places


def _arrow(ax, start, end, **style):
    """An arrow from point to point of the axes."""
    defaults = {"arrowstyle": "-|>", "mutation_scale": 10, "shrinkA": 0, "shrinkB": 0}
    ax.add_patch(FancyArrowPatch(start, end, **(defaults | {"color": INK, "linewidth": 1.3} | style)))


def _bare(ax, xlim, ylim, caption=None):
    """Turn the axis lines off: equal scales, and only a caption below."""
    ax.set(xlim=xlim, ylim=ylim, aspect="equal", xticks=[], yticks=[])
    ax.spines[:].set_visible(False)
    ax.set_xlabel(caption, fontsize=SMALL + 1, linespacing=1.4)


def _ring(center, axis, radius, count=60):
    """Points (count, 3) on a circle about `axis` through `center`."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)[:, None]
    return center + radius * (np.cos(angles) * first + np.sin(angles) * np.cross(axis, first))
