"""The circles that are returned: sorted, without duplicates, inside the image and the radius range."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .outlines import BAND, SECTORS
from .request import _least_score


@dataclass(frozen=True)
class Circles:
    """Circles, the best first: centers (n, 2) px, radii (n,) px, scores (n,); the polarity that was looked for.

    Examples
    --------
    >>> import numpy as np
    >>> circles = Circles(np.array([[70.0, 40.0]]), np.array([20.0]), np.array([1.0]), "bright")
    >>> len(circles)
    1
    """

    centers: np.ndarray
    radii: np.ndarray
    scores: np.ndarray
    polarity: str = ""

    def __len__(self) -> int:
        return len(self.radii)


# ---------------------------------------------------------------------------------------------------- result


def _as_circles(rows, shape, request, max_circles):
    """Sorted circles without duplicates, inside the image and the radius range."""
    centers = np.clip(rows[:, :2], 0, [shape[1] - 1, shape[0] - 1])
    radii = np.clip(rows[:, 2], request.r_min, request.r_max)
    order = np.lexsort((centers[:, 0], centers[:, 1], -rows[:, 3]))
    places, kept = np.column_stack([centers, radii]).tolist(), []
    for i in order.tolist():
        if max_circles is not None and len(kept) == max_circles:
            break
        near = [k for k in kept if _may_touch(places[i], places[k])]
        if not near or not _is_known(places[i], [places[k] for k in near], rows[i, 3], request):
            kept.append(i)
    polarity = "bright" if request.sign > 0 else "dark"
    return Circles(centers[kept], radii[kept], rows[kept, 3], polarity)


def _may_touch(first, second):
    """Whether two circles x, y, r are nearer than the widest tolerance below."""
    apart = math.hypot(first[0] - second[0], first[1] - second[1])
    tolerance = 3.0 + BAND * min(first[2], second[2])
    return abs(first[2] - second[2]) - tolerance < apart < first[2] + second[2] + tolerance


def _is_known(circle, others, score, request):
    """Whether a circle is close to a better one everywhere, or (multiscale) shares too much of its edge with others."""
    x, y, r = np.array(others).T
    smaller = np.minimum(r, circle[2])
    if (np.hypot(x - circle[0], y - circle[1]) + np.abs(r - circle[2]) < np.maximum(3.0, 0.15 * smaller)).any():
        return True
    if request.method != "multiscale":
        return False
    along, across = circle[0] + circle[2] * _COS[:, None] - x, circle[1] + circle[2] * _SIN[:, None] - y
    shared = np.abs(np.hypot(along, across) - r) < np.maximum(2.0, BAND * smaller)
    shared &= along * _COS[:, None] + across * _SIN[:, None] > 0  # where discs touch, each has the edge of its own
    return score - shared.any(axis=1).mean() < _least_score(request)


_COS, _SIN = (function((np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS)) for function in (np.cos, np.sin))
