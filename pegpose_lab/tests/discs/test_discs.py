"""Disc fits against known ellipses: bias, the Cramer-Rao bound, honest sigmas, rejections."""

import numpy as np
import pytest

from pegpose_lab.circles import find_circles
from pegpose_lab.discs import fit_discs, start
from pegpose_lab.tests.discs.stacks import SHAPE, R, _circles, _measure, _near, _one_picture, _stack, _truth
from pegpose_lab.tests.pictures import TURNS, center_bound, draw_ellipses, to_uint8


@pytest.mark.parametrize("noise", [1, 5, 10])
def test_reaches_the_cramer_rao_bound_with_honest_sigmas(noise):
    truth, discs = _measure(noise, ratio=0.97)
    errors = _stack(discs, "centers") - truth[:, :2]
    assert _stack(discs, "accepted").all()
    assert np.sqrt((errors**2).mean()) < 1.2 * center_bound(R, 100, 0.9, noise)
    scaled = errors / _stack(discs, "sigmas")[:, :2]
    assert 0.85 < np.sqrt((scaled**2).mean()) < 1.15
    radius_error = _stack(discs, "radii") - R
    assert np.sqrt((radius_error**2).mean()) < 1.4 * center_bound(R, 100, 0.9, noise) / np.sqrt(2)
    assert abs(_stack(discs, "chi2").mean() - 1) < 0.05


def test_axes_and_angle_have_honest_sigmas():
    truth, discs = _measure(5, ratio=0.8)
    axes = (_stack(discs, "semi_axes") - truth[:, 2:4]) / _stack(discs, "sigmas")[:, 2:4]
    turn = (_stack(discs, "angles") - truth[:, 4] + np.pi / 2) % np.pi - np.pi / 2
    assert (np.sqrt((axes**2).mean(axis=0)) > 0.8).all() and (np.sqrt((axes**2).mean(axis=0)) < 1.2).all()
    assert 0.8 < np.sqrt(((turn / _stack(discs, "sigmas")[:, 4]) ** 2).mean()) < 1.2


def test_blur_does_not_shrink_small_discs():
    """Without the correction s^2 / 2r the radius would be 0.25 px too small."""
    ellipse = [(40.3, 39.8, 10.0, 10.0, 0.0)]
    image = to_uint8(draw_ellipses((80, 80), ellipse, blur=2.2, level=220, background=20))
    discs = fit_discs(image, _circles([(40, 40)], [10]))
    assert abs(discs.radii[0] - 10) < 0.02
    assert np.hypot(*(discs.centers[0] - (40.3, 39.8))) < 0.01


def test_curvature_of_the_ellipse_enters_the_shrinkage():
    ellipse = [(60.2, 59.6, 40.0, 20.0, 0.4)]
    image = to_uint8(draw_ellipses((120, 120), ellipse, blur=1.5), 0)
    discs = fit_discs(image, _circles([(60, 60)], [28]))
    np.testing.assert_allclose(discs.semi_axes[0], (40, 20), atol=0.03)
    assert abs(discs.angles[0] - 0.4) < 1e-3


def test_dark_discs_are_the_negative_of_bright_ones():
    rng = np.random.default_rng(3)
    truth = _truth(rng)
    image, circles = to_uint8(draw_ellipses(SHAPE, truth), 3, rng), _near(truth, rng)
    bright, dark = fit_discs(image, circles), fit_discs(255 - image, circles)
    np.testing.assert_allclose(dark.centers, bright.centers, atol=1e-3)
    np.testing.assert_allclose(dark.contrasts, -bright.contrasts, atol=0.05)
    assert bright.contrasts.min() > 95
    edge = np.sqrt(0.9**2 + 1 / 12)
    np.testing.assert_allclose(bright.blurs, edge, atol=0.05)


def test_known_noise_is_measured():
    for noise in (2.0, 8.0):
        _, discs = _measure(noise, pictures=1)
        np.testing.assert_allclose(_stack(discs, "noises"), np.hypot(noise, np.sqrt(1 / 12)), rtol=0.12)


def test_a_circle_has_a_finite_angle_sigma():
    image = to_uint8(draw_ellipses((140, 140), [(70, 70, R, R, 0)]), 5, 0)
    discs = fit_discs(image, _circles([(70, 70)], [R]))
    assert 0 < discs.sigmas[0, 4] <= np.pi / np.sqrt(12) + 1e-12
    np.testing.assert_allclose(np.sqrt(np.diag(discs.covariance[0])), discs.sigmas[0])
    assert discs.semi_axes[0, 0] >= discs.semi_axes[0, 1]


@pytest.mark.parametrize(
    ("center", "radius", "reason"),
    [((30, 70), R, "leaves the image"), ((70, 70), 1.5, "radius too small")],
)
def test_circles_that_cannot_be_fitted_say_why(center, radius, reason):
    image = to_uint8(draw_ellipses((140, 140), [(70, 70, R, R, 0)]), 2, 0)
    discs = fit_discs(image, _circles([center], [radius]))
    assert discs.reasons[0] == reason and not discs.accepted[0]
    np.testing.assert_allclose(discs.centers[0], center)
    assert np.isinf(discs.sigmas).all() and not np.isnan(discs.covariance).any()


def test_noise_constant_and_square_are_rejected():
    rng = np.random.default_rng(2)
    noise = to_uint8(np.full((140, 140), 100.0), 10, rng)
    constant = np.full((140, 140), 100, np.uint8)
    square = np.full((140, 140), 60.0)
    square[30:110, 30:110] = 160
    for image in (noise, constant, to_uint8(square, 2, rng)):
        discs = fit_discs(image, _circles([(70, 70)], [44]))
        assert not discs.accepted[0] and discs.reasons[0]


def test_order_is_kept_and_empty_is_fine():
    image = to_uint8(draw_ellipses((140, 140), [(70, 70, R, R, 0)]), 2, 0)
    discs = fit_discs(image, _circles([(30, 30), (70, 71)], [R, R]))
    assert discs.accepted.tolist() == [False, True] and len(discs) == 2
    none = fit_discs(image, _circles(np.empty((0, 2)), []))
    assert none.centers.shape == (0, 2) and none.sigmas.shape == (0, 5) and none.covariance.shape == (0, 5, 5)


@pytest.mark.parametrize(
    "circles",
    [None, np.ones((3, 3)), _circles([(1, np.nan)], [3]), _circles([(1, 2)], [3, 4]), _circles([(1, 2)], [-3])],
)
def test_bad_circles(circles):
    with pytest.raises(ValueError, match="circles"):
        fit_discs(np.zeros((9, 9), np.uint8), circles)


@pytest.mark.parametrize("polarity", [None, "Bright", "white", 1, ["bright"]])
def test_a_polarity_is_bright_dark_or_left_open(polarity):
    circles = _circles([(20, 20)], [9])
    circles.polarity = polarity
    with pytest.raises(ValueError, match="circles.polarity is .*; expected one of 'bright', 'dark', ''"):
        fit_discs(np.zeros((40, 40), np.uint8), circles)


@pytest.mark.parametrize("kind", [float, bool, np.uint16])
def test_bad_image(kind):
    with pytest.raises(ValueError, match="image"):
        fit_discs(np.zeros((9, 9), kind), _circles([(4, 4)], [3]))


@pytest.mark.parametrize("length", [32_766, 32_767, 40_000])
@pytest.mark.parametrize("along", [0, 1])
def test_pictures_of_any_length_are_measured(length, along):
    """OpenCV's `remap` refuses sides of 32767 px and more."""
    small = to_uint8(draw_ellipses((140, 140), [(70.3, 68.8, 16, 15, 0.4)]), 2.0, 0)
    image, shift = np.full((140, length), 60, np.uint8), length - 150
    image[:, shift : shift + 140] = small
    truth = fit_discs(small, _circles([(70, 69)], [16]))
    if along:
        image = np.ascontiguousarray(image.T)
        truth = fit_discs(np.ascontiguousarray(small.T), _circles([(69, 70)], [16]))
    place = (69, 70 + shift) if along else (70 + shift, 69)
    discs = fit_discs(image, _circles([place], [16]))
    assert discs.accepted[0]
    np.testing.assert_allclose(discs.centers[0] - ((0, shift) if along else (shift, 0)), truth.centers[0], atol=1e-3)
    np.testing.assert_allclose(discs.semi_axes, truth.semi_axes, atol=1e-3)


def test_discs_larger_than_opencv_takes_are_started_on_every_so_many_th_pixel(monkeypatch):
    image = to_uint8(draw_ellipses((300, 300), [(150.2, 148.9, 110, 110, 0)]), 2.0, 0)
    circles = _circles([(152, 150)], [105])
    whole = fit_discs(image, circles)
    monkeypatch.setattr(start, "REMAP_LIMIT", 99)
    parts = fit_discs(image, circles)
    assert whole.accepted[0] and parts.accepted[0]
    np.testing.assert_allclose(parts.centers, whole.centers, atol=2e-3)


def test_more_circles_than_opencv_takes_rows_are_fitted_in_one_call():
    """64 rays for each of 600 circles are more rows than the 32767 that OpenCV's `remap` takes."""
    places = np.array([(12.3 + 24 * i, 12.1 + 24 * j) for j in range(20) for i in range(30)])
    image = to_uint8(draw_ellipses((480, 720), [(x, y, 7, 7, 0) for x, y in places]), 2, 0)
    starts = _circles(places + 0.4, np.full(600, 7.4))
    discs = fit_discs(image, starts)
    assert len(discs) == 600 and discs.accepted.all()
    assert np.abs(discs.centers - places).max() < 0.05 and np.abs(discs.radii - 7).max() < 0.05
    some = fit_discs(image, _circles(starts.centers[250:350], starts.radii[250:350]))
    np.testing.assert_allclose(discs.centers[250:350], some.centers, atol=1e-3)
    np.testing.assert_allclose(discs.sigmas[250:350], some.sigmas, rtol=0.01)


@pytest.mark.parametrize("radius", [3.0, 4.0, 300.0])
def test_small_and_large_discs_are_found_and_measured(radius):
    side = int(2 * radius + 80)
    truth = np.array([side / 2 + 0.3, side / 2 - 0.2, radius])
    image = to_uint8(draw_ellipses((side, side), [(*truth[:2], radius, radius, 0)]), 2, 0)
    for picture, polarity, sign in ((image, "bright", 1), (255 - image, "dark", -1)):
        found = find_circles(picture, (0.7 * radius, 1.4 * radius), polarity=polarity)
        assert len(found) == 1 and np.hypot(*(found.centers[0] - truth[:2])) < 0.05 * radius + 0.2
        discs = fit_discs(picture, found)
        error = np.abs([*(discs.centers[0] - truth[:2]), discs.radii[0] - radius])
        assert discs.accepted[0] and sign * discs.contrasts[0] > 90
        assert (error < 4 * discs.sigmas[0, :3]).all() and error.max() < 0.05


@pytest.mark.parametrize("place", [(-5, 60), (30, 60), (95, 60), (60, -8), (60, 30), (60, 95)])
def test_fits_of_discs_cut_by_the_border_say_so(place):
    image = to_uint8(draw_ellipses((120, 120), [(*place, 40, 40, 0)]), 2, 0)
    found = find_circles(image, (34, 46), sensitivity=1.0)
    for circles in (_circles([place], [40]), found):
        discs = fit_discs(image, circles)
        assert (discs.reasons == "leaves the image").all()
        np.testing.assert_array_equal(discs.centers, circles.centers)


@pytest.mark.parametrize("turn", TURNS)
def test_turned_pictures_give_the_same_fits(turn):
    """But for radii where even ground counts in one only: noise, measured along the rows, decides on that."""
    _, image, circles = _one_picture()
    turned, back = TURNS[turn]
    discs = fit_discs(image, circles)
    again = fit_discs(turned(image), _circles(np.column_stack(back(*circles.centers.T, SHAPE)), circles.radii))
    assert discs.accepted.all() and again.accepted.all()
    np.testing.assert_allclose(np.column_stack(back(*again.centers.T, SHAPE)), discs.centers, atol=1e-3)
    change = np.abs(again.radii - discs.radii)
    assert (change < 0.4 * discs.sigmas[:, 2]).all() and (change < 1e-3).mean() > 0.8
