"""Corners of a checkerboard in an image, to sub-pixel accuracy (Sect. 4).

OpenCV finds the grid (`grid`).  A sub-pixel fit of all corners (`measure`, `fit`) and the surroundings of the grid
(`whole_board`) then decide whether it is accepted.  Of a board that is cut or partly hidden, `part` has the corners
that are seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import DetectionError, as_image
from .grid import candidate_grids
from .measure import SMALLEST_PITCH, edge_normals, refine
from .part import largest_part, number_part
from .result import BoardCorners
from .whole_board import check_ends, check_fields

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..targets import Checkerboard

_ADVICE = "show the whole board with a light rim, evenly lit and in focus; check columns and rows"


def find_corners(image: ArrayLike, board: Checkerboard) -> NDArray[np.float64]:
    """Find the inner corners of a checkerboard (chessboard) to sub-pixel accuracy.

    Parameters
    ----------
    image : (height, width) uint8
    board : Checkerboard
        At least 3 columns and 3 rows.

    Returns
    -------
    (rows * columns, 2) ndarray
        px, in the order of `board.object_points`.

    Raises
    ------
    ValueError
        If the image is unusable or the board has fewer than 3 columns or rows.
    DetectionError
        If the whole board is not seen, the pattern goes on beyond it, its corners are too close together, one of
        them is not a clear crossing of two edges, or odd and even lines are shifted (interlacing).

    Notes
    -----
    Columns run along x and rows along y of a frame whose z axis points away from the camera: the order
    is never that of a mirrored board.  The remaining rotations are told apart by the colours where these
    differ: the square outside the first corner (diagonally opposite to the board's inside) is black.  Where
    several orders remain (the paper's 8 x 6 board looks the same after half a turn), the first corner is the
    one nearest to the top left of the image.

    The search uses the image at fixed sizes (see `grid`), so its time is bounded even where there is no board.
    In an image of 12 megapixels, squares smaller than about 12 px may be missed.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> board = pl.Checkerboard(columns=5, rows=4, square=20.0)
    >>> cam_from_board = RigidTransform.from_components([-40.0, -30.0, 400.0], Rotation.from_rotvec([0.2, 0, 0]))
    >>> image = pl.render_board(camera, cam_from_board, board, rng=0)
    >>> corners = pl.find_corners(image, board)
    >>> error = corners - camera.project(board.object_points, cam_from_board)
    >>> corners.shape, bool(abs(error).max() < 0.05)
    ((20, 2), True)
    """
    image = _checked(image, board)
    whole, refusal = _whole_board(image, board)
    if whole is not None:
        return whole.image_points
    corners = _board_part(image, board, refusal)
    if corners.whole:
        return corners.image_points
    total = board.columns * board.rows
    reason = refusal or f"no whole board of {board.columns} x {board.rows} inner corners is seen; {_ADVICE}"
    raise DetectionError(
        f"{reason} (`locate_board` measures the {len(corners.index)} of {total} corners that are clear)"
    )


def locate_board(image: ArrayLike, board: Checkerboard) -> BoardCorners:
    """Find a checkerboard (chessboard), or a part of it, with the numbers and the uncertainty of its corners.

    A board that is cut by the border of the image, or partly hidden by a hand or by glare, is measured as far as it is
    seen, if it can be told which part that is: by the light rim that is seen beyond some of its sides, by the number of
    lines, and by the colours.

    Parameters
    ----------
    image : (height, width) uint8
    board : Checkerboard
        At least 3 columns and 3 rows.

    Returns
    -------
    BoardCorners
        With the order of `find_corners` if the whole board is seen.  `calibrate_joint` takes ``object_points`` and
        ``image_points`` of views of different parts.

    Raises
    ------
    ValueError
        If the image is unusable or the board has fewer than 3 columns or rows.
    DetectionError
        If no 3 x 3 corners are seen, if it is not determined which part of the board they are, if they are not
        of such a board, and as `find_corners` if the pattern goes on beyond the board or lines are shifted.

    Notes
    -----
    A rim counts if the dark squares along it end one square beyond the outermost corners and it is light behind the light
    squares; a sheet of light paper that covers the board exactly along a line of squares would pass for it.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> board = pl.Checkerboard(columns=7, rows=5, square=20.0)
    >>> image = pl.render_board(camera, RigidTransform.from_translation([-60.0, -40.0, 400.0]), board, rng=0)
    >>> whole, part = pl.locate_board(image, board), pl.locate_board(image[:220], board)
    >>> whole.whole, len(whole.index), len(part.index), bool(whole.sigmas.max() < 0.05)
    (True, 35, 28, True)
    """
    image = _checked(image, board)
    whole, refusal = _whole_board(image, board)
    return whole or _board_part(image, board, refusal)


def _checked(image, board):
    """The image; raises ValueError if it or the board is unusable."""
    image = as_image(image)
    if min(board.columns, board.rows) < 3:
        raise ValueError(f"board has {board.columns} columns and {board.rows} rows; expected at least 3 of each")
    return image


def _whole_board(image, board):
    """The corners of a whole board, or None and why the first grid of its size was refused (None if there was none)."""
    refusal = None
    for candidate in candidate_grids(image, board.columns, board.rows):
        try:
            corners, fits = _measure(image, *candidate)
        except DetectionError as error:
            refusal = refusal or error
        else:
            for check in (check_fields, check_ends):
                check(image, corners.reshape(board.rows, board.columns, 2))
            return BoardCorners(board, np.arange(len(corners)), corners, fits.covariance), None
    return None, refusal


def _board_part(image, board, refusal):
    """The corners of what is seen of a board; raises `refusal` if nothing is, or no more than the grid that was refused."""
    part = largest_part(image, board)
    if part is None:
        raise refusal or _nothing_seen(image, board)
    try:
        corners = number_part(image, board, part)
    except DetectionError as error:
        same = sorted(part.seen.shape) == sorted((board.columns, board.rows))
        raise refusal if refusal and same else error from None
    check_fields(image, corners.image_points[None])
    if corners.whole:
        check_ends(image, corners.image_points.reshape(board.rows, board.columns, 2))
    return corners


def _nothing_seen(image, board):
    """The error for an image without any board."""
    height, width = image.shape
    return DetectionError(
        f"no board of {board.columns} x {board.rows} inner corners in the {width} x {height} image (grey values "
        f"{image.min()} to {image.max()}); {_ADVICE}"
    )


def _measure(image, grid, view, scale, offset):
    """The corners (n, 2), px of `image`, of a grid that was found in a view of it, and their fits."""
    grid = _orient(view, grid)
    if scale < 0.5 and edge_normals(grid)[1].min() >= SMALLEST_PITCH:
        grid = refine(view, grid)[0].reshape(grid.shape)
    return refine(image, (grid + 0.5) / scale - 0.5 + offset)


def _orient(image, grid):
    """Reorder a grid as the docstring of `find_corners` says."""
    right, down = (grid[:, -1] - grid[:, 0]).mean(axis=0), (grid[-1] - grid[0]).mean(axis=0)
    if right[0] * down[1] - right[1] * down[0] < 0:
        grid = grid[::-1]
    turns = (0, 1, 2, 3) if grid.shape[0] == grid.shape[1] else (0, 2)
    candidates = [np.rot90(grid, turn) for turn in turns]
    black_first = [candidate for candidate in candidates if _first_cell_is_dark(image, candidate)]
    return min(black_first or candidates, key=lambda candidate: np.hypot(*candidate[0, 0]))


def _first_cell_is_dark(image, grid):
    """Whether the cell inside the first corner, and with it the square outside, is one of the dark ones."""
    middles = (grid[:-1, :-1] + grid[:-1, 1:] + grid[1:, :-1] + grid[1:, 1:]) / 4
    x, y = np.clip(np.rint(middles).astype(int), 0, np.array(image.shape[::-1]) - 1).reshape(-1, 2).T
    row, column = np.indices(middles.shape[:2])
    parity = 1.0 - 2 * ((row + column) % 2)
    values = image[y, x].astype(float)
    return np.sum(parity.ravel() * (values - values.mean())) < 0
