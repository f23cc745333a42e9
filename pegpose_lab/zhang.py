"""Zhang's calibration from several views of a plane, by OpenCV: the paper's rival (Sect. 5)."""

import cv2
import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import RigidTransform, Rotation

from .calibration import MINIMUM_POINTS, Calibration, covariance_table, judge_focal_length, pose_names
from .camera import OpenCVCamera, left_jacobian
from .checks import CalibrationError, as_number, as_views


def calibrate_zhang(object_points, image_points, image_size, *, radial=2, tangential=False):
    r"""Zhang's calibration from several views of a plane, by `cv2.calibrateCamera`.

    Free are f_x, f_y, c_x, c_y and `radial` coefficients k1, k2, ...  Two radial ones and no tangential ones
    are what Zhang (2000) estimates and publishes.  ``radial=1`` is the paper's model but for its direction;
    ``tangential=True`` adds p1, p2 as the MATLAB toolbox does.  OpenCV's own default frees k3 as well, which
    an ordinary lens does not determine: it grows to compensate k2.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry a view, each in a plane z = 0.
    image_points : sequence of (n, 2) array_like
        px.
    image_size : (int, int)
        Width and height, px.
    radial : int
        Number of radial coefficients, 0 to 3.
    tangential : bool
        Free the two tangential coefficients, too.

    Returns
    -------
    Calibration
        With `OpenCVCamera` and `covariance`.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If there are fewer than two views, or they do not differ enough in their tilt.
    """
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    if any(np.any(points[:, 2] != 0) for points in object_points):
        raise ValueError("object_points has z other than 0; expected each board in its own frame, z = 0")
    if as_number(radial, "radial", 0, 3) != int(radial):
        raise ValueError(f"radial is {radial}; expected 0, 1, 2 or 3")
    if len(object_points) < 2:
        raise CalibrationError("one view of a plane gives two constraints on f_x, f_y, c_x, c_y; add tilted views")
    camera, poses = _opencv_calibration(object_points, image_points, image_size, int(radial), tangential)
    residuals = [
        camera.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    free = ["f_x", "f_y", "c_x", "c_y", *("k1", "k2")[: int(radial)], *("p1", "p2") * bool(tangential)]
    free += ["k3"] * (radial == 3)
    views = zip(object_points, poses, strict=True)
    jacobian = _assemble([_opencv_jacobian(camera, points, pose, free) for points, pose in views])
    squared_sum = sum(np.sum(view**2) for view in residuals)
    covariance = covariance_table(jacobian, squared_sum, free + pose_names(len(poses)))
    flags = judge_focal_length(covariance, "f_x", camera.camera_matrix[0, 0], "px", np.subtract(*jacobian.shape))
    return Calibration(camera, poses, residuals, flags, covariance=covariance)


def _opencv_calibration(object_points, image_points, image_size, radial, tangential):
    """`cv2.calibrateCamera` as an `OpenCVCamera` and poses."""
    flags = 0 if tangential else cv2.CALIB_ZERO_TANGENT_DIST
    for fixed in (cv2.CALIB_FIX_K1, cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K3)[radial:]:
        flags |= fixed
    size = OpenCVCamera(np.eye(3), np.zeros(5), image_size).image_size
    try:
        _, matrix, coefficients, rotations, translations = cv2.calibrateCamera(
            [points.astype(np.float32) for points in object_points],
            [points.astype(np.float32) for points in image_points],
            size,
            None,
            None,
            flags=flags,
        )
        camera = OpenCVCamera(matrix, np.ravel(coefficients)[:5], size)
    except (cv2.error, ValueError) as error:
        raise CalibrationError(f"OpenCV finds no camera; add views of other tilts ({error})") from error
    poses = [
        RigidTransform.from_components(np.ravel(translation), Rotation.from_rotvec(np.ravel(rotation)))
        for rotation, translation in zip(rotations, translations, strict=True)
    ]
    return camera, poses


def _opencv_jacobian(camera, object_points, pose, free):
    """Derivatives (2n, k) and (2n, 6) of the projection by the free intrinsics and by the pose (see `_turn`)."""
    rotation_vector = pose.rotation.as_rotvec()
    jacobian = cv2.projectPoints(
        object_points, rotation_vector, pose.translation, camera.camera_matrix, camera.dist_coeffs
    )[1]
    columns = ["f_x", "f_y", "c_x", "c_y", "k1", "k2", "p1", "p2", "k3"]
    by_rotation = jacobian[:, :3] @ np.linalg.inv(left_jacobian(rotation_vector))
    intrinsics = jacobian[:, 6:][:, [columns.index(name) for name in free]]
    return intrinsics, np.hstack([by_rotation, jacobian[:, 3:6]])


def _assemble(pairs):
    """One Jacobian from each view's derivatives by the shared parameters and by its own pose."""
    shared, own = zip(*pairs, strict=True)
    return np.hstack([np.concatenate(shared), block_diag(*own)])
