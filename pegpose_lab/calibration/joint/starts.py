"""The start of the bundle adjustment: from homographies and Zhang's constraints on f, or from the linear stage 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ...camera import UNKNOWN_SIZE
from ...checks import CalibrationError, outside
from ..planes import is_planar
from ..two_stage.tsai import solve_coplanar, solve_noncoplanar
from .homographies import focal_length_of, homographies_of, plane_rotations, poses_of
from .orders import demand_order
from .views import State, evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .models import FisheyeModel, OpenCVModel, TsaiModel
    from .views import Views


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
    known = tuple(image_size) != UNKNOWN_SIZE
    for view, points in enumerate(image_points if known else ()):
        if outside(points, image_size).all():
            (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
            raise ValueError(
                f"image_points{f'[{view}]' * (len(image_points) > 1)} reach from ({left:.1f}, {top:.1f}) to "
                f"({right:.1f}, {bottom:.1f}) px, all outside the image of width {image_size[0]} and height "
                f"{image_size[1]} px; {_size_hint(view, image_points, image_size)}"
            )
    demand_order(object_points, image_points)


def _size_hint(view, image_points, image_size):
    """What may be wrong if all points of a view lie outside the image."""
    if not any(outside(points, image_size[::-1]).any() for points in image_points):
        return (
            f"they lie inside an image of {image_size[1]} x {image_size[0]} px: is image_size (width, height) swapped?"
        )
    others = [points for other, points in enumerate(image_points) if other != view]
    if others and np.mean([outside(points, image_size).any() for points in others]) < 0.5:
        return "the other views lie inside: is this picture of another size (resolution, crop) or another camera?"
    return "check image_size, and that image_points are of this camera"


def find_start(
    model: TsaiModel | OpenCVModel | FisheyeModel,
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
