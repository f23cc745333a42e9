"""The covariance of the bundle adjustment, and the error if some parameters are not determined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from ..result import pose_names

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from .bundle import Equations
    from .models import Lens
    from .views import State, Views

LEAST_INFORMATION = 1e-11
"""The camera is not determined if the smallest eigenvalue of S, scaled by A's diagonal, is at most this: it is the
fraction of the information that remains when the poses are unknown."""


def covariance_of(
    model: Lens,
    views: Views,
    state: State,
    equations: Equations,
    variance: float,
    shared: NDArray[np.float64] | None = None,
) -> pd.DataFrame:
    """Covariance of all parameters as a labelled table; translations refer to the objects' own origins.

    `equations` must be without weights; `variance` is that of one image coordinate, px^2.  `shared` (k, k) is the
    covariance of the camera's parameters if it is not the classical one; then `variance` only gives what is a pose's own.
    """
    values, directions, moved = equations.directions()
    if not values[0] > LEAST_INFORMATION:
        number = np.count_nonzero(~(values > LEAST_INFORMATION))
        raise CalibrationError(_undetermined(model.names, directions[:number], moved))
    by_shared = equations.eliminated()[1]
    v, _, k = by_shared.shape
    scale = np.sqrt(np.diagonal(equations.a))
    if shared is None:
        shared = variance * (directions.T / values @ directions) / np.outer(scale, scale)
    to_origin = np.zeros((v, 6, 6))  # origin's shift = centroid's shift - turn x (centroid - origin)
    to_origin[:, range(6), range(6)] = 1
    x, y, z = np.einsum("vij,vj->iv", state.rotations, views.centroids)
    to_origin[:, 3, 1], to_origin[:, 4, 0], to_origin[:, 5, 0] = -z, z, -y
    to_origin[:, 3, 2], to_origin[:, 4, 2], to_origin[:, 5, 1] = y, -x, x
    by_shared = (to_origin @ by_shared).reshape(6 * v, k)
    own = variance * to_origin @ np.linalg.inv(equations.c) @ to_origin.transpose(0, 2, 1)
    whole = np.empty((k + 6 * v, k + 6 * v))
    whole[:k, :k] = shared
    whole[k:, :k] = -by_shared @ shared
    whole[:k, k:] = whole[k:, :k].T
    whole[k:, k:] = by_shared @ shared @ by_shared.T
    poses = whole[k:, k:].reshape(v, 6, v, 6)
    poses[range(v), :, range(v), :] += own
    names = model.names + pose_names(v)
    import pandas as pd

    return pd.DataFrame(whole, names, names)


def _undetermined(names, directions, poses):
    """In words, which parameters can change without moving a point; `poses` (V, 6, number) change with them."""
    groups = []  # of directions that share a parameter: any mixture of them is as undetermined
    for k, direction in enumerate(directions):
        own = set(_changing(names, direction, poses[:, :, k]))
        apart = [group for group in groups if not group & own - {"T_z"}]
        groups = [*apart, own.union(*(group for group in groups if group not in apart))]
    order = [*names, "T_z"]
    found = [_trade_off(sorted(group, key=order.index)) for group in groups]
    return (
        f"the views do not determine all of {', '.join(names)}: {'; '.join(found)}; what trades off can change "
        "together without moving a point; add views of other tilts (about 30 deg), or free fewer parameters"
    )


def in_words(names: Sequence[str], direction: NDArray[np.float64], poses: NDArray[np.float64]) -> str:
    """The parameters that change along a direction, with T_z if the poses shift in depth, as a sentence."""
    return _trade_off(_changing(names, direction, poses))


def _changing(names, direction, poses):
    free = [name for name, part in zip(names, direction, strict=True) if abs(part) > 0.1 * np.abs(direction).max()]
    shifts = np.abs(poses[:, 3:]).max(axis=0)
    along_axis = ["T_z"] if shifts[2] > 0.1 * shifts.max() and shifts.max() > 0 else []
    return free + along_axis


def _trade_off(names):
    *others, last = names
    return f"{', '.join(others)} and {last} trade off" if others else f"{last} moves no point"
