"""Even ground beyond the rings."""

import numpy as np

from pegpose_lab.discs import fit_discs, ground, refit, ring
from pegpose_lab.tests.discs.stacks import SHAPE, R, _one_picture


def test_even_ground_stands_for_a_ring_as_wide(monkeypatch):
    """The step by numbers, means and variances ends where least squares over all those pixels ends."""
    truth, image, circles = _one_picture()
    narrow = fit_discs(image, circles)
    with monkeypatch.context() as patch:
        patch.setattr(ground, "RING", ground.GROUND)
        patch.setattr(refit, "RING", ground.GROUND)
        patch.setattr(ring, "RING", ground.GROUND)
        patch.setattr(ground, "GROUND", ground.GROUND + 0.1)
        wide = fit_discs(image, circles)
    radius = narrow.sigmas[:, 2]
    assert np.abs(narrow.radii - wide.radii).max() < 0.25 * radius.min()
    np.testing.assert_allclose(narrow.sigmas[:, :4], wide.sigmas[:, :4], rtol=0.05)
    monkeypatch.setattr(ground, "GROUND", ring.RING)  # no ground: the radius is known less well
    ring_alone = fit_discs(image, circles)
    assert ring_alone.sigmas[:, 2].mean() > 1.03 * narrow.sigmas[:, 2].mean()


def test_ground_is_left_alone_where_it_is_uneven_or_the_edge_reaches_it(monkeypatch):
    truth, image, circles = _one_picture()
    for x, y in truth[:, :2]:  # a grey ring 12 to 16 px outside each edge
        rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
        far = np.hypot(columns - x, rows - y)
        image[(far > R + 12) & (far < R + 16)] += 30
    uneven = fit_discs(image, circles)
    _, blurred_image, _ = _one_picture(blur=1.9)
    blurred = fit_discs(blurred_image, circles)
    monkeypatch.setattr(ground, "_BY_LEVELS", np.array([[0.0, 1.0], [0.0, 1.0]]))  # only the inside counts
    np.testing.assert_allclose(fit_discs(image, circles).radii, uneven.radii, atol=1e-6)
    monkeypatch.setattr(ground, "GROUND", ring.RING)
    np.testing.assert_array_equal(fit_discs(blurred_image, circles).radii, blurred.radii)
