"""The circles in each part of an image that may be pegs."""

from types import SimpleNamespace

import numpy as np

from ..circles import find_circles

SENSITIVITY = 0.95  # of the Hough transform: the pattern sorts out false circles


# ---- circles ----


def _part_circles(image, segmentation):
    """The best circles of each part: `centers` (k, 2) and `radii` (k,), px.

    A part is a disc, or holds one with something attached or hidden: the disc is about as wide as the
    part's shorter side, or smaller.
    """
    found = [np.empty((0, 3))]
    for area, box in zip(segmentation.areas, segmentation.boxes, strict=False):
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
