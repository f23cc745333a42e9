"""The three Hough transforms against literal loops, and what every search promises."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from pegpose_lab import circles
from pegpose_lab.circles import METHODS, circle_accumulator, find_circles
from pegpose_lab.tests.discs import draw_ellipses, to_uint8

TRUTH = np.array([(40.3, 44.8, 14.0), (95.6, 50.2, 18.0), (62.1, 101.4, 16.0)])
RANGE = (10, 22)


def _picture(truth=TRUTH, shape=(140, 140), noise=2.0, **drawing):
    ellipses = [(x, y, r, r, 0) for x, y, r in truth]
    return to_uint8(draw_ellipses(shape, ellipses, **drawing), noise, 0)


# ------------------------------------------------------------------------------------- literal transcripts


def _edges(image, threshold):
    """Edge pixels with G > t max(G), Sobel with replicated border."""
    dx = ndimage.sobel(image.astype(float), axis=1, mode="nearest")
    dy = ndimage.sobel(image.astype(float), axis=0, mode="nearest")
    magnitude = np.hypot(dx, dy)
    return [(x, y, dx[y, x], dy[y, x]) for y, x in np.argwhere(magnitude > threshold * magnitude.max())]


def _votes_by_loop(image, r_min, r_max, sign, threshold, phase):
    """One vote per edge pixel and half-pixel radius, along the gradient or against it."""
    votes = np.zeros(image.shape, complex)
    for x, y, gx, gy in _edges(image, threshold):
        r = r_min
        while r <= r_max:
            column = round(float(np.float32(x + sign * r * gx / np.hypot(gx, gy))))
            row = round(float(np.float32(y + sign * r * gy / np.hypot(gx, gy))))
            if 0 <= column < image.shape[1] and 0 <= row < image.shape[0]:
                angle = 2 * np.pi * np.log(r / r_min) / np.log(r_max / r_min) if phase else 0.0
                votes[row, column] += np.exp(1j * angle) / (2 * np.pi * r)
            r += 0.5
    return votes


def _circles_by_loop(edges, radii):
    """'A circle is drawn for each edge point with a radius r' (Sect. 3.1)."""
    height, width = edges.shape
    volume = np.zeros((len(radii), height, width))
    for plane, r in zip(volume, radii, strict=True):
        for y, x in np.argwhere(edges):
            for b in range(max(y - r - 1, 0), min(y + r + 2, height)):
                for a in range(max(x - r - 1, 0), min(x + r + 2, width)):
                    if round(np.hypot(a - x, b - y)) == r:
                        plane[b, a] += 1 / (2 * np.pi * r)
    return volume


def _maxima_by_reconstruction(surface, h):
    """h-maxima by reconstruction, 8-connected regional maxima, weighted centroids."""
    marker, square = surface - h, np.ones((3, 3))
    while True:
        grown = np.minimum(ndimage.grey_dilation(marker, footprint=square, mode="nearest"), surface)
        if (grown == marker).all():
            break
        marker = grown
    peaks, marker = [], np.round(marker, 9)
    # a plateau is a regional maximum if no neighbour of it is higher
    for value in np.unique(marker):
        plateaus, n = ndimage.label(marker == value, square)
        for k in range(1, n + 1):
            inside = plateaus == k
            border = ndimage.binary_dilation(inside, square) & ~inside
            if not (marker[border] > value).any() and surface[inside].max() >= h:
                y, x = np.nonzero(inside)
                w = surface[inside]
                peaks.append((w @ x / w.sum(), w @ y / w.sum(), w.max()))
    return sorted(peaks, key=lambda peak: -peak[2])


@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("method", ["two-stage", "phase-code"])
def test_votes_equal_the_literal_loop(method, polarity):
    image = _picture([(22.3, 20.8, 9.0)], (44, 48))
    fast = circle_accumulator(image, (6, 12), method=method, polarity=polarity, edge_threshold=0.3)
    slow = _votes_by_loop(image, 6, 12, 1 if polarity == "bright" else -1, 0.3, method == "phase-code")
    assert fast.shape == image.shape and np.iscomplexobj(fast) == (method == "phase-code")
    # a vote within rounding error of a pixel's border may fall on either side
    assert np.abs(fast - slow).sum() < 1e-3 * np.abs(slow).sum()


def test_gradient_is_correctly_rounded_wherever_it_lies_in_memory():
    image = np.random.default_rng(0).integers(0, 256, (61, 83), np.uint8)
    for offset in (0, 4, 16):
        buffer = np.empty(image.nbytes + offset, np.uint8)
        moved = buffer[offset:].reshape(image.shape)
        moved[...] = image
        gradient = circles._Gradient(moved)
        exact = np.hypot(gradient.dx.astype(np.longdouble), gradient.dy.astype(np.longdouble))
        np.testing.assert_array_equal(gradient.magnitude, exact.astype(np.float32))


def test_votes_do_not_depend_on_the_chunks(monkeypatch):
    image = _picture()
    whole = circle_accumulator(image, RANGE)
    monkeypatch.setattr(circles, "CHUNK", 1)
    np.testing.assert_allclose(circle_accumulator(image, RANGE), whole, rtol=1e-12, atol=1e-15)


def test_volume_equals_the_literal_loop():
    image = _picture([(20.3, 18.8, 8.0)], (36, 40))
    dx, dy = (cv2.Sobel(image, cv2.CV_16S, *d, borderType=cv2.BORDER_REPLICATE) for d in ((1, 0), (0, 1)))
    limit = 0.4 * np.hypot(dx.astype(float), dy).max()
    edges = (cv2.Canny(dx, dy, limit, limit, L2gradient=True) > 0) & (np.hypot(dx.astype(float), dy) > limit)
    fast = circle_accumulator(image, (5.5, 10), method="accumulator", edge_threshold=0.4)
    assert edges.any() and fast.shape == (5, *image.shape)
    np.testing.assert_allclose(fast, _circles_by_loop(edges, range(6, 11)), atol=1e-6)


@pytest.mark.parametrize("h", [0.05, 0.2, 0.5])
def test_peaks_equal_h_maxima_by_reconstruction(h):
    rng = np.random.default_rng(1)
    surface = ndimage.gaussian_filter(rng.random((60, 50)), 2)
    surface = ((surface - surface.min()) / np.ptp(surface)).astype(np.float32)
    fast = circles._regional_peaks(surface, h)
    slow = _maxima_by_reconstruction(surface.astype(float), np.float32(h).astype(float))
    assert len(fast) == len(slow) > 0
    np.testing.assert_allclose(fast, slow, atol=1e-4)


def test_otsu_is_the_default_edge_threshold():
    image = _picture()
    dx, dy = (ndimage.sobel(image.astype(float), axis=axis, mode="nearest") for axis in (1, 0))
    scaled = np.hypot(dx, dy) / np.hypot(dx, dy).max()
    otsu = cv2.threshold(np.rint(255 * scaled).astype(np.uint8), 0, 255, cv2.THRESH_OTSU)[0] / 255
    np.testing.assert_array_equal(
        circle_accumulator(image, RANGE), circle_accumulator(image, RANGE, edge_threshold=otsu)
    )


# ------------------------------------------------------------------------------------------------- searches


def _match(found, truth, center_error, radius_error):
    """Assert that the circles are exactly the true ones."""
    assert len(found) == len(truth)
    for x, y, r in truth:
        i = (np.hypot(*(found.centers - (x, y)).T) + abs(found.radii - r)).argmin()
        assert np.hypot(*(found.centers[i] - (x, y))) < center_error
        assert abs(found.radii[i] - r) <= radius_error


@pytest.mark.parametrize("method", METHODS)
def test_finds_bright_and_dark_discs(method):
    image = _picture()
    _match(find_circles(image, RANGE, method=method), TRUTH, 1.0, 1.0)
    _match(find_circles(255 - image, RANGE, method=method, polarity="dark"), TRUTH, 1.0, 1.0)
    assert len(find_circles(image, RANGE, method=method, polarity="dark", sensitivity=0.6)) == 0


@pytest.mark.parametrize("method", METHODS)
def test_finds_discs_in_a_mask(method):
    mask = _picture(noise=0) > 110
    _match(find_circles(mask, RANGE, method=method), TRUTH, 1.0, 1.5)


def test_two_stage_radii_are_whole_and_the_others_are_not():
    image = _picture()
    assert (find_circles(image, RANGE, method="two-stage").radii % 1 == 0).all()
    for method in set(METHODS) - {"two-stage"}:
        radii = find_circles(image, RANGE, method=method).radii
        assert (radii % 1 != 0).any()


def test_only_the_accumulator_tells_concentric_circles():
    picture = draw_ellipses((120, 120), [(60, 60, 36, 36, 0)])
    inner = draw_ellipses((120, 120), [(60, 60, 18, 18, 0)], background=0, level=1)
    image = to_uint8(picture + 60 * inner, 2, 0)
    found = find_circles(image, (12, 42), method="accumulator")
    _match(found, [(60, 60, 36), (60, 60, 18)], 1.0, 1.0)


@pytest.mark.parametrize("method", METHODS)
def test_regions_give_what_the_whole_picture_gives(method):
    image = _picture(shape=(150, 160))
    boxes = [[x - r - 2, y - r - 2, 2 * r + 4, 2 * r + 4] for x, y, r in TRUTH]
    _match(find_circles(image, RANGE, method=method, regions=[*boxes, *boxes[:1]]), TRUTH, 1.0, 1.0)
    only = find_circles(image, RANGE, method=method, regions=boxes[1:2])
    _match(only, TRUTH[1:2], 1.0, 1.0)
    assert len(find_circles(image, RANGE, regions=np.empty((0, 4)))) == 0
    assert len(find_circles(image, RANGE, regions=[[40, 40, 5, 5]])) == 0


def test_order_and_number():
    found = find_circles(_picture(), RANGE)
    assert (np.diff(found.scores) <= 0).all()
    best = find_circles(_picture(), RANGE, max_circles=2)
    np.testing.assert_array_equal(best.centers, found.centers[:2])


def test_sensitivity_is_one_minus_the_least_score():
    image, method = _picture(), "phase-code"
    scores = find_circles(image, RANGE, method=method, sensitivity=0.95).scores
    assert 0 < scores[1] < scores[0] < 1
    between = 1 - (scores[0] + scores[1]) / 2
    assert find_circles(image, RANGE, method=method, sensitivity=between).scores.tolist() == [scores[0]]
    assert len(find_circles(image, RANGE, method=method, sensitivity=1 - scores[0] - 1e-3)) == 0


@pytest.mark.parametrize("method", METHODS)
def test_nothing_to_see(method):
    assert len(find_circles(np.full((50, 60), 7, np.uint8), (5, 12), method=method)) == 0
    found = find_circles(np.zeros((1, 1), np.uint8), (5, 12), method=method)
    assert found.centers.shape == (0, 2) and found.radii.shape == (0,) and found.scores.shape == (0,)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"radius_range": 5}, "radius_range"),
        ({"radius_range": (5, 5)}, "radius_range"),
        ({"radius_range": (0, 5)}, "radius_range"),
        ({"radius_range": (np.nan, 5)}, "radius_range"),
        ({"radius_range": (5.2, 5.8), "method": "accumulator"}, "radius_range"),
        ({"method": "best"}, "method"),
        ({"polarity": "grey"}, "polarity"),
        ({"sensitivity": 1.5}, "sensitivity"),
        ({"edge_threshold": -1}, "edge_threshold"),
        ({"max_circles": 0}, "max_circles"),
        ({"regions": [[1, 2, 3]]}, "regions"),
        ({"image": np.zeros((4, 4, 3), np.uint8)}, "image"),
        ({"image": np.zeros((4, 4), np.uint16)}, "image"),
    ],
)
def test_bad_arguments(arguments, name):
    call = {"image": np.zeros((40, 40), np.uint8), "radius_range": (5, 12)} | arguments
    with pytest.raises(ValueError, match=name):
        find_circles(call.pop("image"), call.pop("radius_range"), **call)


@settings(max_examples=2000, deadline=None)
@given(
    arrays(
        np.uint8, st.tuples(st.integers(1, 30), st.integers(1, 30)), elements=st.sampled_from([0, 9, 130, 255])
    ),
    st.floats(0.5, 12),
    st.floats(0.1, 20),
    st.sampled_from(METHODS),
    st.sampled_from(["bright", "dark"]),
    st.floats(0, 1),
    st.none() | st.floats(0, 1),
)
def test_promises_hold_for_any_picture(image, r_min, width, method, polarity, sensitivity, edge_threshold):
    r_max = max(r_min + width, np.ceil(r_min))
    found = find_circles(
        image,
        (r_min, r_max),
        method=method,
        polarity=polarity,
        sensitivity=sensitivity,
        edge_threshold=edge_threshold,
    )
    assert ((r_min <= found.radii) & (found.radii <= r_max)).all()
    assert (found.centers >= 0).all() and (found.centers <= np.array(image.shape[::-1]) - 1).all()
    assert np.isfinite(found.scores).all() and (np.diff(found.scores) <= 0).all()
    circle = np.column_stack([found.centers, found.radii])
    assert len(np.unique(circle, axis=0)) == len(circle)


def test_multiscale_finds_every_octave_and_concentric_circles():
    truth = [(150, 150, 120), (150, 150, 50), (150, 150, 20), (330, 60, 9), (330, 200, 30), (60, 330, 5), (300, 330, 14)]
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
