"""What all camera models share: projection to pixels, and back-projection of pixels to rays in the scene."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import as_count, as_number, as_points, as_pose

if TYPE_CHECKING:
    from typing import Self

    from scipy.spatial.transform import RigidTransform

    from .opencv import OpenCVCamera

UNKNOWN_SIZE = (1, 1)
"""px: the image size of a camera if none is given."""


class _Camera:
    """The interface of all camera models: what each one defines, and what follows from that."""

    principal_point: tuple[float, float]
    """px"""

    image_size: tuple[int, int]
    """Width and height, px."""

    @property
    def parameters(self) -> dict[str, float]:
        """What a calibration can estimate (the intrinsics), f first, with the names used in `Calibration.covariance`."""
        raise NotImplementedError

    def with_parameters(self, **values: float) -> Self:
        """Return the camera with other values of some of its `parameters`.

        Raises
        ------
        ValueError
            If a name is none of `parameters`, or a value is unusable.

        Examples
        --------
        >>> from pegpose_lab import TsaiCamera
        >>> camera = TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480)).with_parameters(focal_length=9.0, c_x=320.0)
        >>> camera.focal_length, camera.principal_point
        (9.0, (320.0, 239.5))
        """
        _demand_known(values, self.parameters)
        c_x, c_y = self.principal_point
        center = values.pop("c_x", c_x), values.pop("c_y", c_y)
        return replace(self, principal_point=center, **values)

    def from_normalized(self, normalized: ArrayLike) -> NDArray[np.float64]:
        """Undistorted directions (x/z, y/z) to image px."""
        raise NotImplementedError

    def image_and_derivative(self, normalized: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Undistorted directions (n, 2) to image px (n, 2), and the derivative (n, 2, 2) by them."""
        raise NotImplementedError

    def to_normalized(self, image_points: ArrayLike) -> NDArray[np.float64]:
        """Image px to undistorted directions (x/z, y/z)."""
        raise NotImplementedError

    def to_opencv(self) -> OpenCVCamera:
        """The camera as OpenCV's model."""
        raise NotImplementedError

    def project(self, object_points: ArrayLike, cam_from_object: RigidTransform) -> NDArray[np.float64]:
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
            px; points outside the image are returned too.

        Raises
        ------
        ValueError
            If a point lies behind the camera (z <= 0), or so far outside that the distortion gives it
            no image.
        """
        points = as_pose(cam_from_object, "cam_from_object").apply(as_points(object_points, 3, "object_points"))
        return self.from_normalized(self.directions(points))

    def directions(self, camera_points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Undistorted directions (x/z, y/z) of points (n, 3) in the camera frame, mm; ValueError if one is behind it."""
        depth = camera_points[:, 2:]
        if depth.min() <= 0:
            raise ValueError(
                f"object_points: {np.count_nonzero(depth <= 0)} of {len(depth)} lie behind the camera "
                "(z <= 0 in the camera frame)"
            )
        return camera_points[:, :2] / depth

    def back_project(
        self, image_points: ArrayLike, cam_from_object: RigidTransform, z: float = 0.0
    ) -> NDArray[np.float64]:
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

    def rays(self, image_points: ArrayLike) -> NDArray[np.float64]:
        """Return the viewing directions (n, 3) of image points in the camera frame, with z = 1."""
        normalized = self.to_normalized(as_points(image_points, 2, "image_points"))
        return np.column_stack([normalized, np.ones(len(normalized))])

    def _scaled_size(self, scale):
        """Width and height of the image with `scale` times the pixels along each axis."""
        return tuple(max(1, round(scale * side)) for side in self.image_size)


def _demand_known(values, parameters):
    """ValueError if a name of `values` is none of a camera's parameters."""
    unknown = [name for name in values if name not in parameters]
    if unknown:
        raise ValueError(f"values has {', '.join(unknown)}; the camera's parameters are {', '.join(parameters)}")


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
