"""What is known of a camera before calibration: its pixels, and where the optical axis meets them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import as_number
from .pinhole import _as_pair, _as_size

if TYPE_CHECKING:
    from .tsai import TsaiCamera


class _Pixels:
    """Conversion between image px and mm on the sensor, given ``pixel_pitch``, ``principal_point`` and ``scale_x``."""

    pixel_pitch: tuple[float, float]
    principal_point: tuple[float, float]
    scale_x: float

    @property
    def pixels_per_mm(self) -> NDArray[np.float64]:
        """(s_x / d_x, 1 / d_y), px/mm."""
        return np.array([self.scale_x, 1.0]) / self.pixel_pitch

    def to_sensor(self, image_points: ArrayLike) -> NDArray[np.float64]:
        """Image px to distorted sensor coordinates (x_d, y_d), mm from the principal point."""
        return (np.asarray(image_points, np.float64) - self.principal_point) / self.pixels_per_mm

    def to_image(self, sensor_points: ArrayLike) -> NDArray[np.float64]:
        """Distorted sensor coordinates (x_d, y_d), mm, to image px (x_f, y_f): the inverse of `to_sensor`."""
        return np.asarray(sensor_points, np.float64) * self.pixels_per_mm + self.principal_point


@dataclass(frozen=True)
class Sensor(_Pixels):
    """What is known of a camera before calibration; it has no focal length and no lens distortion.

    Parameters
    ----------
    pixel_pitch : (float, float)
        d_x and d_y, mm/px.  If it is not known, use (1, 1): the calibrated f is then in px.
    principal_point : (float, float)
        Centre of the frame, px.
    image_size : (int, int)
        Width and height, px.
    scale_x : float
        Tsai's uncertainty factor of the horizontal scale.

    Raises
    ------
    ValueError
        If a parameter is not a finite number, or not positive where it must be.

    Examples
    --------
    >>> from pegpose_lab import Sensor
    >>> sensor = Sensor(pixel_pitch=(0.01, 0.01), principal_point=(319.5, 239.5), image_size=(640, 480))
    >>> camera = sensor.camera(8.0, kappa1=0.001)
    >>> camera.focal_length, camera.sensor == sensor
    (8.0, True)
    """

    pixel_pitch: tuple[float, float]
    principal_point: tuple[float, float]
    image_size: tuple[int, int]
    scale_x: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale_x", as_number(self.scale_x, "scale_x", 0, exclusive=True))
        object.__setattr__(self, "pixel_pitch", _as_pair(self.pixel_pitch, "pixel_pitch", 0))
        object.__setattr__(self, "principal_point", _as_pair(self.principal_point, "principal_point"))
        object.__setattr__(self, "image_size", _as_size(self.image_size))

    def camera(self, focal_length: float, kappa1: float = 0.0) -> TsaiCamera:
        """The `TsaiCamera` of this sensor with a focal length, mm, and a distortion, mm^-2."""
        from .tsai import TsaiCamera

        return TsaiCamera(
            focal_length, self.pixel_pitch, self.principal_point, self.image_size, kappa1, scale_x=self.scale_x
        )
