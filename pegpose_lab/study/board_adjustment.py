"""Bundle adjustment of a board of discs: camera, poses and the discs' places, with exact images of the discs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

COLUMNS, ROWS, PITCH, RADIUS = 4, 3, 90.0, 35.0  # of the board in discocal-left; mm
START = (
    500.0,
    500.0,
    720.0,
    540.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
)  # f_x, f_y, c_x, c_y, skew, k1, k2, p1, p2: 1440 x 1080 px
POINTS = 64  # on the outline of a disc

_OUTLINE = np.linspace(0, 2 * np.pi, POINTS, endpoint=False)
_PLACES = PITCH * np.stack(np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)), axis=-1).reshape(-1, 2)
_N = len(_PLACES)


def board_residuals(views: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Adjust everything to the discs' centres and return what is left.

    Parameters
    ----------
    views : sequence of (12, 2) px
        Centres of the discs' images in the order of the grid, NaN where there is none.

    Returns
    -------
    list of (m, 2) ndarray
        Residuals, px, of each view's m centres, each divided by the root of 1 less its leverage.
    """
    views, n = [np.asarray(view, float) for view in views], len(views)
    there = np.array([np.isfinite(view[:, 0]) for view in views])
    start = np.concatenate(
        [START, *(_pose(view, seen) for view, seen in zip(views, there, strict=True)), np.zeros(2 * _N)]
    )

    def residuals(unknowns):
        places = _PLACES + unknowns[9 + 6 * n :].reshape(_N, 2)
        poses = unknowns[9 : 9 + 6 * n].reshape(n, 6)
        left = [
            (_images(unknowns[:9], pose, places) - view)[seen]
            for pose, view, seen in zip(poses, views, there, strict=True)
        ]
        return np.concatenate([np.concatenate(left).ravel(), _gauge(places - _PLACES)])

    solution = least_squares(residuals, start, x_scale="jac", max_nfev=60)
    count = 2 * there.sum()
    left = solution.fun[:count].reshape(-1, 2)
    leverage = (np.linalg.svd(solution.jac, full_matrices=False)[0][:count] ** 2).sum(axis=1).reshape(-1, 2)
    left = left / np.sqrt(np.maximum(1 - leverage, 0.05))
    return np.split(left, np.cumsum(there.sum(axis=1))[:-1])


def _pose(view, seen):
    """Rotation vector and translation (6,), mm, of the ideal board."""
    f_x, f_y, c_x, c_y = START[:4]
    camera = np.array([[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]])
    board = np.column_stack([_PLACES, np.zeros(_N)])
    _, rotation, translation = cv2.solvePnP(board[seen], view[seen], camera, None)
    return np.concatenate([rotation.ravel(), translation.ravel()])


def _images(camera, pose, places):
    """Centroids (12, 2), px, of the discs' images: of the polygons through POINTS points of their outlines."""
    f_x, f_y, c_x, c_y, skew, k1, k2, p1, p2 = camera
    outline = RADIUS * np.column_stack([np.cos(_OUTLINE), np.sin(_OUTLINE)])
    points = (places[:, None] + outline).reshape(-1, 2)
    x, y, z = (Rotation.from_rotvec(pose[:3]).apply(np.column_stack([points, np.zeros(len(points))])) + pose[3:]).T
    x, y = x / z, y / z
    square = x * x + y * y
    radial = 1 + k1 * square + k2 * square**2
    u = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
    v = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
    u, v = (f_x * u + skew * v + c_x).reshape(_N, -1), (f_y * v + c_y).reshape(_N, -1)
    following_u, following_v = np.roll(u, -1, axis=1), np.roll(v, -1, axis=1)
    cross = u * following_v - following_u * v
    area = 3 * cross.sum(axis=1)
    return (
        np.column_stack([((u + following_u) * cross).sum(axis=1), ((v + following_v) * cross).sum(axis=1)])
        / area[:, None]
    )


def _gauge(moves):
    """Zero for moves of the places without a common shift, turn and growth, which poses and scale could take over."""
    away = (_PLACES - _PLACES.mean(axis=0)) / PITCH
    turn = moves[:, 1] * away[:, 0] - moves[:, 0] * away[:, 1]
    return np.array([*moves.sum(axis=0), turn.sum(), (moves * away).sum()])
