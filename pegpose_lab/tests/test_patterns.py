"""Descriptions of rings: places, turns, and what is refused."""

import numpy as np
import pytest

from pegpose_lab.patterns import RingMark, RingPattern
from pegpose_lab.targets import Hub

DIAL = [2 * np.pi * k / 14 for k in range(10)]


def test_places_of_the_three_kinds():
    equal = RingPattern(4, pitch_radius=50.0, disc_radius=10.0)
    np.testing.assert_allclose(equal.places, [[50, 0], [0, 50], [-50, 0], [0, -50]], atol=1e-12)
    two_radii = RingPattern(angles=[0, np.pi, np.pi / 2], pitch_radius=[50, 30, 40], disc_radius=5)
    np.testing.assert_allclose(two_radii.places, [[50, 0], [-30, 0], [0, 40]], atol=1e-12)
    anywhere = RingPattern(centers=[[0, 0], [40, 0], [40, 30]], disc_radius=5)
    assert anywhere.n_places == 3 and anywhere.places.tolist() == [[0, 0], [40, 0], [40, 30]]


@pytest.mark.parametrize(
    "pattern, count",
    [
        (RingPattern(5, pitch_radius=50, disc_radius=8), 5),
        (RingPattern(angles=DIAL, pitch_radius=50, disc_radius=8), 1),
        (RingPattern(centers=[[-6, -5], [6, -5], [6, 5], [-6, 5]], disc_radius=1), 2),
        (RingPattern(centers=[[-6, -5], [6, -5], [6, 5], [-6, 5]], disc_radius=1, bore=RingMark((1, 0), 2)), 1),
        (RingPattern(angles=np.arange(6) * np.pi / 3, pitch_radius=[5, 4] * 3, disc_radius=1), 3),
    ],
)
def test_turns_leave_the_places_where_they_are(pattern, count):
    turns = pattern.turns
    middle = pattern.places.mean(axis=0)
    assert len(turns) == count and turns[0].tolist() == list(range(pattern.n_places))
    for turn in turns:
        z, goal = (pattern.places - middle) @ (1, 1j), (pattern.places[turn] - middle) @ (1, 1j)
        spin = goal[0] / z[0]
        np.testing.assert_allclose(z * spin, goal, atol=1e-9)


def test_a_pattern_is_a_value():
    first, second = (RingPattern(6, pitch_radius=50, disc_radius=8, bore=(18, "dark")) for _ in range(2))
    assert first == second and hash(first) == hash(second) and first.bore == RingMark((0, 0), 18, "dark")
    with pytest.raises(AttributeError):
        first.n = 5


def test_a_hub_is_one():
    hub = Hub(n_pegs=5, pitch_circle_diameter=100.0)
    pattern = hub.pattern
    np.testing.assert_allclose(pattern.places, hub.peg_centers[:, :2])
    assert pattern.disc_radius == hub.peg_radius and pattern.bore.radius == hub.bore_radius
    assert [mark.radius for mark in pattern.marks] == [hub.screw_radius] * 2


@pytest.mark.parametrize(
    "arguments, told",
    [
        ({"pitch_radius": 50}, "exactly one of n, angles and centers"),
        ({"n": 4, "angles": [0, 1], "pitch_radius": 50}, "exactly one"),
        ({"n": 25, "pitch_radius": 50}, "between 3 and 24"),
        ({"n": 4}, "pitch_radius is None"),
        ({"n": 4, "pitch_radius": [50, 40]}, r"pitch_radius has shape \(2,\)"),
        ({"n": 4, "pitch_radius": 5}, "overlap"),
        ({"centers": [[0, 0], [50, 0], [0, 30]], "pitch_radius": 80}, "centers give 0 to 50"),
        ({"n": 4, "pitch_radius": 50, "polarity": "grey"}, "polarity is 'grey'"),
        ({"n": 4, "pitch_radius": 50, "max_missing": 4}, "max_missing"),
        ({"n": 4, "pitch_radius": 50, "bore": "big"}, "bore is 'big'"),
        ({"n": 4, "pitch_radius": 50, "marks": [(1, 2)]}, r"marks\[0\]"),
        ({"n": 4, "pitch_radius": 50, "disc_radius": -1}, "disc_radius"),
    ],
)
def test_what_is_unusable_is_refused(arguments, told):
    with pytest.raises(ValueError, match=told):
        RingPattern(**{"disc_radius": 5.0, **arguments})
