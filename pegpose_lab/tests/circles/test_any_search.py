"""What `find_circles` promises of any picture."""

from collections import Counter
from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pegpose_lab.circles import METHODS, Circles, circle_accumulator, find_circles
from pegpose_lab.circles import votes as votes_file
from pegpose_lab.circles.edges import _Gradient
from pegpose_lab.circles.peaks import _regional_peaks
from pegpose_lab.tests.pictures import SEEDS, TURNS, Scene, draw_ellipses, scenes, to_uint8

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
        gradient = _Gradient(moved)
        exact = np.hypot(gradient.dx.astype(np.longdouble), gradient.dy.astype(np.longdouble))
        np.testing.assert_array_equal(gradient.magnitude, exact.astype(np.float32))


def test_votes_do_not_depend_on_the_chunks(monkeypatch):
    image = _picture()
    whole = circle_accumulator(image, RANGE)
    monkeypatch.setattr(votes_file, "CHUNK", 1)
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
    fast = _regional_peaks(surface, h)
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
        ({"radius_range": (5, 4.9)}, "radius_range"),
        ({"radius_range": (0, 5)}, "radius_range"),
        ({"radius_range": (np.nan, 5)}, "radius_range"),
        ({"radius_range": ("5", "9")}, "radius_range"),
        ({"method": "best"}, "method"),
        ({"polarity": "grey"}, "polarity"),
        ({"sensitivity": 1.5}, "sensitivity"),
        ({"edge_threshold": -1}, "edge_threshold"),
        ({"method": None}, "method"),
        ({"polarity": None}, "polarity"),
        ({"sensitivity": True}, "sensitivity"),
        ({"max_circles": 0}, "max_circles"),
        ({"max_circles": 1.7}, "max_circles"),
        ({"max_circles": "2"}, "max_circles"),
        ({"max_circles": True}, "max_circles"),
        ({"regions": [[1, 2, 3]]}, "regions"),
        ({"image": np.zeros((4, 4, 3), np.uint8)}, "image"),
        ({"image": np.zeros((4, 4), np.uint16)}, "image"),
    ],
)
def test_bad_arguments(arguments, name):
    call = {"image": np.zeros((40, 40), np.uint8), "radius_range": (5, 12)} | arguments
    with pytest.raises(ValueError, match=name):
        find_circles(call.pop("image"), call.pop("radius_range"), **call)


# ------------------------------------------------------------------------------------- searches of any picture


@dataclass(frozen=True)
class _Search:
    """Everything that `find_circles` is given."""

    scene: Scene
    radius_range: tuple
    arguments: dict

    @property
    def method(self):
        return self.arguments.get("method", "multiscale")

    def find(self, image, **changes):
        return find_circles(image, self.radius_range, **(self.arguments | changes))


def _random_search(scene, seed, method, known, others):
    """Ask for the scene's own radii if they are `known`, and change the arguments named in `others`."""
    rng, arguments = np.random.default_rng(seed), {} if method is None else {"method": method}
    radii = scene.discs[:, 2] if known and len(scene.discs) else 10 ** rng.uniform(-3, 3, 1)
    wide = rng.uniform(1.1, 2.5) if known else 1 + 10 ** rng.uniform(-3, 3)
    radius_range = rng.uniform(0.5, 0.95) * radii.min(), min(wide * radii.max(), 9.9e4)
    if method == "accumulator":  # a plane for each whole radius is slow: few, and of less than the picture
        middle = min(radii[0], 100)
        radius_range = middle - min(3, 0.3 * middle), middle + rng.uniform(0.1, 3)
    choices = {
        "polarity": rng.choice(["bright", "dark"]),
        "sensitivity": rng.choice([0.0, 1.0, *rng.uniform(0, 1, 2), *rng.uniform(0.6, 1, 4)]),
        "edge_threshold": rng.choice([0.0, 1.0, *rng.random(4)]),
        "max_circles": rng.integers(1, 4),
        "regions": _random_regions(rng, scene),
    }
    arguments |= {"polarity": scene.polarity} | {name: choices[name] for name in others}
    return _Search(scene, radius_range, arguments)


def _random_regions(rng, scene):
    """Up to five boxes around discs, anywhere, outside, empty, even with negative sizes."""
    x, y, r = scene.discs.T
    around = np.column_stack([x - r, y - r, 2 * r, 2 * r])
    anywhere = rng.uniform(-100, 250, (2, 4)) * rng.choice([0, 1, 1, 1000], (2, 1))
    return rng.permutation(np.concatenate([around, anywhere]))[: rng.integers(0, 6)]


OTHERS = ("polarity", "sensitivity", "edge_threshold", "max_circles", "regions")
SEARCHES = st.builds(
    _random_search,
    scenes(masks=1),
    SEEDS,
    method=st.sampled_from((None, None, *METHODS)),
    known=st.sampled_from((True, True, True, True, False)),
    others=st.just([]) | st.just([]) | st.lists(st.sampled_from(OTHERS), min_size=1, max_size=2, unique=True),
)


def _assert_circles(found, search):
    """What `Circles` and `find_circles` promise of every result."""
    n, (height, width) = len(found), search.scene.image.shape
    assert found.centers.shape == (n, 2) and found.radii.shape == found.scores.shape == (n,)
    assert found.centers.dtype == found.radii.dtype == found.scores.dtype == float
    assert (found.centers >= 0).all() and (found.centers <= (width - 1, height - 1)).all()
    assert (found.radii >= search.radius_range[0]).all() and (found.radii <= search.radius_range[1]).all()
    assert (found.scores >= _least_score(search) - 1e-6).all() and np.isfinite(found.scores).all()
    order = [(-score, y, x) for score, (x, y) in zip(found.scores, found.centers, strict=True)]
    assert order == sorted(order)
    apart = np.hypot(*(found.centers[:, None] - found.centers).T) + abs(found.radii[:, None] - found.radii)
    near = np.maximum(3, 0.15 * np.minimum(found.radii[:, None], found.radii))
    assert (apart >= near - 1e-9)[~np.eye(n, dtype=bool)].all()


def _least_score(search):
    sensitivity = search.arguments.get("sensitivity", 0.85)
    if search.method == "multiscale":
        return 1.55 - sensitivity
    return 1 - sensitivity / 2 if search.method == "accumulator" else 1 - sensitivity


def _assert_same(found, expected):
    for name in ("centers", "radii", "scores"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def _hits(found, discs):
    """The number of discs that a circle lies on, to 10 % of the radius and 1 px."""
    apart = np.hypot(*(found.centers[:, None] - discs[:, :2]).T) + abs(found.radii[:, None] - discs[:, 2]).T
    return (apart.min(axis=1, initial=np.inf) < 0.1 * discs[:, 2] + 1).sum()


def _inside_regions(found, regions, r_max):
    """Which centres lie in a box, grown by the margin and rounded to whole pixels."""
    margin, (x, y, width, height) = r_max / 4 + 5, np.reshape(regions, (-1, 4)).T
    across, down = found.centers.T[..., None]
    inside = (x - margin <= across) & (across <= x + width + margin)
    return (inside & (y - margin <= down) & (down <= y + height + margin)).any(axis=1)


def _check_search(search, seen):
    """Assert all promises for one search; `seen` counts what it was like."""
    image, before = search.scene.image, search.scene.image.copy()
    found = search.find(image)
    np.testing.assert_array_equal(image, before)
    _assert_circles(found, search)
    most = search.arguments.get("max_circles")
    everything = search.find(before, max_circles=None)
    _assert_same(found, Circles(*(getattr(everything, name)[:most] for name in ("centers", "radii", "scores"))))
    if "regions" in search.arguments:  # which may be none
        assert _inside_regions(found, search.arguments["regions"], search.radius_range[1]).all()
    seen[search.method, "searches"] += 1
    seen[search.method, "with circles"] += len(found) > 0
    seen[search.method, "with true circles"] += bool(_hits(found, search.scene.discs))
    for name in search.arguments:
        seen[name, "with circles"] += len(found) > 0
    seen["max_circles", "at work"] += len(everything) > len(found)


def test_promises_hold_for_any_picture_and_a_quarter_of_them_has_circles():
    seen = Counter()

    @settings(max_examples=2000, deadline=None, derandomize=True)
    @given(SEARCHES)
    def check(search):
        _check_search(search, seen)

    check()
    assert sum(seen[method, "searches"] for method in METHODS) > 1900, seen
    for method in METHODS:
        assert seen[method, "with circles"] >= 0.25 * seen[method, "searches"], seen
        assert seen[method, "with true circles"] >= 0.1 * seen[method, "searches"], seen
    assert min(seen[name, "with circles"] for name in OTHERS) > 20 and seen["max_circles", "at work"] > 5, seen


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


@pytest.mark.parametrize("blur", [0.3, 1.0, 2.0])
def test_multiscale_finds_a_disc_of_any_contrast_above_six_grey_values(blur):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        center, radius, ground = 60 + rng.uniform(-2, 2, 2), rng.uniform(20, 30), 100 + rng.random()
        picture = draw_ellipses((120, 120), [(*center, radius, radius, 0)], background=ground, level=ground + 6.5, blur=blur)
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


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("place", [(-5, 60), (0, 60), (30, 60), (124, 60), (60, -8), (60, 125), (-20, 60)])
def test_discs_cut_by_the_border_are_never_placed_outside(place, method):
    image = _picture([(*place, 40.0)], (121, 120))
    found = find_circles(image, (34, 46), method=method, sensitivity=1.0)
    assert (found.centers >= 0).all() and (found.centers <= (119, 120)).all()
    if place == (30, 60):
        assert np.hypot(*(found.centers[0] - place)) < 1.5 and abs(found.radii[0] - 40) < 1.5


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(150, 170), (151, 173)])
@pytest.mark.parametrize("turn", TURNS)
def test_turned_pictures_give_the_same_circles(turn, shape, method):
    """To the accuracy of the default method, "a few per cent of the radius", and to that of the others."""
    turned, back = TURNS[turn]
    image = _picture([(40.3, 44.8, 14.0), (105.6, 50.2, 18.0), (62.1, 101.4, 16.0), (128.4, 115.3, 11.5)], shape)
    found, again = (find_circles(picture, (10, 22), method=method) for picture in (image, turned(image)))
    expected = np.column_stack([*back(*again.centers.T, shape), again.radii])
    _match(found, expected, 0.6, 0.6 if method == "multiscale" else 1.0)
