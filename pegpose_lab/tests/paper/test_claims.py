"""Rules and verdicts."""

from fnmatch import fnmatchcase

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pegpose_lab.lab import results
from pegpose_lab.paper import claims, experiment, numbers
from pegpose_lab.tests.paper.agreeing_values import as_printed


def row(values, identifier):
    """One row of the table."""
    return claims.claims_table(values).set_index("id").loc[identifier]


def test_there_is_one_rule_for_each_printed_number():
    patterns = claims._rules()["ids"]
    identifiers = numbers.printed_numbers().index
    matches = np.array([[fnmatchcase(identifier, pattern) for pattern in patterns] for identifier in identifiers])
    assert (matches.sum(axis=1) == 1).all()
    assert (matches.sum(axis=0) >= 1).all()


def test_rules_are_known_and_complete():
    rules = claims._rules()
    assert set(rules["rule"]) == {"input", "within", "at most", "mean", "sd", "share"}
    compared = rules[rules["rule"] != "input"]
    assert set(compared["otherwise"]) == {"contradicted", "not determined", "range"}
    assert (compared["reason_otherwise"] != "").all() and (rules["reason"] != "").all()
    assert (rules.loc[rules["rule"] == "within", "tolerance"].astype(float) > 0).all()
    assert (rules.loc[rules["rule"] != "within", "tolerance"] == "").all()
    assert set(compared["met"]) == {claims.RECOVERED, claims.ARITHMETIC, claims.REPRODUCED, "not determined"}
    assert (rules.loc[rules["rule"] == "input", "met"] == "").all()


def test_table_without_values():
    table = claims.claims_table({})
    assert table.columns.tolist() == claims.COLUMNS
    assert len(table) == len(numbers.printed_numbers()) >= 60
    inputs = table["verdict"] == "input"
    assert table["ours"].isna().all() and table["difference"].isna().all()
    assert (table.loc[~inputs, "verdict"] == "not determined").all()
    assert (table.loc[~inputs, "reason"] == claims.NOT_COMPUTED).all()
    assert inputs.sum() == 22


def test_table_that_agrees_with_the_paper():
    table = claims.claims_table(as_printed()).set_index("id")
    counts = {"input": 22, claims.RECOVERED: 16, claims.ARITHMETIC: 9, claims.REPRODUCED: 7, "not determined": 8}
    assert table["verdict"].value_counts().to_dict() == counts
    assert (table["difference"] == 0).all()
    assert not table["reason"].str.contains(claims.NOT_COMPUTED).any()


def test_an_input_is_never_reproduced():
    for identifier in ("setup.width", "alpha", "bounds", "T2.x1", "T1-linear.kappa1"):
        for value in (numbers.printed(identifier), numbers.printed(identifier) + 1):
            assert row({identifier: value}, identifier)["verdict"] == "input"


TOLERANCES = {
    "setup.distance_m": (0.005, claims.ARITHMETIC, "contradicted"),
    "T1-linear.Tx": (1.2, claims.RECOVERED, "not determined"),
    "T1-ga.f": (0.24, claims.RECOVERED, "not determined"),
    "T1-ga.Tz": (1.3, claims.RECOVERED, "not determined"),
    "T1-ga.kappa1": (5.5e-7, claims.RECOVERED, "not determined"),
    "T1-R.r5": (0.001, claims.RECOVERED, "not determined"),
    "T2.X1": (0.001, claims.ARITHMETIC, "contradicted"),
    "T2.Y4": (0.001, claims.ARITHMETIC, "contradicted"),
    "E-rms": (0.005, claims.REPRODUCED, "not determined"),
}


@pytest.mark.parametrize("identifier", TOLERANCES)
@pytest.mark.parametrize("sign", [-1, 1])
def test_within_its_tolerance_and_beyond(identifier, sign):
    tolerance, met, otherwise = TOLERANCES[identifier]
    inside = row({identifier: numbers.printed(identifier) + sign * tolerance}, identifier)
    beyond = row({identifier: numbers.printed(identifier) + sign * tolerance * 1.01}, identifier)
    assert inside["tolerance"] == tolerance
    assert (inside["verdict"], beyond["verdict"]) == (met, otherwise)
    assert beyond["difference"] == pytest.approx(sign * tolerance * 1.01)


@pytest.mark.parametrize("identifier", ["F7.range", "acc"])
def test_at_most(identifier):
    limit = numbers.printed(identifier)
    assert row({identifier: limit / 10}, identifier)["verdict"] == "reproduced"
    assert row({identifier: limit}, identifier)["verdict"] == "reproduced"
    assert row({identifier: limit * 1.01}, identifier)["verdict"] == "not determined"


def test_share_has_the_binomial_interval():
    low, high = stats.binomtest(round(0.57 * 240), 240).proportion_ci(method="wilson")
    tolerance = row({}, "F6.percent")["tolerance"]
    assert tolerance == pytest.approx(50 * (high - low), rel=0.02)
    assert row({"F6.percent": 57 + tolerance * 0.99}, "F6.percent")["verdict"] == "reproduced"
    assert row({"F6.percent": 57 - tolerance * 1.01}, "F6.percent")["verdict"] == "not determined"


@pytest.mark.parametrize(("frames", "count"), [("1-10", 10), ("11-20", 10), ("21-30", 10), ("31-45", 15)])
def test_table3_has_the_intervals_of_so_many_frames(frames, count):
    """The stated intervals hold 95 % of simulated means and standard deviations."""
    sd = numbers.printed(f"T3.sd.{frames}")
    samples = np.random.default_rng(count).normal(0, sd, (20_000, count))
    means, deviations = samples.mean(axis=1), samples.std(axis=1, ddof=1)
    student = row({}, f"T3.mean.{frames}")["tolerance"] / sd * deviations
    assert np.mean(np.abs(means) <= student) == pytest.approx(0.95, abs=0.006)
    spread = row({}, f"T3.sd.{frames}")["tolerance"]
    assert np.mean(np.abs(deviations - sd) <= spread) == pytest.approx(0.95, abs=0.01)


@pytest.mark.parametrize("identifier", ["T1-linear.f", "T1-linear.Tz"])
def test_range_of_what_is_not_printed(identifier):
    printed = numbers.printed(identifier)
    ours = {identifier: printed * 0.88}
    missing = row(ours, identifier)
    assert missing["verdict"] == "not determined"
    assert missing["reason"].startswith(claims.NOT_COMPUTED) and f"{identifier}.low" in missing["reason"]
    outside = row(ours | {f"{identifier}.low": printed * 0.8, f"{identifier}.high": printed * 0.9}, identifier)
    inside = row(ours | {f"{identifier}.low": printed * 0.8, f"{identifier}.high": printed * 1.1}, identifier)
    assert (outside["verdict"], inside["verdict"]) == ("contradicted", "not determined")
    assert f"{printed * 0.88:.2f}" in outside["reason"] and f"{printed * 0.9:.1f}" in outside["reason"]


def test_a_reason_that_lacks_its_number_says_so():
    lacking = row({"E-zhang": 0.03}, "E-zhang")
    assert lacking["reason"] == f"{claims.NOT_COMPUTED} (E-zhang.whole-pixel is missing)"
    complete = row({"E-zhang": 0.03, "E-zhang.whole-pixel": 0.391}, "E-zhang")
    assert complete["verdict"] == "not determined" and "0.39 px" in complete["reason"]


def test_reasons_quote_computed_numbers():
    table = claims.claims_table(as_printed()).set_index("id")
    assert f"{numbers.mm_per_pixel():.6f} mm" in table.at["T2.X1", "reason"]
    assert "12-fold" in table.at["T1-ga.kappa1", "reason"]
    assert "interval of 240" in table.at["F6.percent", "reason"]
    assert not table["reason"].str.contains("[{}]").any()


def test_every_reason_can_be_formatted_beyond_its_tolerance():
    values = {identifier: value + 1000 for identifier, value in as_printed().items()}
    table = claims.claims_table(values)
    assert not table["reason"].str.contains(r"[{}]|nan|not computed").any()
    assert set(table["verdict"]) == {"input", "contradicted", "not determined"}


def test_unusable_values_are_refused():
    with pytest.raises(ValueError, match="unknown ids T1-ga.F, theta"):
        claims.claims_table({"T1-ga.F": 48.0, "acc": 0.1, "theta": 1.0})
    with pytest.raises(ValueError, match="two entries for acc"):
        claims.claims_table(pd.Series([0.1, 0.2], index=["acc", "acc"]))
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match="NaN or infinity for acc"):
            claims.claims_table({"acc": value})


def test_values_are_found_where_notebooks_put_them(tmp_path, monkeypatch):
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))
    results.save_values("03_tsai_calibration", {"acc": 0.05})
    results.save_values("04_genetic_stage", {"T1-ga.f": 47.96})
    table = claims.claims_table().set_index("id")
    assert table["ours"].dropna().to_dict() == {"T1-ga.f": 47.96, "acc": 0.05}
    assert table.at["acc", "difference"] == pytest.approx(-0.95)


def rendered_truth():
    """Numbers that fix the rendered experiment: its camera, its boards and its hubs, as they are seen."""
    truth = experiment.paper_experiment()
    points = [truth.camera.project(truth.board.object_points, pose) for pose in truth.cam_from_boards]
    points += [truth.camera.project(truth.hub.peg_centers, pose) for pose in truth.cam_from_hubs]
    camera = [truth.camera.focal_length, *truth.camera.principal_point, *truth.camera.image_size, truth.camera.kappa1]
    return np.concatenate([camera, np.ravel(np.concatenate(points))])


def given_to_the_rendering(monkeypatch):
    """Ids of the printed numbers without which the rendered experiment would be another one."""
    given, before = [], rendered_truth()
    for identifier, row in numbers.printed_numbers().iterrows():
        changed = numbers.printed_numbers()
        changed.loc[identifier, "value"] = 2 * row["value"] if identifier.startswith("setup") else 1.01 * row["value"]
        with monkeypatch.context() as patch:
            patch.setattr(numbers, "_numbers", lambda changed=changed: changed)
            experiment.paper_camera.cache_clear()
            if not np.array_equal(rendered_truth(), before):
                given.append(identifier)
    experiment.paper_camera.cache_clear()
    assert np.array_equal(rendered_truth(), before)
    return given


def test_what_the_rendering_was_given_is_never_called_reproduced(monkeypatch):
    """Each printed number is changed in turn; where the rendering changes with it, finding it again proves nothing."""
    given = given_to_the_rendering(monkeypatch)
    assert {"setup.width", "setup.pitch", "T1-ga.f", "T1-ga.kappa1", "T1-R.r5", "T2.x1", "T2.X1"} <= set(given)
    assert not {"E-rms", "acc", "F6.percent", "T3.mean.1-10", "T1-linear.f"} & set(given)
    table = claims.claims_table(as_printed()).set_index("id")
    assert not (table.loc[given, "verdict"] == claims.REPRODUCED).any()
    assert set(table.index[table["verdict"] == claims.RECOVERED]) <= set(given) | {"T1-linear.Tx", "T1-linear.Ty"}
    for axis in ("Tx", "Ty"):  # one number, printed for both stages
        assert numbers.printed(f"T1-linear.{axis}") == numbers.printed(f"T1-ga.{axis}")


def test_what_depends_on_our_choice_is_not_determined_even_if_it_agrees():
    for identifier in ("T3.mean.1-10", "T3.sd.31-45"):  # tilt, turn and noise of the rendering
        assert row({identifier: numbers.printed(identifier)}, identifier)["verdict"] == "not determined"
