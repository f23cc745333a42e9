"""Rendered images of a checkerboard."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_number
from .raycast import _cast, _outside, _View, expose

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray
    from scipy.spatial.transform import RigidTransform

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from ..targets import Checkerboard


@dataclass(frozen=True)
class BoardLook:
    """Grey values (0..255) of a board: its black and white squares, and what lies around it."""

    black: float = 30.0
    white: float = 220.0
    surroundings: float = 120.0
    margin: float = 0.5  # white rim around the squares, in squares


def render_board(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera,
    cam_from_board: RigidTransform,
    board: Checkerboard,
    *,
    look: BoardLook = BoardLook(),
    blur: float = 0.9,
    noise: float | None = 2.0,
    rng: int | Sequence[int] | np.random.Generator | None = None,
) -> NDArray[Any]:
    """Render an image of a checkerboard (chessboard), with lens distortion, blur and noise.

    Parameters
    ----------
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera
    cam_from_board : RigidTransform
    board : Checkerboard
    look : BoardLook
    blur : float
        Standard deviation of the Gaussian blur, px.
    noise : float
        Standard deviation of the noise, grey values.
    rng : seed or Generator

    Returns
    -------
    (height, width) uint8 ndarray

    Raises
    ------
    ValueError
        If the board lies behind the camera, or a parameter is unusable.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> board = pl.Checkerboard(columns=5, rows=4, square=20.0)
    >>> image = pl.render_board(camera, RigidTransform.from_translation([-40.0, -30.0, 400.0]), board, rng=0)
    >>> image.shape, image.dtype
    ((300, 400), dtype('uint8'))
    """
    blur = as_number(blur, "blur", 0, 100)
    camera.project(board.object_points, cam_from_board)  # raises if a corner is behind the camera
    view = _View(cam_from_board)

    def shade(directions):
        x, y = view.on_plane(directions, 0.0) / board.square + 1
        column, row = np.floor(x), np.floor(y)
        part = ((column + row) % 2).astype(np.uint8)
        part[_outside(x, board.columns + 1, 0) | _outside(y, board.rows + 1, 0)] = 1
        part[_outside(x, board.columns + 1, look.margin) | _outside(y, board.rows + 1, look.margin)] = 2
        return np.take(np.float32([look.black, look.white, look.surroundings]), part), part

    return expose(_cast(camera, shade, blur), noise, rng)
