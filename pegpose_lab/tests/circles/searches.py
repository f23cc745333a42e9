"""A picture of known circles, and how searches are compared with it."""

import numpy as np

from pegpose_lab.tests.pictures import draw_ellipses, to_uint8

TRUTH = np.array([(40.3, 44.8, 14.0), (95.6, 50.2, 18.0), (62.1, 101.4, 16.0)])
RANGE = (10, 22)


def _picture(truth=TRUTH, shape=(140, 140), noise=2.0, **drawing):
    ellipses = [(x, y, r, r, 0) for x, y, r in truth]
    return to_uint8(draw_ellipses(shape, ellipses, **drawing), noise, 0)


# ------------------------------------------------------------------------------------------------- searches


def _match(found, truth, center_error, radius_error):
    """Assert that the circles are exactly the true ones."""
    assert len(found) == len(truth)
    for x, y, r in truth:
        i = (np.hypot(*(found.centers - (x, y)).T) + abs(found.radii - r)).argmin()
        assert np.hypot(*(found.centers[i] - (x, y))) < center_error
        assert abs(found.radii[i] - r) <= radius_error
