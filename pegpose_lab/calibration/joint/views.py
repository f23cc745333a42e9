"""The points of all views, the parameters of a fit, and the residuals with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .models import Lens


@dataclass(frozen=True)
class Views:
    """The points (V, m, 3) of all views, relative to their centroids (V, 3); their images (V, m, 2); and `used`
    (V, m), which is 1 where there is a point."""

    points: np.ndarray
    centroids: np.ndarray
    image: np.ndarray
    used: np.ndarray

    @classmethod
    def stack(cls, object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]]) -> Views:
        shape = len(object_points), max(len(points) for points in object_points)
        points, image, used = np.zeros((*shape, 3)), np.zeros((*shape, 2)), np.zeros(shape)
        centroids = np.array([points.mean(axis=0) for points in object_points])
        for view, (p, q) in enumerate(zip(object_points, image_points, strict=True)):
            points[view, : len(p)], image[view, : len(p)], used[view, : len(p)] = p - centroids[view], q, 1
        return cls(points, centroids, image, used)


@dataclass(frozen=True)
class State:
    """Parameters: the camera's, and each view's rotation (V, 3, 3) and position of the centroid (V, 3).

    The data determine the position of the centroid far better than that of a distant origin.
    """

    shared: np.ndarray
    rotations: np.ndarray
    positions: np.ndarray

    def moved(self, shared: NDArray[np.float64], turns: NDArray[np.float64], shifts: NDArray[np.float64]) -> State:
        """The state after a step; `turns` (V, 3) are rotation vectors about the camera's axes, applied last."""
        rotations = Rotation.from_rotvec(turns).as_matrix() @ self.rotations
        return State(self.shared + shared, rotations, self.positions + shifts)

    def poses(self, views: Views) -> list[RigidTransform]:
        """Poses of the objects' own origins."""
        origins = self.positions - np.einsum("vij,vj->vi", self.rotations, views.centroids)
        return [
            RigidTransform.from_components(origin, Rotation.from_matrix(rotation))
            for origin, rotation in zip(origins, self.rotations, strict=True)
        ]


def evaluate(model: Lens, views: Views, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Residuals (V, m, 2) and derivatives (V, m, 2, k + 6) by camera, turn and shift; None if a point has no image.

    If the board has unknowns, they are the last of the k: their derivatives are those by the point in the camera frame,
    times the view's rotation, times those of the object point (`board.BoardUnknowns.bent`).
    """
    own, by_board = views.points, None
    shared = state.shared
    if model.board is not None:
        shared, values = np.split(shared, [len(model.lens_names)])
        bent, by_board = model.board.bent(views.points + views.centroids[:, None], values)
        own = bent - views.centroids[:, None]
    turned = own @ state.rotations.transpose(0, 2, 1)
    points = (turned + state.positions[:, None]).reshape(-1, 3)
    projection = model.project(shared, points)
    if projection is None:
        return None
    image, by_shared, by_point = projection
    x, y, z = turned.reshape(-1, 1, 3).transpose(2, 0, 1)
    by_x, by_y, by_z = by_point.transpose(2, 0, 1)
    by_turn = np.stack([y * by_z - z * by_y, z * by_x - x * by_z, x * by_y - y * by_x], axis=2)
    if by_board is not None:
        moved = (state.rotations[:, None] @ by_board).reshape(-1, *by_board.shape[2:])
        by_shared = np.concatenate([by_shared, by_point @ moved], axis=2)
    jacobian = np.concatenate([by_shared, by_turn, by_point], axis=2)
    return image.reshape(views.image.shape) - views.image, jacobian.reshape(*views.image.shape, -1)
