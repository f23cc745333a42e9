"""How far a calibration can be trusted: held-out views, how its points cover the image, and the traces of a wrong model."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..calibration import board_pose
from ..checks import CalibrationError, as_count, as_number, as_points

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray
    from pandas import DataFrame

    from ..calibration import Calibration
    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera

LEAST_IN_RING = 5


def held_out_distances(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera, object_points: ArrayLike, image_points: ArrayLike
) -> NDArray[np.float64]:
    """Reprojection errors of a view that was not used for the calibration, when only the pose of the view is fitted.

    Parameters
    ----------
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera
    object_points : (n, 3) array_like
        mm, n >= 4.
    image_points : (n, 2) array_like
        px.

    Returns
    -------
    (n,) ndarray
        px.

    Raises
    ------
    ValueError
        If the input is unusable, or a point has no image by this camera.
    CalibrationError
        If no pose is found.

    Examples
    --------
    >>> from pegpose_lab import paper, study
    >>> truth = paper.paper_experiment()
    >>> board, (first, *_) = truth.board.object_points, truth.cam_from_boards
    >>> study.held_out_distances(truth.camera, board, truth.camera.project(board, first)).max().round(4) + 0
    np.float64(0.0)
    """
    return np.hypot(*_residuals(camera, object_points, image_points).T)


def _residuals(camera, object_points, image_points):
    """Projected minus measured points (n, 2), px, of a view whose pose alone is fitted."""
    return camera.project(object_points, board_pose(object_points, image_points, camera)) - image_points


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
    return [_residuals(c, object_points, view) for c, view in pairs]


def leave_one_out(
    calibrate: Callable[..., Calibration], object_points: Sequence[ArrayLike], image_points: Sequence[ArrayLike]
) -> DataFrame:
    """Leave-one-out cross-validation: calibrate without each view in turn, then fit only the pose of that view.

    Parameters
    ----------
    calibrate : callable
        Maps lists of object points and image points to a `Calibration`.
    object_points, image_points : sequences of (n, 3) and (n, 2) array_like
        mm and px, an entry a view; at least three.

    Returns
    -------
    DataFrame
        A row a view: rms and mean_distance (Eq. 7) of the view left out, px, and the others' focal_length (mm, or f_x in
        px for an OpenCV camera).

    Raises
    ------
    ValueError
        If there are fewer than three views.
    CalibrationError
        If the others do not determine the camera.

    Examples
    --------
    >>> from pegpose_lab import calibrate_joint, paper, study
    >>> truth = paper.paper_experiment()
    >>> boards = [truth.board.object_points] * 5
    >>> images = [truth.camera.project(truth.board.object_points, pose) for pose in truth.cam_from_boards]
    >>> table = study.leave_one_out(lambda *views: calibrate_joint(*views, truth.camera), boards, images)
    >>> len(table), bool(table["rms"].max() < 1e-6)  # exact corners
    (5, True)
    """
    if len(object_points) < 3 or len(object_points) != len(image_points):
        raise ValueError(
            f"object_points has {len(object_points)} views and image_points {len(image_points)}; "
            "expected as many, three or more"
        )
    rows = []
    for left_out in range(len(object_points)):
        others = [[view for k, view in enumerate(views) if k != left_out] for views in (object_points, image_points)]
        camera = calibrate(*others).camera
        distances = held_out_distances(camera, object_points[left_out], image_points[left_out])
        f = next(iter(camera.parameters.values()))  # mm, or f_x in px
        rows.append((np.sqrt(np.mean(distances**2)), distances.mean(), f))
    return pd.DataFrame(rows, columns=["rms", "mean_distance", "focal_length"])


def coverage(
    image_points: Sequence[ArrayLike], image_size: tuple[int, int], cells: tuple[int, int] = (8, 6)
) -> NDArray[np.int_]:
    """Corners in each cell of a grid over the image; where there are none, the distortion is extrapolated.

    Parameters
    ----------
    image_points : sequence of (n, 2) array_like
        px, an entry a view.
    image_size : (int, int)
        Width and height, px.
    cells : (int, int)
        Columns and rows.

    Returns
    -------
    (rows, columns) int ndarray
        Its sum is less than the number of points if some lie outside the image.

    Raises
    ------
    ValueError
        If the input is unusable, or all points lie outside the image.

    Examples
    --------
    >>> coverage([[[10.0, 10.0], [90.0, 10.0]]], (100, 80), cells=(2, 2)).tolist()
    [[1, 1], [0, 0]]
    """
    if np.shape(cells) != (2,):
        raise ValueError(f"cells is {cells}; expected two whole numbers, columns and rows")
    if len(image_points) == 0:
        raise ValueError("image_points has no views; expected at least one")
    columns, rows = (as_count(count, "cells", 1) for count in cells)
    width, height = (as_number(length, "image_size", 1) for length in image_size)
    points = np.concatenate([as_points(view, 2, "image_points") for view in image_points])
    edges = np.linspace(-0.5, height - 0.5, rows + 1), np.linspace(-0.5, width - 0.5, columns + 1)
    counts = np.histogram2d(points[:, 1], points[:, 0], edges)[0].astype(int)
    if counts.sum() == 0:
        raise ValueError(f"image_points: all {len(points)} lie outside the image of {width:g} x {height:g} px")
    return counts


def radial_profile(calibration: Calibration, image_points: Sequence[ArrayLike], rings: int = 8) -> DataFrame:
    """Mean residual along the radius around the principal point, in rings: a wrong distortion model leaves a curve.

    Parameters
    ----------
    calibration : Calibration
    image_points : sequence of (n, 2) array_like
        The measured points that it was made from, px.
    rings : int
        Rings of equal numbers of points.

    Returns
    -------
    DataFrame
        radius (mean, px), residual (mean of projected minus measured along the radius, px), sigma (its standard error),
        count.

    Raises
    ------
    ValueError
        If there are fewer than `LEAST_IN_RING` points in a ring, so also where many have one radius, or other points
        than residuals.

    Examples
    --------
    >>> from pegpose_lab import calibrate_joint, paper, study
    >>> truth = paper.paper_experiment()
    >>> boards = [truth.board.object_points] * 5
    >>> images = [truth.camera.project(truth.board.object_points, pose) for pose in truth.cam_from_boards]
    >>> found = calibrate_joint(boards, images, truth.camera)
    >>> len(study.radial_profile(found, images, rings=4))
    4
    """
    from scipy.stats import binned_statistic  # here, because scipy.stats takes longest of all imports

    rings = as_count(rings, "rings", 1)
    if not calibration.residuals:
        raise ValueError("calibration has no residuals; it was read from a file that keeps the camera only")
    points, residuals = (np.concatenate(views) for views in (image_points, calibration.residuals))
    if len(points) != len(residuals) or len(points) < LEAST_IN_RING * rings:
        raise ValueError(
            f"image_points has {len(points)} points and the calibration {len(residuals)}; expected as many, and at least "
            f"{LEAST_IN_RING * rings} for {rings} rings"
        )
    arms = points - calibration.camera.principal_point
    radius = np.hypot(*arms.T)
    along = np.sum(arms * residuals, axis=1) / np.maximum(radius, 1e-9)
    edges = np.quantile(radius, np.linspace(0, 1, rings + 1))
    counts = np.histogram(radius, edges)[0] if np.all(np.diff(edges) > 1e-9) else np.zeros(rings)
    if counts.min() < LEAST_IN_RING:
        raise ValueError(f"image_points lie on too few radii for rings = {rings}; expected fewer rings or more places")
    statistics = {
        "radius": binned_statistic(radius, radius, "mean", edges)[0],
        "residual": binned_statistic(radius, along, "mean", edges)[0],
        "count": binned_statistic(radius, along, "count", edges)[0].astype(int),
    }
    spread = binned_statistic(radius, along, "std", edges)[0]
    statistics["sigma"] = spread / np.sqrt(np.maximum(statistics["count"] - 1, 1))
    return pd.DataFrame(statistics)[["radius", "residual", "sigma", "count"]]


def sensitivity(
    calibrate: Callable[..., Calibration],
    object_points: Sequence[ArrayLike],
    images: Mapping[str, Sequence[ArrayLike]],
) -> DataFrame:
    """How the calibration depends on the corner detector: each parameter by several detectors, beside its sigma.

    Parameters
    ----------
    calibrate : callable
        As for `leave_one_out`.
    object_points : sequence of (n, 3) array_like
        mm, an entry a view.
    images : dict of str to sequence of (n, 2) array_like
        The same corners, px, by the detectors' names; the first is what the others are compared with.

    Returns
    -------
    DataFrame
        A row for each detector: rms (px), the camera's parameters, and how many of the first one's sigmas each moved.

    Raises
    ------
    CalibrationError
        If one of them does not determine the camera.
    """
    rows, first = {}, None
    for name, image_points in images.items():
        found = calibrate(object_points, image_points)
        if found.covariance is None:
            raise CalibrationError("calibrate states no covariance; compare a joint or Zhang's calibration")
        names = [name for name in found.covariance.index if not re.search(r"_\d+$", name)]  # the camera's, no pose's
        values = np.array([found.camera.parameters[name] for name in names])
        first = (values, [found.sigma(column) for column in names]) if first is None else first
        moved = (values - first[0]) / first[1]
        by_name, moves = (dict(zip(names, numbers, strict=True)) for numbers in (values, moved))
        rows[name] = {"rms": found.rms, **by_name, **{f"{name} moved": move for name, move in moves.items()}}
    return pd.DataFrame(rows).T.rename_axis("detector").reset_index()
