"""The environments of other calibration tools: made once, complete or left out with a message."""

import sys

import pytest

from pegpose_lab.lab import calibrators, environment
from pegpose_lab.lab.installers import SetUpError


@pytest.fixture
def installs(monkeypatch, tmp_path):
    """What would be run, in an empty `.venv`."""
    ran = []
    monkeypatch.setattr(environment, "VENV", tmp_path)
    monkeypatch.setattr(calibrators, "_base", lambda versions: sys.executable)
    monkeypatch.setattr(calibrators, "_run_first", lambda commands, task: calibrators_folder(task).mkdir())
    monkeypatch.setattr(environment, "_pip_install", lambda arguments, name, python: ran.append((name, arguments)))
    return ran


def calibrators_folder(task):
    return environment.VENV / "calibrators" / task.rpartition("/")[2]


def test_each_tool_is_installed_once_and_again_in_another_version(installs, monkeypatch, capsys):
    calibrators.add_calibrators()
    assert [name for name, _ in installs] == list(calibrators.TOOLS)
    assert installs[0][1][:2] == ["--no-deps", "mrcal==2.5.2.post1"] and "Installing" in capsys.readouterr().out
    assert calibrators.missing("lensboy") == "" and "lensboy" in str(calibrators.calibrator_python("lensboy"))
    calibrators.add_calibrators()
    assert len(installs) == len(calibrators.TOOLS) and capsys.readouterr().out == ""
    other = calibrators.TOOLS | {"lensboy": calibrators.Tool(("lensboy==5",))}
    monkeypatch.setattr(calibrators, "TOOLS", other)
    assert calibrators.missing("lensboy") == "lensboy is not installed"


def test_a_tool_that_cannot_be_installed_is_named_and_left_out(installs, monkeypatch, capsys):
    def refuse(arguments, name, python):
        raise SetUpError(f"Installing {name} failed; the lines above say why.")

    monkeypatch.setattr(environment, "_pip_install", refuse)
    calibrators.add_calibrators()
    said = capsys.readouterr().err
    assert said.count("The benchmark goes on without it.") == 3 and "Installing mrcal failed" in said
    assert calibrators.missing("mrcal") == "mrcal is not installed; it needs Python 3.12 or 3.13"


def test_a_tool_whose_python_is_not_found_is_left_out(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(environment, "VENV", tmp_path)
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path))
    monkeypatch.setattr(calibrators, "TOOLS", {"mrcal": calibrators.Tool(("mrcal",), (), ("3.99",))})
    calibrators.add_calibrators()
    assert "mrcal needs Python 3.99, which is not found." in capsys.readouterr().err
    assert not (tmp_path / "calibrators").exists()


def test_a_python_is_found_among_pyenvs_versions(monkeypatch, tmp_path):
    own = ".".join(map(str, sys.version_info[:2]))
    assert calibrators._base((own,)) == calibrators._base(()) is not None
    python = tmp_path / "versions" / "3.99.1" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path))
    assert calibrators._base(("3.98", "3.99")) == python


def test_debians_mrcal_is_used_where_it_is(monkeypatch, tmp_path):
    monkeypatch.setattr(calibrators, "DEBIAN_PYTHON", str(tmp_path / "python3"))
    assert calibrators.calibrator_python(calibrators.DEBIAN) is None
    assert calibrators.missing(calibrators.DEBIAN) == "Debian's packages mrcal and python3-mrcal are not installed"
    monkeypatch.setattr(calibrators.subprocess, "call", lambda *_, **__: 0)
    assert calibrators.calibrator_python(calibrators.DEBIAN) == str(tmp_path / "python3")
