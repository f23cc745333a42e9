"""Corners of a checkerboard in a picture, to sub-pixel accuracy (Sect. 4).

OpenCV finds the grid; what it is worth is then decided here, by one fit for all corners.  Near a corner the
picture of two crossing, blurred edges is

    I = m + a erf(d_1 / (sqrt(2) s)) erf(d_2 / (sqrt(2) s)) + g_x x + g_y y,

d_1 and d_2 the signed distances to the edges, s the blur, and g a gradient of the light, which would
otherwise pull the corner.  Least squares over a round window (maximum likelihood under white noise) gives the
corner, the directions of both edges, the blur and the levels together.
"""

import cv2
import numpy as np
from scipy.special import erf

from .checks import DetectionError, as_image

WINDOW = 15.0  # px, largest radius of a window: noise falls with it, the pull of edges bent by the lens grows
SMALLEST_BLUR, LARGEST_BLUR = 0.3, 5.0  # px
REACH = 0.4  # of the distance to the next corner: the window's radius on small boards
SMALLEST_PITCH = 7.0  # px between neighbouring corners; below, a window holds too few pixels
_STEPS = 30
_TOLERANCE = 1e-5  # px
_STEP_LIMITS = np.array([1.0, 1.0, 0.2, 0.2, 0.5] + [np.inf] * 4)


def find_corners(image, board):
    """Find the inner corners of a checkerboard.

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
        If the whole board is not seen, its corners are too close together, or one of them is not a clear
        crossing of two edges.

    Notes
    -----
    Columns run along x and rows along y of a frame whose z axis points away from the camera: the order
    is never that of a mirrored board.  What rotations are left is decided by the colours where they
    differ: the square outside the first corner (diagonally opposite to the board's inside) is black.  Where
    several orders remain (the paper's 8 x 6 board looks the same after half a turn), the first corner is the
    one nearest to the top left of the picture.
    """
    image = as_image(image)
    if min(board.columns, board.rows) < 3:
        raise ValueError(f"board has {board.columns} columns and {board.rows} rows; expected at least 3 of each")
    grid = _orient(image, _find_grid(image, board.columns, board.rows))
    return _refine(image, grid)


def _find_grid(image, columns, rows):
    """The corners (rows, columns, 2) to a pixel or so, in any of the orders that fit the board."""
    sectors = [cv2.CALIB_CB_NORMALIZE_IMAGE, cv2.CALIB_CB_EXHAUSTIVE]
    classic = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    attempts = [(cv2.findChessboardCornersSB, flags) for flags in sectors] + [(cv2.findChessboardCorners, classic)]
    for detect, flags in attempts if min(image.shape) > 2 * SMALLEST_PITCH else []:
        found, corners = detect(image, (columns, rows), flags=flags)
        if found:
            return np.asarray(corners, np.float64).reshape(rows, columns, 2)
    height, width = image.shape
    raise DetectionError(
        f"no board of {columns} x {rows} inner corners in the {width} x {height} picture (grey values "
        f"{image.min()} to {image.max()}); show the whole board with a light rim, evenly lit and in focus; check "
        "columns and rows"
    )


def _orient(image, grid):
    """Turn a grid into the order that `find_corners` promises."""
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
    """Fit the model of the module's text to every corner of an oriented grid; return (n, 2) px."""
    start = grid.reshape(-1, 2)
    normals, pitch = _edge_normals(grid)
    if pitch.min() < SMALLEST_PITCH:
        raise DetectionError(
            f"neighbouring corners are down to {pitch.min():.1f} px apart; at least {SMALLEST_PITCH:g} px are "
            "needed: bring the board closer or take a larger picture"
        )
    pixels = np.rint(start)
    values, weights, lattice = _windows(image, pixels.astype(int), np.minimum(REACH * pitch, WINDOW))
    parameters, converged = _fit(values, weights, lattice, np.column_stack([start - pixels, normals]))
    corners = pixels + parameters[:, :2]
    _check(corners, start, parameters[:, 6], converged, pitch, grid.shape[1])
    return corners


def _edge_normals(grid):
    """Directions (n, 2) rad of the normals of the edges along columns and along rows, and the pitch (n,) px.

    The first normal points along a row, the second along a column.
    """
    along_row, along_column = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    pitch = np.minimum(np.linalg.norm(along_row, axis=2), np.linalg.norm(along_column, axis=2))
    first = np.arctan2(-along_column[..., 0], along_column[..., 1])
    second = np.arctan2(along_row[..., 0], -along_row[..., 1])
    return np.column_stack([first.ravel(), second.ravel()]), pitch.ravel()


def _windows(image, pixels, radii):
    """Grey values and weights (n, k) in square windows around pixels, and the windows' lattice (2, k).

    The weight is 1 within the radius and the picture, else 0.
    """
    half = int(np.ceil(radii.max()))
    lattice = np.indices((2 * half + 1, 2 * half + 1)).reshape(2, -1)[::-1] - half
    x, y = (pixels[:, :, None] + lattice).transpose(1, 0, 2)
    height, width = image.shape
    seen = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    weights = seen & (np.hypot(*lattice) <= radii[:, None])
    values = image[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)].astype(float)
    return values, weights.astype(float), lattice.astype(float)


def _fit(values, weights, lattice, start):
    """Gauss-Newton on all corners at once.

    Parameters are x, y, the two normals' directions, log s, m, a, g_x, g_y; `start` holds the first four.
    Returns them (n, 9) and whether the last step was small (n,).
    """
    parameters = np.hstack([start, np.zeros((len(start), 5))])
    product = _model(parameters, lattice)[1][:, :, 6]
    total = weights.sum(axis=1)
    parameters[:, 5] = np.sum(weights * values, axis=1) / total
    spread = np.maximum(np.sum(weights * product**2, axis=1), 1e-9)
    parameters[:, 6] = np.sum(weights * product * (values - parameters[:, 5:6]), axis=1) / spread
    for _ in range(_STEPS):
        model, jacobian = _model(parameters, lattice)
        weighted = (jacobian * weights[:, :, None]).transpose(0, 2, 1)
        normal = weighted @ jacobian
        diagonal = np.einsum("nii->ni", normal)
        diagonal += 1e-9 * diagonal + 1e-9  # a window without an edge has no unique solution
        step = np.linalg.solve(normal, weighted @ (values - model)[:, :, None])[:, :, 0]
        parameters += np.clip(step, -_STEP_LIMITS, _STEP_LIMITS)
        parameters[:, 4] = np.clip(parameters[:, 4], np.log(SMALLEST_BLUR), np.log(LARGEST_BLUR))
        small = np.abs(step[:, :2]).max(axis=1) < _TOLERANCE
        if small.all():
            break
    return parameters, small


def _model(parameters, lattice):
    """The model (n, k) of the module's text and its derivatives (n, k, 9)."""
    x, y, first, second, log_s, mean, amplitude, slope_x, slope_y = parameters.T[:, :, None]
    dx, dy = lattice[0] - x, lattice[1] - y
    s = np.exp(log_s)
    near, along, edge, slope = [], [], [], []
    for angle in (first, second):
        distance = np.cos(angle) * dx + np.sin(angle) * dy
        near.append(distance)
        along.append(np.cos(angle) * dy - np.sin(angle) * dx)
        edge.append(erf(distance / (np.sqrt(2) * s)))
        slope.append(np.sqrt(2 / np.pi) / s * np.exp(-0.5 * (distance / s) ** 2))
    product = edge[0] * edge[1]
    model = mean + amplitude * product + slope_x * lattice[0] + slope_y * lattice[1]
    pull = amplitude * slope[0] * edge[1], amplitude * slope[1] * edge[0]  # derivatives by the two distances
    columns = [
        -pull[0] * np.cos(first) - pull[1] * np.cos(second),
        -pull[0] * np.sin(first) - pull[1] * np.sin(second),
        pull[0] * along[0],
        pull[1] * along[1],
        -pull[0] * near[0] - pull[1] * near[1],
        np.ones_like(product),
        product,
        *np.broadcast_arrays(*lattice, product)[:2],
    ]
    return model, np.stack(columns, axis=2)


def _check(corners, start, amplitude, converged, pitch, columns):
    """Raise if a corner ran away, did not converge, or has dark squares where its neighbours have light ones."""
    index = np.arange(len(corners))
    row, column = np.divmod(index, columns)
    signs = np.sign(amplitude) * (1 - 2 * ((row + column) % 2))
    majority = 1.0 if np.sum(signs) > 0 else -1.0
    moved = np.linalg.norm(corners - start, axis=1)
    bad = index[~converged | (signs != majority) | (moved > 0.25 * pitch)]
    if bad.size:
        places = ", ".join(f"({start[k, 0]:.0f}, {start[k, 1]:.0f})" for k in bad[:3])
        raise DetectionError(
            f"{bad.size} of {len(corners)} corners are not clear crossings of two edges, near {places} px; look "
            "there for glare, dirt or something in front of the board"
        )
