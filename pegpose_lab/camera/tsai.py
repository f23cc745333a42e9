"""The paper's camera (Fig. 4, Eq. 3), in sensor coordinates."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..checks import as_count, as_number, as_points, as_pose

OPENCV_PLAIN, OPENCV_LIMIT = 1e-3, 0.05
"""px: how far OpenCV's model with 5 and with 8 coefficients may be from a `TsaiCamera` in its picture."""

UNKNOWN_SIZE = (1, 1)
"""px: the image size of a camera to which none was given."""

LARGEST_SKEW = 1e-9
"""px: what a matrix that was computed may have in place of 0; it moves no point by more."""

RATIO_ROUNDS = 4
"""Weighted fits of a ratio of polynomials: more change its error by less than a tenth."""


def max_undistorted_radius(kappa1):
    """Return the largest undistorted radius that Eq. 3 can produce: 2 / (3 sqrt(-3 kappa1)), or infinity.

    For kappa1 >= 0 the map r_d -> r_d (1 + kappa1 r_d^2) is monotonic.  For kappa1 < 0 it turns back at
    r_d = 1 / sqrt(-3 kappa1); scene points beyond that radius have no image.
    """
    kappa1 = np.asarray(kappa1, dtype=np.float64)
    if kappa1.ndim == 0:
        return np.array(2 / (3 * np.sqrt(-3 * kappa1)) if kappa1 < 0 else np.inf)
    negative = np.minimum(kappa1, -np.finfo(float).tiny)
    return np.where(kappa1 < 0, 2 / (3 * np.sqrt(-3 * negative)), np.inf)


def distort_radius(radius, kappa1):
    r"""Solve Eq. 3 for the distorted radius: :math:`r_d (1 + \kappa_1 r_d^2) = r_u`.

    The root next to r_u is written in closed form, with hyperbolic functions for barrel distortion
    (kappa1 > 0) and circular ones for pincushion distortion (kappa1 < 0), then polished by one Newton
    step.  Nothing is iterated to convergence, so strong distortion is as exact as weak.

    Parameters
    ----------
    radius : array_like
        Undistorted radius r_u >= 0, mm.
    kappa1 : array_like
        Coefficient, mm^-2; broadcast against `radius`.

    Returns
    -------
    ndarray
        Distorted radius r_d, mm; beyond `max_undistorted_radius` the radius at which the map turns back.
    """
    radius, kappa1 = np.asarray(radius, np.float64), np.asarray(kappa1, np.float64)
    scale = np.sqrt(3 * np.maximum(np.abs(kappa1), np.finfo(float).tiny))
    argument = 1.5 * radius * scale
    pincushion = kappa1 < 0
    if not np.any(pincushion):
        root = np.sinh(np.arcsinh(argument) / 3)
    elif np.all(pincushion):
        root = np.sin(np.arcsin(np.minimum(argument, 1.0)) / 3)
    else:  # each form where it holds, for they take most of the time
        barrel, pincushion = (np.broadcast_to(chosen, argument.shape) for chosen in (~pincushion, pincushion))
        third = np.arcsinh(argument, where=barrel, out=np.zeros(argument.shape))
        third = np.arcsin(np.minimum(argument, 1.0), where=pincushion, out=third) / 3
        root = np.sinh(third, where=barrel, out=np.zeros(argument.shape))
        root = np.sin(third, where=pincushion, out=root)
    root = root * (2 / scale)
    if np.any(kappa1 == 0):
        root = np.where(kappa1 == 0, radius, root)
    stretch = kappa1 * root**2
    excess, slope = root * (1 + stretch) - radius, 1 + 3 * stretch
    if np.any(pincushion):
        reachable = radius <= max_undistorted_radius(kappa1) * (1 - 1e-6)  # at the turning point the slope is 0
        if not np.all(reachable):
            excess, slope = np.where(reachable, excess, 0.0), np.where(reachable, slope, 1.0)
    return root - excess / slope


class _Camera:
    """What both models share, given ``to_image`` and ``to_normalized``."""

    def project(self, object_points, cam_from_object):
        """Project object points into the image.

        Parameters
        ----------
        object_points : (n, 3) array_like
            mm, in the object's frame.
        cam_from_object : RigidTransform
            Pose of the object.

        Returns
        -------
        (n, 2) ndarray
            px; points outside the picture are returned too.

        Raises
        ------
        ValueError
            If a point lies behind the camera (z <= 0), or so far outside that the distortion gives it
            no image.
        """
        points = as_pose(cam_from_object, "cam_from_object").apply(as_points(object_points, 3, "object_points"))
        behind = np.count_nonzero(points[:, 2] <= 0)
        if behind:
            raise ValueError(
                f"object_points: {behind} of {len(points)} lie behind the camera (z <= 0 in the camera frame)"
            )
        return self.from_normalized(points[:, :2] / points[:, 2:])

    def back_project(self, image_points, cam_from_object, z=0.0):
        """Intersect the rays of image points with the plane z = const of an object's frame.

        Parameters
        ----------
        image_points : (n, 2) array_like
            px.
        cam_from_object : RigidTransform
            Pose of the object.
        z : float
            The plane, mm in the object's frame.

        Returns
        -------
        (n, 3) ndarray
            mm, in the object's frame, third column `z`.

        Raises
        ------
        ValueError
            If a ray does not meet the plane in front of the camera.
        """
        z = as_number(z, "z")
        rays = self.rays(image_points)
        object_from_cam = as_pose(cam_from_object, "cam_from_object").inv()
        origin = object_from_cam.translation
        directions = object_from_cam.rotation.apply(rays)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (z - origin[2]) / directions[:, 2]
        missed = np.count_nonzero(~(np.isfinite(distance) & (distance > 0)))
        if missed:
            raise ValueError(
                f"image_points: {missed} of {len(rays)} rays do not meet the plane z = {z:g} in front of the camera"
            )
        points = origin + distance[:, None] * directions
        points[:, 2] = z
        return points

    def rays(self, image_points):
        """Return the viewing directions (n, 3) of image points in the camera frame, with z = 1."""
        normalized = self.to_normalized(as_points(image_points, 2, "image_points"))
        return np.column_stack([normalized, np.ones(len(normalized))])


@dataclass(frozen=True)
class TsaiCamera(_Camera):
    """The paper's camera (Fig. 4, Eq. 3).

    Parameters
    ----------
    focal_length : float
        f, mm.
    pixel_pitch : (float, float)
        d_x and d_y, mm/px.
    principal_point : (float, float)
        Centre of the frame, px.
    image_size : (int, int)
        Width and height, px.
    kappa1 : float
        Undistorting radial coefficient, mm^-2 (positive for barrel distortion).
    scale_x : float
        Tsai's uncertainty factor of the horizontal scale.

    Raises
    ------
    ValueError
        If a parameter is not a finite number, or not positive where it must be.
    """

    focal_length: float
    pixel_pitch: tuple = (1.0, 1.0)
    principal_point: tuple = (0.0, 0.0)
    image_size: tuple = UNKNOWN_SIZE
    kappa1: float = 0.0
    scale_x: float = 1.0

    def __post_init__(self):
        for name in ("focal_length", "scale_x"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, 0, exclusive=True))
        object.__setattr__(self, "kappa1", as_number(self.kappa1, "kappa1"))
        object.__setattr__(self, "pixel_pitch", _as_pair(self.pixel_pitch, "pixel_pitch", 0))
        object.__setattr__(self, "principal_point", _as_pair(self.principal_point, "principal_point"))
        object.__setattr__(self, "image_size", _as_size(self.image_size))

    @property
    def pixels_per_mm(self):
        """(s_x / d_x, 1 / d_y), px/mm."""
        return np.array([self.scale_x, 1.0]) / self.pixel_pitch

    def to_sensor(self, image_points):
        """Image px to distorted sensor coordinates (x_d, y_d), mm from the principal point."""
        return (np.asarray(image_points, np.float64) - self.principal_point) / self.pixels_per_mm

    def to_image(self, sensor_points):
        """Distorted sensor coordinates (x_d, y_d), mm, to image px (x_f, y_f): the inverse of `to_sensor`."""
        return np.asarray(sensor_points, np.float64) * self.pixels_per_mm + self.principal_point

    def undistort(self, sensor_points):
        r"""Eq. 3: :math:`(x_u, y_u) = (x_d, y_d)(1 + \kappa_1 r^2)`, :math:`r^2 = x_d^2 + y_d^2`; mm."""
        sensor_points = np.asarray(sensor_points, np.float64)
        squared_radius = sensor_points[..., :1] ** 2 + sensor_points[..., 1:] ** 2
        return sensor_points * (1 + self.kappa1 * squared_radius)

    def distort(self, undistorted_points):
        """Eq. 3 solved for (x_d, y_d), exactly (see `distort_radius`); mm.

        Raises
        ------
        ValueError
            If kappa1 < 0 and a point lies beyond `max_undistorted_radius`: it has no image.
        """
        undistorted_points = np.asarray(undistorted_points, np.float64)
        radius = np.hypot(undistorted_points[..., :1], undistorted_points[..., 1:])
        if np.any(radius > max_undistorted_radius(self.kappa1)):
            raise ValueError(
                f"points up to {radius.max():g} mm from the axis have no image: with kappa1 = {self.kappa1:g} mm^-2 "
                f"the distortion of Eq. 3 reaches {float(max_undistorted_radius(self.kappa1)):g} mm at most"
            )
        ratio = distort_radius(radius, self.kappa1) / np.where(radius > 0, radius, 1)
        return undistorted_points * np.where(radius > 0, ratio, 1)

    def from_normalized(self, normalized):
        """Undistorted directions (x/z, y/z) to image px."""
        return self.to_image(self.distort(self.focal_length * np.asarray(normalized)))

    def to_normalized(self, image_points):
        """Image px to undistorted directions (x/z, y/z)."""
        return self.undistort(self.to_sensor(image_points)) / self.focal_length

    def to_opencv(self):
        r"""Return the `OpenCVCamera` that agrees with this one over the picture, to `OPENCV_LIMIT` px.

        Eq. 3 maps distorted to undistorted radii, OpenCV's model the other way:

        .. math:: r_d = r \frac{1 + k_1 r^2 + k_2 r^4 + k_3 r^6}{1 + k_4 r^2 + k_5 r^4 + k_6 r^6}

        is fitted to the inverse of Eq. 3 up to the farthest corner of the picture.  The denominator is 1, and
        there are 5 coefficients, where that is exact to `OPENCV_PLAIN` px; else there are 8.

        Raises
        ------
        ValueError
            If the picture reaches beyond the range in which Eq. 3 can be inverted, or if OpenCV's model is farther from
            it than `OPENCV_LIMIT` px somewhere in the picture.
        """
        distorted = self._radii()
        undistorted = distorted * (1 + self.kappa1 * distorted**2)
        for terms, limit in ((0, OPENCV_PLAIN), (3, OPENCV_LIMIT)):
            above, below = _fit_ratio(undistorted / self.focal_length, distorted / self.focal_length, terms)
            fitted = undistorted * _ratio(undistorted / self.focal_length, above, below)
            error = np.abs(fitted - distorted).max() * self.pixels_per_mm.max()
            if error <= limit:
                camera_matrix = np.diag([*(self.focal_length * self.pixels_per_mm), 1.0])
                camera_matrix[:2, 2] = self.principal_point
                return OpenCVCamera(camera_matrix, [*above[:2], 0, 0, above[2], *below], self.image_size)
        raise ValueError(
            f"kappa1 = {self.kappa1:g} mm^-2 distorts the picture so strongly that OpenCV's model is up to "
            f"{error:.2g} px off; the limit is {OPENCV_LIMIT:g} px"
        )

    def _radii(self):
        """Distorted radii, mm, from the principal point to the farthest corner of the picture."""
        width, height = self.image_size
        corners = self.to_sensor([(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)])
        farthest = np.hypot(*corners.T).max()
        limit = np.inf if self.kappa1 >= 0 else 1 / np.sqrt(-3 * self.kappa1)
        if farthest >= limit:
            raise ValueError(
                f"kappa1 = {self.kappa1:g} mm^-2 folds the picture at {limit:g} mm from its centre; "
                "no OpenCV model describes that"
            )
        return farthest * np.sin(np.linspace(0, np.pi / 2, 400))[1:]  # denser towards the corner, where errors grow


@dataclass(frozen=True, eq=False)
class OpenCVCamera(_Camera):
    """OpenCV's camera.

    Parameters
    ----------
    camera_matrix : (3, 3) array_like
        px; without skew, which OpenCV's model does not have.
    dist_coeffs : (4,), (5,), (8,), (12,) or (14,) array_like
        k1, k2, p1, p2, k3, ...; distorting.
    image_size : (int, int)
        Width and height, px.

    Raises
    ------
    ValueError
        If a shape or a value is unusable.
    """

    camera_matrix: np.ndarray
    dist_coeffs: np.ndarray
    image_size: tuple = UNKNOWN_SIZE

    def __post_init__(self):
        matrix = as_points(self.camera_matrix, 3, "camera_matrix", 3)
        if matrix.shape != (3, 3) or matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or np.any(matrix[2] != (0, 0, 1)):
            raise ValueError("camera_matrix is not of the form [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0")
        if max(abs(matrix[0, 1]), abs(matrix[1, 0])) > LARGEST_SKEW:
            raise ValueError(
                f"camera_matrix has skew, K[0, 1] = {matrix[0, 1]:g} and K[1, 0] = {matrix[1, 0]:g} px; OpenCV's camera has "
                "none and its functions ignore it: expected 0 (calibrate the camera without skew)"
            )
        matrix[0, 1] = matrix[1, 0] = 0.0
        coefficients = np.array(self.dist_coeffs, dtype=np.float64).ravel()
        if coefficients.size not in (4, 5, 8, 12, 14) or not np.isfinite(coefficients).all():
            raise ValueError(f"dist_coeffs has {coefficients.size} values; expected 4, 5, 8, 12 or 14 finite ones")
        object.__setattr__(self, "camera_matrix", matrix)
        object.__setattr__(self, "dist_coeffs", coefficients)
        object.__setattr__(self, "image_size", _as_size(self.image_size))

    def from_normalized(self, normalized):
        """Undistorted directions (x/z, y/z) to image px."""
        return self.image_and_derivative(normalized)[0]

    def to_normalized(self, image_points, *, iterations=50, tolerance=1e-11):
        """Image px to undistorted directions (x/z, y/z), by Newton's method.

        Raises
        ------
        ValueError
            If a point has no preimage near it under this distortion.
        """
        image_points = np.asarray(image_points, np.float64)
        normalized = (image_points - self.camera_matrix[:2, 2]) / np.diag(self.camera_matrix)[:2]
        largest = max(self.image_size)
        for _ in range(iterations):
            projected, jacobian = self.image_and_derivative(normalized)
            error = projected - image_points
            if np.abs(error).max() <= tolerance * largest:
                return normalized
            step = _solve_2x2(jacobian, error)
            length = np.linalg.norm(step, axis=1, keepdims=True)
            normalized = normalized - step * np.minimum(1, 0.5 / np.maximum(length, 1e-300))
        worst = np.linalg.norm(error, axis=1).max()
        raise ValueError(f"image_points: the distortion cannot be inverted there (left after Newton: {worst:.3g} px)")

    def image_and_derivative(self, normalized):
        """Undistorted directions (n, 2) to image px (n, 2), and the derivative (n, 2, 2) by them."""
        points = np.column_stack([normalized, np.ones(len(normalized))])
        zero = np.zeros(3)
        image_points, jacobian = cv2.projectPoints(points, zero, zero, self.camera_matrix, self.dist_coeffs)[:2]
        return image_points.reshape(-1, 2), jacobian[:, 3:5].reshape(-1, 2, 2)


def _fit_ratio(radius, target, terms):
    """Coefficients (3,) above and (terms,) below of `_ratio`, so that radius * ratio is nearest to a target.

    Least squares of radius * above - target * below is linear; weights of 1 / below make it that of the ratio itself.
    """
    powers = np.column_stack([radius**2, radius**4, radius**6])
    columns = np.column_stack([radius[:, None] * powers, -target[:, None] * powers[:, :terms]])
    scale, below = np.linalg.norm(columns, axis=0), np.zeros(terms)
    for _ in range(RATIO_ROUNDS if terms else 1):
        weight = 1 / (1 + powers[:, :terms] @ below)
        rows = columns / scale * weight[:, None]
        fitted = np.linalg.lstsq(rows, (target - radius) * weight, rcond=None)[0] / scale
        above, below = fitted[:3], fitted[3:]
    return above, below


def _ratio(radius, above, below):
    """(1 + a1 r^2 + a2 r^4 + a3 r^6) / (1 + b1 r^2 + ...)."""
    powers = np.column_stack([radius**2, radius**4, radius**6])
    return (1 + powers @ above) / (1 + powers[:, : len(below)] @ below)


def _solve_2x2(matrices, vectors):
    """Solve stacked 2x2 systems by Cramer's rule; a singular one gives a zero step."""
    (a, b), (c, d) = np.moveaxis(matrices, 0, -1)
    x, y = vectors.T
    determinant = a * d - b * c
    safe = np.where(determinant == 0, np.inf, determinant)
    return np.column_stack([(d * x - b * y) / safe, (a * y - c * x) / safe])


def _as_pair(pair, name, minimum=-np.inf):
    values = tuple(np.ravel(pair))
    if len(values) != 2:
        raise ValueError(f"{name} has {len(values)} values; expected two")
    return tuple(as_number(value, name, minimum, exclusive=True) for value in values)


def _as_size(size):
    values = tuple(size) if np.iterable(size) and not isinstance(size, str) else ()
    if len(values) != 2:
        raise ValueError(f"image_size is {size!r}; expected two whole numbers, (width, height)")
    return tuple(as_count(value, f"image_size[{k}]", 1) for k, value in enumerate(values))


def demand_tsai(camera):
    """Raise ValueError if the camera is not a `TsaiCamera`."""
    if not isinstance(camera, TsaiCamera):
        raise ValueError(f"camera is {type(camera).__name__}; expected a TsaiCamera")
