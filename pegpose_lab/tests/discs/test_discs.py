"""Disc fits against known ellipses: bias, the Cramer-Rao bound, honest sigmas, rejections."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

from pegpose_lab.circles import find_circles
from pegpose_lab.discs import fit_discs, ground, measure, model, refit, ring, start
from pegpose_lab.discs.ellipse import _Ellipse
from pegpose_lab.tests.pictures import SEEDS, TURNS, center_bound, draw_ellipses, scenes, to_uint8

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
    assert (0.8 < np.sqrt((axes**2).mean(axis=0))).all() and (np.sqrt((axes**2).mean(axis=0)) < 1.2).all()
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


def _with_wall(rng, noise):
    """Discs with a wall 12 grey values above the base on one side, and a slope over the base."""
    truth = _truth(rng)
    walls = truth + [-6, -3, 0, 0, 0]
    base = draw_ellipses(SHAPE, walls, background=60, level=72)
    base += np.linspace(0, 10, SHAPE[1])
    share = draw_ellipses(SHAPE, truth, background=0, level=1)
    return truth, to_uint8(base + share * (160 - base), noise, rng)


def test_side_walls_are_fitted_by_sectors(monkeypatch):
    rng = np.random.default_rng(11)
    truth, image = _with_wall(rng, 2)
    circles = _near(truth, rng)

    def rms_and_scaled():
        discs = fit_discs(image, circles)
        errors = discs.centers - truth[:, :2]
        return np.sqrt((errors**2).mean()), np.sqrt(((errors / discs.sigmas[:, :2]) ** 2).mean()), discs

    rms, scaled, discs = rms_and_scaled()
    assert discs.accepted.all() and rms < 0.03 and scaled < 1.5
    monkeypatch.setattr(measure, "REFIT_SIGMAS", np.inf)
    monkeypatch.setattr(ground, "GROUND_SIGMAS", np.inf)
    assert rms_and_scaled()[0] > 5 * rms


def test_a_bar_over_the_edge_moves_the_center_little():
    rng = np.random.default_rng(5)
    picture = draw_ellipses((140, 140), [(70.2, 69.7, R, R, 0)])
    picture[60:75, :40] = 110
    discs = fit_discs(to_uint8(picture, 2, rng), _circles([(70, 70)], [R]))
    error = discs.centers[0] - (70.2, 69.7)
    assert discs.accepted[0] and np.hypot(*error) < 0.03
    assert (np.abs(error) < 4 * discs.sigmas[0, :2]).all()


def test_an_arc_is_enough_and_too_short_an_arc_is_refused():
    """What lies right of a column is hidden by a bar of the background's own level."""
    results = []
    for column in (95, 40):
        picture = draw_ellipses((140, 140), [(70.2, 69.7, R, R, 0)])
        picture[:, column:] = 60
        results.append(fit_discs(to_uint8(picture, 2, 1), _circles([(70, 70)], [R])))
    arc, little = results
    error = np.abs(arc.centers[0] - (70.2, 69.7))
    assert arc.accepted[0] and error.max() < 0.1 and (error < 4 * arc.sigmas[0, :2]).all()
    assert not little.accepted[0]


def test_sectors_cost_little_where_nothing_is_wrong(monkeypatch):
    monkeypatch.setattr(measure, "REFIT_SIGMAS", -1e9)
    truth, discs = _measure(5, pictures=6)
    errors = _stack(discs, "centers") - truth[:, :2]
    assert np.sqrt((errors**2).mean()) < 1.3 * center_bound(R, 100, 0.9, 5)
    assert 0.8 < np.sqrt(((errors / _stack(discs, "sigmas")[:, :2]) ** 2).mean()) < 1.3


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


# ----------------------------------------------------------------------------------------- fits of any picture


REASONS = {
    "leaves the image",
    "radius too small",
    "no edge",
    "does not converge",
    "edge hidden",
    "contrast below noise",
    "chi2",
    "same disc",
    "other polarity",
}
NAMES = tuple(measure.Discs.__dataclass_fields__)


def _random_starts(scene, seed, arbitrary):
    """Circles off each disc's centre and radius by up to 20 % of it, then some that have to do with no disc."""
    rng, (x, y, r) = np.random.default_rng(seed), scene.discs.T
    far, turn = 0.2 * r * rng.random(len(r)), rng.uniform(0, 2 * np.pi, len(r))
    near = np.column_stack([x + far * np.cos(turn), y + far * np.sin(turn), r * rng.uniform(0.8, 1.2, len(r))])
    scale = rng.choice([1, 1, 1, 1e6], (arbitrary, 1))
    places = rng.uniform(-0.2, 1.2, (arbitrary, 2)) * scene.image.shape[::-1] * scale
    rows = np.concatenate([near, np.hstack([places, 10 ** rng.uniform(-0.5, 2, (arbitrary, 1)) * scale])])
    return _circles(rows[:, :2], rows[:, 2])


def _assert_discs(discs, shape, circles):
    """What `Discs` and `fit_discs` promise of every result."""
    n = len(circles.radii)
    shapes = {"centers": (n, 2), "semi_axes": (n, 2), "sigmas": (n, 5), "covariance": (n, 5, 5)}
    for name in NAMES:
        assert getattr(discs, name).shape == shapes.get(name, (n,))
        assert getattr(discs, name).dtype.kind == {"accepted": "b", "reasons": "U"}.get(name, "f")
    assert len(discs) == n and set(discs.reasons) <= REASONS | {""}
    np.testing.assert_array_equal(discs.accepted, discs.reasons == "")
    for name in ("centers", "semi_axes", "angles", "contrasts", "blurs", "noises", "radii"):
        assert np.isfinite(getattr(discs, name)).all()
    major, minor = discs.semi_axes.T
    assert (major >= minor).all() and (minor > 0).all()
    np.testing.assert_allclose(discs.radii, np.sqrt(major * minor))
    assert (np.abs(discs.angles) <= np.pi / 2).all() and (discs.angles > -np.pi / 2).all()
    assert (discs.noises >= np.sqrt(1 / 12) - 1e-12).all() and (discs.blurs >= 0).all() and (discs.chi2 >= 0).all()
    _assert_sigmas(discs)
    _assert_no_fit(discs, circles)
    _assert_on_picture(discs, shape)


def _assert_sigmas(discs):
    """Positive, the roots of the covariances' diagonals, the angle's no more than that of any direction."""
    assert (discs.sigmas > 0).all() and not np.isnan(discs.covariance).any()
    np.testing.assert_allclose(np.sqrt(np.diagonal(discs.covariance, axis1=1, axis2=2)), discs.sigmas)
    fitted = np.isfinite(discs.sigmas).all(axis=1)
    assert fitted[discs.accepted].all() and np.isinf(discs.sigmas[~fitted]).all()
    assert (discs.sigmas[fitted, 4] <= np.pi / np.sqrt(12) + 1e-9).all()
    scaled = discs.covariance[fitted] / (discs.sigmas[fitted, :, None] * discs.sigmas[fitted, None])
    np.testing.assert_allclose(scaled, scaled.swapaxes(1, 2), atol=1e-6)
    assert (np.linalg.eigvalsh(scaled) > -1e-6).all()


def _assert_no_fit(discs, circles):
    """Where there is no fit, centre and radius are the circle's own."""
    none = np.isinf(discs.chi2)
    np.testing.assert_array_equal(none, np.isinf(discs.sigmas).all(axis=1))
    np.testing.assert_array_equal(discs.centers[none], circles.centers[none])
    np.testing.assert_allclose(discs.radii[none], circles.radii[none])
    assert none[discs.reasons == "radius too small"].all() and not none[discs.accepted].any()


def _assert_on_picture(discs, shape):
    """An accepted ellipse lies on the picture, as far as the last, small step lets it."""
    (a, b), cos, sin = discs.semi_axes.T, np.cos(discs.angles), np.sin(discs.angles)
    reach = np.column_stack([np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)])[discs.accepted]
    centers = discs.centers[discs.accepted]
    assert (centers >= reach - 0.1).all() and (centers + reach <= np.array(shape[::-1]) - 1 + 0.1).all()


def _assert_limits(discs, max_chi2=1.5, max_misfit=0.05):
    """An accepted fit shows the disc above the noise, and keeps one of the limits at least."""
    misfit = discs.noises * np.sqrt(np.maximum(discs.chi2 - 1, 0))
    kept = (discs.chi2 <= max_chi2 + 1e-9) | (misfit <= max_misfit * np.abs(discs.contrasts) + 1e-9)
    assert (kept & (np.abs(discs.contrasts) > discs.noises))[discs.accepted].all()


def _check_fit(scene, circles, limits, again, seen):
    """Assert all promises for one picture, and that they are kept `again`; `seen` counts what came of it."""
    before = scene.image.copy()
    discs = fit_discs(scene.image, circles, **limits)
    np.testing.assert_array_equal(scene.image, before)
    _assert_discs(discs, before.shape, circles)
    _assert_limits(discs, **limits)
    if again:
        repeated = fit_discs(before, circles, **limits)
        for name in NAMES:
            np.testing.assert_array_equal(getattr(discs, name), getattr(repeated, name))
    near = len(scene.discs)
    off = np.column_stack([discs.centers, discs.radii])[:near] - scene.discs
    right = discs.accepted[:near] & (np.hypot(*off[:, :2].T) + np.abs(off[:, 2]) < 0.3)
    seen.update(fits=len(discs), accepted=discs.accepted.sum().item(), near=near, right=right.sum().item())
    seen.update(pictures=1, with_accepted=int(discs.accepted.any()), **{"own limits": int(bool(limits))})
    seen.update(discs.reasons.tolist())


LIMITS = st.just({}) | st.fixed_dictionaries(
    {}, optional={"max_chi2": st.floats(0, 10), "max_misfit": st.floats(0, 0.5)}
)


def test_promises_hold_for_any_picture_and_a_fifth_of_the_fits_is_accepted():
    seen = Counter()

    @settings(max_examples=2000, deadline=None, derandomize=True)
    @given(scenes(), SEEDS, st.sampled_from((0, 1, 0, 2)), LIMITS, st.sampled_from((False, False, True)))
    def check(scene, seed, arbitrary, limits, again):
        _check_fit(scene, _random_starts(scene, seed, arbitrary), limits, again, seen)

    check()
    assert seen["pictures"] == 2000 and seen["accepted"] >= 0.2 * seen["fits"], seen
    assert seen["right"] >= 0.15 * seen["near"] and len(REASONS & set(seen)) >= 6, seen


@given(st.floats(-0.6, 0.6), st.floats(-1.5, 1.5), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_shape_steps_match_the_distance_derivatives(m, angle, dp, dq):
    """A small step of the shape changes the distance as the analytic derivatives say."""
    ellipse = _Ellipse(3.0, -2.0, 20.0, abs(m), angle)
    t = np.linspace(0, 6, 25)
    x, y = 3 + 21 * np.cos(t), -2 + 19 * np.sin(t)
    (a, b), cos, sin = ellipse.axes, np.cos(angle), np.sin(angle)
    x, y = 3 + a * np.cos(t) * cos - b * np.sin(t) * sin, -2 + a * np.cos(t) * sin + b * np.sin(t) * cos
    step = 1e-6 * np.array([0.7, -0.4, 0.9, dp, dq])
    before, rows, _ = _geometry(x, y, ellipse)
    after = _geometry(x, y, ellipse.moved(*step))[0]
    np.testing.assert_allclose(before, 0, atol=1e-9)
    np.testing.assert_allclose(after - before, step @ rows, atol=2e-9)


# ---------------------------------------------------------------------------- the fast model and a literal one


def _geometry(x, y, ellipse):
    """Signed distance (positive inside), its derivatives by x, y, r, p, q as rows, and the curvature.

    With w = S (X - c), S = diag(e^-m, e^m) R^T, the ellipse is |w| = r; the distance is
    (r - |w|) / |S^T w / |w||, exact for circles and in error by (d^2/r) O(m^2) for ellipses.
    """
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    grow, shrink = np.exp(ellipse.m), np.exp(-ellipse.m)
    dx, dy = x - ellipse.x, y - ellipse.y
    u, v = shrink * (dx * cos + dy * sin), grow * (dy * cos - dx * sin)
    norm = np.sqrt(u * u + v * v)
    centre = norm < 1e-6  # has no direction; any will do
    u[centre], norm[centre] = 1e-6, 1e-6
    u /= norm
    v /= norm
    along, across = shrink * u, grow * v
    inverse = 1 / np.sqrt(along * along + across * across)
    rows = np.empty((5, len(x)))
    rows[0] = (along * cos - across * sin) * inverse
    rows[1] = (along * sin + across * cos) * inverse
    rows[2] = inverse
    rows[3] = (u * u - v * v) * norm * inverse
    rows[4] = 2 * u * v * norm * inverse
    return (ellipse.r - norm) * inverse, rows, inverse**3 / ellipse.r


def _model(x, y, ellipse, log_s):
    """Phi and the derivatives of Phi by x, y, r, p, q, log s (rows)."""
    s = np.exp(log_s)
    distance, rows, curvature = _geometry(x, y, ellipse)
    shift = 0.5 * s * curvature
    z = distance / s - shift
    density = np.exp(-0.5 * z * z) * (1 / (np.sqrt(2 * np.pi) * s))
    derivatives = np.empty((6, len(x)))
    np.multiply(rows, density, out=derivatives[:5])
    derivatives[5] = -(z + 2 * shift) * density * s
    return ndtr(z), derivatives


@given(
    st.floats(0, 0.4), st.floats(-1.5, 1.5), st.floats(-0.5, 0.7), st.floats(3, 60), st.sampled_from([0.0, 0.3, -0.4])
)
def test_fast_rows_equal_the_literal_model(m, angle, log_s, r, shift):
    """Single precision and the tables cost less than 1e-3 of the contrast, and of its derivatives."""
    ellipse = _Ellipse(*(np.array([value]) for value in (100.0 + shift, 90.0 - shift, r, m, angle)))
    t = np.linspace(0, 6.2, 40)[:, None]
    beyond = 1 + np.linspace(-4, 4, 9) / r
    x = np.rint(100 + r * beyond * np.cos(t)).ravel()
    y = np.rint(90 + r * beyond * np.sin(t)).ravel()
    ones = np.ones((1, len(x)), np.float32)
    pixels = ring._Pixels(
        np.array([[100.0, 90.0]]), (x[None] - 100).astype(np.float32), (y[None] - 90).astype(np.float32), ones, ones,
        np.zeros(1),
    )
    fast = model._ingredients(pixels, ellipse, np.array([log_s]), extra=2)[0]
    one = _Ellipse(*(float(getattr(ellipse, name)[0]) for name in ("x", "y", "r", "m", "angle")))
    share, derivatives = _model(x, y, one, log_s)
    far = np.hypot(x - one.x, y - one.y) > 1
    np.testing.assert_allclose(fast[7][far], share[far], atol=1e-3)
    np.testing.assert_allclose(fast[:6, far], derivatives[:, far], atol=2e-3 * max(1, r * np.exp(-log_s) / 10))
    distance = _geometry(x, y, one)[0]
    np.testing.assert_allclose(fast[9][far], distance[far], atol=1e-3)
