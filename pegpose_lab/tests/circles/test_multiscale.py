"""The multiscale method: octaves, tilt, contrast, touching discs."""

import numpy as np
import pytest

from pegpose_lab.circles import find_circles
from pegpose_lab.tests.circles.searches import _match, _picture
from pegpose_lab.tests.pictures import draw_ellipses, to_uint8


def test_multiscale_finds_every_octave_and_concentric_circles():
    truth = [
        (150, 150, 120),
        (150, 150, 50),
        (150, 150, 20),
        (330, 60, 9),
        (330, 200, 30),
        (60, 330, 5),
        (300, 330, 14),
    ]
    picture = np.full((380, 400), 60.0)
    for x, y, r in truth:
        picture += draw_ellipses(picture.shape, [(x, y, r, r, 0)], background=0, level=40)
    image = to_uint8(picture, 2, 0)
    found = find_circles(image, (4, 130))
    assert len(found) == len(truth)
    for x, y, r in truth:
        error = np.hypot(*(found.centers - (x, y)).T) + np.abs(found.radii - r)
        assert error.min() < 0.06 * r + 1
    assert len(find_circles(image, (4, 130), polarity="dark")) <= 1


@pytest.mark.parametrize("contrast", [12.0, 120.0])
def test_multiscale_finds_tilted_discs_in_uneven_light(contrast):
    """Semi-axes 1 : 0.75, and a slope of brightness that exceeds the contrast of the weak ones."""
    ellipses = [(70, 70, 32, 24, 0.4), (190, 80, 12, 9, 1.2), (90, 190, 8, 6, -0.5), (200, 190, 45, 36, 2.0)]
    share = draw_ellipses((260, 280), ellipses, background=0, level=1)
    image = to_uint8(40 + np.linspace(0, 80, 280) + contrast * share, 2, 0)
    found = find_circles(image, (5, 60))
    for x, y, a, b, _ in ellipses:
        assert (np.hypot(*(found.centers - (x, y)).T) + np.abs(found.radii - np.sqrt(a * b))).min() < 0.15 * a + 1
    assert len(found) == len(ellipses)


@pytest.mark.parametrize("blur", [0.3, 1.0, 2.0])
def test_multiscale_finds_a_disc_of_any_contrast_above_six_grey_values(blur):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        center, radius, ground = 60 + rng.uniform(-2, 2, 2), rng.uniform(20, 30), 100 + rng.random()
        picture = draw_ellipses(
            (120, 120), [(*center, radius, radius, 0)], background=ground, level=ground + 6.5, blur=blur
        )
        assert len(find_circles(to_uint8(picture, 0.5, rng), (15, 35))) == 1


def test_multiscale_finds_nothing_in_noise_and_does_not_need_the_whole_edge():
    rng = np.random.default_rng(0)
    assert len(find_circles(to_uint8(np.full((300, 400), 100.0), 10, rng), (5, 60))) == 0
    picture = draw_ellipses((140, 140), [(70, 70, 40, 40, 0)])
    picture[:, 95:] = 60
    assert len(find_circles(to_uint8(picture, 2, rng), (20, 60), sensitivity=0.7)) == 0
    found = find_circles(to_uint8(picture, 2, rng), (20, 60), sensitivity=1.0)
    assert np.hypot(*(found.centers[0] - 70)) < 3 and abs(found.radii[0] - 40) < 3


def test_multiscale_measures_the_same_circle_in_any_part_of_a_reduced_pixel():
    for shift in (0.0, 1.3, 3.6, 5.9):
        image = to_uint8(draw_ellipses((230, 240), [(110 + shift, 105 - shift, 60, 60, 0)]), 3, 0)
        found = find_circles(image, (40, 90))
        assert len(found) == 1
        assert np.hypot(*(found.centers[0] - (110 + shift, 105 - shift))) < 2 and abs(found.radii[0] - 60) < 2


@pytest.mark.parametrize("radius", [20.0, 30.0, 50.0])
def test_multiscale_tells_concentric_dark_discs(radius):
    truth = [(80.2, 79.6, radius), (80.2, 79.6, 0.6 * radius)]
    image = _picture(truth, (160, 160), background=200, level=[130, 60])
    found = find_circles(image, (0.45 * radius, 1.3 * radius), polarity="dark")
    _match(found, truth, 0.05 * radius, 0.05 * radius)


def _touching(arrangement, radius):
    """40 discs x, y, r that touch their neighbours, and the shape of the picture."""
    i, half_turn = np.arange(40), np.pi / 40
    if arrangement == "ring":
        x, y = (radius / np.sin(half_turn) * function(2 * half_turn * i) for function in (np.cos, np.sin))
    elif arrangement == "hexagon":
        x, y = radius * (2 * (i % 8) + i // 8 % 2), radius * np.sqrt(3) * (i // 8)
    else:
        x, y = 2 * radius * i, 0.3 + 0 * i
    low = min(x) - radius - 8, min(y) - radius - 8
    truth = np.column_stack([x - low[0], y - low[1], np.full(40, radius)])
    return truth, tuple((truth[:, 1::-1].max(axis=0) + radius + 9).astype(int))


@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("arrangement", ["row", "hexagon", "ring"])
def test_multiscale_finds_all_of_forty_touching_discs(arrangement, polarity):
    truth, shape = _touching(arrangement, 10.0)
    image = _picture(truth, shape)
    found = find_circles(image if polarity == "bright" else 255 - image, (6, 16), polarity=polarity)
    _match(found, truth, 1.5, 1.5)
