"""Discs in perspective: projection of a disc to its image, and back-projection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_points, as_pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..camera import OpenCVCamera, TsaiCamera

RIM_POINTS = 32
"""On a disc's rim: sums over a smooth closed curve converge exponentially, and this many reach rounding errors."""

SETTLED = 1e-10
"""mm: after a step of `back_project_discs` that is no larger, no further step is needed."""

_ANGLES = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
_RIM = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])


def _fourier_derivative(number):
    """The matrix that takes `number` samples of a periodic function to those of its derivative by the angle."""
    order = np.arange(number // 2 + 1)
    return np.fft.irfft(1j * order[:, None] * np.fft.rfft(np.eye(number), axis=0), number, axis=0)


_DERIVATIVE = _fourier_derivative(RIM_POINTS)


# ---- discs in perspective ----


def project_discs(
    camera: TsaiCamera | OpenCVCamera, cam_from_object: RigidTransform, centers: ArrayLike, radii: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Image of discs that lie in planes z = const of an object's frame.

    Parameters
    ----------
    camera : TsaiCamera or OpenCVCamera
    cam_from_object : RigidTransform
    centers : (n, 3) array_like
        mm, in the object's frame.
    radii : (n,) array_like
        mm.

    Returns
    -------
    centers : (n, 2) ndarray
        Centres of area of the images, px.
    radii : (n,) ndarray
        Radii of the circles of equal area, px.

    Raises
    ------
    ValueError
        If part of a disc lies behind the camera or has no image, or an argument is unusable.

    References
    ----------
    J. Heikkila and O. Silven, "A four-step camera calibration procedure with implicit image correction", IEEE Conference
    on Computer Vision and Pattern Recognition, 1997 (the centre of an ellipse is not the image of the circle's centre).

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> centers, radii = project_discs(camera, RigidTransform.from_translation([0, 0, 400.0]), [[0, 0, 0]], [10.0])
    >>> centers.round(3).tolist(), radii.round(3).tolist()
    ([[199.5, 149.5]], [20.0])
    """
    centers = as_points(centers, 3, "centers")
    radii = _as_radii(radii, len(centers), "radii")
    pose = as_pose(cam_from_object, "cam_from_object")
    images = DiscImages.of(camera, pose.rotation.as_matrix(), pose.translation, centers, radii)
    return images.centers, images.radii


@dataclass(frozen=True, eq=False)
class DiscImages:
    r"""Images of n discs, and what they change by.

    With the outline X of an image, its area A and centre c, Green's theorem gives, for any small change of the outline,

    .. math:: \delta A = \oint (\delta x \, dy - \delta y \, dx), \qquad
        \delta c = \frac{1}{A} \oint (X - c) (\delta x \, dy - \delta y \, dx).

    Attributes
    ----------
    centers : (n, 2) ndarray
        Centres of area, px.
    areas : (n,) ndarray
        Signed areas over 2 pi, px^2.
    offsets : (n, m, 2) ndarray
        Points of the outlines from the centres of area, px.
    normals : (n, m, 2) ndarray
        (dy, -dx) along the outlines, px.
    slopes : (n, m, 2, 2) ndarray
        Derivative of the outlines' points by the undistorted directions, px.
    arms : (n, m, 3) ndarray
        Points of the rims from the object's origin, mm in axes of the camera.
    points : (n, m, 3) ndarray
        The same in the camera frame.
    """

    centers: np.ndarray
    areas: np.ndarray
    offsets: np.ndarray
    normals: np.ndarray
    slopes: np.ndarray
    arms: np.ndarray
    points: np.ndarray

    @classmethod
    def of(cls, camera, rotation, translation, centers, radii) -> DiscImages:
        """Discs with checked centres (n, 3) and radii (n,), mm; ValueError if a part of a disc has no image."""
        n = len(centers)
        rims = radii[:, None, None] * (_RIM @ rotation[:, :2].T)
        arms = (centers @ rotation.T)[:, None] + rims
        points = arms + translation
        outlines, slopes = camera.image_and_derivative(camera.directions(points.reshape(-1, 3)))
        outlines = outlines.reshape(n, RIM_POINTS, 2)
        middle = outlines.mean(axis=1)
        outlines = outlines - middle[:, None]
        along = _DERIVATIVE @ outlines
        normals = np.stack([along[..., 1], -along[..., 0]], axis=2)
        areas = np.mean(np.sum(outlines * normals, axis=2), axis=1) / 2
        moments = np.mean(outlines**2 * normals, axis=1) / 2
        shift = moments / areas[:, None]
        slopes = slopes.reshape(n, RIM_POINTS, 2, 2)
        return cls(middle + shift, areas, outlines - shift[:, None], normals, slopes, arms, points)

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radii (n,) of the circles of equal area, px."""
        return np.sqrt(2 * np.abs(self.areas))

    def _pulls(self):
        """(n, m, 3): what dx dy - dy dx is of a shift of the rim's point, mm in the camera frame."""
        x, y, z = np.moveaxis(self.points, 2, 0)
        u, v = np.moveaxis((self.normals[:, :, None] @ self.slopes)[:, :, 0], 2, 0)
        return np.stack([u, v, -(u * x + v * y) / z], axis=2) / z[..., None]

    def by_pose(self) -> NDArray[np.float64]:
        """Derivatives (n, 2, 6) of the centres by the pose: see `moved` in `fit`."""
        pulls = self._pulls()
        changes = np.concatenate([pulls, np.cross(self.arms, pulls)], axis=2)
        return self._of_centers(changes)

    def by_place(self, rotation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives (n, 3, 3) of centre and area, as stated above, by the disc's own x, y and radius, mm."""
        in_plane = self._pulls() @ rotation[:, :2]
        changes = np.concatenate([in_plane, np.sum(in_plane * _RIM, axis=2, keepdims=True)], axis=2)
        return np.concatenate([self._of_centers(changes), changes.mean(axis=1)[:, None]], axis=1)

    def _of_centers(self, changes):
        """Changes (n, 2, k) of the centres from those (n, m, k) of dx dy - dy dx."""
        return self.offsets.transpose(0, 2, 1) @ changes / (RIM_POINTS * self.areas[:, None, None])


def back_project_discs(
    image_centers: ArrayLike,
    image_radii: ArrayLike,
    camera: TsaiCamera | OpenCVCamera,
    cam_from_plane: RigidTransform,
    *,
    iterations: int = 30,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the discs in the plane z = 0 of a frame whose images have given centres and radii.

    Parameters
    ----------
    image_centers : (n, 2) array_like
        Centres of area of the images (centres of the ellipses), px.
    image_radii : (n,) array_like
        Radii of the circles of equal area, px.
    camera : TsaiCamera or OpenCVCamera
    cam_from_plane : RigidTransform
    iterations : int
        Largest number of Newton's steps; they end when nothing moves by more than `SETTLED`.

    Returns
    -------
    centers : (n, 3) ndarray
        mm, in the plane's frame, z = 0.
    radii : (n,) ndarray
        mm.

    Raises
    ------
    ValueError
        If a ray does not meet the plane in front of the camera, or an argument is unusable.
    """
    image_centers = as_points(image_centers, 2, "image_centers")
    image_radii = _as_radii(image_radii, len(image_centers), "image_radii")
    pose = as_pose(cam_from_plane, "cam_from_plane")
    n, rotation, translation = len(image_centers), pose.rotation.as_matrix(), pose.translation
    rims = image_centers + image_radii[:, None] * (1, 0)
    points = camera.back_project(np.vstack([image_centers, rims]), pose)
    places = np.column_stack([points[:n, :2], np.linalg.norm(points[n:] - points[:n], axis=1)])
    for _ in range(iterations):
        centers = np.column_stack([places[:, :2], np.zeros(n)])
        images = DiscImages.of(camera, rotation, translation, centers, places[:, 2])
        areas = np.sign(images.areas) * image_radii**2 / 2
        missing = np.column_stack([image_centers - images.centers, areas - images.areas])
        steps = np.linalg.solve(images.by_place(rotation), missing[..., None])[..., 0]
        places = places + steps
        if np.abs(steps).max() <= SETTLED:
            break
    return np.column_stack([places[:, :2], np.zeros(n)]), places[:, 2]


# ---- input ----


def _as_radii(radii, count, name):
    """Return (count,) positive radii."""
    array = as_points(np.reshape(radii, (-1, 1)), 1, name).ravel()
    if len(array) != count or (array <= 0).any():
        raise ValueError(f"{name} has {len(array)} values from {array.min():g}; expected {count} positive ones")
    return array
