"""Monte Carlo: the same numbers however they are computed, resumed where they stopped, and honest intervals."""

import joblib
import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pegpose_lab.calibration import CALIBRATION_METHODS
from pegpose_lab.calibration.joint import richer
from pegpose_lab.paper import experiment, paper_camera
from pegpose_lab.study import PARAMETERS, load_rendered_trials, monte_carlo, trial_poses, trials
from pegpose_lab.targets import Checkerboard

SMALL = {"noises": (0.05, 0.2), "tilts": (20.0, 30.0), "views": (3,), "trials": 2, "progress": False}


def test_a_row_for_each_trial_in_order():
    table = monte_carlo(**SMALL, methods=list(CALIBRATION_METHODS))
    assert len(table) == 2 * 2 * 4 * 2 and (table["status"] == "").all()
    keys = table[["seed", "corners", "noise", "tilt", "views", "method", "trial"]]
    pd.testing.assert_frame_equal(keys, keys.sort_values(list(keys)).reset_index(drop=True))
    assert table["focal_length_sigma"].notna().tolist() == table["method"].isin(["zhang", "joint"]).tolist()


def test_numbers_do_not_depend_on_workers_or_on_what_else_is_asked():
    one, two = (monte_carlo(**SMALL, workers=workers) for workers in (None, 2))
    pd.testing.assert_frame_equal(one, two, rtol=1e-9)
    alone = monte_carlo(**(SMALL | {"noises": (0.2,)}))
    pd.testing.assert_frame_equal(alone, one[one["noise"] == 0.2].reset_index(drop=True), rtol=1e-9)


def test_noise_levels_share_their_boards():
    board = Checkerboard(8, 6, 29.0)
    table = monte_carlo(**SMALL)
    quiet, loud = (table[table["noise"] == noise].reset_index() for noise in (0.05, 0.2))
    np.testing.assert_allclose(loud["focal_length_sigma"] / quiet["focal_length_sigma"], 4, rtol=0.2)
    for pose in trial_poses(board, 45.0, 5, 1):
        seen = paper_camera().project(board.object_points, pose)
        assert seen.min() > 0 and np.all(seen.max(axis=0) < (1600, 1200))
        assert np.degrees(np.arccos(pose.rotation.as_matrix()[2, 2])) == pytest.approx(45.0)


def test_an_interrupted_run_goes_on_where_it_stopped(tmp_path, monkeypatch):
    path = tmp_path / "trials.csv"
    first = monte_carlo(**(SMALL | {"trials": 1}), path=path)
    run, calls = trials.run_trial, []
    monkeypatch.setattr(trials, "run_trial", lambda *key: calls.append(key) or run(*key))
    table = monte_carlo(**SMALL, path=path)
    assert len(calls) == 4 and all(key[-1] == 1 for key in calls)
    pd.testing.assert_frame_equal(table[table["trial"] == 0].reset_index(drop=True), first)
    pd.testing.assert_frame_equal(table, monte_carlo(**SMALL), rtol=1e-12)
    assert len(calls) == 4 + 8 and len(pd.read_csv(path)) == 8


def test_what_was_finished_before_an_interrupt_is_kept(tmp_path, monkeypatch):
    path, run = tmp_path / "trials.csv", trials.run_trial

    def interrupted(*key):
        if key[1:] == ("simulated", 0.2, 20.0, 3, "joint", 1):
            raise KeyboardInterrupt
        return run(*key)

    monkeypatch.setattr(trials, "run_trial", interrupted)
    with pytest.raises(KeyboardInterrupt):
        monte_carlo(**SMALL, path=path)
    assert 0 < len(pd.read_csv(path)) < 8
    monkeypatch.undo()
    pd.testing.assert_frame_equal(monte_carlo(**SMALL, path=path), monte_carlo(**SMALL), rtol=1e-12)


@pytest.mark.parametrize("kept", [3, 25, 40, 60, 120, -30, -2, -1])
def test_a_cut_last_line_is_run_again(tmp_path, kept):
    path = tmp_path / "trials.csv"
    whole = monte_carlo(**SMALL, path=path)
    *lines, last = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines) + last[:kept])
    pd.testing.assert_frame_equal(monte_carlo(**SMALL, path=path), whole, rtol=1e-12)
    assert len(pd.read_csv(path)) == 8


def test_damaged_and_double_lines_do_not_count(tmp_path):
    path = tmp_path / "trials.csv"
    whole = monte_carlo(**SMALL, path=path)
    header, first, second, third, *others = path.read_text().splitlines(keepends=True)
    no_rms = third.split(",")
    no_rms[header.split(",").index("rms")] = ""
    damaged = [first, first, second.replace("47.9", "47.9x"), ",".join(no_rms), "garbage,1,2\n", "\0\n"]
    path.write_text("".join([header, *damaged, *others]))
    pd.testing.assert_frame_equal(monte_carlo(**SMALL, path=path), whole, rtol=1e-12)
    assert len(pd.read_csv(path)) == 8


def test_rows_without_a_stated_sigma_are_finished(tmp_path, monkeypatch):
    options = SMALL | {"methods": ("tsai",), "tilts": (0.0, 30.0)}
    whole = monte_carlo(**options, path=tmp_path / "trials.csv")
    monkeypatch.setattr(trials, "run_trial", None)
    pd.testing.assert_frame_equal(monte_carlo(**options, path=tmp_path / "trials.csv"), whole)


@pytest.mark.parametrize(
    "error, reason",
    [
        (np.linalg.LinAlgError("Singular\n matrix"), "LinAlgError: Singular matrix"),
        (OverflowError("too large"), "OverflowError: too large"),
        (ValueError("no image"), "ValueError: no image"),
    ],
)
def test_a_numerical_error_is_a_row_with_its_type(tmp_path, monkeypatch, error, reason):
    def fail(*_, **__):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr("pegpose_lab.calibration.joint.calibrate.calibrate_joint", fail)
        table = monte_carlo(**SMALL, path=tmp_path / "trials.csv")
    assert (table["status"] == reason).all() and table["rms"].isna().all() and (table["flags"] == "").all()
    pd.testing.assert_frame_equal(monte_carlo(**SMALL, path=tmp_path / "trials.csv"), table)


def test_flags_of_the_calibration_are_kept(tmp_path):
    """One hardly tilted board leaves f to a trade with T_z, and a well tilted one does not."""
    options = {"methods": ("tsai",), "tilts": (4.0, 30.0), "trials": 10, "progress": False}
    options["path"] = tmp_path / "trials.csv"
    table = monte_carlo(**options)
    flat, tilted = (table[table["tilt"] == tilt] for tilt in (4.0, 30.0))
    known = flat[flat["status"] == ""]
    assert len(known) and known["flags"].str.contains("f and T_z trade off").all()
    assert (tilted["flags"] == "").all() and (tilted["status"] == "").all()
    pd.testing.assert_frame_equal(monte_carlo(**options), table)


def test_what_is_refused_is_a_row_with_its_reason():
    table = monte_carlo(noises=(0.2,), tilts=(0.0,), views=(3,), trials=2, progress=False)
    assert table["status"].str.contains("straight ahead").all() and table["focal_length"].isna().all()


def test_the_noise_floor_and_the_intervals():
    """rms / (sigma sqrt(2 (1 - p / 2n))) is 1, and 95 % intervals hold the truth as often as they say."""
    table = monte_carlo(trials=150, progress=False)
    floor = table["rms"] / table["expected_rms"]
    assert floor.mean() == pytest.approx(1, abs=min(0.03, 3 * floor.std() / np.sqrt(150)))
    camera = paper_camera()
    for name, true in zip(PARAMETERS, (camera.focal_length, *camera.principal_point, camera.kappa1), strict=True):
        inside = np.abs(table[name] - true) < 1.96 * table[f"{name}_sigma"]
        assert inside.mean() == pytest.approx(0.95, abs=3.3 * np.sqrt(0.95 * 0.05 / 150))


def test_rendered_trials_leave_the_noise_of_their_corners():
    """The file's trials: rms over sigma sqrt(2 (1 - p / 2n)), sigma being the corners' true error."""
    table = load_rendered_trials()
    assert len(table) == 200 and (table["corners"] == "rendered").all()
    assert (table["status"] == "").all()
    flagged = table.loc[
        table["flags"] != "", "flags"
    ]  # the model is the right one: only the misfit test's false alarms
    assert flagged.str.startswith("The points do not fit this model").all()
    assert len(flagged) <= stats.binom.ppf(0.999, len(table), richer.LEVEL)
    floor = table["rms"] / table["expected_rms"]
    assert floor.mean() == pytest.approx(1, abs=0.03) and floor.std() < 0.03
    assert table["corner_sigma"].between(0.001, 0.01).all()


def test_rendered_trials_are_current():
    again = monte_carlo(**(trials.RENDERED | {"trials": 1}), progress=False)
    pd.testing.assert_frame_equal(again, load_rendered_trials()[:1], rtol=1e-5)


def test_a_board_that_is_not_found_is_a_row_with_its_reason(monkeypatch):
    monkeypatch.setattr(experiment, "render_board", lambda *_, **__: np.full((1200, 1600), 90, np.uint8))
    monkeypatch.setattr(trials, "render_board", lambda *_, **__: np.full((1200, 1600), 90, np.uint8))
    table = monte_carlo(corners="rendered", noises=(2.0,), views=(3,), trials=1, progress=False)
    assert table["status"][0] != "" and table["rms"].isna().all()


@pytest.mark.parametrize(
    "options, named",
    [
        ({"noises": (-1,)}, "noises"),
        ({"tilts": (80,)}, "tilts"),
        ({"views": (0,)}, "views"),
        ({"methods": ("magic",)}, "methods"),
        ({"trials": 0}, "trials"),
        ({"corners": "drawn"}, "corners"),
        ({"views": (2.5,)}, "views.*whole"),
        ({"trials": 2.5}, "trials.*whole"),
        ({"seed": 0.5}, "seed.*whole"),
        ({"seed": -1}, "seed"),
        ({"noises": 0.1}, "noises.*sequence"),
        ({"methods": "joint"}, "methods.*sequence"),
        ({"tilts": ()}, "tilts.*at least one"),
    ],
)
def test_unusable_options_are_named(options, named):
    with pytest.raises(ValueError, match=named):
        monte_carlo(**(SMALL | options))


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "", "\xff\0"])
def test_another_file_is_refused(tmp_path, text):
    path = tmp_path / "other.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"other\.csv has columns"):
        monte_carlo(**SMALL, path=path)
    assert path.read_text() == text


def test_a_dask_cluster_takes_the_trials_over():
    distributed = pytest.importorskip("dask.distributed", reason="optional: dask is not installed")
    local = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None)
    with local as cluster, distributed.Client(cluster), joblib.parallel_config("dask"):
        table = monte_carlo(**SMALL)
    pd.testing.assert_frame_equal(table, monte_carlo(**SMALL), rtol=1e-9)
