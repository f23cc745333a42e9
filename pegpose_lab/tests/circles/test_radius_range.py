"""Circles in narrow ranges are found, and circles whose own radius lies outside are not returned."""

import numpy as np
import pytest

from pegpose_lab.circles import DETECTION_METHODS, circle_accumulator, find_circles
from pegpose_lab.circles.own_radius import end_tolerance, own_radius
from pegpose_lab.tests.pictures import draw_quickly, to_uint8

BEYOND = 0.05  # part of the radius: the tolerance of 3 % and the error of the estimate


def _disc(radius, polarity="bright", noise=2.0, ratio=1.0, seed=0):
    """A picture of one disc, and its centre."""
    rng = np.random.default_rng([seed, int(1000 * radius)])
    size = int(2 * radius + 60)
    center = size / 2 + rng.uniform(-3, 3, 2)
    ellipse = (*center, radius / ratio**0.5, radius * ratio**0.5, rng.uniform(0, 3))
    picture = draw_quickly((size, size), [ellipse], 60.0, [160.0], 1.0)
    return to_uint8(picture if polarity == "bright" else 255 - picture, noise, rng), center


def _assert_found(found, center, radius, radius_range):
    assert len(found) == 1
    assert np.hypot(*(found.centers[0] - center)) < 0.05 * radius + 0.7
    assert abs(found.radii[0] - radius) < 0.05 * radius + 0.7
    assert radius_range[0] <= found.radii[0] <= radius_range[1]


@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("method", DETECTION_METHODS)
@pytest.mark.parametrize(
    "radius_range",
    [
        (40, 48),
        (42, 46),
        (39, 48),
        (44, 45),
        (44.2, 44.6),
        (44, 44),
        (80, 96),
        (88, 88),
        (20, 24),
        (22, 22),
        (10, 12),
        (10.5, 11.5),
        (11, 11),
        (11, 12),
        (5, 6),
        (6, 6),
    ],
)
def test_every_narrow_range_works(radius_range, method, polarity):
    middle = float(np.mean(radius_range))
    image, center = _disc(middle, polarity)
    found = find_circles(image, radius_range, method=method, polarity=polarity, sensitivity=0.95)
    _assert_found(found, center, middle, radius_range)


@pytest.mark.parametrize("low", np.arange(6.0, 130.0, 5.7))
def test_the_default_has_no_gaps(low):
    for radius_range in ((low, 1.05 * low), (low, 1.19 * low), (low, 1.21 * low), (low, 1.45 * low)):
        radius = float(np.mean(radius_range))
        image, center = _disc(radius)
        _assert_found(find_circles(image, radius_range), center, radius, radius_range)


@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("method", DETECTION_METHODS)
@pytest.mark.parametrize("sensitivity", [0.85, 0.95])
def test_circles_outside_the_range_are_not_returned(method, polarity, sensitivity):
    low, high = 40.0, 56.0
    outside = [24.0, 30.0, 34.0, low * (1 - BEYOND), high * (1 + BEYOND), 62.0, 70.0, 84.0]
    for radius in outside:
        image, _ = _disc(radius, polarity)
        found = find_circles(image, (low, high), method=method, polarity=polarity, sensitivity=sensitivity)
        assert len(found) == 0, (radius, found)


@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("method", DETECTION_METHODS)
@pytest.mark.parametrize("ratio", [1.0, 0.95])
def test_circles_at_the_ends_of_the_range_are_kept(method, polarity, ratio):
    # the drawn circles of "accumulator" do not meet in one place where axes differ by more
    sensitivity, ratio = (0.95, max(ratio, 0.98)) if method == "accumulator" else (0.85, ratio)
    for radius_range in ((40.0, 56.0), (10.0, 14.0), (23.5, 31.5)):
        for radius in radius_range:
            for seed in range(3):
                image, center = _disc(radius, polarity, ratio=ratio, seed=seed)
                found = find_circles(image, radius_range, method=method, polarity=polarity, sensitivity=sensitivity)
                _assert_found(found, center, radius, radius_range)


@pytest.mark.parametrize("method", DETECTION_METHODS)
def test_a_circle_within_the_range_is_kept_beside_larger_ones(method):
    """Concentric steps of one polarity, and a large disc beside: the wanted circle stays."""
    ellipses = [(100.0, 100.0, 90.0, 90.0, 0.0), (102.0, 99.0, 48.0, 48.0, 0.0)]
    image = to_uint8(draw_quickly((200, 200), ellipses, 40.0, [110.0, 200.0], 1.0), 2.0, 0)
    found = find_circles(image, (40, 56), method=method, sensitivity=0.95 if method == "accumulator" else 0.85)
    _assert_found(found, (102.0, 99.0), 48.0, (40, 56))


def test_phase_code_does_not_take_one_end_for_the_other():
    for radius in (40.0, 40.3, 55.7, 56.0):
        image, _ = _disc(radius)
        found = find_circles(image, (40, 56), method="phase-code")
        assert abs(found.radii[0] - radius) < 2


def test_the_accumulator_itself_needs_a_whole_radius():
    with pytest.raises(ValueError, match="radius_range.*whole radius"):
        circle_accumulator(np.zeros((40, 40), np.uint8), (5.2, 5.8), method="accumulator")


def _edge(center, radius, angles):
    """Points and gradients of a disc's edge of which all pixels within 2 px count."""
    t = np.repeat(angles, 5)
    inwards = -np.stack([np.cos(t), np.sin(t)], axis=1)
    offsets = np.tile([-2.0, -1.0, 0.0, 1.0, 2.0], len(angles))
    return center - (radius + offsets[:, None]) * inwards, inwards * (3 - np.abs(offsets[:, None]))


@pytest.mark.parametrize("start", [(0.0, 0.0, 30.0), (5.0, -3.0, 24.0), (0.0, 10.0, 40.0)])
def test_own_radius_is_the_edges(start):
    center = np.array([50.0, 40.0])
    points, gradients = _edge(center, 30.0, np.linspace(0, 5, 90))
    circle = (*(center + start[:2]), start[2])
    assert own_radius(points, gradients, circle, 100.0) == pytest.approx(30.0, abs=0.01)


def test_own_radius_of_too_little_edge_is_unknown():
    center = np.array([50.0, 40.0])
    points, gradients = _edge(center, 30.0, np.linspace(0, 2.0, 60))
    assert np.isnan(own_radius(points, gradients, (50.0, 40.0, 30.0), 100.0))
    straight = np.stack([np.arange(60.0), np.zeros(60)], axis=1), np.tile([0.0, 1.0], (60, 1))
    assert np.isnan(own_radius(*straight, (30.0, 30.0, 30.0), 100.0))
    assert np.isnan(own_radius(np.empty((0, 2)), np.empty((0, 2)), (30.0, 30.0, 30.0), 100.0))


def test_tolerance_at_the_ends():
    np.testing.assert_allclose(end_tolerance([5.0, 50.0]), [0.5, 1.5])
