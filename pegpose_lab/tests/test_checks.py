"""The checks that all public functions share."""

import numpy as np
import pytest

from pegpose_lab.checks import as_choice, as_count, as_number


@pytest.mark.parametrize("value", [4, 4.0, np.int64(4), np.uint8(4), np.float32(4), np.array(4)])
def test_whole_numbers_become_ints(value):
    count = as_count(value, "n", 3, 5)
    assert count == 4 and type(count) is int


@pytest.mark.parametrize(
    "value", ["4", b"4", True, np.True_, None, 4.5, np.nan, np.inf, [4], np.array([4]), 4j, 2, 6]
)
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
