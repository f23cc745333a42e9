"""Where a grid of corners can start: saddle points of the grey values that form three rows of three.

At a corner of a checkerboard the smoothed grey values have a saddle.  From one corner to the next the saddle's axes are
turned by a quarter, so that twice their angle points the other way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

_SMOOTH = 1.2  # px
_SEVEN = np.ones((7, 7), np.uint8)
WEAKEST = 0.1  # of the strongest saddle
CLEAR = 0.3  # the same, where noise makes many weaker ones
MOST = 500  # saddles, the strongest ones; the more of them, the longer it takes
_NEIGHBOURS = 12
NEAR = 0.35  # of a step: how far a corner may be from where its neighbours put it
ALIKE = 0.5  # cosine of the difference of twice the angles
_LEAST_ANGLE = 0.3  # sine of the angle between the lines of a grid


def saddle_points(image: NDArray[np.uint8]) -> tuple[NDArray[np.bool_], NDArray[np.float32], NDArray[np.float32]]:
    """Where the saddle points are (h, w) bool, how strong they are, and twice the angle of their axes (rad)."""
    smooth = cv2.GaussianBlur(image.astype(np.float32), (0, 0), _SMOOTH)
    across = cv2.Sobel(smooth, -1, 1, 1, ksize=3)
    along_x, along_y = cv2.Sobel(smooth, -1, 2, 0, ksize=3), cv2.Sobel(smooth, -1, 0, 2, ksize=3)
    strength = across**2 - along_x * along_y
    peaks = (strength == cv2.dilate(strength, _SEVEN)) & (strength > WEAKEST * strength.max())
    return peaks, strength, np.arctan2(2 * across, along_x - along_y)


def blocks_of_nine(image: NDArray[np.uint8]) -> Iterator[NDArray[np.float64]]:
    """Yield (3, 3, 2) arrays of saddle points, px, in three rows of three, those around the strongest saddles first."""
    peaks, strength, angles = saddle_points(image)
    for weakest in (CLEAR, WEAKEST):
        y, x = np.nonzero(peaks & (strength > weakest * strength.max()))
        strongest = np.argsort(-strength[y, x], kind="stable")[:MOST]
        x, y = x[strongest], y[strongest]
        yield from _blocks(np.column_stack([x, y]).astype(float), np.exp(1j * angles[y, x]))


def _blocks(points, turns):
    """The blocks of nine among points (n, 2), the first ones first; `turns` (n,) are unit numbers at their saddles' angles."""
    if len(points) < 9:
        return
    tree = cKDTree(points)
    for center, near in enumerate(tree.query(points, min(_NEIGHBOURS + 1, len(points)))[1]):
        alike = (turns[near[1:]] * np.conj(turns[center])).real
        pairs = _opposite(points[near[1:]][alike < -ALIKE] - points[center])
        block = None if pairs is None else _block(tree, turns, center, *pairs)
        if block is not None:
            yield points[block]


def _opposite(steps):
    """The two shortest pairs of opposite steps, on different lines: two (2, 2) arrays; None if there are none."""
    found = []
    for k, step in enumerate(steps):  # the nearest first
        rest = np.linalg.norm(steps[k + 1 :] + step, axis=1)
        if not len(rest) or rest.min() > NEAR * np.linalg.norm(step):
            continue
        if found and abs(_sine(found[0][0], step)) < _LEAST_ANGLE:
            continue
        found.append(np.array([step, steps[k + 1 + np.argmin(rest)]]))
        if len(found) == 2:
            return found
    return None


def _sine(one, other):
    """The sine of the angle between two steps."""
    return (one[0] * other[1] - one[1] * other[0]) / (np.linalg.norm(one) * np.linalg.norm(other))


def _block(tree, turns, center, across, down):
    """The numbers (3, 3) of the points around a center, None if one is missing."""
    places = tree.data[center] + np.array(
        [
            [across[1] + down[1], down[1], across[0] + down[1]],
            [across[1], (0, 0), across[0]],
            [across[1] + down[0], down[0], across[0] + down[0]],
        ]
    )
    reach = NEAR * min(np.linalg.norm(across[0]), np.linalg.norm(down[0]))
    distances, number = tree.query(places.reshape(-1, 2))
    signs = (turns[number] * np.conj(turns[center])).real * (1 - 2 * (np.arange(9) % 2))
    if (distances > reach).any() or (signs < ALIKE).any() or len(set(number)) < 9:
        return None
    return number.reshape(3, 3)
