"""The paper's camera (Fig. 4, Eq. 3), in sensor coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import as_number
from .opencv import OpenCVCamera
from .pinhole import UNKNOWN_SIZE, _Camera
from .radial import distort_radius, max_undistorted_radius
from .sensor import Sensor, _Pixels

OPENCV_PLAIN, OPENCV_LIMIT = 1e-3, 0.05
"""px: how far OpenCV's model with 5 and with 8 coefficients may be from a `TsaiCamera` within the image."""

RATIO_ROUNDS = 4
"""Weighted fits of a ratio of polynomials: more change its error by less than a tenth."""


@dataclass(frozen=True)
class TsaiCamera(_Pixels, _Camera):
    """The paper's camera: a pinhole camera with radial lens distortion (Fig. 4, Eq. 3).

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

    Examples
    --------
    >>> from pegpose_lab import TsaiCamera
    >>> from scipy.spatial.transform import RigidTransform
    >>> camera = TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480), kappa1=0.001)
    >>> camera.project([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]], RigidTransform.from_translation([0, 0, 500])).round(2).tolist()
    [[319.5, 239.5], [399.45, 239.5]]
    """

    focal_length: float
    pixel_pitch: tuple[float, float] = (1.0, 1.0)
    principal_point: tuple[float, float] = (0.0, 0.0)
    image_size: tuple[int, int] = UNKNOWN_SIZE
    kappa1: float = 0.0
    scale_x: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "focal_length", as_number(self.focal_length, "focal_length", 0, exclusive=True))
        object.__setattr__(self, "kappa1", as_number(self.kappa1, "kappa1"))
        for name, value in vars(self.sensor).items():  # checked there
            object.__setattr__(self, name, value)

    @property
    def sensor(self) -> Sensor:
        """What was known of the camera before it was calibrated: all but f and kappa1."""
        return Sensor(self.pixel_pitch, self.principal_point, self.image_size, self.scale_x)

    @property
    def parameters(self) -> dict[str, float]:
        """focal_length, mm, scale_x, kappa1, mm^-2, c_x and c_y, px."""
        c_x, c_y = self.principal_point
        own = {name: getattr(self, name) for name in ("focal_length", "scale_x", "kappa1")}
        return own | {"c_x": c_x, "c_y": c_y}

    def undistort(self, sensor_points: ArrayLike) -> NDArray[np.float64]:
        r"""Eq. 3: :math:`(x_u, y_u) = (x_d, y_d)(1 + \kappa_1 r^2)`, :math:`r^2 = x_d^2 + y_d^2`; mm."""
        sensor_points = np.asarray(sensor_points, np.float64)
        squared_radius = sensor_points[..., :1] ** 2 + sensor_points[..., 1:] ** 2
        return sensor_points * (1 + self.kappa1 * squared_radius)

    def distort(self, undistorted_points: ArrayLike) -> NDArray[np.float64]:
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

    def from_normalized(self, normalized: ArrayLike) -> NDArray[np.float64]:
        """Undistorted directions (x/z, y/z) to image px."""
        return self.to_image(self.distort(self.focal_length * np.asarray(normalized)))

    def image_and_derivative(self, normalized: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        r"""Undistorted directions (n, 2) to image px (n, 2), and the derivative (n, 2, 2) by them.

        With :math:`h = 1 / (1 + \kappa_1 r_d^2)`, Eq. 3 solved for :math:`x_d = h x_u` has

        .. math:: dx_d/dx_u = h I - \frac{2 \kappa_1 h}{1 + 3 \kappa_1 r_d^2} x_d x_d^T.
        """
        distorted = self.distort(self.focal_length * np.asarray(normalized, np.float64))
        bend = self.kappa1 * (distorted[:, 0] ** 2 + distorted[:, 1] ** 2)
        h = 1 / (1 + bend)
        derivative = (
            distorted[:, :, None] * distorted[:, None, :] * (-2 * self.kappa1 * h / (1 + 3 * bend))[:, None, None]
        )
        derivative[:, 0, 0] += h
        derivative[:, 1, 1] += h
        return self.to_image(distorted), derivative * (self.focal_length * self.pixels_per_mm)[:, None]

    def to_normalized(self, image_points: ArrayLike) -> NDArray[np.float64]:
        """Image px to undistorted directions (x/z, y/z)."""
        return self.undistort(self.to_sensor(image_points)) / self.focal_length

    def scaled(self, scale: float) -> TsaiCamera:
        """Return the camera with the same image at `scale` times the pixels along each axis."""
        pitch = np.array(self.pixel_pitch) / scale
        middle = scale * (np.array(self.principal_point) + 0.5) - 0.5
        return TsaiCamera(self.focal_length, pitch, middle, self._scaled_size(scale), self.kappa1, self.scale_x)

    def cropped(self, left: int, top: int, width: int, height: int) -> TsaiCamera:
        """Return the camera of a part of its image: pixel (left, top) becomes pixel (0, 0)."""
        middle = np.array(self.principal_point) - (left, top)
        size = (width, height)
        return TsaiCamera(self.focal_length, self.pixel_pitch, middle, size, self.kappa1, self.scale_x)

    def to_opencv(self) -> OpenCVCamera:
        r"""Return the `OpenCVCamera` that agrees with this one over the whole image, to `OPENCV_LIMIT` px.

        Eq. 3 maps distorted to undistorted radii, OpenCV's model the other way:

        .. math:: r_d = r \frac{1 + k_1 r^2 + k_2 r^4 + k_3 r^6}{1 + k_4 r^2 + k_5 r^4 + k_6 r^6}

        is fitted to the inverse of Eq. 3 up to the farthest corner of the image.  The denominator is 1, and
        there are 5 coefficients, where that is exact to `OPENCV_PLAIN` px; else there are 8.

        Raises
        ------
        ValueError
            If the image reaches beyond the range in which Eq. 3 can be inverted, or if OpenCV's model is farther from
            it than `OPENCV_LIMIT` px somewhere in the image.
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
            f"kappa1 = {self.kappa1:g} mm^-2 distorts the image so strongly that OpenCV's model is up to "
            f"{error:.2g} px off; the limit is {OPENCV_LIMIT:g} px"
        )

    def _radii(self):
        """Distorted radii, mm, from the principal point to the farthest corner of the image."""
        width, height = self.image_size
        corners = self.to_sensor([(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)])
        farthest = np.hypot(*corners.T).max()
        limit = np.inf if self.kappa1 >= 0 else 1 / np.sqrt(-3 * self.kappa1)
        if farthest >= limit:
            raise ValueError(
                f"kappa1 = {self.kappa1:g} mm^-2 folds the image at {limit:g} mm from its centre; "
                "no OpenCV model describes that"
            )
        return farthest * np.sin(np.linspace(0, np.pi / 2, 400))[1:]  # denser towards the corner, where errors grow


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


def as_sensor(camera: Sensor | TsaiCamera) -> Sensor:
    """Return a `Sensor`, or that of a `TsaiCamera`, to start a calibration; ValueError if it is neither.

    Examples
    --------
    >>> from pegpose_lab import TsaiCamera
    >>> from pegpose_lab.camera import as_sensor
    >>> as_sensor(TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480))).pixel_pitch
    (0.01, 0.01)
    """
    if not isinstance(camera, (Sensor, TsaiCamera)):
        raise ValueError(f"camera is {type(camera).__name__}; expected a Sensor or a TsaiCamera")
    return camera if isinstance(camera, Sensor) else camera.sensor
