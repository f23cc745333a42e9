"""The circles in each part of an image that may be pegs."""

from types import SimpleNamespace

import cv2
import numpy as np

from ..circles import find_circles
from ..segmentation import AREA_SHARE, segment

SENSITIVITY = 0.95  # of the Hough transform: the pattern sorts out false circles
COARSE = 400  # px: longer side of the reduced picture that is segmented first
ROUND = 0.2  # how much a round part's area may differ from that of the ellipse in its box,
LARGEST_RATIO = 2.0  # and ratio of the box's sides


def _circles_of_parts(image, min_area, threshold):
    """Circles that may be pegs, `centers` (k, 2) and `radii` (k,), px: first those that take least time to find.

    The parts of a reduced picture that are round; the best circles in all its parts; the same for the picture itself;
    and for the picture with a single threshold, since bright swarf on a bore can give it two grey levels.  With each,
    whether it is what says what is missing.
    """
    step = max(image.shape) // COARSE
    if step > 1 and np.ptp(image[::step, ::step]) > 0:
        height, width = (side // step * step for side in image.shape)
        small = cv2.resize(image[:height, :width], (width // step, height // step), interpolation=cv2.INTER_AREA)
        least = max(4.0, AREA_SHARE * small.size) if min_area is None else min_area / step**2
        parts = segment(small, min_area=least, threshold=threshold)
        yield _round_parts(parts, step), False
        yield _part_circles(image, parts, step), False
    parts = segment(image, min_area=min_area, threshold=threshold)
    yield _part_circles(image, parts), True
    if len(parts.levels) > 1:
        yield _part_circles(image, segment(image, min_area=min_area, threshold=parts.threshold)), False


def _round_parts(parts, step):
    """The circles of equal area at the centroids of round parts of a picture that is reduced by `step`."""
    sides = parts.boxes[:, 2:].astype(float)
    fill = parts.areas / (np.pi / 4 * sides.prod(axis=1))
    is_round = (np.abs(fill - 1) < ROUND) & (sides.max(axis=1) < LARGEST_RATIO * sides.min(axis=1))
    centers = (parts.centroids[is_round] + 0.5) * step - 0.5
    return _as_circles(np.column_stack([centers, step * np.sqrt(parts.areas[is_round] / np.pi)]))


def _part_circles(image, parts, step=1):
    """The best circles of each part of a picture that is reduced by `step`.

    A part is a disc, or holds one with something attached or hidden: the disc is about as wide as the
    part's shorter side, or smaller.
    """
    found = [np.empty((0, 3))]
    for area, box in zip(parts.areas * step**2, parts.boxes * step, strict=True):
        largest = 1.25 * box[2:].min() / 2
        smallest = max(0.5 * np.sqrt(area / np.pi), largest / 3)
        if largest > smallest + 1:
            circles = find_circles(
                image, (smallest, largest), regions=box[None], max_circles=2, sensitivity=SENSITIVITY
            )
            found.append(np.column_stack([circles.centers, circles.radii]))
    return _as_circles(np.vstack(found))


def _as_circles(rows):
    return SimpleNamespace(centers=rows[:, :2], radii=rows[:, 2])
