"""Flat discs: where they are said to be, with the radius, contrast and tilt that the bound is computed for."""

import numpy as np
from numpy.testing import assert_allclose

from pegpose_lab.study import flat_discs


def test_the_discs_are_where_they_are_said_to_be():
    discs = flat_discs([3, 1], blur=0.9)
    y, x = np.mgrid[:480, :480]
    assert_allclose([discs.image.min(), discs.image.max()], [60, 160], atol=1e-3)
    for center, radius in zip(discs.centers, discs.radii, strict=True):
        near = np.hypot(x - center[0], y - center[1]) < 56
        share = (discs.image[near] - 60) / 100
        assert_allclose([share @ x[near] / share.sum(), share @ y[near] / share.sum()], center, atol=0.01)
        assert_allclose(np.sqrt(share.sum() / np.pi), radius, atol=0.01)


def test_one_seed_gives_one_image_and_tilts_stay_small():
    first, again, other = (flat_discs([3, seed], blur=0.9) for seed in (1, 1, 2))
    assert np.array_equal(first.image, again.image) and not np.array_equal(first.centers, other.centers)
    assert np.abs(first.radii - 48).max() < 3 and len(first.radii) == 9
