"""Otsu, the area filter and the splitting of parts with two grey levels."""

from collections import Counter

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pegpose_lab.checks import DetectionError
from pegpose_lab.segmentation import segment
from pegpose_lab.tests.pictures import draw_ellipses, scenes, to_uint8

SHAPE = (360, 400)
PEGS = [(140.0, 120.0), (260.0, 125.0), (255.0, 240.0), (145.0, 235.0)]
RADIUS = 20.0


def _hub(background, hub, peg, noise=3.0, highlight=0.0, bore=20):
    """A round hub with four pegs and a dark bore; `highlight` is added in a spot on the first peg."""
    picture = draw_ellipses(SHAPE, [(200, 180, 150, 150, 0)], background=background, level=hub)
    discs = [(x, y, RADIUS, RADIUS, 0) for x, y in PEGS]
    for disc, level in [*((disc, peg) for disc in discs), ((200, 180, 25, 25, 0), bore)]:
        share = draw_ellipses(SHAPE, [disc], background=0, level=1)
        picture += share * (level - picture)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    picture += highlight * ((x - PEGS[0][0] - 4) ** 2 + (y - PEGS[0][1]) ** 2 < 8**2)
    return to_uint8(picture, noise, 0)


def _peg_parts(segmentation):
    """Index of the part at each peg, checked to be that peg and nothing more."""
    found = []
    for center in PEGS:
        distance = np.hypot(*(segmentation.centroids - center).T)
        i = distance.argmin()
        assert distance[i] < 0.7
        assert abs(segmentation.areas[i] / (np.pi * RADIUS**2) - 1) < 0.08
        found.append(i)
    assert len(set(found)) == 4
    return found


def test_is_otsu_and_eight_connected_components():
    rng = np.random.default_rng(0)
    image = ndimage.gaussian_filter(rng.random((80, 90)) * 255, 2)
    image = to_uint8((image - image.min()) / np.ptp(image) * 255)
    level = cv2.threshold(image, 0, 255, cv2.THRESH_OTSU)[0]
    labels, n = ndimage.label(image > level, np.ones((3, 3)))
    sizes = np.bincount(labels.ravel())[1:]
    result = segment(image, min_area=30, threshold=level)
    assert result.threshold == level and result.levels == (level,)
    np.testing.assert_array_equal(result.mask, np.isin(labels, np.nonzero(sizes >= 30)[0] + 1))
    assert sorted(result.areas) == sorted(sizes[sizes >= 30])
    assert segment(image).threshold == level


def test_pixels_at_the_threshold_are_black():
    image = np.full((20, 20), 100, np.uint8)
    image[5:10, 5:10] = 101
    assert segment(image, threshold=100).areas.tolist() == [25]
    assert len(segment(image, threshold=101)) == 0
    assert segment(image, threshold=99).areas.tolist() == [400]


def test_corners_connect():
    image = np.zeros((20, 20), np.uint8)
    image[2:5, 2:5] = image[5:8, 5:8] = 200
    assert segment(image, threshold=100).areas.tolist() == [18]


def test_labels_boxes_and_centroids_agree():
    result = segment(_hub(40, 40, 160))
    assert result.labels.dtype == np.uint16 and result.mask.dtype == bool
    np.testing.assert_array_equal(np.unique(result.labels), np.arange(len(result) + 1))
    for k, (area, box, centroid) in enumerate(zip(result.areas, result.boxes, result.centroids, strict=True), 1):
        y, x = np.nonzero(result.labels == k)
        assert area == len(x)
        assert box.tolist() == [x.min(), y.min(), np.ptp(x) + 1, np.ptp(y) + 1]
        np.testing.assert_allclose(centroid, (x.mean(), y.mean()))
    np.testing.assert_array_equal(result.mask, result.labels > 0)


def test_area_filter_keeps_parts_of_exactly_min_area():
    image = np.zeros((50, 50), np.uint8)
    image[2:7, 2:6] = image[20:24, 20:25] = image[40:43, 40:46] = 200
    assert segment(image, min_area=20).areas.tolist() == [20, 20]
    assert len(segment(image, min_area=21)) == 0


def test_default_min_area():
    image = np.zeros((400, 500), np.uint8)
    image[10:14, 10:15] = 200
    image[30:50, 30:50] = 200
    image[100, 100:119] = 200
    assert sorted(segment(image).areas) == [20, 400]


@pytest.mark.parametrize("noise", [0.0, 3.0, 8.0])
@pytest.mark.parametrize(
    ("background", "hub", "peg"),
    [(60, 60, 160), (30, 60, 160), (0, 90, 170), (120, 60, 160), (200, 60, 160), (245, 90, 160), (160, 60, 160)],
)
def test_pegs_are_parts_whatever_the_background(background, hub, peg, noise):
    result = segment(_hub(background, hub, peg, noise))
    _peg_parts(result)
    assert len(result) <= 5  # the pegs, and the background where it is bright


def test_splitting_is_what_finds_them():
    image = _hub(0, 90, 170)
    result = segment(image)
    assert len(result.levels) == 2 and 110 < result.levels[1] < 150
    flat = segment(image, threshold=result.threshold)
    assert len(flat.levels) == 1 and len(flat) == 1


@pytest.mark.parametrize("background", [30, 60])
def test_a_highlight_is_no_part_of_its_own(background):
    _peg_parts(segment(_hub(background, 60, 160, highlight=80)))


def test_a_disc_on_a_plate():
    picture = draw_ellipses(SHAPE, [(200, 180, 150, 150, 0)], background=20, level=60)
    share = draw_ellipses(SHAPE, [(190, 170, 25, 25, 0)], background=0, level=1)
    result = segment(to_uint8(picture + share * (170 - picture), 3, 0))
    assert len(result) == 1 and abs(result.areas[0] - np.pi * 25**2) < 60


def test_ramps_and_noise_are_not_split():
    ramp = np.tile(np.linspace(0, 255, 200), (150, 1))
    wave = 128 + 100 * np.sin(np.arange(200) / 20) * np.ones((150, 1))
    noise = 128 + 40 * np.random.default_rng(0).standard_normal((150, 200))
    for picture in (ramp, wave, noise):
        assert len(segment(to_uint8(picture, 1, 0)).levels) == 1


def test_more_components_than_sixteen_bits_can_count():
    image = np.zeros((700, 700), np.uint8)
    image[::2, ::2] = 200
    image[101:140, 101:140] = 200
    assert segment(image, min_area=100, threshold=90).areas.tolist()[0] > 39**2 - 1
    with pytest.raises(DetectionError, match="min_area"):
        segment(image, min_area=1, threshold=90)


def test_constant_image():
    with pytest.raises(DetectionError, match="constant"):
        segment(np.full((30, 40), 90, np.uint8))
    assert len(segment(np.full((30, 40), 90, np.uint8), threshold=100)) == 0
    assert segment(np.full((30, 40), 90, np.uint8), threshold=10).areas.tolist() == [1200]


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"min_area": -1}, "min_area"),
        ({"threshold": 300}, "threshold"),
        ({"threshold": np.nan}, "threshold"),
        ({"threshold": "90"}, "threshold"),
        ({"min_area": True}, "min_area"),
    ],
)
def test_bad_arguments(arguments, name):
    with pytest.raises(ValueError, match=name):
        segment(np.zeros((5, 5), np.uint8), **arguments)


@pytest.mark.parametrize("image", [np.zeros((0, 3), np.uint8), np.zeros((3, 3)), np.zeros((3, 3, 3), np.uint8), "no"])
def test_bad_image(image):
    with pytest.raises(ValueError, match="image"):
        segment(image)


# ---------------------------------------------------------------------------------- segmentation of any picture


def _assert_segmentation(result, image, least):
    """What `Segmentation` and `segment` promise of every result."""
    n = len(result)
    assert isinstance(result.threshold, float) and result.levels[0] == result.threshold
    assert all(isinstance(level, float) and 0 <= level <= 255 for level in result.levels)
    assert result.mask.shape == result.labels.shape == image.shape
    assert result.mask.dtype == bool and result.labels.dtype == np.uint16
    assert result.areas.shape == (n,) and result.boxes.shape == (n, 4) and result.centroids.shape == (n, 2)
    assert result.areas.dtype.kind == result.boxes.dtype.kind == "i" and result.centroids.dtype == float
    assert (result.areas >= least).all()
    np.testing.assert_array_equal(result.mask, result.labels > 0)
    np.testing.assert_array_equal(np.bincount(result.labels.ravel(), minlength=n + 1)[1:], result.areas)
    _assert_parts(result)
    if len(result.levels) == 1:
        white = image > result.threshold
        removed, _ = ndimage.label(white & ~result.mask, np.ones((3, 3)))
        assert not (result.mask & ~white).any() and (np.bincount(removed.ravel())[1:] < least).all()


def _assert_parts(result):
    """The parts are the mask's 8-connected components, numbered from the top; boxes and centroids are theirs."""
    components, n = ndimage.label(result.mask, np.ones((3, 3)))
    assert n == len(result) == len(np.unique(result.labels[result.mask] * (n + 1.0) + components[result.mask]))
    for number, (rows, columns) in enumerate(ndimage.find_objects(result.labels)):
        box = columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start
        assert result.boxes[number].tolist() == list(box)
    if n:
        centroids = ndimage.center_of_mass(result.mask, result.labels, range(1, n + 1))
        np.testing.assert_allclose(result.centroids[:, ::-1], centroids, atol=1e-6)
        assert (np.diff(result.boxes[:, 1]) >= -1).all()  # two rows are numbered at a time


def _check_segmentation(scene, min_area, threshold, seen):
    """Assert all promises for one picture; `seen` counts what came of it."""
    image, before = scene.image, scene.image.copy()
    if threshold is None and (image == image[0, 0]).all():
        with pytest.raises(DetectionError, match="constant"):
            segment(image, min_area=min_area)
        return
    result = segment(image, min_area=min_area, threshold=threshold)
    np.testing.assert_array_equal(image, before)
    _assert_segmentation(result, image, max(4.0, 1e-4 * image.size) if min_area is None else min_area)
    if threshold is not None:
        assert result.levels == (threshold,)
    again = segment(before, min_area=min_area, threshold=threshold)
    assert again.levels == result.levels
    for name in ("mask", "labels", "areas", "boxes", "centroids"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))
    seen.update(pictures=1, parts=len(result) > 0, several=len(result) > 1, split=len(result.levels) > 1)


def test_promises_hold_for_any_picture_and_most_pictures_have_parts():
    seen = Counter()

    @settings(max_examples=500, deadline=None, derandomize=True)
    @given(scenes(), st.none() | st.floats(0, 500), st.none() | st.none() | st.floats(0, 255))
    def check(scene, min_area, threshold):
        _check_segmentation(scene, min_area, threshold, seen)

    check()
    assert seen["parts"] >= 0.6 * seen["pictures"] > 240 and seen["several"] > 40 and seen["split"] > 3, seen
