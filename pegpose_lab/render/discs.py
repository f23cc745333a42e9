"""The exact image of a disc: its outline, centroid and area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_count, as_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera


@dataclass(frozen=True)
class TrueDisc:
    """Exact image of a disc: the centroid (2,) px of its area, the area px^2, and sqrt(area / pi) px.

    Examples
    --------
    >>> import numpy as np
    >>> TrueDisc(np.array([10.0, 20.0]), np.pi * 9, 3.0).radius
    3.0
    """

    centroid: np.ndarray
    area: float
    radius: float


def true_disc(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera, cam_from_object: RigidTransform, center: ArrayLike, radius: float
) -> TrueDisc:
    """Return the exact image of a disc that lies in a plane z = const of an object's frame.

    The centroid is that of the imaged area, which is not the image of the disc's centre.

    Parameters
    ----------
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera
    cam_from_object : RigidTransform
    center : (3,) array_like
        mm, in the object's frame.
    radius : float
        mm.

    Returns
    -------
    TrueDisc

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> disc = true_disc(camera, RigidTransform.from_translation([0, 0, 400.0]), [0, 0, 0], 10.0)
    >>> disc.centroid.round(3).tolist(), round(disc.radius, 3)
    ([199.5, 149.5], 20.0)
    """
    outline = disc_outline(camera, cam_from_object, center, radius, 2000)
    origin = outline.mean(axis=0)
    x, y = (outline - origin).T
    x_next, y_next = np.roll(x, -1), np.roll(y, -1)
    cross = x * y_next - x_next * y
    area = cross.sum() / 2
    centroid = np.array([np.sum((x + x_next) * cross), np.sum((y + y_next) * cross)]) / (6 * area)
    return TrueDisc(origin + centroid, abs(area), float(np.sqrt(abs(area) / np.pi)))


def disc_outline(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera,
    cam_from_object: RigidTransform,
    center: ArrayLike,
    radius: float,
    n_points: int = 100,
) -> NDArray[np.float64]:
    """Image points (n_points, 2), px, on the rim of a disc that lies in a plane z = const of an object's frame.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> disc_outline(camera, RigidTransform.from_translation([0, 0, 400.0]), [0, 0, 0], 10.0, 4).round(3).tolist()
    [[219.5, 149.5], [199.5, 169.5], [179.5, 149.5], [199.5, 129.5]]
    """
    radius = as_number(radius, "radius", 0)
    return disc_outlines(camera, cam_from_object, [center], [radius], as_count(n_points, "n_points", 3))[0]


def disc_outlines(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera,
    cam_from_object: RigidTransform,
    centers: ArrayLike,
    radii: ArrayLike,
    n_points: int,
) -> NDArray[np.float64]:
    """`disc_outline` of m discs, centres (m, 3) and radii (m,), mm: (m, n_points, 2), px.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> place = RigidTransform.from_translation([0, 0, 400.0])
    >>> disc_outlines(camera, place, [[0, 0, 0], [30, 0, 0]], [10.0, 5.0], 50).shape
    (2, 50, 2)
    """
    angles = np.linspace(0, 2 * np.pi, n_points, endpoint=False)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(n_points)])
    points = np.asarray(centers)[:, None, :] + np.asarray(radii)[:, None, None] * rim
    return camera.project(points.reshape(-1, 3), cam_from_object).reshape(len(points), n_points, 2)


# ---- from rays to pixels ----


def _bounding_box(camera, cam_from_hub, hub, swarf, margin):
    """Rows and columns (top, bottom, left, right) of the image that show anything but background."""
    reach = max([hub.radius, hub.pitch_circle_diameter / 2 + hub.peg_radius, *(np.hypot(*swarf.T[:2]) + swarf[:, 3])])
    outlines = [disc_outline(camera, cam_from_hub, (0, 0, z), reach) for z in (0.0, hub.peg_height)]
    low = np.floor(np.min(np.vstack(outlines), axis=0)).astype(int) - margin
    high = np.ceil(np.max(np.vstack(outlines), axis=0)).astype(int) + margin
    width, height = camera.image_size
    left, right = np.clip([low[0], high[0]], 0, width)
    top, bottom = np.clip([low[1], high[1]], 0, height)
    return top, bottom, left, right
