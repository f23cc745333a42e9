"""Ellipses as the fit sees them: centre, radius of equal area and shape, and how far steps move their edge."""

from dataclasses import dataclass

import numpy as np


@dataclass
class _Ellipse:
    """Centre, radius of equal area, shape m, angle of the major axis: numbers, or arrays (n,) for n ellipses."""

    x: np.ndarray
    y: np.ndarray
    r: np.ndarray
    m: np.ndarray | float = 0.0
    angle: np.ndarray | float = 0.0

    @property
    def axes(self):
        return self.r * np.exp(self.m), self.r * np.exp(-self.m)

    @property
    def half_size(self):
        """Half width and half height of the upright box around the ellipse."""
        (a, b), cos, sin = self.axes, np.cos(self.angle), np.sin(self.angle)
        return np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)

    def moved(self, dx, dy, dr, dp, dq):
        """The ellipse after a step; (dp, dq) is the change of shape in the ellipse's own axes.

        The shape's matrix S^T S, S = diag(e^-m, e^m) R^T, becomes S^T exp(-2 [dp dq; dq -dp]) S.
        """
        size = np.hypot(dp, dq)
        even, odd = np.cosh(2 * size), np.where(size > 0, np.sinh(2 * size) / np.where(size > 0, size, 1), 2)
        shrink, grow = np.exp(-2 * self.m), np.exp(2 * self.m)
        along, across, mixed = shrink * (even - odd * dp), grow * (even + odd * dp), -odd * dq
        cos, sin = np.cos(2 * self.angle), np.sin(2 * self.angle)
        split = 0.5 * (across - along)  # of the form's eigenvalues, in the old axes
        c, s = split * cos + mixed * sin, split * sin - mixed * cos
        return _Ellipse(self.x + dx, self.y + dy, self.r + dr, 0.5 * np.arcsinh(np.hypot(c, s)), 0.5 * np.arctan2(s, c))

    def __getitem__(self, i):
        return _Ellipse(self.x[i], self.y[i], self.r[i], self.m[i], self.angle[i])

    def __setitem__(self, i, other):
        for name in ("x", "y", "r", "m", "angle"):
            getattr(self, name)[i] = getattr(other, name)


def _inside(ellipse, shape):
    """Whether the whole ellipse lies on the picture."""
    width, height = ellipse.half_size
    return (
        (width <= ellipse.x)
        & (ellipse.x <= shape[1] - 1 - width)
        & (height <= ellipse.y)
        & (ellipse.y <= shape[0] - 1 - height)
    )


def _distance(first, second):
    """An upper bound, px, of how far the edge moved between two ellipses."""
    change = np.abs(np.subtract(first.half_size, second.half_size)).max(axis=0)
    return np.hypot(first.x - second.x, first.y - second.y) + change + np.abs(first.r - second.r)


def _movement(step, ellipse):
    """An upper bound, px, of how far steps (..., 6) move any part of the edge, or s."""
    shape = np.abs(step[..., 3:5]).max(axis=-1) * ellipse.r
    return np.maximum(np.maximum(np.abs(step[..., :3]).max(axis=-1), np.abs(step[..., 5])), shape)


def _limited(step, ellipse):
    """Steps (..., 6) shortened so that no part of the edge moves by more than 2 px and s by more than half."""
    size = np.abs(step[..., :3]).max(axis=-1) / 2, np.abs(step[..., 3:5]).max(axis=-1) * ellipse.r / 2
    return step / np.maximum(np.maximum(*size), np.maximum(np.abs(step[..., 5]) / 0.7, 1.0))[..., None]


def _choose(where, first, second):
    """The first ellipses where that is said, else the second."""
    return _Ellipse(
        *(np.where(where, getattr(first, name), getattr(second, name)) for name in ("x", "y", "r", "m", "angle"))
    )
