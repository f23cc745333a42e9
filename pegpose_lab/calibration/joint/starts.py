"""The start of the bundle adjustment: from homographies and Zhang's constraints on f, or from the linear stage 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...camera import UNKNOWN_SIZE
from ...checks import CalibrationError, outside
from ..planes import is_planar, plane_rotation
from ..two_stage.tsai import solve_coplanar, solve_noncoplanar
from .views import State, Views, evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...camera import Sensor
    from .models import OpenCVModel, TsaiModel

DISORDER = 0.25
"""The order of a plane's points is wrong if the residual of its homography, in units of the points' spread per axis, is
above this.  A wrong order leaves 0.3 to 0.8, distortion at most 0.07 and noise of a fifth of a square 0.2."""


def demand_views(
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
    image_size: tuple[int, int],
) -> None:
    """Refuse views whose points all lie outside the image (if its size is known) or are in the wrong order.

    Raises
    ------
    ValueError
        If all points of a view are outside; if only some are, `result.judge_image_size` flags them.
    CalibrationError
        See `demand_order`.
    """
    for view, points in enumerate(image_points if tuple(image_size) != UNKNOWN_SIZE else ()):
        if outside(points, image_size).all():
            (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
            raise ValueError(
                f"image_points{f'[{view}]' * (len(image_points) > 1)} reach from ({left:.1f}, {top:.1f}) to "
                f"({right:.1f}, {bottom:.1f}) px, all outside the image of width {image_size[0]} and height "
                f"{image_size[1]} px; check image_size, and that image_points are of this camera"
            )
    demand_order(object_points, image_points)


def demand_order(object_points: Sequence[NDArray[np.float64]], image_points: Sequence[NDArray[np.float64]]) -> None:
    """Refuse planes whose image points are not even roughly a perspective image: their order is wrong.

    Raises
    ------
    CalibrationError
        It names the views, counted from 0.
    """
    planar = [view for view, points in enumerate(object_points) if is_planar(points)]
    if not planar:
        return
    views = Views.stack(*([points[view] for view in planar] for points in (object_points, image_points)))
    planes = plane_rotations([object_points[view] for view in planar])
    left = _linear_homographies(views, planes, views.image)[1]
    wrong = [view for view, residual in zip(planar, left, strict=True) if residual > DISORDER]
    if wrong:
        which = "" if len(object_points) == 1 else f" of view{'s' * (len(wrong) > 1)} {', '.join(map(str, wrong))}"
        raise CalibrationError(
            f"the image points{which} are no image of the plane (a homography misses them by "
            f"{100 * max(left):.0f} % of their spread): they are not in the order of object_points; check the order, "
            "and that the board's columns and rows are not mixed up"
        )


def find_start(
    model: TsaiModel | OpenCVModel,
    views: Views,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
) -> State:
    """The state to start from: by homographies if all views are of planes and give an f, otherwise by stage 1."""
    matrix, focal_length = np.diag([*model.sensor.pixels_per_mm, 1.0]), None
    matrix[:2, 2] = model.sensor.principal_point
    if all(is_planar(points) for points in object_points):
        planes = plane_rotations(object_points)
        to_sensor = homographies_of(views, planes, model.sensor)
        focal_length = focal_length_of(to_sensor)
    if focal_length is not None:
        rotations, positions = poses_of(to_sensor, planes, focal_length)
        state = State(model.start(focal_length), rotations, positions)
        if evaluate(model, views, state) is not None:
            return state
    focal_length = _linear_focal_length(object_points, image_points, model.sensor)
    matrix = matrix @ np.diag([focal_length, focal_length, 1.0])
    poses = [
        pnp(points - centroid, measured, matrix)
        for points, measured, centroid in zip(object_points, image_points, views.centroids, strict=True)
    ]
    rotations = np.array([pose.rotation.as_matrix() for pose in poses])
    return State(model.start(focal_length), rotations, np.array([pose.translation for pose in poses]))


def plane_rotations(object_points: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Rotations (V, 3, 3) from the objects' frames into the frames of the planes through their points."""
    return np.array([plane_rotation(points) for points in object_points])


def homographies_of(views: Views, planes: NDArray[np.float64], sensor: Sensor) -> NDArray[np.float64]:
    """Homographies (V, 3, 3) from the planes (see `plane_rotations`; origin at the points' centroid) to the sensor in
    mm, by the normalised direct linear transform."""
    return _linear_homographies(views, planes, (views.image - sensor.principal_point) / sensor.pixels_per_mm)[0]


def _linear_homographies(views, planes, target):
    """Homographies (V, 3, 3) from planes to target points (V, m, 2), and the rms residual of each per axis, in units
    of the target points' spread per axis."""
    in_plane = views.points @ planes.transpose(0, 2, 1)
    source, from_plane = _normalised(in_plane[:, :, :2], views.used)
    target, from_target = _normalised(target, views.used)
    ones, zeros = views.used[:, :, None], np.zeros_like(source[:, :, :1])
    rows = np.concatenate([source, ones, zeros, zeros, zeros], axis=2)
    other = np.concatenate([zeros, zeros, zeros, source, ones], axis=2)
    plane = np.concatenate([source, ones], axis=2)
    design = np.concatenate(
        [
            np.concatenate([rows, -target[:, :, :1] * plane], axis=2),
            np.concatenate([other, -target[:, :, 1:] * plane], axis=2),
        ],
        axis=1,
    )
    values, vectors = np.linalg.eigh(design.transpose(0, 2, 1) @ design)
    left = np.sqrt(np.maximum(values[:, 0], 0) / views.used.sum(axis=1))
    return np.linalg.inv(from_target) @ vectors[:, :, 0].reshape(-1, 3, 3) @ from_plane, left


def _normalised(points, used):
    """Points scaled to mean 0 and mean square 2, zero where unused, and the matrices (V, 3, 3) that scale them."""
    count = used.sum(axis=1)
    mean = (points * used[:, :, None]).sum(axis=1) / count[:, None]
    points = (points - mean[:, None]) * used[:, :, None]
    scale = np.sqrt(2 * count / np.maximum((points**2).sum(axis=(1, 2)), 1e-300))
    matrix = np.zeros((len(points), 3, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = scale
    matrix[:, :2, 2], matrix[:, 2, 2] = -scale[:, None] * mean, 1
    return points * scale[:, None, None], matrix


def focal_length_of(homographies: NDArray[np.float64]) -> float | None:
    """f, mm, by least squares over Zhang's two constraints of each view: the columns h1, h2 of diag(1/f, 1/f, 1) H are
    orthogonal and of equal length.  None if no f fits."""
    h1, h2 = (homographies / np.linalg.norm(homographies, axis=(1, 2), keepdims=True)).transpose(2, 0, 1)[:2]
    lateral = np.concatenate([h1[:, :2] * h2[:, :2], (h1[:, :2] ** 2 - h2[:, :2] ** 2) / 2]).sum(axis=1)
    axial = np.concatenate([h1[:, 2] * h2[:, 2], (h1[:, 2] ** 2 - h2[:, 2] ** 2) / 2])
    inverse_square = -(lateral @ axial) / max(lateral @ lateral, 1e-300)
    return inverse_square**-0.5 if inverse_square > 0 else None


def poses_of(
    homographies: NDArray[np.float64], planes: NDArray[np.float64], focal_length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (V, 3, 3) of the objects and positions (V, 3) of their centroids, by the planes' homographies."""
    columns = np.diag([1 / focal_length, 1 / focal_length, 1.0]) @ homographies
    scale = (np.linalg.norm(columns[:, :, 0], axis=1) + np.linalg.norm(columns[:, :, 1], axis=1)) / 2
    columns = columns * (np.sign(columns[:, 2, 2]) / scale)[:, None, None]
    third = np.cross(columns[:, :, 0], columns[:, :, 1])
    left, _, right = np.linalg.svd(np.stack([columns[:, :, 0], columns[:, :, 1], third], axis=2))
    return left @ right @ planes, columns[:, :, 2]


def _linear_focal_length(object_points, image_points, sensor):
    """f, mm, by stage 1 of the view that has the smallest relative sigma of f."""
    found, reasons = [], []
    for points, measured in zip(object_points, image_points, strict=True):
        solve = solve_coplanar if is_planar(points) else solve_noncoplanar
        try:
            solution = solve(points, sensor.to_sensor(measured))
            found.append((solution.focal_length_sigma / solution.focal_length, solution.focal_length))
        except CalibrationError as error:
            reasons.append(str(error))
    if not found:
        raise CalibrationError(f"none of {len(object_points)} views determines f; of the first: {reasons[0]}")
    return min(found)[1]


def pnp(
    object_points: NDArray[np.float64], image_points: NDArray[np.float64], camera_matrix: NDArray[np.float64]
) -> RigidTransform:
    """Pose of one view in a camera without distortion, by OpenCV."""
    found, rotation, translation = cv2.solvePnP(
        object_points, image_points, camera_matrix, None, flags=cv2.SOLVEPNP_SQPNP
    )
    if not found or not np.isfinite([rotation, translation]).all():
        raise CalibrationError("OpenCV finds no pose for a view; check the order of its points")
    return RigidTransform.from_components(translation.ravel(), Rotation.from_rotvec(rotation.ravel()))
