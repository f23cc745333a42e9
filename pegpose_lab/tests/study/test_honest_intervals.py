"""Halves of real sets and correlated noise: the study's functions, and that its table says what the sigmas promise."""

import numpy as np
import pandas as pd
import pytest

from pegpose_lab.study import correlated_noise, correlated_trials, interval_coverage, load_measured
from pegpose_lab.study.honest_intervals import HALVES, LENSES, measure_split_halves


def test_coverage_of_intervals_that_are_honest_and_of_some_half_as_wide():
    rng, truth = np.random.default_rng(0), pd.Series({"f": 48.0, "c_x": 800.0})
    columns = {"f": rng.normal(48.0, 0.2, 4000), "f_sigma": 0.2, "c_x": rng.normal(800.0, 3.0, 4000), "c_x_sigma": 1.5}
    z, table = interval_coverage(pd.DataFrame(columns), truth)
    np.testing.assert_allclose(z.std(), [1, 2], rtol=0.05)
    np.testing.assert_allclose(table["95 % intervals that hold it (%)"], [95, 67.3], atol=1.5)
    np.testing.assert_allclose(table["sd of the estimates"] / table["mean stated sigma"], z.std())


def test_noise_has_the_stated_correlation():
    points, rng = [[0.0, 0.0], [60.0, 0.0], [0.0, 120.0]], np.random.default_rng(0)
    draws = np.array([correlated_noise(points, 60.0, rng) for _ in range(4000)])
    expected = np.exp(-0.5 * np.array([[0, 1, 4], [1, 0, 5], [4, 5, 0]]))
    for axis in (0, 1):
        np.testing.assert_allclose(np.cov(draws[:, :, axis].T), expected, atol=0.07)
    assert abs(np.mean(draws[:, :, 0] * draws[:, :, 1])) < 0.03
    apart = np.array([correlated_noise(points, 0.0, rng) for _ in range(4000)])
    np.testing.assert_allclose(np.cov(apart[:, :, 0].T), np.eye(3), atol=0.07)
    with pytest.raises(ValueError, match="length"):
        correlated_noise(points, -1.0, rng)


def test_trials_say_what_correlated_noise_does():
    table = correlated_trials(lengths=[0.0, 200.0], views=[6], trials=12)
    shares = table.groupby("length")[["flagged", "holds", "classical_holds"]].mean()
    assert shares.loc[200.0, "flagged"] == 1 and shares.loc[0.0, "flagged"] < 0.2
    assert shares.loc[200.0, "holds"] > 0.8 > 0.7 > shares.loc[200.0, "classical_holds"]
    assert (table["sigma"] >= 0.999999 * table["classical_sigma"]).all()


def test_stated_sigmas_hold_on_photographs():
    """Classical sigmas hold half of the differences between halves, stated ones nearly all that they should."""
    table = load_measured("split_halves")
    assert table["dataset"].nunique() == 5 and set(table["lens"]) == set(LENSES) and (table["repeats"] == HALVES).all()
    for _, part in table.groupby("lens"):
        assert 92 < part["within"].mean() < 98 and part["classical_within"].mean() < 65
    rms = table.groupby(["dataset", "lens"])[["rms_z", "classical_rms_z"]].agg(lambda z: np.sqrt(np.mean(z**2)))
    assert rms["rms_z"].between(0.75, 1.25).all() and (rms["classical_rms_z"] > 1.4).all()


def test_the_table_of_halves_is_current(pegpose_data):
    lens = "f, k1 (Eq. 3)"
    found = measure_split_halves(["boards-sony"], [lens]).round(3)
    stored = load_measured("split_halves").query("dataset == 'boards-sony' and lens == @lens").reset_index(drop=True)
    pd.testing.assert_frame_equal(found, stored, rtol=0.01, atol=2)
