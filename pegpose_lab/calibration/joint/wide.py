"""The start of the bundle adjustment for a wide lens, whose distortion a homography cannot follow.

A wide lens is nearly equidistant, whatever its model: a point at the angle t to the axis is at about f t.  For a set of f
the image points become rays, the rays give the poses, and the coefficients follow by linear least squares.  The start is
the one that fits the views best.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...camera import FisheyeCamera, equidistant
from ...checks import CalibrationError
from .models import FisheyeModel, TsaiModel
from .starts import find_start, pnp
from .views import State, evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .models import OpenCVModel
    from .views import Views

WIDE = 0.02
"""The other starts are tried if the first one misses the points by more than this fraction of their spread: distortion
of 0.1 at the picture's edge is at the limit."""

HALF_ANGLES = np.radians([20, 28, 36, 44, 52, 60, 68, 76, 84])
"""Angles to the axis that the outermost point may have."""


def find_any_start(
    model: TsaiModel | OpenCVModel | FisheyeModel,
    views: Views,
    object_points: Sequence[NDArray[np.float64]],
    image_points: Sequence[NDArray[np.float64]],
) -> State:
    """The state to start from: that of `starts.find_start`, unless the lens is wide and another fits better."""
    found = []
    try:
        state = find_start(model, views, object_points, image_points)
        spread = np.sum(views.used[..., None] * (views.image - model.sensor.principal_point) ** 2)
        cost = _cost(model, views, state)
        if cost < WIDE**2 * spread and not isinstance(model, FisheyeModel):
            return state
        found.append((cost, state))
    except CalibrationError:
        if not isinstance(model, FisheyeModel):  # its reason is the better one: views that do not determine f
            raise
    radius = np.linalg.norm((views.image - model.sensor.principal_point) / model.sensor.pixels_per_mm, axis=2)
    for angle in HALF_ANGLES:
        state = _equidistant_start(model, views, object_points, image_points, radius[views.used > 0].max() / angle)
        if state is not None:
            state = with_coefficients(model, views, state)
            found.append((_cost(model, views, state), state))
    if not found or not np.isfinite(min(cost for cost, _ in found)):
        raise CalibrationError("no start sees all points; check their order")
    return min(found, key=lambda entry: entry[0])[1]


def _cost(model, views, state):
    """Sum of the squared residuals; infinite if a point has no image."""
    evaluated = evaluate(model, views, state)
    return np.inf if evaluated is None else float(np.sum(views.used[..., None] * evaluated[0] ** 2))


def _equidistant_start(model, views, object_points, image_points, focal_length):
    """The state without distortion of an f, mm, with the poses of an equidistant lens; None if a view has none."""
    matrix = np.diag([*(focal_length * model.sensor.pixels_per_mm), 1.0])
    matrix[:2, 2] = model.sensor.principal_point
    camera = FisheyeCamera(matrix, np.zeros(4))
    try:
        poses = [
            pnp(points - centroid, camera.to_normalized(measured), np.eye(3))
            for points, measured, centroid in zip(object_points, image_points, views.centroids, strict=True)
        ]
    except (CalibrationError, ValueError):
        return None
    rotations = np.array([pose.rotation.as_matrix() for pose in poses])
    return State(model.start(focal_length), rotations, np.array([pose.translation for pose in poses]))


def with_coefficients(model: TsaiModel | OpenCVModel | FisheyeModel, views: Views, state: State) -> State:
    """The state with the radial coefficients that fit the views best at its poses, f and principal point.

    They follow from linear least squares; for a ratio of polynomials that of its numerator, less the measured radius times
    its denominator.  The state itself is returned if a point then has no image.
    """
    camera = model.camera(state.shared)
    seen = views.points @ state.rotations.transpose(0, 2, 1) + state.positions[:, None]
    points, image = seen[views.used > 0], views.image[views.used > 0]
    if points[:, 2].min() <= 0:
        return state
    normalized = points[:, :2] / points[:, 2:]
    radius = np.hypot(*normalized.T)
    unit = normalized / np.where(radius > 0, radius, 1)[:, None]
    if isinstance(model, TsaiModel):
        focal, center = camera.focal_length * camera.pixels_per_mm, np.array(camera.principal_point)
    else:
        focal, center, _ = model.split(state.shared)
    measured = np.sum((image - center) / focal * unit, axis=1)
    if isinstance(model, TsaiModel):
        powers = (measured**3)[:, None] * camera.focal_length**2
        kappa1 = np.linalg.lstsq(powers, radius - measured, rcond=None)[0][0]
        values = [camera.focal_length, camera.scale_x, kappa1, *center]
        return _usable(model, views, state, model.values(values))
    coefficients = np.zeros(len(model.every))
    if isinstance(model, FisheyeModel):
        angle = np.arctan(radius)
        columns, target = angle[:, None] ** [3, 5, 7, 9], measured - equidistant(angle, coefficients)[0]
        radial = ("k1", "k2", "k3", "k4")
    else:
        powers = radius[:, None] ** [2, 4, 6]
        columns, target = np.hstack([radius[:, None] * powers, -measured[:, None] * powers]), measured - radius
        radial = ("k1", "k2", "k3", "k4", "k5", "k6")
    free = [k for k, name in enumerate(radial) if name in model.coefficient_names]
    if not free:
        return state
    scale = np.linalg.norm(columns[:, free], axis=0)
    fitted = np.linalg.lstsq(columns[:, free] / scale, target, rcond=1e-9)[0] / scale
    coefficients[[model.every.index(radial[k]) for k in free]] = fitted
    return _usable(model, views, state, model.values(focal, center, coefficients))


def _usable(model, views, state, shared):
    """The state with these parameters, if that fits better."""
    trial = State(shared, state.rotations, state.positions)
    return trial if _cost(model, views, trial) < _cost(model, views, state) else state
