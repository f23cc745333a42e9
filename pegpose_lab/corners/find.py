"""Corners of a checkerboard in an image, to sub-pixel accuracy (Sect. 4).

OpenCV finds the grid (`grid`).  A sub-pixel fit of all corners (`fit`) and the surroundings of the grid
(`whole_board`) then decide whether it is accepted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import DetectionError, as_image
from .fit import fit_corners
from .grid import candidate_grids, seen_grid
from .whole_board import check_ends, check_fields

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..targets import Checkerboard

WINDOW = (
    15.0  # px, largest radius of a window: a larger one has less noise, but more bias from edges that the lens bends
)
REACH = 0.4  # of the distance to the next corner: the window's radius on small boards
SMALLEST_PITCH = 7.0  # px between neighbouring corners; below, a window holds too few pixels
PASSES = 3  # of the fit; after them the place where the grid was found changes a corner by less than 1e-5 px
LARGEST_MOVE = 0.25  # of the pitch, from where the grid was found
LARGEST_SIGMA = 0.5  # px
LARGEST_MISFIT = 0.4  # of the contrast, or 3 times the board's median (noise): beyond, something covers it
SMALLEST_CONTRAST = 0.15  # of the board's median


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
    image = as_image(image)
    if min(board.columns, board.rows) < 3:
        raise ValueError(f"board has {board.columns} columns and {board.rows} rows; expected at least 3 of each")
    refusal = None
    for candidate in candidate_grids(image, board.columns, board.rows):
        try:
            corners = _measure(image, *candidate)
        except DetectionError as error:
            refusal = refusal or error
        else:
            for check in (check_fields, check_ends):
                check(image, corners.reshape(board.rows, board.columns, 2))
            return corners
    raise _not_found(image, board, refusal)


def _not_found(image, board, refusal):
    """The error for an image without the board: `refusal` if a grid of its size was refused, else what is seen."""
    asked, seen = sorted((board.columns, board.rows)), _seen_size(image)
    if refusal and (seen is None or sorted(seen) == asked):
        return refusal
    height, width = image.shape
    instead = f"; a board of {seen[0]} x {seen[1]} is seen" if seen else ""
    return DetectionError(
        f"no board of {board.columns} x {board.rows} inner corners in the {width} x {height} image (grey values "
        f"{image.min()} to {image.max()}){instead}; show the whole board with a light rim, evenly lit and in "
        "focus; check columns and rows"
    )


def _seen_size(image):
    """Numbers of columns and rows, the larger first, of the clear corners of any board that is seen, or None."""
    grid, view = seen_grid(image)
    if grid is None or min(grid.shape[:2]) < 3 or _edge_normals(grid)[1].min() < SMALLEST_PITCH:
        return None
    clear = ~_unclear(*_fit(view, grid, passes=1), grid).reshape(grid.shape[:2])
    for _ in range(4):  # OpenCV may count a line along the rim
        for _side in range(4):
            if clear.shape[0] > 3 and clear[0].mean() < 0.6:
                clear = clear[1:]
            clear = np.rot90(clear)
    return (max(clear.shape), min(clear.shape)) if clear.mean() > 0.9 else None


def _measure(image, grid, view, scale, offset):
    """The corners (n, 2), px of `image`, of a grid that was found in a view of it."""
    grid = _orient(view, grid)
    if scale < 0.5 and _edge_normals(grid)[1].min() >= SMALLEST_PITCH:
        grid = _refine(view, grid).reshape(grid.shape)
    return _refine(image, (grid + 0.5) / scale - 0.5 + offset)


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


def _refine(image, grid):
    """Fit every corner of an oriented grid (rows, columns, 2); return (n, 2) px."""
    pitch = _edge_normals(grid)[1].min()
    if pitch < SMALLEST_PITCH:
        raise DetectionError(
            f"neighbouring corners are down to {pitch:.1f} px apart; at least {SMALLEST_PITCH:g} px are "
            "needed: bring the board closer or take a larger image"
        )
    corners, fits = _fit(image, grid)
    _check(corners, fits, grid)
    return corners


def _fit(image, grid, passes=PASSES):
    """Corners (n, 2), px, of a grid (rows, columns, 2), and their fits.

    Window and start come from the grid at first, then from the corners, so the result depends on the image
    alone.  All passes but the last are rough; they stop if more than a tenth of the corners are unclear.
    """
    corners = grid.reshape(-1, 2)
    start = _edge_normals(grid)[0]
    for count in range(passes):
        pixels, offsets = np.rint(corners), corners - np.rint(corners)
        _, pitch = _edge_normals(corners.reshape(grid.shape))
        values, weights, lattice = _windows(image, pixels.astype(int), offsets, np.minimum(REACH * pitch, WINDOW))
        fits = fit_corners(values, weights, lattice, np.column_stack([offsets, start]), rough=count < PASSES - 1)
        corners, start = pixels + fits.parameters[:, :2], fits.parameters[:, 2:]
        if _unclear(corners, fits, grid, converged=count < PASSES - 1).mean() > 0.1:
            break
    return corners, fits


def _edge_normals(grid):
    """Directions (n, 2) rad of the normals of the edges along columns and along rows, and the pitch (n,) px.

    The first normal points along a row, the second along a column.
    """
    along_row, along_column = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    pitch = np.minimum(np.linalg.norm(along_row, axis=2), np.linalg.norm(along_column, axis=2))
    first = np.arctan2(-along_column[..., 0], along_column[..., 1])
    second = np.arctan2(along_row[..., 0], -along_row[..., 1])
    return np.column_stack([first.ravel(), second.ravel()]), pitch.ravel()


def _windows(image, pixels, offsets, radii):
    """Grey values and weights (n, k) in windows around pixels, and the windows' lattice (2, k).

    The weight is 1 within the radius around pixel + offset and falls to 0 over one px; outside of the image it
    is 0.
    """
    half = int(np.ceil(radii.max() + 1.3))  # an offset is up to 0.71 px
    lattice = np.indices((2 * half + 1, 2 * half + 1)).reshape(2, -1)[::-1] - half
    lattice = lattice[:, np.hypot(*lattice) <= half]
    x, y = (pixels[:, :, None] + lattice).transpose(1, 0, 2)
    height, width = image.shape
    seen = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    distances = np.hypot(*(lattice - offsets[:, :, None]).transpose(1, 0, 2))
    weights = seen * np.clip(radii[:, None] - distances + 0.5, 0.0, 1.0)
    values = image[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)].astype(float)
    return values, weights, lattice.astype(float)


def _unclear(corners, fits, grid, converged=False):
    """Which corners (n,) ran away, did not converge, are covered, or have the colours of their neighbours.

    With `converged` all fits count as converged (for a rough fit).
    """
    row, column = np.divmod(np.arange(len(corners)), grid.shape[1])
    amplitude = fits.parameters[:, 6]
    signs = np.sign(amplitude) * (1 - 2 * ((row + column) % 2))
    majority = 1.0 if np.sum(signs) > 0 else -1.0
    moved = np.linalg.norm(corners - grid.reshape(-1, 2), axis=1)
    unclear = ~(fits.converged | converged) | (signs != majority) | (moved > LARGEST_MOVE * _edge_normals(grid)[1])
    faint = np.abs(amplitude) < SMALLEST_CONTRAST * np.median(np.abs(amplitude))
    misfit = fits.misfit > max(LARGEST_MISFIT, 3 * np.median(fits.misfit))
    return unclear | faint | misfit | (fits.sigma > LARGEST_SIGMA)


def _check(corners, fits, grid):
    """Raise if a corner is unclear."""
    bad = grid.reshape(-1, 2)[_unclear(corners, fits, grid)]
    if len(bad):
        places = ", ".join(f"({x:.0f}, {y:.0f})" for x, y in bad[:3])
        raise DetectionError(
            f"{len(bad)} of {len(corners)} corners are not clear crossings of two edges, near {places} px; look "
            "there for glare, dirt or something in front of the board"
        )
