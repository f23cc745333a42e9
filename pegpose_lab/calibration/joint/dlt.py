"""The direct linear transform of one view of a plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...camera import Sensor, TsaiCamera, as_sensor
from ...checks import CalibrationError, as_views, undetermined_if_singular
from ..planes import is_planar, relief
from ..result import MINIMUM_POINTS, Calibration
from .homographies import focal_length_of, homographies_of, plane_rotations, poses_of
from .starts import demand_views
from .views import State, Views


@undetermined_if_singular()
def calibrate_dlt(object_points: ArrayLike, image_points: ArrayLike, camera: Sensor | TsaiCamera) -> Calibration:
    """The direct linear transform of one view of a plane: homography, f by Zhang's two constraints, pose.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 5, all on one plane.
    image_points : (n, 2) array_like
        px.
    camera : Sensor or TsaiCamera
        Gives pixel pitch, scale_x, principal point and image size.

    Returns
    -------
    Calibration
        With kappa1 = 0.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If the view does not determine f, or no camera can give this image of the plane.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_dlt
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0).project(board, pose)
    >>> round(calibrate_dlt(board, image, sensor).camera.focal_length, 3)
    8.0
    """
    object_points, image_points = as_views([object_points], [image_points], MINIMUM_POINTS)
    sensor = as_sensor(camera)
    if not is_planar(object_points[0]):
        raise ValueError(
            f"object_points leave the plane through them by {100 * relief(object_points[0]):.2g} % of their width; "
            "expected a plane"
        )
    demand_views(object_points, image_points, sensor.image_size)
    views, planes = Views.stack(object_points, image_points), plane_rotations(object_points)
    homographies = homographies_of(views, planes, sensor)
    focal_length = focal_length_of(homographies)
    if focal_length is None:
        raise CalibrationError("the homography belongs to no camera with this principal point; tilt the board more")
    camera = sensor.camera(focal_length)
    pose = State(np.zeros(0), *poses_of(homographies, planes, focal_length)).poses(views)[0]
    residuals = camera.project(object_points[0], pose) - image_points[0]
    return Calibration(camera, [pose], [residuals], n_parameters=7)
