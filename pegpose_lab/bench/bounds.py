"""Cramer-Rao bounds of a disc's centre and radius, from the whole edge and from its visible arc."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.special import ndtr

CLEAN_EDGE = 0.05  # of the contrast: largest deviation of a clean edge from the blurred step


# ---- bounds ----


def center_bound(radius: float, contrast: float, edge_width: float, noise: float) -> float:
    """Cramer-Rao bound, px per axis, for the centre of a whole disc; the bound of the radius is 1/sqrt(2) of it."""
    sigma = np.sqrt(noise**2 + 1 / 12)
    return sigma / contrast * np.sqrt(2 * edge_width / (np.sqrt(np.pi) * radius))


def _clean_edge(picture, outline, base, contrast, width):
    """Mask of the points of an outline where the noise-free image shows only the blurred step."""
    tangent = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]]) / np.hypot(*tangent.T)[:, None]
    outwards = np.sign(np.sum(normal * (outline - outline.mean(axis=0))))
    distance = np.linspace(-3 * width, 3 * width, 19)
    points = outline[:, None] + outwards * distance[:, None] * normal[:, None]
    x, y = np.moveaxis(points, 2, 0).astype(np.float32)
    profile = cv2.remap(picture, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    departure = np.abs(profile - base - contrast * ndtr(-distance / width))
    return departure.max(axis=1) < CLEAN_EDGE * contrast


def _arc_shape(visible, outline):
    """The visible share of an edge, and the bounds of x, y and r relative to those of the whole edge.

    An edge of length dl has information about its position along the normal that is proportional to dl.  If the
    normal has the direction t, the edge moves by (cos t, sin t, 1, cos 2t, sin 2t) for a change of x, y, radius and
    the two parameters of the ellipse's shape.  The bounds are infinite if the visible part does not determine them.
    """
    offset = outline - outline.mean(axis=0)
    t = np.arctan2(offset[:, 1], offset[:, 0])
    moves = np.stack([np.cos(t), np.sin(t), np.ones_like(t), np.cos(2 * t), np.sin(2 * t)], axis=1)
    seen = moves[visible]
    information = seen.T @ seen / len(moves)
    if np.linalg.cond(information) > 1e6:
        return visible.mean(), np.full(3, np.inf)
    return visible.mean(), np.sqrt(np.diag(np.linalg.inv(information))[:3] / [2, 2, 1])
