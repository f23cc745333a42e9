"""The benchmark of calibration: same corners and unknowns, same objective and box."""

from numpy.testing import assert_allclose

from pegpose_lab import study
from pegpose_lab.bench import calibration
from pegpose_lab.study import baselines, ga_success


def test_joint_calibration_is_measured_beside_opencv():
    """Same corners and unknowns: the same rms, but for OpenCV's single precision."""
    table = calibration.measure_joint((3, 5), repeats=1)
    assert table["views"].tolist() == [3, 5] and (table[["ms", "opencv_ms"]] > 0).all(axis=None)
    assert_allclose(table["ratio"], table["ms"] / table["opencv_ms"])
    assert table["rms_difference"].abs().max() < 1e-4


def test_genetic_algorithm_is_measured_beside_differential_evolution():
    sets = ga_success.trial_sets()
    table = calibration.measure_genetic([sets[0], sets[7]], seeds=3)
    assert table["view"].tolist() == [sets[0][0], sets[7][0]]
    assert (table[["reached", "de_reached"]] == 100).all(axis=None)
    assert (table[["ms", "de_ms"]] > 0).all(axis=None) and (table["ratio"] > 0).all()


def test_a_seed_off_the_optimum_is_not_counted(monkeypatch):
    monkeypatch.setattr(study, "REACHED", -1.0)
    monkeypatch.setattr(ga_success, "REACHED", -1.0)
    table = calibration.measure_genetic(ga_success.trial_sets()[:1], seeds=2)
    assert (table[["reached", "de_reached"]] == 0).all(axis=None)


def test_every_rival_has_its_cost():
    table = calibration.measure_rivals(repeats=1).set_index("method")
    assert len(table) == 12 and (table["ms"] > 0).all()
    assert table.loc[baselines.GENETIC, "evaluations"] > table.loc["Nelder-Mead", "evaluations"] > 0
