"""The equidistant fisheye camera: OpenCV's `cv2.fisheye`, ROS's `equidistant`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .matrix import _MatrixCamera
from .pinhole import UNKNOWN_SIZE

if TYPE_CHECKING:
    from .opencv import OpenCVCamera

WIDEST = np.pi / 2 - 1e-6
"""rad: rays at a larger angle to the axis do not meet the plane z = 1, which directions (x/z, y/z) refer to."""

INVERSION_ROUNDS, INVERTED = 60, 1e-14
"""Most rounds of the safeguarded Newton method for the angle, and the error, rad, at which it ends."""


@dataclass(frozen=True, eq=False)
class FisheyeCamera(_MatrixCamera):
    r"""The equidistant fisheye camera of `cv2.fisheye`, which ROS calls ``equidistant``.

    A ray at the angle :math:`\theta` to the axis has its image at the distance :math:`f \theta_d`, with

    .. math:: \theta_d = \theta (1 + k_1 \theta^2 + k_2 \theta^4 + k_3 \theta^6 + k_4 \theta^8).

    Parameters
    ----------
    camera_matrix : (3, 3) array_like
        px; without skew.
    dist_coeffs : (4,) array_like
        k1, k2, k3, k4; distorting.
    image_size : (int, int)
        Width and height, px.

    Raises
    ------
    ValueError
        If a shape or a value is unusable.

    Examples
    --------
    >>> from pegpose_lab import FisheyeCamera
    >>> from scipy.spatial.transform import RigidTransform
    >>> camera = FisheyeCamera([[300, 0, 319.5], [0, 300, 239.5], [0, 0, 1]], [0, 0, 0, 0], (640, 480))
    >>> camera.project([[500.0, 0.0, 500.0]], RigidTransform.identity()).round(2).tolist()  # 300 px * pi / 4
    [[555.12, 239.5]]

    References
    ----------
    J. Kannala and S. S. Brandt, "A generic camera model and calibration method for conventional, wide-angle, and
    fish-eye lenses", IEEE Transactions on Pattern Analysis and Machine Intelligence 28(8), 1335-1340, 2006.
    """

    camera_matrix: NDArray[np.float64]
    dist_coeffs: NDArray[np.float64]
    image_size: tuple[int, int] = UNKNOWN_SIZE

    def __post_init__(self) -> None:
        self._check((4,))

    @property
    def parameters(self) -> dict[str, float]:
        """f_x, f_y, c_x, c_y, px, and k1 to k4."""
        return self._parameters(("k1", "k2", "k3", "k4"))

    @property
    def widest_angle(self) -> float:
        """The largest angle to the axis, rad, that has an image: the polynomial folds there, or it is `WIDEST`."""
        slope = np.polynomial.Polynomial([1, *np.array([3, 5, 7, 9]) * self.dist_coeffs])  # of the angle's square
        roots = slope.roots()
        folds = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
        return float(min(np.sqrt(folds.min()), WIDEST)) if len(folds) else WIDEST

    def to_opencv(self) -> OpenCVCamera:
        """Raises ValueError: OpenCV's other functions do not take a fisheye camera (use `cv2.fisheye`)."""
        raise ValueError("OpenCV's model for perspective lenses does not describe a fisheye camera; use cv2.fisheye")

    def from_normalized(self, normalized: ArrayLike) -> NDArray[np.float64]:
        """Undistorted directions (x/z, y/z) to image px."""
        return self.image_and_derivative(normalized)[0]

    def image_and_derivative(self, normalized: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        r"""Undistorted directions (n, 2) to image px (n, 2), and the derivative (n, 2, 2) by them.

        For the direction r e with a unit vector e, the derivative of :math:`\theta_d e` is
        :math:`(\theta_d / r) (I - e e^T) + \theta_d' / (1 + r^2) e e^T`.

        Raises
        ------
        ValueError
            If a ray is beyond `widest_angle`.
        """
        normalized = np.asarray(normalized, np.float64)
        radius = np.hypot(*normalized.T)
        angle = np.arctan(radius)
        if angle.max() > self.widest_angle:
            raise ValueError(
                f"rays up to {np.degrees(angle.max()):.1f} deg from the axis have no image: the distortion folds at "
                f"{np.degrees(self.widest_angle):.1f} deg"
            )
        distorted, slope = equidistant(angle, self.dist_coeffs)
        across = np.where(radius > 0, distorted / np.where(radius > 0, radius, 1), 1.0)
        unit = normalized / np.where(radius > 0, radius, 1)[:, None]
        derivative = (slope / (1 + radius**2) - across)[:, None, None] * unit[:, :, None] * unit[:, None, :]
        derivative += across[:, None, None] * np.eye(2)
        focal = np.diag(self.camera_matrix)[:2]
        image = across[:, None] * normalized * focal + self.camera_matrix[:2, 2]
        return image, derivative * focal[:, None]

    def to_normalized(self, image_points: ArrayLike) -> NDArray[np.float64]:
        """Image px to undistorted directions (x/z, y/z).

        Raises
        ------
        ValueError
            If the ray of a point is not in front of the camera, or the distortion folds before it.
        """
        scaled = np.asarray(image_points, np.float64) - self.camera_matrix[:2, 2]
        scaled = scaled / np.diag(self.camera_matrix)[:2]
        distorted, widest = np.hypot(*scaled.T), self.widest_angle
        limit = equidistant(np.array([widest]), self.dist_coeffs)[0][0]
        if distorted.max() > limit:
            raise ValueError(
                f"image_points: {np.count_nonzero(distorted > limit)} of {len(distorted)} have no ray within "
                f"{np.degrees(widest):.1f} deg of the axis"
            )
        angle = self._angle(distorted, widest)
        return scaled * np.where(distorted > 0, np.tan(angle) / np.where(distorted > 0, distorted, 1), 1.0)[:, None]

    def _angle(self, distorted, widest):
        """The angles with these distorted ones, by Newton's method, which halves the interval where it leaves it."""
        low, high, angle = np.zeros_like(distorted), np.full_like(distorted, widest), np.minimum(distorted, widest)
        for _ in range(INVERSION_ROUNDS):
            value, slope = equidistant(angle, self.dist_coeffs)
            error = value - distorted
            if np.abs(error).max() <= INVERTED:
                break
            low, high = np.where(error <= 0, angle, low), np.where(error > 0, angle, high)
            newton = angle - error / np.where(slope > 0, slope, np.inf)
            angle = np.where((newton >= low) & (newton <= high), newton, (low + high) / 2)
        return angle


def equidistant(angle: NDArray[np.float64], coefficients: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Distorted angles :math:`\theta_d` of angles (n,), rad, and their derivative.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab.camera import equidistant
    >>> distorted, slope = equidistant(np.array([0.5]), [0.1, 0, 0, 0])
    >>> float(distorted[0]), float(slope[0])
    (0.5125, 1.075)
    """
    k1, k2, k3, k4 = np.asarray(coefficients, np.float64)
    square = angle * angle
    value = angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    slope = 1 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * 9 * k4)))
    return value, slope
