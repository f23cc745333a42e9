"""Set-up: made once, made anew where it is broken, by whatever tool there is."""

import os
import shutil
import subprocess
import sys

import pytest

from pegpose_lab.lab import environment, installers, progress
from pegpose_lab.tests.commands import CHECKOUT


@pytest.fixture
def steps(checkout, monkeypatch):
    """The steps that set-up takes; they make a folder with two empty files instead of an environment."""
    steps = []

    def make():
        steps.append("make")
        environment.python().parent.mkdir(parents=True)
        environment.python().touch()
        (checkout / ".venv" / "pyvenv.cfg").touch()

    monkeypatch.setattr(environment, "_make_venv", make)
    monkeypatch.setattr(environment, "_install", lambda: steps.append("install"))
    monkeypatch.setattr(environment, "_write_path_file", lambda: steps.append("path"))
    return steps


@pytest.fixture
def broken_install(steps, monkeypatch):
    """Let the next installation end with a given exception, those after it succeed."""

    def break_with(error):
        working = environment._install

        def broken():
            monkeypatch.setattr(environment, "_install", working)
            raise error

        monkeypatch.setattr(environment, "_install", broken)

    return break_with


def test_set_up_has_nothing_to_do_the_second_time(steps):
    assert environment.set_up()
    assert not environment.set_up()
    assert steps == ["make", "install", "path"]


def test_changed_lock_is_installed_into_the_same_environment(steps):
    environment.set_up()
    environment.LOCK.write_text("numpy==2.4.7\n")
    assert environment.set_up()
    assert steps == ["make", "install", "path", "install", "path"]
    assert not environment.set_up()


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (KeyboardInterrupt(), ""),
        (installers.SetUpError("no network"), "no network"),
        (OSError(28, "No space left on device"), "cannot: No space left on device"),
    ],
)
def test_set_up_that_fails_leaves_nothing(steps, broken_install, error, told):
    broken_install(error)
    with pytest.raises((KeyboardInterrupt, installers.SetUpError)) as ended:
        environment.set_up()
    assert told in str(ended.value)
    assert not environment.VENV.exists()
    assert environment.set_up()


def test_set_up_that_was_killed_is_not_taken_for_complete(steps, broken_install, monkeypatch):
    broken_install(KeyboardInterrupt())
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(shutil, "rmtree", lambda *_, **__: None)  # as if there was no time to clean up
        environment.set_up()
    assert environment.VENV.exists()
    assert environment.set_up()
    assert steps == ["make", "make", "install", "path"]


def test_failed_update_keeps_the_environment_but_is_tried_again(steps, broken_install):
    environment.set_up()
    environment.LOCK.write_text("numpy==2.4.7\n")
    broken_install(installers.SetUpError("no network"))
    with pytest.raises(installers.SetUpError):
        environment.set_up()
    assert environment._is_whole()
    assert environment.set_up()
    assert steps.count("make") == 1


def test_interrupted_update_starts_afresh(steps, broken_install):
    environment.set_up()
    environment.LOCK.write_text("numpy==2.4.7\n")
    broken_install(KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        environment.set_up()
    assert environment.set_up()
    assert steps.count("make") == 2


@pytest.mark.parametrize(
    "spoil",
    [
        lambda: environment._write_stamp({**environment._read_stamp(), "python": "cpython-27"}),
        lambda: environment._write_stamp({**environment._read_stamp(), "checkout": "/elsewhere"}),
        lambda: (environment.VENV / environment.STAMP_NAME).write_text("{half"),
        lambda: environment.python().unlink(),
        lambda: (environment.VENV / "pyvenv.cfg").unlink(),
    ],
    ids=["other Python", "moved checkout", "half a stamp", "Python gone", "no environment"],
)
def test_unusable_environment_is_made_anew(steps, spoil):
    environment.set_up()
    spoil()
    assert environment.set_up()
    assert steps.count("make") == 2


def test_environment_of_unknown_origin_is_not_touched_if_unusable(steps):
    (environment.VENV / "precious").mkdir(parents=True)
    with pytest.raises(installers.SetUpError, match="not made by this command"):
        environment.set_up()
    assert [path.name for path in environment.VENV.iterdir()] == ["precious"]


def test_environment_of_unknown_origin_is_adopted_if_it_fits(steps, monkeypatch):
    environment._make_venv()
    monkeypatch.setattr(environment, "_venv_tag", lambda: sys.implementation.cache_tag)
    assert environment.set_up()
    assert not environment.set_up()
    assert steps == ["make", "install", "path"]


def test_missing_lock_is_named(steps):
    environment.LOCK.unlink()
    with pytest.raises(installers.SetUpError, match=r"environment\.txt is missing"):
        environment.set_up()


def test_python_without_venv_is_told_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr(environment, "VENV", tmp_path / ".venv")
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setattr(environment.importlib.util, "find_spec", lambda name: None if name == "ensurepip" else object())
    with pytest.raises(installers.SetUpError, match=r"sudo apt install python3\.\d+-venv"):
        environment._make_venv()


@pytest.mark.parametrize(
    ("found", "has_venv", "expected"),
    [(("uv", "virtualenv"), True, "uv"), (("virtualenv",), True, "venv"), (("virtualenv",), False, "virtualenv")],
)
def test_environment_is_made_by_the_first_tool_found(monkeypatch, found, has_venv, expected):
    calls = []
    monkeypatch.setattr(shutil, "which", lambda name: name if name in found else None)
    monkeypatch.setattr(environment.importlib.util, "find_spec", lambda _: has_venv or None)
    monkeypatch.setattr(subprocess, "call", lambda command: calls.append(command) or 0)
    environment._make_venv()
    assert len(calls) == 1
    assert expected in (calls[0][0], calls[0][2])


@pytest.mark.parametrize(
    ("works", "tools"), [({"uv", "pip"}, ["uv"]), ({"pip"}, ["uv", "pip"]), (set(), ["uv", "pip"])]
)
def test_pip_installs_where_uv_fails(monkeypatch, works, tools):
    calls = []

    def call(command, *_):
        calls.append("uv" if command[0] == "uv" else command[2])
        return 0 if calls[-1] in works else 1

    monkeypatch.setattr(shutil, "which", lambda name: name)
    monkeypatch.setattr(progress, "run", call)
    if works:
        environment._install()
    else:
        with pytest.raises(installers.SetUpError, match="failed"):
            environment._install()
    assert calls == tools


def test_package_is_importable_from_everywhere(tmp_path, monkeypatch):
    monkeypatch.setattr(environment, "VENV", tmp_path / ".venv")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment.VENV], check=True)
    environment._write_path_file()
    code = "import pegpose_lab, sys; print(sys.prefix, pegpose_lab.__file__)"
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    found = subprocess.run(
        [environment.python(), "-c", code], cwd=tmp_path, env=variables, check=True, capture_output=True, text=True
    )
    assert found.stdout.split() == [str(environment.VENV), str(CHECKOUT / "pegpose_lab" / "__init__.py")]


def test_installed_packages_are_told_on_a_bare_python():
    """In an interpreter of its own: here others have imported what a file itself may have forgotten."""
    code = "from pegpose_lab.lab import installers as i; print(i._has_package('pip>=1'), i._has_package('no-such-package'))"
    run = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True)
    assert run.stdout.split() == ["True", "False"], run.stderr


def test_the_benchmark_installs_what_is_missing_only(checkout, monkeypatch):
    shutil.copy(CHECKOUT / "pyproject.toml", checkout)
    environment.LOCK.write_text("opencv-python-headless==5.0.0.93\n")
    installed = []
    monkeypatch.setattr(environment, "_try_to_install", installed.append)
    monkeypatch.setattr(environment, "_has_package", lambda requirement: False)
    environment.add_bench_packages()
    monkeypatch.setattr(environment, "_has_package", lambda requirement: True)
    (environment.contrib_folder() / "cv2").mkdir(parents=True)
    environment.add_bench_packages()
    assert len(installed) == 2
    assert any("scikit-image" in str(part) for part in installed[0])
    assert "opencv-contrib-python-headless==5.0.0.93" in installed[1]
