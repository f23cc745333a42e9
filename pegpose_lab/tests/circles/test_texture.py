"""Texture has circles by chance: they are rare in the result, and discs that lie in it are found."""

import cv2
import numpy as np

from pegpose_lab.circles import find_circles, outlines
from pegpose_lab.tests.pictures import draw_ellipses

SIZE, PICTURES = 400, 3
DISCS = np.array([[60.0 + 90 * i, 60.0 + 90 * j, 10 + 4 * i] for i in range(4) for j in range(4)])


def _grained(rng, strokes):
    """Discs on a ground of which a third has a grain: short strokes of all directions, bright and dark."""
    ellipses = np.column_stack([DISCS, DISCS[:, 2], np.zeros(len(DISCS))])
    grain = np.zeros((SIZE, 3 * SIZE), np.float32)
    ends = rng.uniform(0, SIZE, (strokes, 2))
    for start, along, grey in zip(ends, rng.uniform(-12, 12, (strokes, 2)), rng.uniform(-30, 30, strokes), strict=True):
        points = np.rint([start, start + along]).astype(int)
        cv2.line(grain, points[0].tolist(), points[1].tolist(), float(grey), 2)
    image = draw_ellipses((SIZE, 3 * SIZE), ellipses, level=180.0) + cv2.GaussianBlur(grain, (0, 0), 0.8)
    return np.clip(np.rint(image + rng.normal(0, 1, image.shape)), 0, 255).astype(np.uint8)


def _found(strokes):
    """How many circles are found on the discs of some pictures, and elsewhere."""
    right = wrong = 0
    for seed in range(PICTURES):
        circles = find_circles(_grained(np.random.default_rng([seed, strokes]), strokes), (8, 24))
        apart = np.hypot(*np.moveaxis(circles.centers[:, None] - DISCS[:, :2], 2, 0))
        near = (apart < 0.2 * DISCS[:, 2]).any(axis=1)
        right, wrong = right + near.sum(), wrong + (~near).sum()
    return right, wrong


def test_circles_by_chance_are_rarer_in_grain(monkeypatch):
    right, wrong = _found(4000)
    assert right == PICTURES * len(DISCS)
    monkeypatch.setattr(outlines, "FALSE_ALARMS", np.inf)
    assert wrong <= 0.85 * _found(4000)[1]


def test_an_outline_is_the_rarer_the_more_of_it_is_seen_and_the_emptier_its_ground():
    def chance(sectors, points):
        """Of an outline of 8 px with a band of 1 px in a neighbourhood of 14 px, with 48 edge points on it."""
        values = (np.array([value]) for value in (sectors / outlines.SECTORS, points + 48, 48, 8.0, 1.0))
        return outlines._by_chance(*values, 14.0).item()

    assert chance(24, 0) < 1e-30 and chance(12, 0) < 1e-12
    assert chance(16, 100) > 1e-2 > chance(16, 20)
    assert chance(24, 100) < 1e-5 and chance(0, 100) == 1
