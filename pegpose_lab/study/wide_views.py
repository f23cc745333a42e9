"""Simulated views for lenses of any width: boards all over the image, as far as they lie in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import FisheyeCamera, OpenCVCamera, Sensor
from ..checks import as_count, as_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..camera import TsaiCamera
    from ..targets import Checkerboard

FEWEST = 25
"""Corners of a board that is used."""

WIDE_SIZE = (1600, 1200)


def _matrix(f):
    """A camera matrix with the principal point a little off the middle, px."""
    return [[f, 0, 802.0], [0, f, 597.0], [0, 0, 1]]


WIDE_LENSES = {
    "Eq. 3": (Sensor((1.0, 1.0), (802.0, 597.0), WIDE_SIZE).camera(1300.0, kappa1=4e-8), 40, {}),
    "k1, k2": (OpenCVCamera(_matrix(1000.0), [-0.25, 0.12, 0, 0, 0], WIDE_SIZE), 45, {"coefficients": ("k1", "k2")}),
    "tangential": (
        OpenCVCamera(_matrix(1000.0), [-0.1, 0, 2e-3, -1e-3, 0], WIDE_SIZE),
        45,
        {"coefficients": ("k1", "k2", "p1", "p2")},
    ),
    "action camera": (
        OpenCVCamera(_matrix(870.0), [-0.35, 0.15, 0, 0, -0.03], WIDE_SIZE),
        52,
        {"coefficients": ("k1", "k2", "k3")},
    ),
    "equidistant fisheye": (
        FisheyeCamera(_matrix(500.0), [0.02, -5e-3, 2e-3, -5e-4], WIDE_SIZE),
        78,
        {"lens": "equidistant"},
    ),
}
"""Lenses from the paper's model to a fisheye: the camera, the largest angle to its axis (deg) that is seen, and the
options of `calibrate_joint` for the model that fits it."""

BORDER, MARGIN = 5.0, (1 / 8, 7 / 8)
"""px that stay free at the image's border, and where in the image the boards' first corners are seen, in its size."""


def views_over_image(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera,
    board: Checkerboard,
    *,
    widest: float = 50.0,
    depths: tuple[float, float] = (200.0, 350.0),
    number: int = 13,
    noise: float = 0.1,
    rng: int | np.random.Generator | None = None,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Boards over the whole image, tilted by 10 to 40 degrees to the line of sight, as far as they lie in it.

    Parameters
    ----------
    camera : camera
    board : Checkerboard
    widest : float
        deg; corners farther from the axis are not seen.
    depths : (float, float)
        mm, range of the boards' distances.
    number : int
        Of views.
    noise : float
        Of the corners, px per axis.
    rng : int, Generator or None

    Returns
    -------
    object_points, image_points : list of (n, 3) and (n, 2) ndarray
        mm and px, an entry for each view.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, FisheyeCamera
    >>> camera = FisheyeCamera([[500, 0, 799.5], [0, 500, 599.5], [0, 0, 1]], [0, 0, 0, 0], (1600, 1200))
    >>> points, images = views_over_image(camera, Checkerboard(9, 7, 30.0), widest=75, number=3, rng=0)
    >>> len(images), min(map(len, images)) >= FEWEST
    (3, True)
    """
    rng, grid = np.random.default_rng(rng), board.object_points
    number, widest = as_count(number, "number", 1), np.radians(as_number(widest, "widest", 1, 89))
    size, object_points, image_points = np.array(camera.image_size), [], []
    while len(image_points) < number:
        angle, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(10, 40))
        turn = Rotation.from_rotvec(tilt * np.array([np.cos(angle), np.sin(angle), 0]))
        turn = turn * Rotation.from_rotvec([0, 0, rng.uniform(-0.5, 0.5)])
        place = [rng.uniform(*np.multiply(MARGIN, side)) for side in size]
        sight = np.append(camera.to_normalized([place])[0], 1.0)
        sight /= np.linalg.norm(sight)
        turn = Rotation.align_vectors([sight], [[0, 0, 1]])[0] * turn
        pose = RigidTransform.from_components(sight * rng.uniform(*depths) - turn.apply(grid.mean(axis=0)), turn)
        seen = pose.apply(grid)
        own = grid[np.arctan2(np.hypot(*seen[:, :2].T), seen[:, 2]) < widest]
        if len(own) < FEWEST:
            continue
        image = camera.project(own, pose)
        inside = np.all((image > BORDER) & (image < size - 1 - BORDER), axis=1)
        own, image = own[inside], image[inside]
        if len(own) >= FEWEST and min(len(np.unique(own[:, 0])), len(np.unique(own[:, 1]))) > 2:
            object_points.append(own)
            image_points.append(image + noise * rng.standard_normal(image.shape))
    return object_points, image_points
