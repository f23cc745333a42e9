"""Joint calibration beside other tools: mrcal's stored uncertainty, the table, and what happens without a tool."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pegpose_lab import projection_uncertainty, study
from pegpose_lab.bench import calibrator_process, calibrators
from pegpose_lab.lab import calibrators as environments

SETS = {corners.name: corners for corners in calibrators.corner_sets()}


@pytest.mark.parametrize("name", SETS)
def test_our_uncertainty_is_mrcals(name):
    """The same definition, corners and noise: mrcal's stored figures, to far less than the 10 % that count."""
    stored = study.load_measured(calibrators.MEASURED_FILE).query(f"corners == '{name}'")
    found = calibrators.our_calibration(SETS[name])
    assert_allclose(found.camera.parameters["f_x"], stored["f_x"], rtol=1e-6)
    assert_allclose(found.sigma("f_x"), stored["f_x_sigma"], rtol=1e-3)
    assert len(stored) == 10 and set(stored["distance"]) == set(calibrators.DISTANCES)
    for distance, rows in stored.groupby("distance"):
        ours = projection_uncertainty(found, rows[["x", "y"]].to_numpy(), distance)
        assert_allclose(ours.sigmas, rows["sigma"], rtol=1e-3)


@pytest.fixture
def no_tools(monkeypatch):
    monkeypatch.setattr(environments, "calibrator_python", lambda name: None)


def test_the_table_without_other_tools_names_the_reason(no_tools, monkeypatch):
    monkeypatch.setattr(calibrators, "corner_sets", lambda: [SETS["simulated"]])
    table = calibrators.measure_calibrators(splits=2, repeats=1).set_index("tool")
    ours, opencv = table.loc[calibrators.OURS], table.loc[calibrators.OPENCV]
    assert_allclose(ours["f"], opencv["f"], atol=1e-3)
    assert_allclose(table.loc[calibrators.CLASSICAL, "sigma"], opencv["sigma"], rtol=1e-3)
    assert ours["ms"] > 0 and ours["half_px"] > 0 and 0 < ours["z"] < 3
    assert ours["corner_inf"] > 10 * ours["sigma"] and np.isnan(opencv["corner_inf"])
    assert table["off_mrcal"].isna().all()
    reasons = table.loc[list(calibrators.PEERS), "missing"].tolist()
    assert reasons[0] == "mrcal is not installed; it needs Python 3.12 or 3.13" and "Debian" in reasons[1]
    assert reasons[2:] == ["calibsense is not installed", "lensboy is not installed"]
    with pytest.raises(SystemExit, match="mrcal is not installed"):
        calibrators.write_mrcal_uncertainty(None)


def test_a_tool_that_fails_is_a_reason(monkeypatch):
    monkeypatch.setattr(environments, "calibrator_python", lambda name: sys.executable)
    answer = calibrators._answer("calibsense", SETS["simulated"], 1, 1)
    assert answer == {"missing": "calibsense failed: ModuleNotFoundError: No module named 'calibsense'"}


@pytest.mark.skipif(bool(environments.missing("mrcal")), reason="mrcal is not installed (the benchmark installs it)")
def test_mrcal_itself_where_it_is_installed():
    corners = SETS["simulated"]
    theirs = calibrators._answer("mrcal", corners, 1, 1)
    ours = calibrators._answer(calibrators.CLASSICAL, corners, 1, 1)
    row = calibrators._row(ours, theirs)
    assert row["off_mrcal"] < 0.1 and abs(row["f"] - theirs["f"]) < 1e-4
    assert_allclose(np.array(ours["halves"]), np.array(theirs["halves"]), rtol=1e-3)


def test_halves_and_times_are_those_of_the_calibrations():
    """One calibration that is not timed, the timed ones, then two for each split, which share no view."""
    seen = []

    def calibrate(images):
        seen.append(images[:, 0, 0].astype(int).tolist())
        return {"f": float(images[:, 0, 0].sum()), "sigma": None, "uncertain": None}

    images = np.arange(5.0)[:, None, None] * np.ones((5, 3, 2))
    answer = calibrator_process.compare(calibrate, images, np.array([[4, 0, 2, 1, 3]]), None, None, 2)
    assert seen == [[0, 1, 2, 3, 4]] * 3 + [[0, 4], [1, 2, 3]]
    assert answer["halves"] == [[4.0, None, 6.0, None]] and answer["uncertain"] is None and answer["f"] == 10
    row = calibrators._row(answer | {"version": "1"}, {})
    assert row["half_px"] == 2.0 and np.isnan(row["sigma"]) and np.isnan(row["z"])
