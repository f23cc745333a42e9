"""Set-up wherever a checkout may stand: folders of any name, places that cannot be written."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pegpose_lab.lab import environment, installers

NAMES = ["Prüfstand", "ends in a space ", "日本", "a#b;c", "import os"]


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """Make a folder of a given name the checkout, with an empty lock and a package that says that it is there."""

    def make(name):
        folder = tmp_path / name
        (folder / "pegpose_lab").mkdir(parents=True)
        (folder / "pegpose_lab" / "__init__.py").write_text("there = True\n")
        (folder / "environment.txt").write_text("")
        monkeypatch.setattr(environment, "CHECKOUT", folder)
        monkeypatch.setattr(environment, "LOCK", folder / "environment.txt")
        monkeypatch.setattr(environment, "VENV", folder / ".venv")
        return folder

    return make


@pytest.mark.parametrize("locale", ["C", "C.UTF-8", "en_US.ISO-8859-1"])
@pytest.mark.parametrize("name", NAMES)
def test_a_checkout_of_any_name_is_importable_in_every_locale(checkout, name, locale, tmp_path):
    folder = checkout(name)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment.VENV], check=True)
    environment._write_path_file()
    (path_file,) = environment.VENV.rglob("pegpose_lab.pth")
    assert path_file.read_bytes().isascii()
    code = (
        "import os, pegpose_lab; print(pegpose_lab.there, ascii(os.fsencode(os.path.realpath(pegpose_lab.__file__))))"
    )
    variables = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONUTF8", "LANG")}
    for utf8 in "01":  # Python's UTF-8 mode hides what the locale does
        run = subprocess.run(
            [environment.python(), "-c", code], cwd=tmp_path, env={**variables, "LC_ALL": locale, "PYTHONUTF8": utf8},
            capture_output=True, encoding="utf-8", errors="replace",
        )  # fmt: skip
        assert run.returncode == 0, run.stderr
        assert run.stdout.split(" ", 1)[1].strip() == ascii(os.fsencode(folder / "pegpose_lab" / "__init__.py"))


def test_the_stamp_is_the_same_in_every_locale(checkout, tmp_path):
    """Else every change of locale would make the environment anew."""
    folder = checkout("Prüfstand")
    code = (
        "import json, sys; from pathlib import Path; from pegpose_lab.lab import environment\n"
        "import os; environment.CHECKOUT = Path(os.fsdecode(bytes.fromhex(sys.argv[1])))\n"
        "environment.LOCK = environment.CHECKOUT / 'environment.txt'; print(json.dumps(environment._wanted_stamp()))"
    )
    project = Path(environment.__file__).parents[2]
    stamps = {
        subprocess.check_output(
            [sys.executable, "-c", code, os.fsencode(folder).hex()],
            cwd=project,
            env={**os.environ, "LC_ALL": locale, "PYTHONUTF8": "0"},
        )  # fmt: skip
        for locale in ("C", "C.UTF-8", "en_US.ISO-8859-1")
    }
    assert len(stamps) == 1


def test_a_file_in_the_way_is_told_in_one_sentence(checkout):
    folder = checkout("lab")
    (folder / ".venv").write_text("precious")
    with pytest.raises(installers.SetUpError, match=r"\.venv is a file where set-up makes a folder") as told:
        environment.set_up()
    assert "\n" not in str(told.value)
    assert (folder / ".venv").read_text() == "precious"


@pytest.mark.parametrize("code", [errno.EACCES, errno.EROFS, errno.ENOSPC])
@pytest.mark.parametrize("call", ["mkdir", "replace"])
def test_a_place_that_cannot_be_written_is_told_in_one_sentence(checkout, monkeypatch, call, code):
    """As the first call that writes meets it, and as the one that writes the stamp."""
    folder = checkout("lab")

    def refuse(path, *_):
        raise OSError(code, os.strerror(code), str(path))

    monkeypatch.setattr(os, call, refuse)
    with pytest.raises(installers.SetUpError, match=os.strerror(code)) as told:
        environment.set_up()
    assert str(folder / ".venv") in str(told.value) and "\n" not in str(told.value)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_told_in_one_sentence(checkout):
    folder = checkout("lab")
    folder.chmod(0o555)
    try:
        with pytest.raises(installers.SetUpError, match="cannot: Permission denied"):
            environment.set_up()
    finally:
        folder.chmod(0o755)


def test_set_up_says_what_it_is_about_to_do(checkout, monkeypatch, capsys):
    folder = checkout("lab")
    (folder / "environment.txt").write_text(
        "# from\nnumpy==2.4.6\n    # via x\ncolorama==0.4 ; sys_platform == 'win32'\n"
    )
    monkeypatch.setattr(environment.shutil, "which", lambda _: None)
    environment._announce()
    told = capsys.readouterr().out
    assert "with pip: 2 packages" in told and f"{environment.SECONDS['pip']} s" in told


def test_another_python_has_an_environment_for_the_lock_as_it_is(checkout, monkeypatch):
    folder, installed = checkout("a"), []
    (folder / ".venv").mkdir()

    def make(commands, task):
        (folder / ".venv" / "python3.99").mkdir(exist_ok=True)

    monkeypatch.setattr(environment.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(environment.subprocess, "call", lambda *_, **__: 0)
    monkeypatch.setattr(environment, "_run_first", make)
    monkeypatch.setattr(environment, "_pip_install", lambda arguments, *_: installed.append(arguments))
    for _ in range(2):
        assert environment.python_of_version("3.99") == folder / ".venv" / "python3.99" / "bin" / "python"
    assert installed == [["-r", environment.LOCK]]
    environment.LOCK.write_text("numpy==2.4.6\n")
    environment.python_of_version("3.99")
    assert len(installed) == 2


def test_a_python_that_is_not_there_has_no_environment(checkout, monkeypatch):
    checkout("a")
    monkeypatch.setattr(environment.shutil, "which", lambda name: None)
    assert environment.python_of_version("3.99") is None
