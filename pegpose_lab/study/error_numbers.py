"""The numbers in use for "the reprojection error", and the error of views that one-view calibrations have not seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..calibration import board_pose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..calibration import Calibration


def error_numbers(residuals: Sequence[ArrayLike]) -> dict[str, float]:
    r"""Return the four numbers that are called the error of residuals [(n, 2), ...], px.

    "Eq. 7": mean distance.  "rms": root of the mean squared distance (OpenCV's `calibrateCamera`).  "sd per axis":
    standard deviation of all coordinates (MATLAB toolbox).  "norm / n": :math:`\lVert e\rVert / n`, which is the rms
    over :math:`\sqrt n` (OpenCV's tutorial).

    Examples
    --------
    >>> {name: round(number, 3) for name, number in error_numbers([[[3.0, 4.0]], [[-3.0, -4.0]]]).items()}
    {'Eq. 7': 5.0, 'rms': 5.0, 'sd per axis': 4.082, 'norm / n': 3.536}
    """
    e = np.concatenate([np.asarray(r, np.float64) for r in residuals])
    rms = np.sqrt(np.mean(np.sum(e**2, axis=1)))
    numbers = {
        "Eq. 7": np.hypot(*e.T).mean(),
        "rms": rms,
        "sd per axis": e.std(ddof=1),
        "norm / n": rms / np.sqrt(len(e)),
    }
    return {name: float(number) for name, number in numbers.items()}


def single_views_left_out(
    calibrations: Sequence[Calibration], object_points: ArrayLike, image_points: Sequence[ArrayLike]
) -> list[NDArray[np.float64]]:
    """Return the residuals (n, 2) of every view through the camera of each *other* view, its pose fitted, px.

    Parameters
    ----------
    calibrations : (m,) sequence of Calibration
        One a view, of that view alone.
    object_points : (n, 3) array_like
        mm, the same in every view.
    image_points : (m,) sequence of (n, 2) array_like
        px.

    Returns
    -------
    list of m (m - 1) arrays

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from pegpose_lab import paper
    >>> truth = paper.paper_experiment()
    >>> board = truth.board.object_points
    >>> views = [truth.camera.project(board, pose) for pose in truth.cam_from_boards[:2]]
    >>> residuals = single_views_left_out([SimpleNamespace(camera=truth.camera)] * 2, board, views)
    >>> len(residuals), bool(max(np.abs(r).max() for r in residuals) < 1e-6)
    (2, True)
    """
    cameras = [calibration.camera for calibration in calibrations]
    pairs = [(c, view) for k, c in enumerate(cameras) for j, view in enumerate(image_points) if j != k]
    return [c.project(object_points, board_pose(object_points, view, c)) - view for c, view in pairs]
