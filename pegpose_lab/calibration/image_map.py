"""Values over the image: a regular grid of pixels, and a map of what was computed at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..camera import UNKNOWN_SIZE
from ..checks import as_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

COLUMNS = 25
"""Columns of a grid: lenses are smooth, and a map of 40 x 40 px cells of a 1600 x 1200 image shows all of their shape."""


@dataclass(frozen=True, eq=False)
class ImageMap:
    """A value at each point of a regular grid over the image.

    Attributes
    ----------
    x, y : (m,) and (k,) ndarray
        px; the outermost are the centres of the image's outermost pixels.
    values : (k, m) ndarray
    label : str
        What the values are, with their unit.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab.calibration import ImageMap, image_grid
    >>> x, y, points = image_grid((640, 480), columns=9)
    >>> ImageMap.of_points(x, y, np.hypot(*points.T), "distance from the first pixel (px)").values.shape
    (7, 9)
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    values: NDArray[np.float64]
    label: str

    @classmethod
    def of_points(
        cls, x: NDArray[np.float64], y: NDArray[np.float64], values: NDArray[np.float64], label: str
    ) -> ImageMap:
        """The map of values (k m,) at the points of `image_grid`, row by row."""
        return cls(x, y, np.reshape(values, (len(y), len(x))), label)


def image_grid(
    image_size: tuple[int, int], columns: int = COLUMNS
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return a regular grid from corner to corner of an image, in cells that are as square as can be.

    Parameters
    ----------
    image_size : (int, int)
        Width and height, px.
    columns : int
        Number of points along x, at least 2.

    Returns
    -------
    x, y : (columns,) and (rows,) ndarray
        px.
    points : (rows columns, 2) ndarray
        px, row by row.

    Raises
    ------
    ValueError
        If the image size is not known, or `columns` is not a whole number of at least 2.

    Examples
    --------
    >>> from pegpose_lab.calibration import image_grid
    >>> x, y, points = image_grid((641, 481), columns=3)
    >>> x.tolist(), y.tolist(), points[0].tolist()
    ([0.0, 320.0, 640.0], [0.0, 240.0, 480.0], [0.0, 0.0])
    """
    columns = as_count(columns, "columns", 2)
    if tuple(image_size) == UNKNOWN_SIZE:
        raise ValueError("image_size of the camera is not known; calibrate with it, or state the points")
    right, bottom = np.subtract(image_size, 1)
    x = np.linspace(0, right, columns)
    y = np.linspace(0, bottom, max(2, 1 + round((columns - 1) * bottom / max(right, 1))))
    return x, y, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
