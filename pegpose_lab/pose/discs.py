"""Discs in perspective: projection of a disc to its image, and back-projection."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_points
from ..render import disc_outlines

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..camera import OpenCVCamera, TsaiCamera

_RIM_POINTS = 32  # sums over a smooth closed curve converge exponentially: this many reach rounding errors


# ---- discs in perspective ----


SETTLED = 1e-10
"""mm: after a fixed-point step of `back_project_discs` that is no larger, no further step is needed."""


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
    outlines = disc_outlines(camera, cam_from_object, centers, radii, _RIM_POINTS)
    middle = outlines.mean(axis=1)
    x, y = np.moveaxis(outlines - middle[:, None, :], 2, 0)
    dx, dy = _derivative(x), _derivative(y)
    area = np.mean(x * dy - y * dx, axis=1) / 2  # Green's theorem, all integrals over 2 pi
    moments = np.stack([np.mean(x**2 * dy, axis=1), -np.mean(y**2 * dx, axis=1)], axis=1) / 2
    return middle + moments / area[:, None], np.sqrt(2 * np.abs(area))


def _derivative(curve):
    """Derivative by the angle of samples (n, m) of periodic functions, by their Fourier series."""
    order = np.arange(curve.shape[1] // 2 + 1)
    return np.fft.irfft(1j * order * np.fft.rfft(curve, axis=1), curve.shape[1], axis=1)


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
        Largest number of fixed-point iterations: the correction shrinks a hundredfold in each, less for large discs seen
        at a steep slant; they end when nothing moves by more than `SETTLED`.

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
    centers = camera.back_project(image_centers, cam_from_plane)
    rim = camera.back_project(image_centers + image_radii[:, None] * (1, 0), cam_from_plane)
    radii = np.linalg.norm(rim - centers, axis=1)
    for _ in range(iterations):
        seen, seen_radii = project_discs(camera, cam_from_plane, centers, radii)
        shift = seen - camera.project(centers, cam_from_plane)
        before, centers = centers, camera.back_project(image_centers - shift, cam_from_plane)
        growth = image_radii / seen_radii
        radii = radii * growth
        if max(np.abs(centers - before).max(), np.abs(radii * (growth - 1)).max()) <= SETTLED:
            break
    return centers, radii


# ---- input ----


def _as_radii(radii, count, name):
    """Return (count,) positive radii."""
    array = as_points(np.reshape(radii, (-1, 1)), 1, name).ravel()
    if len(array) != count or (array <= 0).any():
        raise ValueError(f"{name} has {len(array)} values from {array.min():g}; expected {count} positive ones")
    return array
