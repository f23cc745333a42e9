r"""Least squares of all views at once, and what it leaves uncertain.

The unknowns are the camera's parameters, shared by all views, and six numbers of each view's pose.  A view's pose
meets no other, so the normal equations have the shape of an arrow,

.. math:: \begin{pmatrix} A & B \\ B^T & C \end{pmatrix}, \qquad C = \mathrm{diag}(C_1, \dots, C_V),

and eliminating the poses leaves the Schur complement :math:`S = A - \sum_v B_v C_v^{-1} B_v^T`, as small as
the camera has parameters: time and memory grow linearly with the number of views.  S is also the information that the
views have about the camera when nothing is known of their poses; its smallest eigenvalue says if they determine it.

What the residuals' noise does to S is judged too.  A view's tilt makes its information about f; where the tilt is no
larger than its own noise, the noise makes it, more so with every view, and f is wrong by many of its stated sigmas.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pandas as pd
from scipy import stats
from scipy.spatial.transform import RigidTransform, Rotation

from .calibration import MINIMUM_POINTS, Calibration, judge_focal_length, judge_principal_point, pose_names
from .camera import OpenCVCamera, demand_tsai, distort_radius, max_undistorted_radius
from .checks import CalibrationError, as_number, as_views
from .tsai import SMALL_TILT, TILT_SIGNIFICANCE, is_planar, solve_coplanar, solve_noncoplanar

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3")
"""OpenCV's distortion coefficients in OpenCV's order."""

MAX_STEPS = 200
SMALL_STEP = 1e-7
"""Length of a step, in standard deviations, after which none is needed."""

NEAR = 1e-3
"""Length of the full step, in sigmas, within which a state is a minimum though rounding forbids the step."""

SMALLEST_RMS = 1e-9
"""px; points without noise are not fitted any better than this."""

LEAST_INFORMATION = 1e-11
"""Smallest eigenvalue of S, scaled by A's diagonal: the part of the information that unknown poses leave."""

HUBER, CAUCHY = 1.501, 2.549
"""Where the robust losses of a point's distance bend, in standard deviations per axis: with many points to a parameter
the variance is 1/0.95 of least squares' for errors that are normal in x and y (1.345 and 2.385 are for one axis)."""

ROBUST_ROUNDS = 50
SMALL_ROUND = 1e-3
"""Length of a round's step, in standard deviations, after which no more are needed."""

LITTLE_WORTH = 0.05
"""Relative sigma of f times the root of the number of views, above which the information about f is put to the test."""

FLAGGED_SHARE, REFUSED_SHARE = 0.03, 0.1
"""Parts of the information about f that the noise makes, from which it is flagged and refused."""

LEAST_RISE = 25.0
"""Variances by which the sum of squares must grow when f is changed by one of `OTHER_FACTORS`."""

OTHER_FACTORS = (1 / 2, 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64)
"""Most are below 1: noise on little tilt makes f too large, up to a hundred times."""

PROFILED, PROFILE_STEP = 20.0, 0.05
"""How far from the best f its profile is followed, as a factor, and in which steps of ln f."""

POSE_STEPS = 8
"""Gauss-Newton steps of `board_pose`: from OpenCV's answer two or three are enough."""


def calibrate_joint(
    object_points, image_points, camera, *, principal_point="free", focal="one", coefficients=None, loss="linear"
):
    r"""Least squares of all views at once, with the paper's camera model (Eq. 3) or OpenCV's.

    Minimises the sum of the squared signed x and y residuals (not of Eq. 7's distances, whose derivative
    jumps at zero) over the camera's parameters and the pose of each view, by Levenberg and Marquardt's method
    with exact derivatives.  It starts at the f of the views' homographies, or at the view whose linear solution
    (stage 1) has the smallest relative sigma of f.

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
    focal : {"one", "two"}
        One f; or two, f_x and f_y in px.  With the paper's model the second is scale_x, Tsai's uncertainty factor.
    coefficients : sequence of str, optional
        None: the paper's model, with kappa1.  Else OpenCV's distorting model with these of `COEFFICIENTS` free and
        the others zero, none of them for a camera without distortion; the result is an `OpenCVCamera`.
    loss : {"linear", "huber", "cauchy"}
        What a point's distance costs.  The two robust losses bend at `HUBER` and `CAUCHY` standard deviations (by
        the median of the distances), so that single wrong corners hardly count.

    Returns
    -------
    Calibration
        With `covariance` of all parameters: ``focal_length`` (mm), ``scale_x``, ``kappa1``, ``c_x``, ``c_y`` as far as
        they are free, or ``f_x``, ``f_y`` (or ``f_x`` for both), ``c_x``, ``c_y`` and the coefficients; and for
        view v ``rx_v, ry_v, rz_v, tx_v, ty_v, tz_v``.  A robust loss's is that of M-estimation (`_robust_variance`).
        `flags` say it when planes are tilted by less than `SMALL_TILT`, or f or the principal point is hardly known.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If the views do not determine f, as when all are fronto-parallel as far as the noise can tell, or not all
        parameters together, or no minimum is found.
    """
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    demand_tsai(camera)
    _demand(principal_point, "principal_point", ("free", "fixed"))
    _demand(focal, "focal", ("one", "two"))
    _demand(loss, "loss", ("linear", "huber", "cauchy"))
    model = _model(camera, principal_point == "free", focal == "two", coefficients)
    fit = _fit(model, object_points, image_points, loss)
    flags = _judge(fit, object_points)
    found, poses = model.camera(fit.state.shared), fit.state.poses(fit.views)
    residuals = [
        found.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    return Calibration(found, poses, residuals, flags, covariance=fit.covariance)


def profile_focal_length(object_points, image_points, camera, *, principal_point="free", level=0.95):
    r"""The interval of f by its profile likelihood: all f with which the views can be explained nearly as well.

    For each f the sum of squares is minimised over everything else; f belongs to the interval while

    .. math:: SSE(f) \le SSE_{min} \left(1 + \frac{F_{level}(1, \nu)}{\nu}\right)

    with :math:`\nu` degrees of freedom.  Unlike +-1.96 sigma it need not be symmetric, and is right where f trades
    off with T_z along a curve.

    Parameters
    ----------
    object_points, image_points, camera, principal_point
        As for `calibrate_joint`; one view will do.
    level : float
        Between 0 and 1.

    Returns
    -------
    low, high : float
        mm.  0 or infinity where the interval does not end within a factor `PROFILED` of the best f.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        As `calibrate_joint`, but not because the interval is wide.
    """
    level = as_number(level, "level", 0, 1, exclusive=True)
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    demand_tsai(camera)
    _demand(principal_point, "principal_point", ("free", "fixed"))
    fit = _fit(_model(camera, principal_point == "free", False, None), object_points, image_points)
    _demand_tilt(fit, object_points)
    _demand_signal(fit)
    limit = fit.equations.cost * (1 + stats.f.ppf(level, 1, fit.freedom) / fit.freedom)
    best, ends = fit.state.shared[0], []
    for direction in (-1, 1):
        state, inside, factor = fit.state, best, np.exp(direction * PROFILE_STEP)
        while True:
            outside = inside * factor
            if not 1 / PROFILED < outside / best < PROFILED:
                ends.append(0.0 if direction < 0 else np.inf)
                break
            cost, found = _profile(fit, outside, state)
            if cost > limit:
                ends.append(_crossing(fit, state, outside, limit))
                break
            state, inside = found, outside
    return tuple(ends)


def _profile(fit, focal_length, near):
    """The smallest sum of squares with a given f, and where it is, found from the state of a near f."""
    model, state = _with_focal_length(fit, focal_length, near)
    state, equations = _minimise(model, fit.views, state, fit.weights)
    return equations.cost, replace(state, shared=np.array([focal_length, *state.shared]))


def _with_focal_length(fit, focal_length, near):
    """The model with a given f (or f_x), and the state of a near f with the depths changed as f is."""
    depth = focal_length / near.shared[0]
    state = _State(near.shared[1:], near.rotations, near.positions * [1, 1, depth])
    return _GivenFocalLength(fit.model, focal_length), state


def _crossing(fit, state, outside, limit):
    """f between a state's and another at which the smallest sum of squares passes the limit, by bisection in ln f."""
    while abs(np.log(outside / state.shared[0])) > 1e-5:
        middle = np.sqrt(state.shared[0] * outside)
        cost, found = _profile(fit, middle, state)
        if cost > limit:
            outside = middle
        else:
            state = found
    return float(np.sqrt(state.shared[0] * outside))


def board_pose(object_points, image_points, camera):
    """Pose of one object through a known camera: least squares over the image points.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 4; of a plane, or not.
    image_points : (n, 2) array_like
        px.
    camera : TsaiCamera or OpenCVCamera

    Returns
    -------
    RigidTransform
        cam_from_object.

    Raises
    ------
    ValueError
        If the input is unusable, or points lie on a line: any turn about it is possible.
    CalibrationError
        If no pose is found.
    """
    (object_points,), (image_points,) = as_views([object_points], [image_points], 4)
    pose = _pnp(object_points, camera.to_normalized(image_points), np.eye(3))
    if isinstance(camera, OpenCVCamera):
        lens = camera.camera_matrix, camera.dist_coeffs
        start = pose.rotation.as_rotvec(), pose.translation
        rotation, translation = cv2.solvePnPRefineLM(object_points, image_points, *lens, *start)
        return RigidTransform.from_components(translation.ravel(), Rotation.from_rotvec(rotation.ravel()))
    model, views = _TsaiModel(camera, False, False), _Views.stack([object_points], [image_points])
    shared = np.array([camera.focal_length, camera.kappa1])
    rotation, position = pose.rotation.as_matrix(), pose.apply(views.centroids)
    state = _State(shared, rotation[None], position)
    for _ in range(POSE_STEPS):
        evaluated = _evaluate(model, views, state)
        if evaluated is None:
            raise CalibrationError("no pose sees all points; check their order")
        residuals, jacobian = evaluated
        step = np.linalg.lstsq(jacobian[..., 2:].reshape(-1, 6), -residuals.ravel(), rcond=None)[0]
        state = state.moved(0.0, step[None, :3], step[None, 3:])
    return state.poses(views)[0]


def calibrate_dlt(object_points, image_points, camera):
    """The direct linear transform of one view of a plane: homography, f by Zhang's two constraints, pose.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 5, of one z.
    image_points : (n, 2) array_like
        px.
    camera : TsaiCamera
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
        If the view does not determine f, or no camera sees the plane so.
    """
    object_points, image_points = as_views([object_points], [image_points], MINIMUM_POINTS)
    demand_tsai(camera)
    if not is_planar(object_points[0]):
        raise ValueError("object_points differ in z; expected a plane")
    views = _Views.stack(object_points, image_points)
    homographies = _homographies(views, camera)
    focal_length = _focal_length_of(homographies)
    if focal_length is None:
        raise CalibrationError("the homography belongs to no camera with this principal point; tilt the board more")
    camera = replace(camera, focal_length=focal_length, kappa1=0.0)
    pose = _State(np.zeros(0), *_poses_of(homographies, focal_length)).poses(views)[0]
    return Calibration(camera, [pose], [camera.project(object_points[0], pose) - image_points[0]])


# --- camera models: shared parameters, the camera, and the projection with its derivatives ------------------


def _model(camera, free_center, two_focal_lengths, coefficients):
    if coefficients is None:
        return _TsaiModel(camera, free_center, two_focal_lengths)
    coefficients = tuple(coefficients) if np.iterable(coefficients) else (coefficients,)
    if set(coefficients) - set(COEFFICIENTS) or len(set(coefficients)) < len(coefficients):
        raise ValueError(f"coefficients is {coefficients}; expected each once, of {', '.join(COEFFICIENTS)}")
    return _OpenCVModel(camera, free_center, two_focal_lengths, coefficients)


class _TsaiModel:
    """The paper's camera: f, (scale_x), kappa1, (c_x, c_y)."""

    unit = "mm"

    def __init__(self, camera, free_center, two_focal_lengths):
        self.start_camera = camera
        free = [True, two_focal_lengths, True, free_center, free_center]
        self.names = [name for name, kept in zip(("focal_length", "scale_x", "kappa1", "c_x", "c_y"), free) if kept]
        self.columns = np.flatnonzero(free)

    def start(self, focal_length):
        values = [focal_length, self.start_camera.scale_x, 0.0, *self.start_camera.principal_point]
        return np.array(values)[self.columns]

    def _values(self, shared):
        values = [self.start_camera.focal_length, self.start_camera.scale_x, 0.0, *self.start_camera.principal_point]
        for column, value in zip(self.columns, shared, strict=True):
            values[column] = value
        return values

    def camera(self, shared):
        focal_length, scale_x, kappa1, *center = self._values(shared)
        return replace(
            self.start_camera, focal_length=focal_length, scale_x=scale_x, kappa1=kappa1, principal_point=tuple(center)
        )

    def project(self, shared, points):
        r"""Image points (n, 2) of points in the camera frame, and derivatives by the parameters and by the point.

        None where a point has no image.  With :math:`h = 1 / (1 + \kappa_1 r_d^2)` and
        :math:`s = 1 + 3 \kappa_1 r_d^2`, Eq. 3 solved for :math:`x_d = h x_u` has
        :math:`dx_d/dx_u = h I - (2 \kappa_1 h^3 / s) x_u x_u^T` and
        :math:`dx_d/d\kappa_1 = -(h r_d^2 / s) x_u`.
        """
        if min(self._values(shared)[:2]) <= 0 or points[:, 2].min() <= 0:
            return None
        camera = self.camera(shared)
        x_u = camera.focal_length / points[:, 2:] * points[:, :2]
        radius = np.hypot(*x_u.T)
        if radius.max() > max_undistorted_radius(camera.kappa1):
            return None
        squared = distort_radius(radius, camera.kappa1)[:, None] ** 2
        h, s = 1 / (1 + camera.kappa1 * squared), 1 + 3 * camera.kappa1 * squared
        if s.min() <= 0:
            return None
        scale = camera.pixels_per_mm
        by_x_u = (-2 * camera.kappa1 * h**3 / s)[:, :, None] * x_u[:, :, None] * x_u[:, None, :]
        by_x_u[:, (0, 1), (0, 1)] += h
        by_x_u *= scale[:, None]
        x_d = h * x_u
        by_shared = np.zeros((len(points), 2, 5))
        by_shared[:, :, 0] = (by_x_u @ x_u[:, :, None])[:, :, 0] / camera.focal_length
        by_shared[:, 0, 1] = x_d[:, 0] * scale[0] / camera.scale_x
        by_shared[:, :, 2] = scale * (-h * squared / s) * x_u
        by_shared[:, 0, 3] = by_shared[:, 1, 4] = 1
        return camera.to_image(x_d), by_shared[:, :, self.columns], _by_point(by_x_u, x_u, camera.focal_length, points)


class _OpenCVModel:
    """OpenCV's camera: f_x, (f_y), (c_x, c_y) and coefficients that distort."""

    unit = "px"

    def __init__(self, camera, free_center, two_focal_lengths, coefficients):
        self.start_camera, self.two, self.free_center = camera, two_focal_lengths, free_center
        self.aspect = camera.pixels_per_mm[1] / camera.pixels_per_mm[0]
        self.coefficients = [COEFFICIENTS.index(name) for name in coefficients]
        self.names = ["f_x", *["f_y"] * two_focal_lengths, *("c_x", "c_y") * free_center, *coefficients]

    def start(self, focal_length):
        f_x, f_y = focal_length * self.start_camera.pixels_per_mm
        center = self.start_camera.principal_point if self.free_center else ()
        return np.array([f_x, *[f_y] * self.two, *center, *[0.0] * len(self.coefficients)])

    def _split(self, shared):
        """f_x and f_y, the principal point, and all five coefficients."""
        shared, coefficients = list(shared), np.zeros(5)
        f_x = shared.pop(0)
        f_y = shared.pop(0) if self.two else f_x * self.aspect
        center = (shared.pop(0), shared.pop(0)) if self.free_center else self.start_camera.principal_point
        coefficients[self.coefficients] = shared
        return np.array([f_x, f_y]), np.array(center), coefficients

    def camera(self, shared):
        focal, center, coefficients = self._split(shared)
        matrix = np.diag([*focal, 1.0])
        matrix[:2, 2] = center
        return OpenCVCamera(matrix, coefficients, self.start_camera.image_size)

    def project(self, shared, points):
        """As `_TsaiModel.project`."""
        focal, center, (k1, k2, p1, p2, k3) = self._split(shared)
        if focal.min() <= 0 or points[:, 2].min() <= 0:
            return None
        x, y = normalized = points[:, :2].T / points[:, 2]
        r2 = x * x + y * y
        radial, slope = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), k1 + r2 * (2 * k2 + r2 * 3 * k3)
        x_d = radial * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        y_d = radial * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
        by_normalized = np.empty((len(points), 2, 2))
        by_normalized[:, 0, 0] = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
        by_normalized[:, 1, 1] = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
        by_normalized[:, 0, 1] = by_normalized[:, 1, 0] = mixed
        by_coefficients = np.stack([
            [x * r2, x * r2**2, 2 * x * y, r2 + 2 * x * x, x * r2**3],
            [y * r2, y * r2**2, r2 + 2 * y * y, 2 * x * y, y * r2**3],
        ]).transpose(2, 0, 1)[:, :, self.coefficients]
        by_focal = np.zeros((len(points), 2, 2))
        by_focal[:, 0, 0], by_focal[:, 1, 1] = x_d, y_d
        if not self.two:
            by_focal = by_focal @ np.array([[1.0], [self.aspect]])
        by_center = np.broadcast_to(np.eye(2), (len(points), 2, 2))[:, :, : 2 * self.free_center]
        by_shared = np.concatenate([by_focal, by_center, by_coefficients * focal[:, None]], axis=2)
        by_point = _by_point(by_normalized * focal[:, None], normalized.T, 1.0, points)
        return np.column_stack([x_d, y_d]) * focal + center, by_shared, by_point


class _GivenFocalLength:
    """One of the models without its first parameter, f or f_x."""

    def __init__(self, model, focal_length):
        self.model, self.focal_length, self.names = model, focal_length, model.names[1:]

    def project(self, shared, points):
        """As `_TsaiModel.project`."""
        projection = self.model.project([self.focal_length, *shared], points)
        if projection is None:
            return None
        image, by_shared, by_point = projection
        return image, by_shared[:, :, 1:], by_point


def _by_point(by_x_u, x_u, focal_length, points):
    """Derivatives (n, 2, 3) by the point in the camera frame, from those by x_u = f (x, y) / z."""
    by_point = np.empty((len(points), 2, 3))
    by_point[:, :, :2] = focal_length * by_x_u
    by_point[:, :, 2] = -(by_x_u @ x_u[:, :, None])[:, :, 0]
    return by_point / points[:, 2, None, None]


# --- views and poses ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Views:
    """All views' points (V, m, 3) from their centroids (V, 3), their images (V, m, 2), and 1 where there is one."""

    points: np.ndarray
    centroids: np.ndarray
    image: np.ndarray
    used: np.ndarray

    @classmethod
    def stack(cls, object_points, image_points):
        shape = len(object_points), max(len(points) for points in object_points)
        points, image, used = np.zeros((*shape, 3)), np.zeros((*shape, 2)), np.zeros(shape)
        centroids = np.array([points.mean(axis=0) for points in object_points])
        for view, (p, q) in enumerate(zip(object_points, image_points, strict=True)):
            points[view, : len(p)], image[view, : len(p)], used[view, : len(p)] = p - centroids[view], q, 1
        return cls(points, centroids, image, used)


@dataclass(frozen=True)
class _State:
    """Parameters: the camera's, and each view's rotation (V, 3, 3) and position (V, 3) of the centroid.

    The data determine the centroid's position far better than that of a distant origin.
    """

    shared: np.ndarray
    rotations: np.ndarray
    positions: np.ndarray

    def moved(self, shared, turns, shifts):
        """After a step; `turns` (V, 3) are rotation vectors about the camera's axes, applied after the rotation."""
        rotations = Rotation.from_rotvec(turns).as_matrix() @ self.rotations
        return _State(self.shared + shared, rotations, self.positions + shifts)

    def poses(self, views):
        """Poses of the objects' own origins."""
        origins = self.positions - np.einsum("vij,vj->vi", self.rotations, views.centroids)
        return [
            RigidTransform.from_components(origin, Rotation.from_matrix(rotation))
            for origin, rotation in zip(origins, self.rotations, strict=True)
        ]


def _start(model, views, object_points, image_points):
    """Where to start: from homographies if the views are of planes and these give an f, else from stage 1."""
    camera = model.start_camera
    matrix, focal_length = np.diag([*camera.pixels_per_mm, 1.0]), None
    matrix[:2, 2] = camera.principal_point
    if all(is_planar(points) for points in object_points):
        sensor = _homographies(views, camera)
        focal_length = _focal_length_of(sensor)
    if focal_length is not None:
        rotations, positions = _poses_of(sensor, focal_length)
        state = _State(model.start(focal_length), rotations, positions)
        if _evaluate(model, views, state) is not None:
            return state
    focal_length = _linear_focal_length(object_points, image_points, camera)
    matrix = matrix @ np.diag([focal_length, focal_length, 1.0])
    poses = [
        _pnp(points - centroid, measured, matrix)
        for points, measured, centroid in zip(object_points, image_points, views.centroids, strict=True)
    ]
    rotations = np.array([pose.rotation.as_matrix() for pose in poses])
    return _State(model.start(focal_length), rotations, np.array([pose.translation for pose in poses]))


def _homographies(views, camera):
    """Homographies (V, 3, 3) from the planes to the sensor, mm, by the normalised direct linear transform."""
    sensor = (views.image - camera.principal_point) / camera.pixels_per_mm
    source, from_plane = _normalised(views.points[:, :, :2], views.used)
    target, from_sensor = _normalised(sensor, views.used)
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
    smallest = np.linalg.eigh(design.transpose(0, 2, 1) @ design)[1][:, :, 0].reshape(-1, 3, 3)
    return np.linalg.inv(from_sensor) @ smallest @ from_plane


def _normalised(points, used):
    """Points with mean 0 and mean square 2, zero where unused, and the matrices (V, 3, 3) that make them so."""
    count = used.sum(axis=1)
    mean = (points * used[:, :, None]).sum(axis=1) / count[:, None]
    points = (points - mean[:, None]) * used[:, :, None]
    scale = np.sqrt(2 * count / np.maximum((points**2).sum(axis=(1, 2)), 1e-300))
    matrix = np.zeros((len(points), 3, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = scale
    matrix[:, :2, 2], matrix[:, 2, 2] = -scale[:, None] * mean, 1
    return points * scale[:, None, None], matrix


def _focal_length_of(homographies):
    """f, mm, by least squares over Zhang's two constraints of each view, or None: the columns h1, h2 of
    diag(1/f, 1/f, 1) H are orthogonal and of one length."""
    h1, h2 = (homographies / np.linalg.norm(homographies, axis=(1, 2), keepdims=True)).transpose(2, 0, 1)[:2]
    lateral = np.concatenate([h1[:, :2] * h2[:, :2], (h1[:, :2] ** 2 - h2[:, :2] ** 2) / 2]).sum(axis=1)
    axial = np.concatenate([h1[:, 2] * h2[:, 2], (h1[:, 2] ** 2 - h2[:, 2] ** 2) / 2])
    inverse_square = -(lateral @ axial) / max(lateral @ lateral, 1e-300)
    return inverse_square**-0.5 if inverse_square > 0 else None


def _poses_of(homographies, focal_length):
    """Rotations (V, 3, 3) and positions (V, 3) of planes from their homographies to the sensor."""
    columns = np.diag([1 / focal_length, 1 / focal_length, 1.0]) @ homographies
    scale = (np.linalg.norm(columns[:, :, 0], axis=1) + np.linalg.norm(columns[:, :, 1], axis=1)) / 2
    columns = columns * (np.sign(columns[:, 2, 2]) / scale)[:, None, None]
    third = np.cross(columns[:, :, 0], columns[:, :, 1])
    left, _, right = np.linalg.svd(np.stack([columns[:, :, 0], columns[:, :, 1], third], axis=2))
    return left @ right, columns[:, :, 2]


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


@dataclass(frozen=True)
class _Fit:
    """The least squares of a model: the state at the minimum, its equations without weights, and what follows.

    `weights` are 1 where there is a point, or those of a robust loss; `variance` is that of a coordinate, px^2.
    """

    model: object
    views: _Views
    state: _State
    equations: object
    weights: np.ndarray
    variance: float
    freedom: int
    covariance: pd.DataFrame


def _fit(model, object_points, image_points, loss="linear"):
    """Minimise; not yet judged."""
    views = _Views.stack(object_points, image_points)
    state = _start(model, views, object_points, image_points)
    count, unknowns = 2 * int(views.used.sum()), len(model.names) + 6 * len(object_points)
    freedom = count - unknowns
    if freedom <= 0:
        raise CalibrationError(f"{count} coordinates cannot determine {unknowns} parameters; add points or views")
    state, equations = _minimise(model, views, state, views.used)
    weights, variance = views.used, max(equations.cost / freedom, SMALLEST_RMS**2)
    if loss != "linear":
        state, weights, variance = _minimise_robust(model, views, state, loss)
        equations = _Equations.of(*_evaluate(model, views, state), views.used)
    covariance = _covariance(model, views, state, equations, variance)
    return _Fit(model, views, state, equations, weights, variance, freedom, covariance)


# --- least squares -----------------------------------------------------------------------------------------


def _evaluate(model, views, state):
    """Residuals (V, m, 2) and derivatives (V, m, 2, k + 6) by the camera, a turn and a shift; None without an image."""
    turned = views.points @ state.rotations.transpose(0, 2, 1)
    points = (turned + state.positions[:, None]).reshape(-1, 3)
    projection = model.project(state.shared, points)
    if projection is None:
        return None
    image, by_shared, by_point = projection
    x, y, z = turned.reshape(-1, 1, 3).transpose(2, 0, 1)
    by_x, by_y, by_z = by_point.transpose(2, 0, 1)
    by_turn = np.stack([y * by_z - z * by_y, z * by_x - x * by_z, x * by_y - y * by_x], axis=2)
    jacobian = np.concatenate([by_shared, by_turn, by_point], axis=2)
    return image.reshape(views.image.shape) - views.image, jacobian.reshape(*views.image.shape, -1)


@dataclass(frozen=True)
class _Equations:
    """The normal equations' blocks A (k, k), B (V, k, 6), C (V, 6, 6), the gradient's, and the weighted cost."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    shared_gradient: np.ndarray
    pose_gradient: np.ndarray
    cost: float

    @classmethod
    def of(cls, residuals, jacobian, weights):
        v, m, _, columns = jacobian.shape
        k, root = columns - 6, np.sqrt(weights)[:, :, None]
        rows = (jacobian * root[..., None]).reshape(v, 2 * m, columns)
        residuals = (residuals * root).reshape(v, 2 * m, 1)
        normal, gradient = rows.transpose(0, 2, 1) @ rows, (rows.transpose(0, 2, 1) @ residuals)[:, :, 0]
        blocks = normal[:, :k, :k].sum(axis=0), normal[:, :k, k:], normal[:, k:, k:]
        return cls(*blocks, gradient[:, :k].sum(axis=0), gradient[:, k:], float(np.sum(residuals**2)))

    def eliminated(self, damping=0.0):
        """S (k, k), and C^-1 B^T (V, 6, k) and C^-1 times the poses' gradient (V, 6, 1)."""
        k = len(self.a)
        grown = 1 + damping
        c = self.c.copy()
        c[:, range(6), range(6)] *= grown
        solved = np.linalg.solve(c, np.concatenate([self.b.transpose(0, 2, 1), self.pose_gradient[:, :, None]], axis=2))
        schur = self.a - (self.b @ solved[:, :, :k]).sum(axis=0)
        schur[range(k), range(k)] += damping * np.diagonal(self.a)
        return schur, solved[:, :, :k], solved[:, :, k:]

    def directions(self):
        """Eigenvalues (k,) of S scaled by A's diagonal, smallest first, the directions (k, k) as rows, in the scaled
        parameters, and what the poses (V, 6, k) do along each."""
        schur, by_shared, _ = self.eliminated()
        scale = np.sqrt(np.diagonal(self.a))
        values, vectors = np.linalg.eigh(schur / np.outer(scale, scale))
        return values, vectors.T, -by_shared @ (vectors / scale[:, None])

    def step(self, damping):
        """Steps of the camera's parameters, turns and shifts, and the decrease of the cost that they promise."""
        schur, by_shared, by_gradient = self.eliminated(damping)
        reduced = self.shared_gradient - (self.b @ by_gradient).sum(axis=0)[:, 0]
        scale = np.sqrt(np.diagonal(self.a))
        shared = -np.linalg.solve(schur / np.outer(scale, scale), reduced / scale) / scale
        pose = -(by_gradient[:, :, 0] + by_shared @ shared)
        promised = -(self.shared_gradient @ shared + np.sum(self.pose_gradient * pose))
        return shared, pose[:, :3], pose[:, 3:], promised


def _minimise(model, views, state, weights):
    """The state at the minimum and its `_Equations`."""
    state, equations, settled = _descend(model, views, state, weights)
    if not settled:
        _, directions, poses = equations.directions()
        raise CalibrationError(
            f"the least squares found no minimum in {MAX_STEPS} steps, for the views hardly determine all of "
            f"{', '.join(model.names)}: {_in_words(model.names, directions[0], poses[:, :, 0])}; add views of other "
            "tilts (about 30 deg), or free fewer parameters"
        )
    return state, equations


def _descend(model, views, state, weights):
    """Levenberg and Marquardt's method: the last state, its `_Equations`, and whether it is a minimum."""
    evaluated = _evaluate(model, views, state)
    if evaluated is None:
        raise CalibrationError("the starting solution does not see all points; check their order")
    equations, damping, growth = _Equations.of(*evaluated, weights), 1e-4, 2.0
    count, floor = views.used.sum(), np.sum(weights) * SMALLEST_RMS**2
    for _ in range(MAX_STEPS):
        *step, promised = equations.step(damping)
        trial = state.moved(*step)
        evaluated = _evaluate(model, views, trial) if promised > 0 else None
        found = None if evaluated is None else _Equations.of(*evaluated, weights)
        noise = max(equations.cost, floor) / count
        if found is not None and found.cost <= equations.cost:
            gain = min((equations.cost - found.cost) / promised, 1.0)
            damping, growth = damping * max(0.1, 1 - (2 * gain - 1) ** 3), 2.0
            state, equations = trial, found
        else:
            damping, growth = damping * growth, 2 * growth
        if promised <= SMALL_STEP**2 * noise and damping < 1 or equations.cost <= floor:
            return state, equations, True
        if damping > 1e12:
            break
    near = equations.step(0.0)[-1] <= NEAR**2 * max(equations.cost, floor) / count
    return state, equations, bool(near)


def _minimise_robust(model, views, state, loss):
    """Repeated weighted least squares: weights by the distances, which are judged by their median.

    Returns the state at the minimum, the weights, and the variance per axis that `_robust_variance` gives.
    """
    for _ in range(ROBUST_ROUNDS):
        distances = np.hypot(*np.moveaxis(_evaluate(model, views, state)[0], -1, 0))
        sigma = np.median(distances[views.used > 0]) / np.sqrt(2 * np.log(2))  # per axis: distances are Rayleigh's
        sigma = max(sigma, SMALLEST_RMS)
        weights = _robust_weights(distances / sigma, loss)[0] * views.used
        before = state
        state, equations = _minimise(model, views, state, weights)
        change = state.shared - before.shared
        if change @ equations.eliminated()[0] @ change <= (SMALL_ROUND * sigma) ** 2:
            return state, weights, _robust_variance(model, views, state, sigma, loss)
    raise CalibrationError(
        f"the {loss} loss found no minimum in {ROBUST_ROUNDS} rounds; look for views with many wrong corners"
    )


def _robust_weights(scaled, loss):
    r"""Weight w and slope w' r of the distances r in standard deviations; the influence is :math:`\psi = w r`."""
    if loss == "huber":
        weights = HUBER / np.maximum(scaled, HUBER)
        return weights, np.where(scaled > HUBER, -weights, 0.0)
    weights = 1 / (1 + (scaled / CAUCHY) ** 2)
    return weights, -2 * (scaled / CAUCHY) ** 2 * weights**2


def _robust_variance(model, views, state, sigma, loss):
    r"""The s^2 with which :math:`s^2 (J^T J)^{-1}` is the covariance of M-estimation, px^2.

    With the influence :math:`\psi(r) e / r` of a residual e of length r, and half the trace of its derivative
    :math:`\psi_1 = (\psi' + \psi / r) / 2`, of n points and p parameters (Huber, Robust Statistics, 1981, Eq. 7.6.8),

    .. math:: s^2 = K^2\, \frac{\sum \psi^2 / (2 n - p)}{(\sum \psi_1 / n)^2},
        \qquad K = 1 + \frac{p}{2 n} \frac{\mathrm{var}\, \psi_1}{(\mathrm{mean}\, \psi_1)^2}.
    """
    distances = np.hypot(*np.moveaxis(_evaluate(model, views, state)[0], -1, 0))[views.used > 0]
    weights, slopes = _robust_weights(distances / sigma, loss)
    derivative = weights + slopes / 2
    count, unknowns = 2 * len(distances), len(model.names) + 6 * len(views.used)
    correction = 1 + unknowns / count * derivative.var() / derivative.mean() ** 2
    return correction**2 * np.sum((weights * distances) ** 2) / (count - unknowns) / derivative.mean() ** 2


def _covariance(model, views, state, equations, variance):
    """Covariance of all parameters as a labelled table, translations being those of the objects' own origins.

    `equations` are without weights, `variance` is that of a coordinate, px^2.
    """
    values, directions, moved = equations.directions()
    if not values[0] > LEAST_INFORMATION:
        number = np.count_nonzero(~(values > LEAST_INFORMATION))
        raise CalibrationError(_undetermined(model.names, directions[:number], moved))
    by_shared = equations.eliminated()[1]
    v, _, k = by_shared.shape
    scale = np.sqrt(np.diagonal(equations.a))
    shared = (directions.T / values @ directions) / np.outer(scale, scale)
    to_origin = np.zeros((v, 6, 6))  # the origin's shift is the centroid's less the turn times the way between them
    to_origin[:, range(6), range(6)] = 1
    x, y, z = np.einsum("vij,vj->iv", state.rotations, views.centroids)
    to_origin[:, 3, 1], to_origin[:, 4, 0], to_origin[:, 5, 0] = -z, z, -y
    to_origin[:, 3, 2], to_origin[:, 4, 2], to_origin[:, 5, 1] = y, -x, x
    by_shared = (to_origin @ by_shared).reshape(6 * v, k)
    own = to_origin @ np.linalg.inv(equations.c) @ to_origin.transpose(0, 2, 1)
    whole = np.empty((k + 6 * v, k + 6 * v))
    whole[:k, :k] = shared
    whole[k:, :k] = -by_shared @ shared
    whole[:k, k:] = whole[k:, :k].T
    whole[k:, k:] = by_shared @ shared @ by_shared.T
    poses = whole[k:, k:].reshape(v, 6, v, 6)
    poses[range(v), :, range(v), :] += own
    names = model.names + pose_names(v)
    return pd.DataFrame(variance * whole, names, names)


def _undetermined(names, directions, poses):
    """What can change without moving a point, in words; `poses` (V, 6, number) are the poses' changes along with it."""
    found = [_in_words(names, direction, poses[:, :, k]) for k, direction in enumerate(directions)]
    return (
        f"the views do not determine all of {', '.join(names)}: {'; '.join(found)}; what trades off can change "
        "together without moving a point; add views of other tilts (about 30 deg)"
    )


def _in_words(names, direction, poses):
    """Names of the parameters that change along a direction, and T_z if the poses shift along it."""
    free = [name for name, part in zip(names, direction, strict=True) if abs(part) > 0.1 * np.abs(direction).max()]
    shifts = np.abs(poses[:, 3:]).max(axis=0)
    along_axis = ["T_z"] if shifts[2] > 0.1 * shifts.max() and shifts.max() > 0 else []
    return f"{' and '.join(free + along_axis)} trade off"


# --- what the views know -----------------------------------------------------------------------------------


def _judge(fit, object_points):
    """Flags in words; `CalibrationError` if f is not determined."""
    largest = _demand_tilt(fit, object_points)
    value, name, unit = fit.state.shared[0], fit.model.names[0], fit.model.unit
    flags = judge_focal_length(fit.covariance, name, value, unit, fit.freedom)
    flags += judge_principal_point(fit.covariance, fit.model.start_camera.image_size, fit.freedom)
    if _is_suspect(fit, largest):
        share = _demand_signal(fit)
        _demand_ends(fit)
        if share > FLAGGED_SHARE:
            flags += (
                f"The noise makes {100 * share:.0f} % of what the views seem to know of f: its sigma is too small; "
                "tilt the board by about 30 deg.",
            )
    if largest < SMALL_TILT:
        sigma = np.sqrt(fit.covariance.loc[name, name])
        flags += (
            f"The boards are tilted by {largest:.1f} deg at most, and f ({value:.5g} +- {sigma:.2g} {unit}) rests on "
            "that: it trades off with T_z; tilt them by about 30 deg.",
        )
    return flags


def _demand_tilt(fit, object_points):
    """The largest tilt of planes, deg (90 of other objects); refused if none is more than its own sigma explains."""
    if not all(is_planar(points) for points in object_points):
        return 90.0
    tilts, sigmas, matrix = [], [], fit.covariance.to_numpy()
    for first, rotation in zip(range(len(fit.model.names), len(matrix), 6), fit.state.rotations, strict=True):
        across = np.array([-rotation[1, 2], rotation[0, 2]])  # the axis of the tilt, times its sine
        sine = np.linalg.norm(across)
        axis = across / sine if sine > 0 else np.array([1.0, 0.0])
        tilts.append(np.degrees(np.arcsin(min(sine, 1.0))))
        sigmas.append(np.degrees(np.sqrt(axis @ matrix[first : first + 2, first : first + 2] @ axis)))
    if all(tilt < TILT_SIGNIFICANCE * sigma or tilt < 0.05 for tilt, sigma in zip(tilts, sigmas, strict=True)):
        raise CalibrationError(
            f"all planes are seen from straight ahead (tilts up to {max(tilts):.2g} deg, not distinguishable from 0): "
            "f and T_z trade off and are not determined; tilt the board by about 30 deg"
        )
    return max(tilts)


def _is_suspect(fit, tilt):
    """Whether the information about f must be tested: little tilt, or little information in each view."""
    relative = np.sqrt(fit.covariance.iloc[0, 0]) / fit.state.shared[0]
    return tilt < SMALL_TILT or relative * np.sqrt(len(fit.state.rotations)) > LITTLE_WORTH


def _demand_signal(fit):
    """The share of the information about f that the noise makes; refused if it is large."""
    share = _noise_share(fit)
    if share > REFUSED_SHARE:
        raise CalibrationError(
            f"f is not determined: {100 * min(share, 1):.0f} % of what the views seem to know of it is the points' "
            "noise, as with planes seen from nearly straight ahead or tilted about one axis; f and T_z trade off; tilt "
            "the board by about 30 deg in several directions"
        )
    return share


def _noise_share(fit):
    r"""The share of the information about f that the noise of the poses makes.

    The information S is a function of the estimated poses, and they differ from the true ones by noise of covariance
    :math:`s^2 C_v^{-1}`.  On average that adds to S

    .. math:: \Delta S = \frac{1}{2} \sum_k (S(+c_k) + S(-c_k) - 2 S)

    with S taken at poses moved by the columns c_k of the root of this covariance.  Of the information about f alone,
    which is :math:`u^T S u` along :math:`u = S^{-1} e_1`, the share is :math:`u^T \Delta S u / u^T S u`.
    """
    root = np.linalg.cholesky(np.linalg.inv(fit.equations.c) * fit.variance)
    information = fit.equations.eliminated()[0]
    added = np.zeros_like(information)
    for column in np.concatenate([root, -root], axis=2).transpose(2, 0, 1):
        evaluated = _evaluate(fit.model, fit.views, fit.state.moved(0.0, column[:, :3], column[:, 3:]))
        if evaluated is None:
            return np.inf
        added += (_Equations.of(*evaluated, fit.views.used).eliminated()[0] - information) / 2
    k = len(information)
    direction = fit.covariance.iloc[:k, 0].to_numpy()
    return float(direction @ added @ direction / (direction @ information @ direction))


def _demand_ends(fit):
    """Refuse a fit if another f explains the points nearly as well, or better (as far as the search comes).

    Half and twice are for a valley that is nearly level; the others for a valley of its own, as there is with f_x and
    f_y if boards with little tilt are taken for tilted ones of a camera with pixels that are not as stated.
    """
    best = float(np.sum(fit.weights[:, :, None] * _evaluate(fit.model, fit.views, fit.state)[0] ** 2))
    value, unit = fit.state.shared[0], fit.model.unit
    for other in np.multiply(OTHER_FACTORS, value):
        rise = (_least_cost(fit, other) - best) / fit.variance
        if rise < LEAST_RISE:
            raise CalibrationError(
                f"f is not determined: {other:.4g} {unit} explains the points nearly as well as {value:.4g} {unit}, or "
                f"better (the sum of squares grows by {rise:.2g} variances); f and T_z trade off; tilt the board by "
                "about 30 deg in several directions"
            )


def _least_cost(fit, focal_length):
    """The sum of squares that a search with a given f comes to; infinite if not all points can be seen with it."""
    model, state = _with_focal_length(fit, focal_length, fit.state)
    if _evaluate(model, fit.views, state) is None:
        return np.inf
    return _descend(model, fit.views, state, fit.weights)[1].cost


def weakest_direction(calibration):
    """What the views know least: the combination of the camera's parameters and T_z that has the least information.

    Parameters
    ----------
    calibration : Calibration
        With `covariance`.

    Returns
    -------
    eigenvalue : float
        Smallest eigenvalue of the inverse covariance with its diagonal scaled to 1: 1 if no parameter is confounded
        with another, 0 if some can change together without moving a point.
    words : str
        Which ones, for instance "focal_length and T_z trade off".

    Raises
    ------
    ValueError
        If the calibration has no covariance.
    """
    if calibration.covariance is None:
        raise ValueError("calibration has no covariance; expected one of calibrate_joint or calibrate_zhang")
    poses = pose_names(len(calibration.cam_from_object))
    names = [name for name in calibration.covariance.index if name not in poses]
    kept = names + poses[5::6]
    information = np.linalg.inv(calibration.covariance.loc[kept, kept].to_numpy())
    scale = np.sqrt(np.diagonal(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    shifts = np.zeros((len(poses) // 6, 6))
    shifts[:, 5] = vectors[len(names) :, 0]
    return float(values[0]), _in_words(names, vectors[: len(names), 0], shifts)


def _demand(value, name, allowed):
    if value not in allowed:
        raise ValueError(f"{name} is {value!r}; expected {' or '.join(map(repr, allowed))}")
