"""Ellipses in a picture that may be discs of a ring, bright and dark, also dark on dark."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..circles import find_circles
from .edges import _refined

SENSITIVITY = 0.95  # of the search: the pattern sorts out what is no disc
MOST_CIRCLES = 60  # of one polarity in one picture, the best by their score
SMALL = 6.0  # px: radius that the smallest discs have in the reduced picture in which connected parts are looked for
N_LEVELS = 12  # grey levels at which connected parts are looked at
MOST_SEEDS = 120  # the best by the visible share of their rim
FILL = 0.12  # how much a part's area may differ from that of the ellipse with its moments
OVERLAP, LIKE_SIZE = 0.7, 1.5  # of the radius, between centres, and ratio of the radii of two rims of one disc
STRONGER, CLEAR_RIM = 2.5, 0.8  # ratio of the strengths, and visible share, with which one of them wins
LARGEST_RATIO = 3.0  # of the axes


@dataclass(frozen=True, eq=False)
class _Seeds:
    """Ellipses: centers (k, 2) px, shapes (k, 2, 2) px, visible shares (k,), signs (k,): +1 bright, -1 dark;
    how strong their edges are (k,), grey values per px."""

    centers: np.ndarray
    shapes: np.ndarray
    shares: np.ndarray
    signs: np.ndarray
    strengths: np.ndarray

    @property
    def radii(self):
        """Radius of the circle of equal area, px."""
        return np.sqrt(np.abs(np.linalg.det(self.shapes)))

    def __len__(self):
        return len(self.centers)

    def __getitem__(self, rows):
        return _Seeds(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def _seeds(image, field, radius_range, polarity):
    """The ellipses of a picture, the best first, one at each place and size."""
    signs = {"bright": (1,), "dark": (-1,), "either": (1, -1)}[polarity]
    views = (image, _logarithm(image))
    found = [_circles(view, radius_range, sign) for view in views for sign in signs]
    step = max(int(radius_range[0] / SMALL), 1)
    small = image if step == 1 else cv2.resize(image, None, fx=1 / step, fy=1 / step, interpolation=cv2.INTER_AREA)
    back = np.array([image.shape[1] / small.shape[1], image.shape[0] / small.shape[0]])
    limits = radius_range[0] / step, radius_range[1] / step
    found += [_enlarged(_parts(small, limits, sign), back) for sign in signs]
    rows = np.vstack(found)
    centers, shapes = rows[:, :2], rows[:, 2:6].reshape(-1, 2, 2)
    if len(rows) == 0:
        return _Seeds(centers, shapes, rows[:, 6], rows[:, 6], rows[:, 6])
    centers, shapes, shares, strengths, _ = _refined(field, centers, shapes, rows[:, 6])
    seeds = _Seeds(centers, shapes, shares, rows[:, 6], strengths)
    seeds = seeds[_is_usable(seeds, radius_range, image.shape)]
    return _without_twins(seeds[~_is_beaten(seeds)])


def _enlarged(rows, back):
    """Rows of a reduced picture in the full one; `back` (2,) is the factor in x and y."""
    centers = (rows[:, :2] + 0.5) * back - 0.5
    return np.hstack([centers, rows[:, 2:6] * np.repeat(back, 2), rows[:, 6:]])


def _logarithm(image):
    """The picture's logarithm over the whole range of grey values: what is dark on dark becomes visible."""
    table = np.log1p(np.arange(256.0))
    low, high = table[[image.min(), image.max()]]
    return cv2.LUT(image, np.clip(255 * (table - low) / max(high - low, 1e-9), 0, 255).round().astype(np.uint8))


def _circles(view, radius_range, sign):
    """Rows x, y, shape, sign from the Hough transform."""
    found = find_circles(
        view,
        radius_range,
        polarity="bright" if sign > 0 else "dark",
        sensitivity=SENSITIVITY,
        max_circles=MOST_CIRCLES,
    )
    round_ones = found.radii[:, None] * [1.0, 0.0, 0.0, 1.0]
    return np.column_stack([found.centers, round_ones, np.full(len(found), sign)])


def _parts(image, radius_range, sign):
    """Rows x, y, shape, sign of connected parts with the moments of an ellipse, at several grey levels."""
    levels = np.unique(np.quantile(image[::4, ::4], np.linspace(0.04, 0.96, N_LEVELS)).round())
    levels = np.unique(np.concatenate([levels, np.linspace(*levels[[0, -1]], N_LEVELS).round()]))
    found = [np.empty((0, 7))]
    for level in levels:
        mask = image > level if sign > 0 else image < level
        n, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=4)
        area = boxes[:, cv2.CC_STAT_AREA]
        low, high = np.pi * (0.8 * radius_range[0]) ** 2, np.pi * (1.2 * radius_range[1]) ** 2
        fits = (area > low) & (area < high) & (area > 0.5 * boxes[:, 2] * boxes[:, 3] * np.pi / 4 / LARGEST_RATIO)
        rows = [_moments(labels, i, boxes[i]) for i in np.flatnonzero(fits) if i > 0]
        found += [np.append(row, sign)[None] for row in rows if row is not None]
    return np.vstack(found)


def _moments(labels, i, box):
    """x, y and shape of a part that is an ellipse with its holes filled, else None."""
    x, y, width, height = box[:4]
    part = (labels[y : y + height, x : x + width] == i).astype(np.uint8)
    contours, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(part, contours, -1, 1, cv2.FILLED)
    m = cv2.moments(filled, binaryImage=True)
    covariance = np.array([[m["mu20"], m["mu11"]], [m["mu11"], m["mu02"]]]) / m["m00"]
    values, vectors = np.linalg.eigh(covariance)
    area = 4 * np.pi * np.sqrt(max(values.prod(), 0))
    if values[0] < 0.5 or values[1] > LARGEST_RATIO**2 * values[0] or abs(m["m00"] / area - 1) > FILL:
        return None
    shape = 2 * vectors * np.sqrt(values) @ vectors.T
    return np.array([x + m["m10"] / m["m00"], y + m["m01"] / m["m00"], *shape.ravel()])


def _is_usable(seeds, radius_range, shape):
    """Whether ellipses lie in the picture, have a size in the range and are not too flat."""
    singular = np.linalg.svd(seeds.shapes, compute_uv=False)
    size = seeds.radii
    inside = ((seeds.centers > 0) & (seeds.centers < np.array(shape)[::-1] - 1)).all(axis=1)
    fits = (size > 0.85 * radius_range[0]) & (size < 1.15 * radius_range[1])
    return inside & fits & (singular[:, 0] < LARGEST_RATIO * singular[:, 1]) & (seeds.shares > 0.25)


def _is_beaten(seeds):
    """Whether (k,) a clear ellipse of like size overlaps much whose edges are far stronger: one disc has one rim."""
    apart = np.linalg.norm(seeds.centers[:, None] - seeds.centers, axis=2) < OVERLAP * seeds.radii
    like = np.abs(np.log(seeds.radii[:, None] / seeds.radii)) < np.log(LIKE_SIZE)
    stronger = (seeds.strengths > STRONGER * seeds.strengths[:, None]) & (seeds.shares > CLEAR_RIM)
    return (apart & like & stronger).any(axis=1)


def _without_twins(seeds):
    """The best first, without those nearly equal to a better one."""
    order = np.lexsort((seeds.centers[:, 0], seeds.centers[:, 1], -seeds.shares.round(2)))
    seeds, kept = seeds[order], []
    for i in range(len(seeds)):
        near = np.linalg.norm(seeds.centers[kept] - seeds.centers[i], axis=1) < 0.2 * seeds.radii[i]
        if not (near & (np.abs(np.log(seeds.radii[kept] / seeds.radii[i])) < 0.15)).any():
            kept.append(i)
        if len(kept) == MOST_SEEDS:
            break
    return seeds[kept]
