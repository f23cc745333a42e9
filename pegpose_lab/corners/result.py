"""The corners of a board in one image: places, numbers, uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..targets import Checkerboard


@dataclass(frozen=True, eq=False)
class BoardCorners:
    """Corners of a checkerboard, or of a part of it, in one image; in the order of `board.object_points`.

    Attributes
    ----------
    board : Checkerboard
    index : (n,) ndarray of int
        Which rows of `board.object_points` are seen, ascending.
    image_points : (n, 2) ndarray
        px.
    covariances : (n, 2, 2) ndarray
        Of the image points, px^2, from the residuals of each corner's fit.  They are valid if the noise is independent
        from pixel to pixel; compressed, smoothed or sharpened pictures have larger errors.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> board = pl.Checkerboard(columns=7, rows=5, square=20.0)
    >>> image = pl.render_board(camera, RigidTransform.from_translation([-60.0, -40.0, 400.0]), board, rng=0)
    >>> corners = pl.locate_board(image[:220], board)  # the lowest row is cut off
    >>> corners.whole, len(corners.index), corners.object_points[-1].tolist()
    (False, 28, [120.0, 60.0, 0.0])
    """

    board: Checkerboard
    index: np.ndarray
    image_points: np.ndarray
    covariances: np.ndarray

    @property
    def object_points(self) -> NDArray[np.float64]:
        """(n, 3) mm, of the corners that are seen."""
        return self.board.object_points[self.index]

    @property
    def sigmas(self) -> NDArray[np.float64]:
        """(n,) px, standard deviations of x and y: the root of their mean variance."""
        return np.sqrt(np.trace(self.covariances, axis1=1, axis2=2) / 2)

    @property
    def whole(self) -> bool:
        """Whether all corners of the board are seen."""
        return len(self.index) == self.board.columns * self.board.rows
