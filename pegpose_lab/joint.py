"""Least squares of all views at once with the paper's camera model (Eq. 3), and what it leaves uncertain."""

from dataclasses import replace

import cv2
import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from .calibration import MINIMUM_POINTS, Calibration, covariance_table, judge_focal_length, pose_names
from .camera import demand_tsai, distort_radius, left_jacobian, max_undistorted_radius
from .checks import CalibrationError, as_views
from .tsai import is_planar, solve_coplanar, solve_noncoplanar


def calibrate_joint(object_points, image_points, camera, *, principal_point="free"):
    r"""Least squares of all views at once with the paper's camera model (Eq. 3).

    Minimises the sum of the squared signed x and y residuals (not of Eq. 7's distances, whose derivative
    jumps at zero) over f, kappa1, the principal point and the pose of each view, by
    `scipy.optimize.least_squares` with exact derivatives.  It starts at the view whose linear solution has
    the smallest relative sigma of f.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry a view.
    image_points : sequence of (n, 2) array_like
        px.
    camera : TsaiCamera
        Gives pixel pitch, image size, scale_x and the principal point to start from (or to keep).
    principal_point : {"free", "fixed"}
        Whether it is estimated.

    Returns
    -------
    Calibration
        With `covariance` of all parameters: ``focal_length``, ``kappa1``, ``c_x``, ``c_y`` if free, and for
        view v ``rx_v, ry_v, rz_v, tx_v, ty_v, tz_v``.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If no view determines f, as when all are fronto-parallel, or all of them together do not.
    """
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    demand_tsai(camera)
    if principal_point not in ("free", "fixed"):
        raise ValueError(f"principal_point is {principal_point!r}; expected 'free' or 'fixed'")
    problem = _JointProblem(object_points, image_points, camera, principal_point == "free")
    fitted = least_squares(
        problem.residuals, problem.start(), problem.jacobian, x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12
    )
    camera, poses = problem.unpack(fitted.x)
    covariance = problem.covariance(camera, poses, 2 * fitted.cost)
    residuals = [
        camera.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    flags = judge_focal_length(covariance, "focal_length", camera.focal_length, "mm")
    return Calibration(camera, poses, residuals, flags, covariance=covariance)


class _JointProblem:
    """Residuals and their derivatives for `calibrate_joint`.

    Parameters: f, kappa1, (c_x, c_y), then for each view a rotation vector about the camera's axes, applied
    after the starting rotation, and the position of the points' centroid, which the data determine far
    better than that of a distant origin.
    """

    def __init__(self, object_points, image_points, camera, free_principal_point):
        self.object_points, self.image_points, self.camera = object_points, image_points, camera
        self.names = ["focal_length", "kappa1", *("c_x", "c_y") * free_principal_point]
        self.centroids = [points.mean(axis=0) for points in object_points]
        self.start_rotations = None

    def start(self):
        """Starting parameters, kappa1 = 0; sets the rotations that the parameters turn."""
        focal_length = _linear_focal_length(self.object_points, self.image_points, self.camera)
        matrix = np.diag([*(focal_length * self.camera.pixels_per_mm), 1.0])
        matrix[:2, 2] = self.camera.principal_point
        views = zip(self.object_points, self.image_points, self.centroids, strict=True)
        poses = [_pnp(points - centroid, measured, matrix) for points, measured, centroid in views]
        self.start_rotations = [pose.rotation for pose in poses]
        intrinsics = [focal_length, 0.0, *self.camera.principal_point][: len(self.names)]
        return np.concatenate([intrinsics, *([0, 0, 0, *pose.translation] for pose in poses)])

    def residuals(self, parameters):
        """Signed residuals x, y, x, y, ... of all views, px; infinite where a point has no image."""
        intrinsics, blocks = self._split(parameters)
        projected = [
            _project(intrinsics, Rotation.from_rotvec(block[:3]).apply(start.apply(points - centroid)), block[3:])
            for points, centroid, start, block in self._views(blocks)
        ]
        return (np.concatenate(projected) - np.concatenate(self.image_points)).ravel()

    def jacobian(self, parameters):
        """Derivatives of `residuals` by all parameters."""
        intrinsics, blocks = self._split(parameters)
        pairs = []
        for points, centroid, start, block in self._views(blocks):
            turned = Rotation.from_rotvec(block[:3]).apply(start.apply(points - centroid))
            by_intrinsics, by_pose = _project_jacobian(intrinsics, turned, block[3:])
            by_pose[:, :3] = by_pose[:, :3] @ left_jacobian(block[:3])
            pairs.append((by_intrinsics[:, : len(self.names)], by_pose))
        return _assemble(pairs)

    def unpack(self, parameters):
        """Parameters as a camera and poses of the objects' own origins."""
        intrinsics, blocks = self._split(parameters)
        poses = []
        for _, centroid, start, block in self._views(blocks):
            rotation = Rotation.from_rotvec(block[:3]) * start
            poses.append(RigidTransform.from_components(block[3:] - rotation.apply(centroid), rotation))
        return intrinsics, poses

    def covariance(self, camera, poses, squared_sum):
        """Covariance of the parameters, translations being those of the objects' own origins."""
        pairs = [
            _project_jacobian(camera, pose.rotation.apply(points), pose.translation)
            for points, pose in zip(self.object_points, poses, strict=True)
        ]
        jacobian = _assemble([(by_intrinsics[:, : len(self.names)], by_pose) for by_intrinsics, by_pose in pairs])
        return covariance_table(jacobian, squared_sum, self.names + pose_names(len(poses)))

    def _split(self, parameters):
        """The camera and the (views, 6) pose blocks; a trial step to f <= 0 gets the smallest f there is."""
        count = len(self.names)
        focal_length, kappa1 = max(parameters[0], np.finfo(float).tiny), parameters[1]
        center = tuple(parameters[2:4]) if count == 4 else self.camera.principal_point
        camera = replace(self.camera, focal_length=focal_length, kappa1=kappa1, principal_point=center)
        return camera, parameters[count:].reshape(-1, 6)

    def _views(self, blocks):
        return zip(self.object_points, self.centroids, self.start_rotations, blocks, strict=True)


def _linear_focal_length(object_points, image_points, camera):
    """f, mm, of the view whose stage 1 has the smallest relative sigma of f."""
    found, reasons = [], []
    for points, measured in zip(object_points, image_points, strict=True):
        solve = solve_coplanar if is_planar(points) else solve_noncoplanar
        try:
            solution = solve(points, camera.to_sensor(measured))
            found.append((solution.focal_length_sigma / solution.focal_length, solution.focal_length))
        except CalibrationError as error:
            reasons.append(str(error))
    if not found:
        raise CalibrationError(f"none of {len(object_points)} views determines f; of the first: {reasons[0]}")
    return min(found)[1]


def _pnp(object_points, image_points, camera_matrix):
    """Pose of one view through an undistorted camera, by OpenCV."""
    found, rotation, translation = cv2.solvePnP(
        object_points, image_points, camera_matrix, None, flags=cv2.SOLVEPNP_SQPNP
    )
    if not found or not np.isfinite([rotation, translation]).all():
        raise CalibrationError("OpenCV finds no pose for a view; check the order of its points")
    return RigidTransform.from_components(translation.ravel(), Rotation.from_rotvec(rotation.ravel()))


def _project(camera, turned, translation):
    """Image points (n, 2) of points R p (n, 3) at a translation; infinite where there is no image."""
    points = turned + translation
    front = points[:, 2:] > 0
    undistorted = camera.focal_length * points[:, :2] / np.where(front, points[:, 2:], 1.0)
    radius = np.hypot(*undistorted.T)[:, None]
    distorted = distort_radius(radius, camera.kappa1)
    projected = camera.to_image(undistorted / (1 + camera.kappa1 * distorted**2))
    return np.where(front & (radius <= max_undistorted_radius(camera.kappa1)), projected, np.inf)


def _project_jacobian(camera, turned, translation):
    r"""Derivatives (2n, 4) by f, kappa1, c_x, c_y and (2n, 6) by a turn about the camera's axes and a shift.

    With :math:`h = 1 / (1 + \kappa_1 r_d^2)` and :math:`s = 1 + 3 \kappa_1 r_d^2`, Eq. 3 solved for
    :math:`x_d = h x_u` has :math:`dx_d/dx_u = h I - (2 \kappa_1 h^3 / s) x_u x_u^T` and
    :math:`dx_d/d\kappa_1 = -(h r_d^2 / s) x_u`.
    """
    points = turned + translation
    x_u = camera.focal_length * points[:, :2] / points[:, 2:]
    squared = distort_radius(np.hypot(*x_u.T), camera.kappa1)[:, None] ** 2
    h, s = 1 / (1 + camera.kappa1 * squared), 1 + 3 * camera.kappa1 * squared
    outer = x_u[:, :, None] * x_u[:, None, :]
    by_x_u = h[..., None] * np.eye(2) - (2 * camera.kappa1 * h**3 / s)[..., None] * outer
    by_x_u = camera.pixels_per_mm[:, None] * by_x_u
    by_focal_length = by_x_u @ x_u[:, :, None] / camera.focal_length
    by_kappa1 = (camera.pixels_per_mm * (-h * squared / s) * x_u)[:, :, None]
    by_center = np.broadcast_to(np.eye(2), (len(points), 2, 2))
    x_u_by_point = (
        np.concatenate(
            [np.broadcast_to(camera.focal_length * np.eye(2), (len(points), 2, 2)), -x_u[:, :, None]], axis=2
        )
        / points[:, 2, None, None]
    )
    by_shift = by_x_u @ x_u_by_point
    by_turn = np.cross(turned[:, None, :], by_shift)
    by_intrinsics = np.concatenate([by_focal_length, by_kappa1, by_center], axis=2)
    return by_intrinsics.reshape(-1, 4), np.concatenate([by_turn, by_shift], axis=2).reshape(-1, 6)


def _assemble(pairs):
    """One Jacobian from each view's derivatives by the shared parameters and by its own pose."""
    shared, own = zip(*pairs, strict=True)
    return np.hstack([np.concatenate(shared), block_diag(*own)])
