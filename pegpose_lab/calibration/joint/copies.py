"""Views that are copies of one view, and views of the plane from behind."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...flags import Flag
from ..planes import is_planar
from .homographies import plane_rotations

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .views import State

SAME_PLACE = 0.005
"""Two views are copies if their points differ by at most this fraction of the points' spread: a board that is moved for
another view moves by far more, and points of the same picture, found twice, differ by less."""

FARTHEST = 0.02
"""With noise, the fraction may be up to this; a wrong corner or lens must not make different views look like copies."""


def copied_views(
    object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]], noise: float = 0.0
) -> list[list[int]]:
    """Groups of views, counted from 0, with the same image up to noise; `noise` is its sigma per axis, px, if known."""
    groups, free = [], dict.fromkeys(range(len(image_points)))
    centers = np.array([points.mean(axis=0) for points in image_points])
    spreads = np.array([points.std(axis=0).mean() for points in image_points])
    limits = np.clip(2 * noise, SAME_PLACE * spreads, FARTHEST * spreads)
    while free:
        first = next(iter(free))
        near = np.flatnonzero(np.linalg.norm(centers - centers[first], axis=1) <= 2 * limits[first])
        group = [
            view
            for view in near.tolist()
            if view in free
            and object_points[view].shape == object_points[first].shape
            and np.sqrt(np.mean((image_points[view] - image_points[first]) ** 2)) <= limits[first]
            and np.array_equal(object_points[view], object_points[first])
        ]
        for view in group:
            del free[view]
        if len(group) > 1:
            groups.append(group)
    return groups


def copies_sentence(groups: Sequence[Sequence[int]], number: int) -> str:
    """A sentence about groups of copies among `number` views."""
    if len(groups[0]) == number:
        return (
            f"All {number} views are copies of one view: together they tell about f what one view tells, and stated "
            "sigmas are too small if the points were found in the same picture. Add views of other tilts."
        )
    named = "; ".join(", ".join(map(str, group)) for group in groups)
    return (
        f"Views {named} (counted from 0) are copies of one view{' each' * (len(groups) > 1)}: their points are the same "
        "up to noise. Copies tell nothing about f that one of them does not tell, and stated sigmas are too small if "
        "the points were found in the same picture; keep one of them."
    )


def judge_sides(object_points: Sequence[NDArray[np.float64]], state: State) -> tuple[Flag, ...]:
    """A flag if planes are seen from behind, so that the order of their points is mirrored."""
    planar = [view for view, points in enumerate(object_points) if is_planar(points)]
    if not planar:
        return ()
    normals = plane_rotations([object_points[view] for view in planar])[:, 2]
    facing = np.einsum("vij,vj,vi->v", state.rotations[planar], normals, state.positions[planar])
    behind = [view for view, side in zip(planar, facing, strict=True) if side < 0]
    if not behind:
        return ()
    harm = "f is not affected, but the poses are"
    if len(behind) == len(planar):
        which = "The view shows" if len(planar) == 1 else "All views show"
        text = (
            f"{which} the plane from behind (its z axis points to the camera): the order of the points is mirrored, or "
            f"x and y of object_points are exchanged, unless z is meant to point to the camera; {harm}."
        )
        return (Flag("mirrored-view", text),)
    fewer = behind if 2 * len(behind) <= len(planar) else [view for view in planar if view not in behind]
    which = f"View{'s' * (len(fewer) > 1)} {', '.join(map(str, fewer))} (counted from 0)"
    text = (
        f"{which} {'show' if len(fewer) > 1 else 'shows'} the other side of the plane than the other views: the order "
        f"of the points is mirrored (rows read from right to left, or from the last to the first); {harm}."
    )
    return (Flag("mirrored-view", text),)
