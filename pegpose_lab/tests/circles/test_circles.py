"""What every method of `find_circles` finds, and what it refuses."""

import cv2
import numpy as np
import pytest
from scipy import ndimage

from pegpose_lab.circles import DETECTION_METHODS, circle_accumulator, find_circles
from pegpose_lab.tests.circles.searches import RANGE, TRUTH, _match, _picture
from pegpose_lab.tests.pictures import TURNS, draw_ellipses, to_uint8


def test_otsu_is_the_default_edge_threshold():
    image = _picture()
    dx, dy = (ndimage.sobel(image.astype(float), axis=axis, mode="nearest") for axis in (1, 0))
    scaled = np.hypot(dx, dy) / np.hypot(dx, dy).max()
    otsu = cv2.threshold(np.rint(255 * scaled).astype(np.uint8), 0, 255, cv2.THRESH_OTSU)[0] / 255
    np.testing.assert_array_equal(
        circle_accumulator(image, RANGE), circle_accumulator(image, RANGE, edge_threshold=otsu)
    )


# ------------------------------------------------------------------------------------------------- searches


@pytest.mark.parametrize("method", DETECTION_METHODS)
def test_finds_bright_and_dark_discs(method):
    image = _picture()
    _match(find_circles(image, RANGE, method=method), TRUTH, 1.0, 1.0)
    _match(find_circles(255 - image, RANGE, method=method, polarity="dark"), TRUTH, 1.0, 1.0)
    assert len(find_circles(image, RANGE, method=method, polarity="dark", sensitivity=0.6)) == 0


@pytest.mark.parametrize("method", DETECTION_METHODS)
def test_finds_discs_in_a_mask(method):
    mask = _picture(noise=0) > 110
    _match(find_circles(mask, RANGE, method=method), TRUTH, 1.0, 1.5)


def test_two_stage_radii_are_whole_and_the_others_are_not():
    image = _picture()
    assert (find_circles(image, RANGE, method="two-stage").radii % 1 == 0).all()
    for method in set(DETECTION_METHODS) - {"two-stage"}:
        radii = find_circles(image, RANGE, method=method).radii
        assert (radii % 1 != 0).any()


def test_only_the_accumulator_tells_concentric_circles():
    picture = draw_ellipses((120, 120), [(60, 60, 36, 36, 0)])
    inner = draw_ellipses((120, 120), [(60, 60, 18, 18, 0)], background=0, level=1)
    image = to_uint8(picture + 60 * inner, 2, 0)
    found = find_circles(image, (12, 42), method="accumulator")
    _match(found, [(60, 60, 36), (60, 60, 18)], 1.0, 1.0)


@pytest.mark.parametrize("method", DETECTION_METHODS)
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


@pytest.mark.parametrize("method", DETECTION_METHODS)
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


@pytest.mark.parametrize("method", DETECTION_METHODS)
@pytest.mark.parametrize("place", [(-5, 60), (0, 60), (30, 60), (124, 60), (60, -8), (60, 125), (-20, 60)])
def test_discs_cut_by_the_border_are_never_placed_outside(place, method):
    image = _picture([(*place, 40.0)], (121, 120))
    found = find_circles(image, (34, 46), method=method, sensitivity=1.0)
    assert (found.centers >= 0).all() and (found.centers <= (119, 120)).all()
    if place == (30, 60):
        assert np.hypot(*(found.centers[0] - place)) < 1.5 and abs(found.radii[0] - 40) < 1.5


@pytest.mark.parametrize("method", DETECTION_METHODS)
@pytest.mark.parametrize("shape", [(150, 170), (151, 173)])
@pytest.mark.parametrize("turn", TURNS)
def test_turned_pictures_give_the_same_circles(turn, shape, method):
    """To the accuracy of the default method, "a few per cent of the radius", and to that of the others."""
    turned, back = TURNS[turn]
    image = _picture([(40.3, 44.8, 14.0), (105.6, 50.2, 18.0), (62.1, 101.4, 16.0), (128.4, 115.3, 11.5)], shape)
    found, again = (find_circles(picture, (10, 22), method=method) for picture in (image, turned(image)))
    expected = np.column_stack([*back(*again.centers.T, shape), again.radii])
    _match(found, expected, 0.6, 0.6 if method == "multiscale" else 1.0)
