"""Views in another order than object_points: the wrong order is named, and the order that would fit is searched.

The image points of a plane in a wrong order are no perspective image of it, so a homography misses them by far.  Only
then the orders are tried in which boards are read by mistake: column by column, in a zigzag, from another corner on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from ...checks import CalibrationError
from ..planes import is_planar
from .homographies import linear_homographies, plane_rotations
from .views import Views

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

DISORDER = 0.25
"""The order of a plane's points is wrong if the residual of its homography, in units of the points' spread per axis, is
above this.  A wrong order leaves 0.3 to 0.8, distortion at most 0.07 and noise of a fifth of a square 0.2."""

IN_ORDER = 0.12
"""Another order is named if its residual, in the same units, is below this (and below half of that of the given order)."""

FEW = 1 / 6
"""Wrong points of a view are single corners, not an order, if they are at most this share of its points."""

FAR = 10.0
"""A point is far from the homography of the others if it is off by more than this many of their median distances."""


def demand_order(object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]]) -> None:
    """Refuse planes whose image points are not even roughly a perspective image.

    Raises
    ------
    CalibrationError
        It names the views, counted from 0, and for each of them the order or the single corners that explain it.
    """
    planar = [view for view, points in enumerate(object_points) if is_planar(points)]
    if not planar:
        return
    left = homography_residuals(*([points[view] for view in planar] for points in (object_points, image_points)))
    wrong = {view: residual for view, residual in zip(planar, left[0], strict=True) if residual > DISORDER}
    if not wrong:
        return
    alone = len(object_points) == 1
    found = {view: fitting_order(object_points[view], image_points[view], wrong[view]) for view in wrong}
    single = {view: far_corners(object_points[view], image_points[view]) for view in wrong if not found[view]}
    single = {view: corners for view, corners in single.items() if corners}
    if len(single) == len(wrong):
        raise CalibrationError(far_sentence(single, alone) + "; leave them out")
    found = {view: words for view, words in found.items() if view not in single}
    which = "" if alone else f" of view{'s' * (len(found) > 1)} {', '.join(map(str, found))}"
    raise CalibrationError(
        f"the image points{which} are no image of the plane (a homography misses them by "
        f"{100 * max(wrong[view] for view in found):.0f} % of their spread): they are not in the order of "
        f"object_points; {_order_sentences(found, alone)}"
    )


def homography_residuals(
    object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (V,) of the homographies of planes, in units of the points' spread per axis, and their orientations
    (V,): -1 where the image is mirrored, so that the plane's z axis points to the camera."""
    views = Views.stack(object_points, image_points)
    matrices, left = linear_homographies(views, plane_rotations(object_points), views.image)
    return left, np.sign(np.linalg.det(matrices) * matrices[:, 2, 2])


def fitting_order(object_points: NDArray[np.float64], image_points: NDArray[np.float64], residual: float) -> str | None:
    """In words, the order in which a plane's image points would fit; None if none of the usual mistakes explains them.

    `residual` is that of the given order (`homography_residuals`).
    """
    grid = grid_shape(object_points)
    words, orders = zip(*_orders(len(object_points), grid), strict=True)
    left, signs = homography_residuals([object_points] * len(orders), [image_points[order] for order in orders])
    best = int(np.argmin(left))
    if left[best] > min(IN_ORDER, residual / 2):
        return None
    if signs[best] > 0:
        return words[best]
    if words[best] == COLUMN_BY_COLUMN:
        return f"columns and rows of the board are exchanged ({grid[0]} columns, {grid[1]} rows)"
    return f"{words[best]}, and mirrored"


COLUMN_BY_COLUMN = "the corners are listed column by column"


def _orders(number, grid):
    """Words and permutations of the mistakes that are tried."""
    plain = np.arange(number)
    if grid:
        rows, columns = grid
        by_columns, by_rows = plain.reshape(columns, rows), plain.reshape(rows, columns)
        yield COLUMN_BY_COLUMN, by_columns.T.ravel()
        yield "every second row of the corners is reversed", _zigzag(by_rows).ravel()
        yield "the corners are listed column by column, every second one reversed", _zigzag(by_columns).T.ravel()
        for shift in range(1, columns):
            near = min(shift, shift - columns, key=abs)
            yield f"each row of the corners is rolled by {near:+d}", np.roll(by_rows, -shift, axis=1).ravel()
    for shift in range(1, number):
        near = min(shift, shift - number, key=abs)
        rows = f" (whole rows: {near // grid[1]:+d})" if grid and near % grid[1] == 0 else ""
        yield f"the list of corners is rolled by {near:+d}{rows}", np.roll(plain, -shift)


def _zigzag(lines):
    lines = lines.copy()
    lines[1::2] = lines[1::2, ::-1]
    return lines


def grid_shape(object_points: NDArray[np.float64]) -> tuple[int, int] | None:
    """Rows and columns of points (n, 3) that are a grid, listed row by row; None if they are not."""
    number, steps = len(object_points), np.diff(object_points, axis=0)
    jumps = np.flatnonzero(np.linalg.norm(steps - steps[0], axis=1) > 0.3 * np.linalg.norm(steps[0]))
    columns = int(jumps[0]) + 1 if len(jumps) else number
    if columns < 2 or columns >= number or number % columns:
        return None
    grid = object_points.reshape(-1, columns, 3)
    along, across = grid[0, 1] - grid[0, 0], grid[1, 0] - grid[0, 0]
    row, column = np.mgrid[: number // columns, :columns]
    ideal = grid[0, 0] + row[..., None] * across + column[..., None] * along
    near = np.linalg.norm(grid - ideal, axis=2).max() < 0.3 * min(np.linalg.norm(along), np.linalg.norm(across))
    return grid.shape[:2] if near else None


def _order_sentences(found, alone):
    """What explains the views, in words; `found` maps views to words or None."""
    if not any(found.values()):
        return "check the order, and that the board's columns and rows are not mixed up"
    parts = []
    for words in dict.fromkeys(found.values()):
        views = [view for view, other in found.items() if other == words]
        which = "" if alone else f"in view{'s' * (len(views) > 1)} {', '.join(map(str, views))} (counted from 0) "
        parts.append(f"{which}{words or 'no usual mistake explains the order'}")
    return "; ".join(parts)


def far_corners(object_points: NDArray[np.float64], image_points: NDArray[np.float64]) -> dict[int, float]:
    """Single corners of a plane that are far from the homography of the others, and their distances, px.

    Empty if there are none, or more than `FEW`, or the others are in no order either.
    """
    in_plane = (object_points @ plane_rotations([object_points])[0].T)[:, :2]
    if len(object_points) < 8:  # too few to tell a wrong corner from a wrong order
        return {}
    matrix, _ = cv2.findHomography(in_plane, image_points, cv2.LMEDS)
    if matrix is None:
        return {}
    seen = np.column_stack([in_plane, np.ones(len(in_plane))]) @ matrix.T
    distances = np.linalg.norm(seen[:, :2] / seen[:, 2:] - image_points, axis=1)
    far = np.flatnonzero(distances > FAR * np.median(distances))
    if not 0 < len(far) <= FEW * len(object_points):
        return {}
    rest = np.setdiff1d(np.arange(len(object_points)), far)
    if homography_residuals([object_points[rest]], [image_points[rest]])[0][0] > IN_ORDER:
        return {}
    return {int(corner): float(distances[corner]) for corner in far}


def far_sentence(single: dict[int, dict[int, float]], alone: bool) -> str:
    """A sentence about single corners by view; `alone` if there is one view only."""
    parts = []
    for view, corners in single.items():
        of = "" if alone else f" of view {view}"
        parts.append(f"corner{'s' * (len(corners) > 1)} {', '.join(map(str, corners))}{of}")
    largest = max(max(corners.values()) for corners in single.values())
    return (
        f"wrong corners: {'; '.join(parts)} (counted from 0), up to {largest:.0f} px from where the other corners of "
        "the view put them"
    )
