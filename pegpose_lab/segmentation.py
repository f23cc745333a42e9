"""Segmentation of an image into its bright parts: Otsu's threshold, 8-connected components, area filter (Sect. 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from .checks import DetectionError, as_image, as_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

AREA_SHARE = 1e-4  # default min_area as a fraction of the image
BIMODAL = 4.5  # Ashman's D above which a part's grey values are two classes
STEP_SHARE = 0.1  # smallest step between two classes, as a fraction of the step between white and black
MAX_DEPTH = 4
OUTLINE = np.ones((5, 5), np.uint8)  # blur mixes the grey levels of pixels this close to an outline
MAX_LABELS = np.iinfo(np.uint16).max


@dataclass(frozen=True)
class Segmentation:
    """The bright parts of an image, numbered 1 to n from the top.

    Attributes
    ----------
    threshold : float
        The global threshold; pixels above it are white.
    levels : tuple of float
        All thresholds used, the global one first, then those of the parts that were split.
    mask : (height, width) bool
    labels : (height, width) uint16
        0 = background.
    areas : (n,) int, px
    boxes : (n, 4) int, px
        x, y, width, height.
    centroids : (n, 2) px

    Examples
    --------
    >>> import numpy as np
    >>> image = np.pad(np.full((10, 20), 200, np.uint8), 30, constant_values=50)
    >>> parts = segment(image)
    >>> len(parts), parts.areas.tolist(), parts.centroids.tolist()
    (1, [200], [[39.5, 34.5]])
    """

    threshold: float
    levels: tuple
    mask: np.ndarray
    labels: np.ndarray
    areas: np.ndarray
    boxes: np.ndarray
    centroids: np.ndarray

    def __len__(self) -> int:
        return len(self.areas)


def segment(image: ArrayLike, *, min_area: float | None = None, threshold: float | None = None) -> Segmentation:
    """Segment an image into its bright parts with Otsu's threshold (see below).

    Pixels above Otsu's global threshold are white; 8-connected white parts smaller than `min_area` are
    removed as noise (Sect. 3.1).  One threshold is not enough where there are three grey levels: with a
    background darker than the hub, hub and pegs end up in one white part; with a background
    brighter than the pegs, both end up in the black part.  So without an explicit `threshold`

    * a white part is split at the Otsu threshold of its own grey values when these are bimodal and
      the split shows either several parts, or one that stands out from the rest by more than the
      rest stands out from the black around it (a disc on a plate, but not a highlight on a disc);
      the darker pixels of a part that is split become black;
    * a black part is searched in the same way; the bright parts found in it count if they touch nothing white.

    Both are repeated within the parts that are found, down to a depth of four.  "Bimodal" means that the classes' distance
    is large compared with their widths: Ashman's D = sqrt(2) |m1 - m2| / sqrt(v1 + v2) > 4.5, with means m and
    variances v (including that of rounding) on either side of Otsu's threshold.  Unlike Otsu's separability
    it does not depend on the classes' sizes (pegs are a few per cent of their hub): a Gaussian has
    D = 2.65, a uniform ramp 3.46, two Gaussians six standard deviations apart 6.  It is measured on the pixels
    that are not within 2 px of the part's outline, where blur mixes the levels, averaged over 3 x 3 pixels
    to reduce noise.  Steps of less than a tenth of the step between white and black do not count.

    Parameters
    ----------
    image : (height, width) uint8
    min_area : float, optional
        px; by default 1e-4 of the image (192 px of 1600 x 1200), at least 4 px.
    threshold : float in [0, 255], optional
        Use this threshold and split nothing.

    Returns
    -------
    Segmentation
        With no parts if all are smaller than `min_area`.

    Raises
    ------
    ValueError
        If an argument is unusable.
    DetectionError
        If the image is constant and no threshold is given, or more than 65535 parts are found.

    References
    ----------
    N. Otsu, "A threshold selection method from gray-level histograms", IEEE Trans. Systems, Man, and Cybernetics 9(1), 1979.

    Examples
    --------
    >>> import numpy as np
    >>> image = np.pad(np.full((10, 20), 200, np.uint8), 30, constant_values=50)
    >>> segment(image).boxes.tolist()  # x, y, width, height
    [[30, 30, 20, 10]]
    """
    image = as_image(image)
    least = as_number(max(4.0, AREA_SHARE * image.size) if min_area is None else min_area, "min_area", 0.0)
    if threshold is not None:
        level = as_number(threshold, "threshold", 0.0, 255.0)
        return _as_segmentation(_components(cv2.compare(image, level, cv2.CMP_GT), least), level, [level])
    if (image == image[0, 0]).all():
        raise DetectionError(
            f"image is constant ({image[0, 0]}): no parts to tell apart; check the exposure or give a threshold"
        )
    level = cv2.threshold(image, 0, 255, cv2.THRESH_OTSU)[0]
    parts = _components(cv2.compare(image, level, cv2.CMP_GT), least)
    mask = cv2.compare(parts.labels, 0, cv2.CMP_GT)
    step = STEP_SHARE * _picture_step(image, level)
    levels = [
        level,
        *_split_black(image, mask, level, least, step),
        *_split_white(image, mask, parts, least, step),
    ]
    if len(levels) > 1:
        parts = _components(mask, least)
    return _as_segmentation(parts, level, levels)


@dataclass
class _Parts:
    """Label image and the statistics of its components, row k - 1 belongs to label k."""

    labels: np.ndarray
    areas: np.ndarray
    boxes: np.ndarray
    centroids: np.ndarray


def _components(white, least):
    """The 8-connected components of a uint8 mask with at least `least` px, renumbered without gaps."""
    kind = cv2.CV_16U if _few_labels(white) else cv2.CV_32S
    _, labels, stats, centroids = cv2.connectedComponentsWithStatsWithAlgorithm(white, 8, kind, cv2.CCL_GRANA)
    keep = stats[1:, cv2.CC_STAT_AREA] >= least
    if keep.sum() > MAX_LABELS:
        raise DetectionError(f"image has {keep.sum()} parts of {least:g} px or more; raise min_area")
    if not keep.all() or labels.dtype != np.uint16:
        numbers = np.zeros(len(stats), np.uint16)
        numbers[1:][keep] = np.arange(1, keep.sum() + 1)
        labels = _looked_up(numbers, labels)
    stats = stats[1:][keep]
    return _Parts(labels, stats[:, cv2.CC_STAT_AREA].astype(int), stats[:, :4].astype(int), centroids[1:][keep])


def _looked_up(table, labels):
    """``table[labels]``, faster where 8 bits are enough for the labels."""
    if len(table) > 256:
        return table[labels]
    return cv2.LUT(labels.astype(np.uint8), np.resize(table, 256))


def _few_labels(white):
    """Whether 16 bits are enough for the provisional labels, which are no more than the white runs in all rows."""
    height, width = white.shape
    if (height + 1) // 2 * ((width + 1) // 2) < MAX_LABELS:
        return True
    return cv2.countNonZero(cv2.compare(white[:, 1:], white[:, :-1], cv2.CMP_GT)) + height < MAX_LABELS


def _split_white(image, mask, parts, least, step, depth=MAX_DEPTH):
    """Split bimodal white parts, in place in `mask`; return the thresholds used."""
    levels = []
    for window, inside, split, brighter in _bimodal_parts(image, parts, least, step) if depth > 0 else ():
        found = _components(brighter, least)
        if len(found.areas) > 1 or (len(found.areas) == 1 and _stands_out(image[window], mask[window], inside, split)):
            mask[window] &= ~inside
            mask[window] |= brighter
            levels += [split.threshold, *_split_white(image[window], mask[window], found, least, step, depth - 1)]
    return levels


def _split_black(image, mask, level, least, step):
    """Add the islands in bimodal black parts to `mask`, in place; return the thresholds used.

    If all dark pixels together are far from bimodal (D < 3), no part of them is searched.
    """
    counts = cv2.calcHist([cv2.blur(image, (3, 3))], [0], None, [256], [0, 256]).ravel()
    counts[int(level) + 1 :] = 0
    if _bimodal_split(counts, step, BIMODAL / 1.5) is None:
        return []
    levels, parts = [], _components(cv2.bitwise_not(mask), least)
    near_white = cv2.dilate(mask, np.ones((3, 3), np.uint8))
    for window, _, split, brighter in _bimodal_parts(image, parts, least, step):
        found = _components(brighter, least)
        islands = _untouched(found, near_white[window])
        if islands.any():
            mask[window] |= islands
            inner = _components(islands, least)
            levels += [split.threshold, *_split_white(image[window], mask[window], inner, least, step)]
    return levels


def _bimodal_parts(image, parts, least, step):
    """For each part to be split: its window, its pixels there, the split, and the pixels above its threshold."""
    for number, box in enumerate(parts.boxes, 1):
        if parts.areas[number - 1] < 2 * least:
            continue
        window = _window(box, image.shape)
        inside = cv2.compare(parts.labels[window], number, cv2.CMP_EQ)
        split = _bimodal_split(_inner_counts(image[window], inside), step)
        if split is not None:
            yield window, inside, split, inside & cv2.compare(image[window], split.threshold, cv2.CMP_GT)


def _untouched(found, near_white):
    """The parts that touch nothing white, as a mask."""
    number = len(found.areas) + 1
    touched = cv2.calcHist([found.labels], [0], near_white, [number], [0, number]).ravel() > 0
    is_island = np.where(touched, 0, 255).astype(np.uint8)
    is_island[0] = 0
    return _looked_up(is_island, found.labels)


def _window(box, shape):
    """A part's box with a margin of 4 px, as slices."""
    x, y, width, height = box.tolist()
    return (
        slice(max(y - 4, 0), min(y + height + 4, shape[0])),
        slice(max(x - 4, 0), min(x + width + 4, shape[1])),
    )


@dataclass(frozen=True)
class _Split:
    """Otsu's threshold of a part with the means of both classes."""

    threshold: int
    dark: float
    bright: float


def _picture_step(image, level):
    """Difference of the mean grey values above and below a threshold."""
    counts = cv2.calcHist([image], [0], None, [256], [0, 256]).ravel().astype(float)
    grey, low = np.arange(256.0), int(level) + 1
    return counts[low:] @ grey[low:] / counts[low:].sum() - counts[:low] @ grey[:low] / counts[:low].sum()


def _inner_counts(image, inside):
    """Histogram of the pixels `inside`, away from the outline, in the 3 x 3 averaged image."""
    return cv2.calcHist([cv2.blur(image, (3, 3))], [0], cv2.erode(inside, OUTLINE), [256], [0, 256]).ravel()


def _bimodal_split(counts, step, limit=BIMODAL):
    """Otsu's threshold of a histogram, or None if it is not bimodal in the sense of `segment`."""
    counts, grey = counts.astype(float), np.arange(256.0)
    below, first, second = np.cumsum(counts), np.cumsum(counts * grey), np.cumsum(counts * grey**2)
    above = below[-1] - below
    valid = np.nonzero((below > 0) & (above > 0))[0]
    if len(valid) == 0:
        return None
    below, above = below[valid], above[valid]
    dark, bright = first[valid] / below, (first[-1] - first[valid]) / above
    best = int(np.argmax(below * above * (bright - dark) ** 2))
    variance = second[valid][best] / below[best] - dark[best] ** 2
    variance += (second[-1] - second[valid][best]) / above[best] - bright[best] ** 2
    apart = bright[best] - dark[best]
    if apart <= step or np.sqrt(2) * apart <= limit * np.sqrt(max(variance, 0) + 2 / 12):
        return None
    return _Split(int(valid[best]), float(dark[best]), float(bright[best]))


def _stands_out(image, mask, inside, split):
    """Whether the bright class differs more from the dark class than the dark class from the black around the part."""
    near = cv2.dilate(inside, OUTLINE)
    around = cv2.dilate(near, np.ones((3, 3), np.uint8)) & ~near & ~mask
    outside = image[around > 0]
    return len(outside) == 0 or split.bright - split.dark > split.dark - outside.mean()


def _as_segmentation(parts, threshold, levels):
    return Segmentation(
        float(threshold),
        tuple(float(level) for level in levels),
        parts.labels > 0,
        parts.labels,
        parts.areas,
        parts.boxes,
        parts.centroids,
    )
