"""Strangers show as what they are; but for the bars, they keep away from the hub's discs."""

import numpy as np

from pegpose_lab.bench import scenes, strangers

STRANGE = next(scene for scene in scenes.SCENES if scene.strangers)


def test_strangers_keep_away_from_the_hub_but_for_the_bars():
    frame = scenes.draw_frame(STRANGE, 0)
    discs = [disc.truth for disc in frame.discs]
    rng, clean = np.random.default_rng(3), np.full(frame.picture.shape, 60, np.float32)
    laid = strangers.lay_strangers(clean, discs, (20.0, 160.0), 1.0, rng)
    assert (clean == 60).all() and laid.dtype == np.float32
    y, x = np.indices(clean.shape)
    for disc in discs:
        inside = np.hypot(x - disc.centroid[0], y - disc.centroid[1]) < disc.radius - 4
        assert laid[inside].max() < 60.5
    area = np.pi * (np.array(strangers.RADII) ** 2).sum() * 2
    assert area < (laid > 110).sum() < area + 4 * max(strangers.SIDE) ** 2
    assert 0 < (laid < 40).sum() < 0.2 * laid.size


def test_a_frame_of_strangers_is_the_same_each_time():
    first, second = (scenes.draw_frame(STRANGE, 2).picture for _ in range(2))
    np.testing.assert_array_equal(first, second)
