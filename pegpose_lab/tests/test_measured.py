"""Counts of circles in real photographs: the committed table, and that it is current."""

import pandas as pd

from pegpose_lab import measured


def test_counts_of_real_pictures():
    """One set of defaults: every disc is found where the data sets' counts are certain."""
    table = measured.load_counts()
    total = table.groupby("dataset")[["known", "found", "false"]].sum()
    pictures = table.groupby("dataset").size()
    assert pictures.to_dict() == {
        "visp-mire2-a": 12, "visp-grid36-a": 2, "skimage-coins": 1, "conrods-a": 8, "screws4-a": 12
    }
    for name in ("visp-mire2-a", "visp-grid36-a", "skimage-coins", "conrods-a"):
        assert total.loc[name, "found"] == total.loc[name, "known"]
    assert total["known"].to_dict() == {
        "visp-mire2-a": 60, "visp-grid36-a": 72, "skimage-coins": 24, "conrods-a": 28, "screws4-a": 27
    }
    assert (total.loc[["visp-grid36-a", "skimage-coins", "conrods-a", "screws4-a"], "false"] == 0).all()
    assert total.loc["screws4-a", "found"] >= 20


def test_counts_are_current(pegpose_data):
    pd.testing.assert_frame_equal(measured.count_circles(), measured.load_counts())
