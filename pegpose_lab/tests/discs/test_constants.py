"""Constants of the disc fit: each is explained, each measured, and those that seldom matter have their case here."""

import re

import numpy as np
import pytest

from pegpose_lab import discs
from pegpose_lab.bench import disc_constants
from pegpose_lab.discs import fit_discs
from pegpose_lab.study import load_measured
from pegpose_lab.tests.discs.stacks import SHAPE, R, _circles, _near, _truth
from pegpose_lab.tests.pictures import draw_ellipses, to_uint8


def test_every_constant_is_explained_in_the_table():
    explained = re.findall(r"^([A-Z_0-9]+)  +\S", discs.__doc__, re.MULTILINE)
    assert sorted(explained) == sorted(disc_constants.constants())
    assert set(explained) >= disc_constants.LAYOUT


def test_every_constant_was_measured_at_half_and_twice_its_value():
    table = load_measured("disc_constants")
    assert len(table) == 1 + len(disc_constants.tried())
    none, rest = table.iloc[0], table.iloc[1:]
    assert none["constant"] == "none" and none["error"] == 1 and none["move"] == 0 and none["accepted"] > 95
    measured = [(row.constant, row.value, row.tried) for row in rest.itertuples()]
    assert measured == [(name, disc_constants.constants()[name], tried) for name, tried in disc_constants.tried()]


def test_a_changed_constant_reaches_every_file_and_is_put_back():
    from pegpose_lab.discs import fit, ground, refit, ring

    before = disc_constants.constants()
    with pytest.raises(ZeroDivisionError), disc_constants.changed("RING", 3.0):
        assert ring.RING == ground.RING == refit.RING == 3.0
        raise ZeroDivisionError
    with disc_constants.changed("MAX_STEPS", 1):
        assert fit.MAX_STEPS == refit.MAX_STEPS == 1
    after = disc_constants.constants()
    assert all(np.array_equal(after[name], before[name]) for name in before)
    with pytest.raises(ValueError, match="expected one of .*SMALL_STEP"), disc_constants.changed("RINGS", 1):
        pass


def test_a_frame_is_measured_with_every_value():
    fits = disc_constants._measure_frame(next(iter(disc_constants.SCENES)), 30_000)
    assert list(fits) == [None, *disc_constants.tried()]
    assert np.isfinite(fits[None]).all()
    assert not np.array_equal(fits["RING", 3.0], fits[None]) and np.array_equal(fits["SAME", 2.0], fits[None])


# ---- cases ----


def _far_starts(seed):
    """Discs, and circles that are off by up to a fifth of the radius."""
    rng = np.random.default_rng(seed)
    truth = _truth(rng)
    image = to_uint8(draw_ellipses(SHAPE, truth), 5, rng)
    off = rng.uniform(-0.2, 0.2, (len(truth), 3)) * R
    return image, _circles(truth[:, :2] + off[:, :2], R + off[:, 2])


def _partly_hidden(seed):
    """Discs of which a strip of the background's level hides a part of the right side."""
    rng = np.random.default_rng(seed)
    truth = _truth(rng)
    picture = draw_ellipses(SHAPE, truth)
    for x, y in truth[:, :2].astype(int):
        picture[y - 60 : y + 60, x + 10 : x + 65] = 60
    return to_uint8(picture, 5, rng), _near(truth, rng)


@pytest.mark.parametrize(("name", "value", "case"), [("MAX_RINGS", 1, _far_starts), ("UNEVEN", 1e3, _partly_hidden)])
def test_what_a_constant_is_for(name, value, case):
    """Without a second ring far starts do not converge; levels that change freely around the disc fit what hides it."""
    accepted, without, number = 0, 0, 0
    for seed in (2, 3, 4):
        image, circles = case(seed)
        accepted, number = accepted + fit_discs(image, circles).accepted.sum(), number + len(circles.radii)
        with disc_constants.changed(name, value):
            without += fit_discs(image, circles).accepted.sum()
    assert accepted >= number - 1 and without <= accepted - 2


def test_two_circles_on_one_disc_are_one_disc():
    rng = np.random.default_rng(6)
    truth = _truth(rng)[:1]
    image = to_uint8(draw_ellipses(SHAPE, truth), 5, rng)
    both = _circles(np.repeat(truth[:, :2], 2, axis=0) + [[2, 0], [0, -2]], [R + 2, R - 2])
    assert fit_discs(image, both).reasons.tolist() == ["", "same disc"]
    with disc_constants.changed("SAME", 1e-9):
        assert fit_discs(image, both).accepted.all()
