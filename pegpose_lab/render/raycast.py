"""Ray casting through a camera's pixels: where rays meet planes, and the mean grey value of every pixel."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..checks import as_number

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray

LATTICES = {34: 21, 144: 89}
"""Rays in a quarter of a pixel at an edge, and the stride of their Fibonacci lattice, even along every direction."""

_CHUNK = 50_000  # rays at a time: keeps temporary arrays in the cache


class _View:
    """Where undistorted directions (2, n) of the camera, (x/z, y/z), meet planes z = const of an object's frame.

    Points are (2, n) arrays of float32 from here on: exact to 0.0001 px, and half the memory.
    """

    def __init__(self, cam_from_object):
        object_from_cam = cam_from_object.inv()
        self.origin = object_from_cam.translation
        self.rotation = object_from_cam.rotation.as_matrix()

    def on_plane(self, directions, z):
        """Return x and y (2, n), mm; a ray that runs away from the plane ends far outside."""
        side = np.sign(z - self.origin[2])
        # written out, as the last bits of a matrix product depend on how it is cut into blocks
        x, y, slope = (a * directions[0] + b * directions[1] + c for a, b, c in np.float32(side * self.rotation))
        distance = np.float32(abs(z - self.origin[2])) / np.maximum(slope, np.float32(1e-6))
        origin = np.float32(self.origin)
        return np.stack([origin[0] + distance * x, origin[1] + distance * y])


def _dot(a, b):
    """Scalar products (n,) of the columns of two (2, n) arrays."""
    return a[0] * b[0] + a[1] * b[1]


def _offset(points, center):
    """Points (2, n) as seen from `center`."""
    return np.stack([points[0] - float(center[0]), points[1] - float(center[1])])


def _outside(coordinate, end, margin):
    return (coordinate < -margin) | (coordinate >= end + margin)


# ---- from rays to pixels ----


def _cast(camera, shade, blur, box=None, background=0.0, rays=34):
    """Mean grey value of every pixel's area through the blurring lens, float32.

    Only the pixels within `box` are cast; the others get the value `background`.
    """
    width, height = camera.image_size
    image = np.full((height, width), background, np.float32)
    top, bottom, left, right = box or (0, height, 0, width)
    if top < bottom and left < right:
        grey, part = _cast_centers(shade, _pixel_directions(camera)[:, top:bottom, left:right])
        quarters = cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
        y, x = np.nonzero(_borders(part))
        cut = _are_cut(camera, shade, np.column_stack([x + left, y + top]), part[y, x])
        y, x = y[cut], x[cut]
        samples = _sample_quarters(camera, shade, np.column_stack([x + left, y + top]), rays)
        quarters[2 * y[:, None] + [0, 0, 1, 1], 2 * x[:, None] + [0, 1, 0, 1]] = samples
        blurred = _blur(quarters, 2 * blur)
        image[top:bottom, left:right] = cv2.resize(blurred, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return image


def _cast_centers(shade, directions):
    """Grey value and part (height, width) that the rays of the pixels' centres meet."""
    shape = directions.shape[1:]
    grey, part = np.empty(shape, np.float32), np.empty(shape, np.uint8)
    step = max(1, _CHUNK // shape[1])
    for row in range(0, shape[0], step):
        rows = slice(row, row + step)
        level, number = shade(directions[:, rows].reshape(2, -1))
        grey[rows], part[rows] = level.reshape(-1, shape[1]), number.reshape(-1, shape[1])
    return grey, part


def _borders(part):
    """Pixels with a neighbour (of eight) that shows another part."""
    kernel = np.ones((3, 3), np.uint8)
    highest = cv2.dilate(part, kernel, borderType=cv2.BORDER_REPLICATE)
    return highest != cv2.erode(part, kernel, borderType=cv2.BORDER_REPLICATE)


def _are_cut(camera, shade, pixels, part):
    """Which of `pixels` (n, 2) show another part in a corner than in the centre (n,)."""
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)])
    points = (pixels[:, None, :] + corners).reshape(-1, 2)
    seen = shade(camera.to_normalized(points).T.astype(np.float32))[1].reshape(-1, 4)
    return np.any(seen != part[:, None], axis=1)


def _sample_quarters(camera, shade, pixels, rays):
    """Mean grey values (n, 4) over the quarters of `pixels` (n, 2): upper left, upper right, lower left, lower right."""
    index = np.arange(rays)
    lattice = np.column_stack([index + 0.5, (index * LATTICES[rays] + 0.5) % rays]) / rays / 2
    offsets = (np.array([(-0.5, -0.5), (0, -0.5), (-0.5, 0), (0, 0)])[:, None, :] + lattice).reshape(-1, 2)
    grey = np.empty((len(pixels), 4), np.float32)
    step = max(1, _CHUNK // len(offsets))
    for first in range(0, len(pixels), step):
        points = (pixels[first : first + step, None, :] + offsets).reshape(-1, 2)
        values = shade(camera.to_normalized(points).T.astype(np.float32))[0]
        grey[first : first + step] = values.reshape(-1, 4, rays).mean(axis=2)
    return grey


@lru_cache(maxsize=2)
def _pixel_directions(camera):
    """Undistorted directions (2, height, width) of a camera's pixel centres."""
    width, height = camera.image_size
    y, x = np.mgrid[:height, :width]
    directions = camera.to_normalized(np.column_stack([x.ravel(), y.ravel()]).astype(float))
    return directions.T.reshape(2, height, width).astype(np.float32)


def _blur(image, sigma):
    """Gaussian blur, cut at 4.5 standard deviations."""
    if sigma == 0:
        return image
    taps = np.arange(-np.ceil(4.5 * sigma), np.ceil(4.5 * sigma) + 1)
    weights = np.exp(-0.5 * (taps / sigma) ** 2)
    kernel = (weights / weights.sum()).astype(np.float32)
    return cv2.sepFilter2D(image, -1, kernel, kernel, borderType=cv2.BORDER_REPLICATE)


def expose(
    image: NDArray[np.float32], noise: float | None, rng: int | Sequence[int] | np.random.Generator | None = None
) -> NDArray[Any]:
    """Add sensor noise to an image and round it to 8 bits; with noise None return it unchanged.

    Parameters
    ----------
    image : (height, width) float32
    noise : float or None
        Standard deviation, grey values.
    rng : seed or Generator

    Returns
    -------
    (height, width) uint8 ndarray, or `image`

    Raises
    ------
    ValueError
        If `noise` is unusable.

    Examples
    --------
    >>> import numpy as np
    >>> expose(np.array([[10.4, 300.0]], np.float32), 0.0).tolist()
    [[10, 255]]
    """
    if noise is None:
        return image
    noise = as_number(noise, "noise", 0, 255)
    if noise > 0:
        image = image + np.float32(noise) * np.random.default_rng(rng).standard_normal(image.shape, np.float32)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)
