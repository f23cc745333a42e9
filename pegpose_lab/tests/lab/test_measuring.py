"""The command ``measure``: its table is complete, and it says what it cannot make."""

import re
import subprocess
import sys

import pytest

from pegpose_lab import __main__ as commands
from pegpose_lab import study
from pegpose_lab.files import MEASURED_FOLDER, PROJECT_FOLDER
from pegpose_lab.lab import environment, measuring
from pegpose_lab.lab.measuring import MEASUREMENTS, Measurement
from pegpose_lab.study import circle_counts

BY_HAND = {"known_circles"}
WITHOUT_COMMENT = {"rendered_trials"}  # a run goes on writing it


def test_every_file_has_one_measurement_that_exists():
    files = [file for line in MEASUREMENTS.values() for file in line.files]
    assert sorted(files) == sorted({path.stem for path in MEASURED_FOLDER.glob("*.csv")} - BY_HAND)
    assert all(callable(measuring._function(name)) for name in MEASUREMENTS)
    assert set(MEASUREMENTS["circle_counts"].photographs) == {name for name, *_ in circle_counts.SEARCHES}


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_a_file_and_the_table_of_files_name_the_command(name):
    page = (PROJECT_FOLDER / "data" / "README.md").read_text(encoding="utf-8")
    for file in MEASUREMENTS[name].files:
        first = (MEASURED_FOLDER / f"{file}.csv").read_text(encoding="utf-8").partition("\n")[0]
        assert file in WITHOUT_COMMENT or first.endswith(study.made_by(name))
        assert re.search(rf"^\| `{file}\.csv` .*\| `python3 -m pegpose_lab measure {name}` \|$", page, re.MULTILINE)


def test_help_lists_names_files_and_times_on_a_bare_python():
    code = "import sys; from pegpose_lab.__main__ import main; main(['measure', '--help'])"
    command = [sys.executable, "-S", "-c", code]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=PROJECT_FOLDER, check=True)
    for name, line in MEASUREMENTS.items():
        assert re.search(rf"^  {name} +about {line.takes} +{line.files[0]}\.csv", ran.stdout, re.MULTILINE)


def test_an_unknown_name_is_told_in_one_sentence_before_anything_is_done(monkeypatch):
    monkeypatch.setattr(environment, "set_up", lambda: pytest.fail("set-up was run"))
    with pytest.raises(SystemExit, match=r"^Nothing to measure is called circles; there are: circle_counts, .*\.$"):
        commands.main(["measure", "screw_bits", "circles"])


@pytest.fixture
def made(monkeypatch):
    """Measurements that only say that they were made: of photographs that are not there, and of none."""
    names = []
    monkeypatch.delenv("PEGPOSE_DATA", raising=False)
    lines = {
        name: Measurement(name, (), "1 s", sets) for name, sets in {"seen": ("visp-mire2-a",), "drawn": ()}.items()
    }
    monkeypatch.setattr(measuring, "MEASUREMENTS", lines)
    monkeypatch.setattr(measuring, "_function", lambda name: lambda folder: names.append((name, folder)))
    return names


def test_photographs_that_are_not_there_are_asked_for_in_one_sentence(made, tmp_path):
    told = r"^seen is measured in the photographs of visp-mire2-a, which are not found: set PEGPOSE_DATA to .*\.$"
    with pytest.raises(SystemExit, match=told):
        measuring.measure(["drawn", "seen"], tmp_path)
    assert made == []


def test_without_a_name_all_is_made_that_can_be(made, tmp_path, capsys):
    assert measuring.measure([], tmp_path) == 0
    assert made == [("drawn", tmp_path)]
    assert "Left out: seen is measured in the photographs of visp-mire2-a" in capsys.readouterr().err


def test_with_the_photographs_it_is_measured(made, tmp_path, monkeypatch):
    (tmp_path / "visp-mire2-a").mkdir()
    monkeypatch.setenv("PEGPOSE_DATA", str(tmp_path))
    assert measuring.measure(["seen"], tmp_path / "out") == 0
    assert made == [("seen", tmp_path / "out")]


def test_a_table_that_is_not_there_is_named(tmp_path):
    (tmp_path / "a.csv").write_text("x\n1\n")
    with pytest.raises(ValueError, match="file is 'b'; expected a table of .*: a$"):
        study.load_measured("b", tmp_path)
