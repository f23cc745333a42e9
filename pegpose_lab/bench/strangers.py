"""Things that are no discs of the hub: discs of other sizes, squares, and bars, laid into a rendered image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..render import TrueDisc

RADII = (34.0, 66.0)  # px, of the other discs: a sixth below and a tenth above the range that is searched
SIDE = (70.0, 110.0)  # px, of squares: about as wide as the discs that are searched
BAR = (6.0, 24.0)  # px, width of the bars, which cross the image
NUMBERS = (4, 4, 3)  # discs, squares, bars
FINER = 4  # sixteenths of a pixel, as OpenCV's `shift`


def lay_strangers(
    picture: NDArray[np.float32],
    discs: Sequence[TrueDisc],
    levels: tuple[float, float],
    blur: float,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Lay other discs and squares between the hub's discs, and bars across everything.

    Parameters
    ----------
    picture : (height, width) float32
        Without noise; it is left as it is.
    discs : sequence of TrueDisc
        The hub's own: other discs and squares keep away from them.
    levels : (low, high)
        Grey values of bars, and of discs and squares.
    blur : float
        Standard deviation, px, of the image's blur.
    rng : Generator

    Returns
    -------
    (height, width) float32
    """
    taken = [(*disc.centroid, disc.radius) for disc in discs]
    layers = np.zeros((2, *picture.shape), np.float32)
    for _ in range(NUMBERS[2]):
        _draw_bar(layers[0], rng)
    for k in range(NUMBERS[0] + NUMBERS[1]):
        half = RADII[k % 2] if k < NUMBERS[0] else rng.uniform(*SIDE) / 2
        reach = half if k < NUMBERS[0] else half * np.sqrt(2)
        place = _free_place(picture.shape, taken, reach, rng)
        if place is not None:
            taken.append((*place, reach))
            _draw_part(layers[1], place, half, k < NUMBERS[0], rng)
    for layer, level in zip(layers[::-1], levels[::-1], strict=True):
        picture = picture + cv2.GaussianBlur(layer, (0, 0), blur) * (level - picture)
    return picture.astype(np.float32)


def _free_place(shape, taken, reach, rng):
    """A place (x, y) whose neighbourhood holds nothing else, or None after a hundred trials."""
    for _ in range(100):
        x, y = rng.uniform(reach + 12, np.array(shape[::-1]) - reach - 12)
        if all(np.hypot(x - other[0], y - other[1]) > reach + other[2] + 12 for other in taken):
            return x, y
    return None


def _draw_part(layer, place, half, round_one, rng):
    """Fill a disc, or a square that is turned by chance, with 1."""
    if round_one:
        cv2.circle(layer, *_fixed(place, half), 1.0, cv2.FILLED, cv2.LINE_AA, FINER)
        return
    turn = rng.uniform(0, np.pi / 2) + np.arange(4) * np.pi / 2
    corners = np.asarray(place) + half * np.sqrt(2) * np.column_stack([np.cos(turn), np.sin(turn)])
    cv2.fillConvexPoly(layer, np.rint(corners * 2**FINER).astype(int), 1.0, cv2.LINE_AA, FINER)


def _draw_bar(layer, rng):
    """Draw a bar from one side of the image to another."""
    middle, turn = rng.uniform(0, layer.shape[::-1]), rng.uniform(0, np.pi)
    along = 3000 * np.array([np.cos(turn), np.sin(turn)])
    across = rng.uniform(*BAR) / 2 * np.array([-np.sin(turn), np.cos(turn)])
    corners = np.array(
        [middle - along - across, middle + along - across, middle + along + across, middle - along + across]
    )
    cv2.fillConvexPoly(layer, np.rint(corners * 2**FINER).astype(int), 1.0, cv2.LINE_AA, FINER)


def _fixed(place, radius):
    """Centre and radius in sixteenths of a pixel."""
    return np.rint(np.multiply(place, 2**FINER)).astype(int).tolist(), round(radius * 2**FINER)
