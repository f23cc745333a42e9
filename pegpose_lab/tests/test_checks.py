"""The checks that all public functions share."""

import numpy as np
import pytest

from pegpose_lab import CalibrationError, find_circles, segment
from pegpose_lab.checks import (
    as_choice,
    as_count,
    as_number,
    as_points,
    as_views,
    outside,
    undetermined_if_singular,
)


@pytest.mark.parametrize("value", [4, 4.0, np.int64(4), np.uint8(4), np.float32(4), np.array(4)])
def test_whole_numbers_become_ints(value):
    count = as_count(value, "n", 3, 5)
    assert count == 4 and type(count) is int


@pytest.mark.parametrize("value", ["4", b"4", True, np.True_, None, 4.5, np.nan, np.inf, [4], np.array([4]), 4j, 2, 6])
def test_other_values_are_no_counts(value):
    with pytest.raises(ValueError, match="^n is .*; expected"):
        as_count(value, "n", 3, 5)


def test_a_count_keeps_all_digits_of_a_large_int():
    assert as_count(2**63 + 1, "seed") == 2**63 + 1


@pytest.mark.parametrize("value", ["4", b"4", True, np.False_, None, [4.0], np.array([4.0]), "nan", np.nan])
def test_text_and_truth_values_are_no_numbers(value):
    with pytest.raises(ValueError, match="^x is .*; expected"):
        as_number(value, "x")


def test_a_choice_is_returned_as_it_is_listed():
    assert as_choice("dark", "polarity", ("bright", "dark")) == "dark"
    number = as_choice(34.0, "rays", {34: 21, 144: 89})
    assert number == 34 and type(number) is int


@pytest.mark.parametrize("value", ["white", "Bright", None, 1, np.array(["bright"]), ["bright"], {}])
def test_other_values_are_no_choices(value):
    with pytest.raises(ValueError, match="^polarity is .*; expected one of 'bright', 'dark'$"):
        as_choice(value, "polarity", ("bright", "dark"))


def test_an_image_that_was_not_read_is_told():
    for function in (segment, lambda image: find_circles(image, (10, 20))):
        with pytest.raises(ValueError, match="image is None, which cv2.imread returns.*check the path"):
            function(None)


def test_points_as_opencv_returns_them_are_told():
    with pytest.raises(ValueError, match=r"corners has shape \(9, 1, 2\), as OpenCV returns.*reshape\(-1, 2\)"):
        as_points(np.zeros((9, 1, 2)), 2, "corners")


SPREAD = np.random.default_rng(0).uniform(0, 100, (9, 3))


@pytest.mark.parametrize(
    "third, words",
    [
        (None, r"image_points\[2\] is None"),
        (SPREAD[:8, :2], r"object_points\[2\] has 9 rows and image_points\[2\] 8"),
        (np.where(np.arange(18).reshape(9, 2) == 9, np.nan, SPREAD[:, :2]), r"image_points\[2\].*NaN.*first in row 4"),
        (SPREAD[:, None, :2], r"image_points\[2\] has shape \(9, 1, 2\)"),
        (SPREAD[:, :1] * [1, 2], r"image_points\[2\].*one line"),
        ("corners", r"image_points\[2\] is not an array of numbers"),
    ],
)
def test_a_view_is_named_by_its_number(third, words):
    with pytest.raises(ValueError, match=words):
        as_views([SPREAD] * 4, [SPREAD[:, :2], SPREAD[:, :2], third, SPREAD[:, :2]], 5)


@pytest.mark.parametrize(
    "views, words",
    [
        ([], "empty: there is no view"),
        (SPREAD, r"shape \(9, 3\); expected a sequence.*of one view"),
        (None, "is NoneType"),
        ({}, "is dict"),
        ("views", "is str"),
        (3, "is int"),
    ],
)
def test_what_is_no_list_of_views_is_told(views, words):
    with pytest.raises(ValueError, match=f"object_points .*{words}|object_points.*{words}"):
        as_views(views, [SPREAD[:, :2]], 5)


def test_points_at_the_border_are_inside():
    """Pixel centres are at whole numbers: the image ends at -0.5 and 639.5; a pixel more is granted."""
    points = np.array([[-1.4, 5], [640.4, 5], [5, 480.4], [-1.6, 5], [640.6, 5], [5, 480.6]])
    assert outside(points, (640, 480)).tolist() == [False] * 3 + [True] * 3


def test_singular_matrices_are_undetermined():
    solve = undetermined_if_singular()(lambda: np.linalg.solve(np.zeros((2, 2)), np.ones(2)))
    for _ in range(2):
        with pytest.raises(CalibrationError, match="to the last digits"):
            solve()
