"""Cramer-Rao bounds of a disc's centre and radius, of the whole edge and of its visible arc."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.special import ndtr

CLEAN_EDGE = 0.05  # of the contrast: what a clean edge may depart from the blurred step


# ---- bounds ----


def center_bound(radius: float, contrast: float, edge_width: float, noise: float) -> float:
    """Cramer-Rao bound, px per axis, of the centre of a whole disc; the radius's is 1/sqrt(2) of it."""
    sigma = np.sqrt(noise**2 + 1 / 12)
    return sigma / contrast * np.sqrt(2 * edge_width / (np.sqrt(np.pi) * radius))


def _clean_edge(picture, outline, base, contrast, width):
    """At which points of an outline the noise-free picture shows the blurred step and nothing else."""
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
    """The visible share of an edge, and how much larger than the whole edge's the bounds of x, y and r are.

    An edge of length dl tells its place along the normal with an information that is proportional to dl.  Where
    the normal has the direction t, the edge moves by (cos t, sin t, 1, cos 2t, sin 2t) for a change of x, y,
    radius and the two numbers of the ellipse's shape.  Infinite where too little is visible to tell them apart.
    """
    offset = outline - outline.mean(axis=0)
    t = np.arctan2(offset[:, 1], offset[:, 0])
    moves = np.stack([np.cos(t), np.sin(t), np.ones_like(t), np.cos(2 * t), np.sin(2 * t)], axis=1)
    seen = moves[visible]
    information = seen.T @ seen / len(moves)
    if np.linalg.cond(information) > 1e6:
        return visible.mean(), np.full(3, np.inf)
    return visible.mean(), np.sqrt(np.diag(np.linalg.inv(information))[:3] / [2, 2, 1])
