"""Shares of distances given the mean of the same distances."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pegpose_lab.paper import numbers
from pegpose_lab.study import GIVEN, count_below, distances, load_measured, rayleigh_counts
from pegpose_lab.study.distances import two_stage_counts

RATIO = 0.03 / 0.0310


def test_count_below_is_of_the_sample_s_own_scale():
    values = np.array([[1.0, 2.0, 3.0, 10.0], [10.0, 20.0, 30.0, 100.0]])  # mean 4, rms 5.3
    assert count_below(values, 0.5).tolist() == [1, 1]
    assert count_below(values, 0.6, "rms").tolist() == [3, 3]
    assert count_below(values[0], 1.0) == 3


@pytest.mark.parametrize("n", [48, 240])
def test_given_the_rms_the_count_has_its_exact_mean(n):
    """Given their mean square the squared distances are uniform on a simplex: 1 - (1 - ratio^2 / n)^(n - 1) each."""
    counts = rayleigh_counts(n, RATIO, rng=1)["rms"]
    share = 1 - (1 - RATIO**2 / n) ** (n - 1)
    assert counts.mean() / n == pytest.approx(share, abs=4 * counts.std() / n / np.sqrt(len(counts)))


def test_the_mean_of_240_points_and_their_share():
    """The printed pair: 0.0310 px as a mean predicts 48.3 to 55.8 %, and so large a share as 57 % in 1 % of samples."""
    counts = rayleigh_counts(240, RATIO, samples=40_000, rng=2)
    low, high = np.percentile(100 * counts["mean"] / 240, [2.5, 97.5])
    assert (low, high) == pytest.approx((48.3, 55.8), abs=0.5)
    assert np.mean(counts["mean"] >= 136) == pytest.approx(0.011, abs=0.003)
    low, high = np.percentile(100 * counts["rms"] / 240, [2.5, 97.5])
    assert (low, high) == pytest.approx((56.7, 64.6), abs=0.5)
    assert np.mean(counts["rms"] <= 137) == pytest.approx(0.050, abs=0.006)


def test_knowing_the_mean_narrows_the_interval():
    """The binomial interval leaves the scale open: it is half as wide again."""
    n = 240
    counts = rayleigh_counts(n, RATIO, rng=3)["mean"]
    share = stats.rayleigh.cdf(RATIO, scale=1 / np.sqrt(np.pi / 2))
    assert counts.std() < 0.65 * np.sqrt(n * share * (1 - share))
    assert counts.mean() / n == pytest.approx(share, abs=0.003)


def test_the_same_seed_gives_the_same_counts_in_any_number_of_batches(monkeypatch):
    whole = rayleigh_counts(48, RATIO, samples=500, rng=4)
    monkeypatch.setattr(distances, "_BATCH", 480)
    parts = rayleigh_counts(48, RATIO, samples=500, rng=4)
    assert all(np.array_equal(whole[given], parts[given]) for given in GIVEN)


def test_the_residuals_of_two_stages_scatter_more_than_independent_ones():
    table = load_measured("two_stage_counts")
    assert len(table) == 5 * distances.TRIALS and sorted(table["n"].unique()) == [48, 96, 144, 192, 240]
    assert table["mean_distance"].mean() == pytest.approx(numbers.printed("E-rms"), rel=0.1)
    assert (table["rms"] >= table["mean"]).all()  # the rms is never below the mean
    independent = rayleigh_counts(240, distances.printed_ratio(), rng=5)
    for given in GIVEN:
        ours = table.loc[table["n"] == 240, given]
        assert 1.0 < ours.std() / independent[given].std() < 1.4
        assert 0 < (ours.mean() - independent[given].mean()) / 240 < 0.02


def test_the_file_is_current():
    again = two_stage_counts([0, distances.TRIALS - 1], distances.printed_ratio())
    stored = load_measured("two_stage_counts").set_index("trial").loc[[0, distances.TRIALS - 1]].reset_index()
    pd.testing.assert_frame_equal(again, stored, rtol=1e-4)


def test_trials_do_not_depend_on_each_other():
    alone = two_stage_counts([7], RATIO)
    together = two_stage_counts([6, 7], RATIO)
    pd.testing.assert_frame_equal(alone, together[together["trial"] == 7].reset_index(drop=True))


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: count_below([], 1.0), r"distances has shape \(0,\)"),
        (lambda: count_below(3.0, 1.0), r"distances has shape \(\)"),
        (lambda: count_below([1.0], 0.0), "ratio is 0"),
        (lambda: count_below([1.0], 1.0, "median"), "given is 'median'"),
        (lambda: rayleigh_counts(1.5, 1.0), "n is 1.5; expected a whole number"),
        (lambda: rayleigh_counts(0, 1.0), "n is 0; expected a whole number of at least 1"),
        (lambda: rayleigh_counts(5, 1.0, samples=0), "samples is 0"),
        (lambda: rayleigh_counts(5, np.nan), "ratio is nan"),
    ],
)
def test_unusable_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=named):
        call()
