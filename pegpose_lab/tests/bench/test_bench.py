"""The benchmark's report: its verdicts, that what it writes can be read back, and the command."""

import ast
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pegpose_lab import __main__ as commands
from pegpose_lab import bench
from pegpose_lab.bench import FULL, QUICK, aims, peers, scenes, to_text, write
from pegpose_lab.bench import report as report_file
from pegpose_lab.bench.chain import COLUMNS
from pegpose_lab.bench.plan import Report
from pegpose_lab.bench.report import load, readme_is_current
from pegpose_lab.lab import calibrators, environment, installers


def _report(**changes):
    """A report of one row for each scene, at the targets, or with changes."""
    row = {
        "noise": 5, "method": peers.OURS, "frames": 200, "ms": 5.0, "time_ratio": 1.0, "detection": 100.0,
        "false_positives": 0.0, "center": 1.05, "center_rms": 1.1, "radius": 1.2, "radius_rms": 1.3,
        "visible": 100.0, "arc_bound": 1.0, "center_arc": 1.0, "radius_arc": 1.0, "center_sd": 1.0,
        "radius_sd": 1.0, "coverage": 95.0,
    }  # fmt: skip
    circles = pd.DataFrame([{"scene": scene.name} | row | changes for scene in scenes.SCENES])
    methods = pd.DataFrame(
        {"method": [peers.OURS, "EdgeDrawing"], "memory_mb": [99.0, np.nan], "missing": ["", "not installed"]}
    )
    sizes = pd.DataFrame({"megapixels": [0.5, 20.0], "method": peers.OURS, "ms": [1.0, 40.0]})
    joint = pd.DataFrame({"views": [13, 200], "ms": [20.0, 300.0], "opencv_ms": 10.0, "ratio": 3.0})
    joint["rms_difference"] = 0.0
    genetic = pd.DataFrame(
        {"view": ["paper's view", "left01", "left02"], "ms": 50.0, "de_ms": 25.0, "ratio": [2.0, 1.0, 3.0]}
    )
    genetic = genetic.assign(reached=100.0, de_reached=[100.0, 100.0, 90.0])
    tables = circles, methods, sizes, joint, genetic
    rivals = pd.DataFrame({"method": ["linear only", "GA"], "evaluations": [np.nan, 6060.0], "ms": [1.0, 50.0]})
    tools = [
        ("calibrate_joint", "1.0", 1290.0, 0.3, 0.4, 0.9, 20.0, 3.3, 3.2, 0.1, ""),
        ("mrcal", "", *[np.nan] * 8, "no"),
    ]
    names = ["tool", "version", "f", "sigma", "half_px", "z", "ms", "corner_inf", "corner_1m", "off_mrcal", "missing"]
    calibrators = pd.DataFrame(tools, columns=names).assign(corners="simulated")
    chain = pd.DataFrame([("linear", 9, 5.0, 200.0, 0.01, 0.02, np.nan)], columns=COLUMNS)
    return Report(*tables, rivals, calibrators, chain, aims.judge(*tables))


EVERY_SCENE = [scene.name for scene in scenes.SCENES]


def test_targets_are_met_at_their_limits():
    assert (_report().targets["met"] == "yes").all()
    assert len(_report().targets) == 4 * 5 + 7 * 3 + 1 + 7


@pytest.mark.parametrize(
    ("change", "failing"),
    [
        ({"center": 1.06}, ["clean", "tilt"]),
        ({"center": 1.61}, ["clean", "tilt", "highlights", "clean"]),
        ({"center": 2.01}, ["clean", "tilt", "highlights", "clutter", "clean"]),
        ({"radius": 1.21}, ["clean", "tilt"]),
        ({"radius": 2.6}, ["clean", "tilt", "highlights", "clutter"]),
        ({"time_ratio": 1.01}, ["clean", "tilt"]),
        ({"time_ratio": 3.01}, ["clean", "tilt", "highlights", "clutter"]),
        ({"detection": 99.6}, ["clean", "tilt", "highlights"]),
        ({"detection": 99.4}, ["clean", "tilt", "highlights", "clutter"]),
        ({"false_positives": 0.005}, ["clean", "tilt", "highlights", "strangers"]),
        ({"false_positives": 0.02}, ["clean", "tilt", "highlights", "clutter", "strangers"]),
        ({"center_sd": 0.89}, ["clean", "tilt"]),
        ({"radius_sd": 1.31}, EVERY_SCENE),
        ({"coverage": 92.9}, EVERY_SCENE),
        ({"coverage": 97.1}, EVERY_SCENE),
    ],
)
def test_a_missed_target_is_said(change, failing):
    targets = _report(**change).targets
    assert targets.loc[targets["met"] == "no", "scene"].tolist() == failing


def test_honesty_is_judged_at_the_worst_noise():
    report = _report()
    quiet = report.circles.assign(noise=1, center_sd=1.2, coverage=92.0)
    tables = report.methods, report.sizes, report.joint, report.genetic
    missed = aims.judge(pd.concat([report.circles, quiet]), *tables).query("met == 'no'")
    assert missed["scene"].tolist() == ["clean"] * 2 + ["tilt"] * 2 + EVERY_SCENE[2:]
    assert missed["measured"].isin([1.2, 92.0]).all()


def _judged(report, **changes):
    """Whether the aims that are no scene's are met: worst noise, memory, growth, joint's two, genetic's two."""
    report = replace(report, **changes)
    names = ("circles", "methods", "sizes", "joint", "genetic")
    return aims.judge(*(getattr(report, name) for name in names))["met"].tolist()[-7:]


def test_what_belongs_to_no_scene_is_judged():
    report = _report()
    assert _judged(report) == ["yes"] * 7
    assert _judged(report, methods=report.methods.assign(memory_mb=[101.0, np.nan]))[1] == "no"
    assert _judged(report, methods=report.methods.assign(memory_mb=np.nan))[1] == "not measured"
    assert _judged(report, sizes=report.sizes.assign(ms=[1.0, 60.0]))[2] == "no"
    assert _judged(report, joint=report.joint.assign(ms=[1.0, 1000.0], ratio=3.1))[3:5] == ["no", "no"]
    slow_and_lost = report.genetic.assign(ratio=[1.0, 3.1, 1.0], reached=[100.0, 100.0, 90.0])
    assert _judged(report, genetic=slow_and_lost)[5:] == ["no", "no"]


def test_report_is_written_whole_and_read_back(tmp_path):
    readme, report = tmp_path / "README.md", _report()
    readme.write_text("above\n<!-- bench:begin -->\nbefore the run\n<!-- bench:end -->\nbelow\n")
    write(report, tmp_path / "results", readme)
    text = readme.read_text()
    assert text.startswith("above\n<!-- bench:begin -->\n") and text.endswith("<!-- bench:end -->\nbelow\n")
    assert "| 2 photographs | 50 | 25 | 2 | 100 | 90 |" in text and "| linear only |  | 1 |" in text
    assert "| calibrate_joint | 1.0 | 1290.00 | 0.3 |" in text and "mrcal: not measured, no." in text
    assert "before the run" not in text and "EdgeDrawing: not measured, not installed." in text and "1.05" in text
    assert readme_is_current(readme, tmp_path / "results")
    tables = ("circles", "methods", "sizes", "joint", "genetic", "rivals", "calibrators", "chain", "targets")
    names = {f"bench_{name}.{kind}" for name in tables for kind in ("csv", "tex")}
    assert {path.name for path in (tmp_path / "results").iterdir()} == names
    pd.testing.assert_frame_equal(load(tmp_path / "results").circles, report.circles)
    write(replace(report, circles=report.circles.assign(ms=6.0)), tmp_path / "results")
    assert not readme_is_current(readme, tmp_path / "results")


def test_committed_readme_shows_the_committed_results():
    checkout = environment.CHECKOUT
    assert readme_is_current(checkout / "data" / "results" / "README.md", checkout / "data" / "results")


def test_report_as_text_counts_the_aims():
    text = to_text(_report())
    assert text.endswith("49 of 49 aims met.")
    assert json.loads(text.splitlines()[0])["opencv"] == report_file.cv2.__version__


# ---- the command ----


@pytest.fixture
def command(monkeypatch, tmp_path):
    """Run `bench` with a made-up report; returns the plans that were asked for."""
    plans = []
    monkeypatch.setattr(environment, "add_bench_packages", lambda: None)
    monkeypatch.setattr(calibrators, "add_calibrators", lambda: None)
    monkeypatch.setattr(bench, "run", lambda plan: plans.append(plan) or _report())
    monkeypatch.setattr(commands, "CHECKOUT", tmp_path)

    def run(*arguments):
        return commands._bench(commands._parse(["bench", *arguments])), plans[-1]

    return run


def test_quick_run_writes_nothing(command, tmp_path, capsys):
    assert command("--quick") == (0, QUICK)
    assert list(tmp_path.iterdir()) == [] and "aims met" in capsys.readouterr().out


def test_full_run_is_written_into_place(command, tmp_path):
    assert command("--output", str(tmp_path / "elsewhere")) == (0, FULL)
    assert (tmp_path / "elsewhere" / "data" / "results" / "bench_circles.csv").exists()


def test_a_readme_without_a_place_is_refused_before_the_run(command, tmp_path):
    (tmp_path / "data" / "results").mkdir(parents=True)
    (tmp_path / "data" / "results" / "README.md").write_text("nothing")
    with pytest.raises(ValueError, match="bench:begin"):
        command("--output", str(tmp_path))


@pytest.fixture
def installs(monkeypatch, tmp_path):
    """What would be installed, in a checkout of its own."""
    calls = []
    monkeypatch.setattr(environment, "VENV", tmp_path / ".venv")
    monkeypatch.setattr(environment, "_pip_install", lambda arguments, _: calls.append(list(map(str, arguments))))
    return calls


def test_peers_are_installed_once(installs, monkeypatch):
    monkeypatch.setattr(environment, "_bench_group", lambda: ["numpy>=2", "no-such-package>=1"])
    environment.add_bench_packages()
    locked, contrib = installs
    assert locked == ["-c", str(environment.LOCK), "no-such-package>=1"]
    assert contrib[:2] == ["--no-deps", "--target"] and contrib[2] == str(environment.contrib_folder())
    assert contrib[3].replace("contrib-", "") in environment.LOCK.read_text().splitlines()
    installs.clear()
    (environment.contrib_folder() / "cv2").mkdir(parents=True)
    monkeypatch.setattr(environment, "_bench_group", lambda: ["numpy>=2"])
    environment.add_bench_packages()
    assert installs == []


def test_bench_goes_on_without_what_cannot_be_installed(installs, monkeypatch, capsys):
    def fail(*_):
        raise installers.SetUpError("Installing it failed")

    monkeypatch.setattr(environment, "_pip_install", fail)
    environment.add_bench_packages()
    assert "goes on without it" in capsys.readouterr().err


def test_optional_group_has_the_peers():
    names = [requirement.split(">")[0] for requirement in environment._bench_group()]
    packages = {method.package for method in peers.COMPARED.values()}
    assert set(names) == packages - {"pegpose_lab", "opencv-python-headless", "opencv-contrib-python-headless"}


def test_no_module_but_the_benchmark_knows_the_peers():
    package = environment.CHECKOUT / "pegpose_lab"
    users = {
        path.parent.name
        for path in package.rglob("*.py")
        if "tests" not in path.parts
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and "peers" in [alias.name for alias in node.names]
    }
    assert users == {"bench"}
