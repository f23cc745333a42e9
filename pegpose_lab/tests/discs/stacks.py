"""Pictures of known ellipses, and stacks of their fits."""

from types import SimpleNamespace

import numpy as np

from pegpose_lab.discs import fit_discs
from pegpose_lab.tests.pictures import draw_ellipses, to_uint8

GRID = [(80 + 130 * i, 80 + 130 * j) for i in range(4) for j in range(4)]
SHAPE = (550, 550)
R = 48.0


def _circles(centers, radii):
    return SimpleNamespace(centers=np.asarray(centers, float), radii=np.asarray(radii, float))


def _truth(rng, ratio=1.0):
    """Rows cx, cy, a, b, angle with geometric mean radius R."""
    offsets = rng.uniform(-0.5, 0.5, (len(GRID), 2))
    axes = np.tile([R / np.sqrt(ratio), R * np.sqrt(ratio)], (len(GRID), 1))
    return np.hstack([np.array(GRID) + offsets, axes, rng.uniform(-1.5, 1.5, (len(GRID), 1))])


def _near(truth, rng):
    """Circles as a Hough transform would give them: off by a few pixels."""
    return _circles(truth[:, :2] + rng.uniform(-2, 2, (len(truth), 2)), R + rng.uniform(-3, 3, len(truth)))


def _measure(noise, ratio=1.0, pictures=6, **drawing):
    rng = np.random.default_rng(7)
    truth, discs = [], []
    for number in range(pictures):
        if number % 2 == 0:
            ellipses = _truth(rng, ratio)
            clean = draw_ellipses(SHAPE, ellipses, **drawing)
        truth.append(ellipses)
        discs.append(fit_discs(to_uint8(clean, noise, rng), _near(ellipses, rng)))
    return np.concatenate(truth), discs


def _stack(discs, name):
    return np.concatenate([getattr(d, name) for d in discs])


def _one_picture(noise=5.0, **drawing):
    """Sixteen discs, and the circles to start from."""
    rng = np.random.default_rng(3)
    truth = _truth(rng, 0.97)
    return truth, to_uint8(draw_ellipses(SHAPE, truth, **drawing), noise, rng), _near(truth, rng)
