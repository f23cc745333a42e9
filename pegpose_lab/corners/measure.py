"""Sub-pixel corners of a grid that was found to a pixel: windows around its corners, and which fits are clear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import DetectionError
from .fit import CornerFits, fit_corners

if TYPE_CHECKING:
    from numpy.typing import NDArray

WINDOW = (
    15.0  # px, largest radius of a window: a larger one has less noise, but more bias from edges that the lens bends
)
REACH = 0.4  # of the distance to the next corner: the window's radius on small boards
SMALLEST_WINDOW = 2.8  # px; on boards of less than 7 px pitch a window reaches further, for 9 unknowns need pixels
SMALLEST_PITCH = 5.0  # px between neighbouring corners; below, the next edges are in the window
PASSES = 3  # of the fit; after them the place where the grid was found changes a corner by less than 1e-5 px
LARGEST_MOVE = 0.25  # of the pitch, from where the grid was found
LARGEST_SIGMA = 0.5  # px
LARGEST_MISFIT = 0.4  # of the contrast, or 3 times the board's median (noise): beyond, something covers it
SMALLEST_CONTRAST = 0.15  # of the board's median


def refine(image: NDArray[np.uint8], grid: NDArray[np.float64]) -> tuple[NDArray[np.float64], CornerFits]:
    """Fit every corner of an oriented grid (rows, columns, 2); return (n, 2) px and the fits."""
    pitch = edge_normals(grid)[1].min()
    if pitch < SMALLEST_PITCH:
        raise DetectionError(
            f"neighbouring corners are down to {pitch:.1f} px apart; at least {SMALLEST_PITCH:g} px are "
            "needed: bring the board closer or take a larger image"
        )
    corners, fits = fit_grid(image, grid)
    check_corners(corners, fits, grid)
    return corners, fits


def fit_grid(
    image: NDArray[np.uint8], grid: NDArray[np.float64], passes: int = PASSES, seen: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float64], CornerFits]:
    """Corners (n, 2), px, of a grid (rows, columns, 2), and their fits; with `seen` (rows, columns) bool of those only.

    Window and start come from the grid at first, then from the corners, so the result depends on the image
    alone.  All passes but the last are rough; they stop if more than a tenth of the corners are unclear.
    """
    which = slice(None) if seen is None else seen.ravel()
    corners, start = grid.reshape(-1, 2).copy(), edge_normals(grid)[0][which]
    for count in range(passes):
        pixels = np.rint(corners[which])
        offsets, pitch = corners[which] - pixels, edge_normals(corners.reshape(grid.shape))[1][which]
        values, weights, lattice = windows(image, pixels.astype(int), offsets, window_radii(pitch))
        fits = fit_corners(values, weights, lattice, np.column_stack([offsets, start]), rough=count < PASSES - 1)
        corners[which], start = pixels + fits.parameters[:, :2], fits.parameters[:, 2:]
        if unclear_corners(corners[which], fits, grid, count < PASSES - 1, seen).mean() > 0.1:
            break
    return corners[which], fits


def edge_normals(grid: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions (n, 2) rad of the normals of the edges along columns and along rows, and the pitch (n,) px.

    The first normal points along a row, the second along a column.
    """
    return normals_of(np.gradient(grid, axis=1).reshape(-1, 2), np.gradient(grid, axis=0).reshape(-1, 2))


def normals_of(
    along_row: NDArray[np.float64], along_column: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """As `edge_normals`, from the steps (n, 2) to the next corner along the row and along the column."""
    pitch = np.minimum(np.linalg.norm(along_row, axis=1), np.linalg.norm(along_column, axis=1))
    first = np.arctan2(-along_column[:, 0], along_column[:, 1])
    second = np.arctan2(along_row[:, 0], -along_row[:, 1])
    return np.column_stack([first, second]), pitch


def window_radii(pitch: NDArray[np.float64]) -> NDArray[np.float64]:
    """The windows' radii (n,), px, on boards of some pitch."""
    return np.clip(REACH * pitch, SMALLEST_WINDOW, WINDOW)


def windows(
    image: NDArray[np.uint8], pixels: NDArray[np.intp], offsets: NDArray[np.float64], radii: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
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


def unclear_corners(
    corners: NDArray[np.float64],
    fits: CornerFits,
    grid: NDArray[np.float64],
    converged: bool = False,
    seen: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Which corners (n,) ran away, did not converge, are covered, or have the colours of their neighbours.

    With `converged` all fits count as converged (for a rough fit); `seen` is that of `fit_grid`.
    """
    which = np.arange(len(corners)) if seen is None else np.flatnonzero(seen)
    row, column = np.divmod(which, grid.shape[1])
    amplitude = fits.parameters[:, 6]
    signs = np.sign(amplitude) * (1 - 2 * ((row + column) % 2))
    majority = 1.0 if np.sum(signs) > 0 else -1.0
    moved = np.linalg.norm(corners - grid.reshape(-1, 2)[which], axis=1)
    unclear = (
        ~(fits.converged | converged) | (signs != majority) | (moved > LARGEST_MOVE * edge_normals(grid)[1][which])
    )
    faint = np.abs(amplitude) < SMALLEST_CONTRAST * np.median(np.abs(amplitude))
    misfit = fits.misfit > max(LARGEST_MISFIT, 3 * np.median(fits.misfit))
    return unclear | faint | misfit | (fits.sigma > LARGEST_SIGMA)


def check_corners(corners: NDArray[np.float64], fits: CornerFits, grid: NDArray[np.float64]) -> None:
    """Raise if a corner is unclear."""
    bad = grid.reshape(-1, 2)[unclear_corners(corners, fits, grid)]
    if len(bad):
        places = ", ".join(f"({x:.0f}, {y:.0f})" for x, y in bad[:3])
        raise DetectionError(
            f"{len(bad)} of {len(corners)} corners are not clear crossings of two edges, near {places} px; look "
            "there for glare, dirt or something in front of the board"
        )
