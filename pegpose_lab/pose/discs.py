"""Discs in perspective: projection of a disc to its image, and back-projection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..checks import as_points, as_pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..camera import OpenCVCamera, TsaiCamera

RIM_POINTS = 32
"""On a disc's rim: sums over a smooth closed curve converge exponentially, and this many reach rounding errors."""

SETTLED = 1e-5
"""mm: after a step of `back_project_discs` that is no larger, no further step is needed: it would be below 1e-10 mm, since
the error of Newton's method is squared by each."""

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
    images = DiscImages.of(camera, pose_of(as_pose(cam_from_object, "cam_from_object")), centers, radii)
    return images.centers, images.radii


class Pose(NamedTuple):
    """cam_from_object as a rotation matrix (3, 3) and a translation (3,), mm."""

    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]


def pose_of(cam_from_object: RigidTransform) -> Pose:
    """The same as `Pose`."""
    matrix = cam_from_object.as_matrix()
    return Pose(matrix[:3, :3], matrix[:3, 3])


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
    points, slopes : (n, 2) and (n, 2, 2) ndarray
        Images of the discs' centres, px, and their derivatives by the undistorted directions.
    offsets : (n, m, 2) ndarray
        Points of the outlines from the centres of area, px.
    pulls : (n, m, 3) ndarray
        Of the outlines' points: what dx dy - dy dx is of a shift in the scene, by that in the camera frame, mm.
    arms : (n, m, 3) ndarray
        Points of the rims from the object's origin, mm in axes of the camera.
    rotation : (3, 3) ndarray
        Of the object.
    """

    centers: np.ndarray
    areas: np.ndarray
    points: np.ndarray
    slopes: np.ndarray
    offsets: np.ndarray
    pulls: np.ndarray
    arms: np.ndarray
    rotation: np.ndarray

    @classmethod
    def of(
        cls,
        camera: TsaiCamera | OpenCVCamera,
        pose: Pose,
        centers: NDArray[np.float64],
        radii: NDArray[np.float64],
    ) -> DiscImages:
        """Discs with checked centres (n, 3) and radii (n,), mm; ValueError if a part of a disc has no image."""
        n, rotation = len(centers), pose.rotation
        arms = np.empty((n, RIM_POINTS + 1, 3))  # the rim, and the disc's own centre
        arms[:, RIM_POINTS] = centers @ rotation.T
        arms[:, :RIM_POINTS] = arms[:, RIM_POINTS:] + radii[:, None, None] * (_RIM @ rotation[:, :2].T)
        seen = arms + pose.translation
        directions = camera.directions(seen.reshape(-1, 3))
        outlines, slopes = camera.image_and_derivative(directions)
        outlines, slopes = outlines.reshape(n, -1, 2), slopes.reshape(n, -1, 2, 2)
        points, rims = outlines[:, RIM_POINTS], slice(RIM_POINTS)
        outlines = outlines[:, rims] - points[:, None]
        normals = (_DERIVATIVE @ outlines)[..., ::-1] * (1, -1)  # (dy, -dx)
        areas = np.einsum("nmi,nmi->n", outlines, normals) / (2 * RIM_POINTS)
        if not areas.all():
            raise ValueError(
                "centers and radii: a disc has no area in the image; it is seen edge-on, or from too far away"
            )
        shifts = np.einsum("nmi,nmi->ni", outlines**2, normals) / (2 * RIM_POINTS * areas[:, None])
        pulls = np.empty((n, RIM_POINTS, 3))
        pulls[..., :2] = normals[..., :1] * slopes[:, rims, 0] + normals[..., 1:] * slopes[:, rims, 1]
        pulls[..., 2] = -np.einsum("nmi,nmi->nm", pulls[..., :2], directions.reshape(n, -1, 2)[:, rims])
        pulls /= seen[:, rims, 2:]
        offsets = outlines - shifts[:, None]
        return cls(points + shifts, areas, points, slopes[:, -1], offsets, pulls, arms[:, rims], rotation)

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radii (n,) of the circles of equal area, px."""
        return np.sqrt(2 * np.abs(self.areas))

    def by_pose(self) -> NDArray[np.float64]:
        """Derivatives (n, 3, 6) of centres and radii by the pose: see `moved` in `fit`."""
        (x, y, z), (u, v, w) = self.arms.transpose(2, 0, 1), self.pulls.transpose(2, 0, 1)
        changes = np.stack([u, v, w, y * w - z * v, z * u - x * w, x * v - y * u], axis=2)
        of_radii = changes.mean(axis=1) * (np.sign(self.areas) / self.radii)[:, None]
        return np.concatenate([self._of_centers(changes), of_radii[:, None]], axis=1)

    def by_place(self) -> NDArray[np.float64]:
        """Derivatives (n, 3, 3) of centre and area, as stated above, by the disc's own x, y and radius, mm."""
        in_plane = self.pulls @ self.rotation[:, :2]
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
    centers = camera.back_project(image_centers, as_pose(cam_from_plane, "cam_from_plane"))
    rim = camera.back_project(image_centers + image_radii[:, None] * (1, 0), cam_from_plane)
    radii = np.linalg.norm(rim - centers, axis=1)
    pose = pose_of(cam_from_plane)
    images = DiscImages.of(camera, pose, centers, radii)
    return place_discs(image_centers, image_radii, camera, pose, centers, radii, images, iterations)


def place_discs(
    image_centers: NDArray[np.float64],
    image_radii: NDArray[np.float64],
    camera: TsaiCamera | OpenCVCamera,
    pose: Pose,
    centers: NDArray[np.float64],
    radii: NDArray[np.float64],
    images: DiscImages,
    iterations: int = 30,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`back_project_discs` by Newton's method, from centres and radii near the result and their `images`."""
    centers = centers.copy()
    for _ in range(iterations):
        areas = np.sign(images.areas) * image_radii**2 / 2
        missing = np.column_stack([image_centers - images.centers, areas - images.areas])
        try:
            steps = np.linalg.solve(images.by_place(), missing[..., None])[..., 0]
        except np.linalg.LinAlgError as error:
            raise ValueError("image_centers: the plane is seen edge-on; no disc in it has such an image") from error
        centers[:, :2] += steps[:, :2]
        radii = radii + steps[:, 2]
        if np.abs(steps).max() <= SETTLED:
            break
        images = DiscImages.of(camera, pose, centers, radii)
    return centers, radii


# ---- input ----


def _as_radii(radii, count, name):
    """Return (count,) positive radii."""
    array = as_points(np.reshape(radii, (-1, 1)), 1, name).ravel()
    if len(array) != count or (array <= 0).any():
        raise ValueError(f"{name} has {len(array)} values from {array.min():g}; expected {count} positive ones")
    return array
