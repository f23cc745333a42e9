"""The commands: their line, the Python they need, the environment they run in, packaging."""

import ast
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output
from packaging.requirements import Requirement

from pegpose_lab import __main__ as commands
from pegpose_lab.lab import environment
from pegpose_lab.tests.commands import CHECKOUT, WRITE, _start

# --- a bare Python ------------------------------------------------------------------------------


def test_commands_start_on_a_bare_python():
    code = (
        f"import sys; sys.path.insert(0, {str(CHECKOUT)!r}); import pegpose_lab, pegpose_lab.__main__;"
        "print({name.partition('.')[0] for name in sys.modules} - set(sys.stdlib_module_names))"
    )
    ran = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=True)
    assert ast.literal_eval(ran.stdout) <= {"pegpose_lab", "__main__"}


@pytest.mark.parametrize(
    "module",
    [
        "__init__",
        "__main__",
        "lab/__init__",
        "lab/environment",
        "lab/installers",
        "lab/progress",
        "lab/notebooks/__init__",
        "lab/notebooks/exploring",
        "lab/command_line",
        "lab/measuring",
        "files",
    ],
)
def test_an_old_python_can_read_up_to_the_message(module):
    source = (CHECKOUT / "pegpose_lab" / f"{module}.py").read_text(encoding="utf-8")
    ast.parse(source, feature_version=(3, 7))


def test_old_python_is_refused_in_words(monkeypatch):
    monkeypatch.setattr(sys, "version_info", (3, 10, 4, "final", 0))
    with pytest.raises(SystemExit, match=r"needs Python 3\.11 or newer; this is Python 3\.10"):
        commands.main(["setup"])


# --- command line -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "line", ["", "nonsense", "reproduce 03", "reproduce --output", "setup --fast", "setup -- x", "reproduce -- x"]
)
def test_wrong_command_line_ends_with_usage(line, capsys):
    with pytest.raises(SystemExit) as ended:
        commands.main(line.split())
    assert ended.value.code == 2
    assert "usage: python3 -m pegpose_lab" in capsys.readouterr().err


def test_arguments_after_the_dashes_are_handed_on():
    assert commands._parse(["test", "--", "-k", "camera", "--", "x"]).extra == ["-k", "camera", "--", "x"]
    assert commands._parse(["lab"]).extra == []


@pytest.mark.parametrize(
    ("patterns", "expected"),
    [
        (None, ["01_a", "02_b", "10_c"]),
        (["02"], ["02_b"]),
        (["10_c", "01"], ["01_a", "10_c"]),
        (["0[12]*"], ["01_a", "02_b"]),
        (["notebooks/02_b.ipynb"], ["02_b"]),
    ],
)
def test_notebooks_are_chosen_by_name(checkout, patterns, expected):
    (checkout / "notebooks").mkdir()
    for name in ("01_a", "02_b", "10_c", "draft"):
        (checkout / "notebooks" / f"{name}.ipynb").touch()
    assert [path.stem for path in commands._choose(patterns)] == expected
    with pytest.raises(SystemExit, match="'03'; there are: 01_a, 02_b, 10_c"):
        commands._choose(["01", "03"])


def test_words_beyond_the_locale_are_no_error(tmp_path):
    """The output's path in an error message, on a terminal that knows ASCII only."""
    (tmp_path / "Prüfstand").touch()
    run = _start(tmp_path, ["reproduce", "--output", str(tmp_path / "Prüfstand")], PYTHONIOENCODING="ascii")
    told = run.communicate(timeout=60)[0]
    assert run.returncode == 1 and "UnicodeEncodeError" not in told
    assert "Pr\\xfcfstand is no folder: name another folder with --output" in told


@pytest.mark.parametrize("line", ["reproduce --output", "bench --output", "measure --output"])
def test_output_that_cannot_be_written_is_told_before_the_work(tmp_path, monkeypatch, line):
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    options = commands._parse([*line.split(), str(tmp_path / "new" / "output")])
    with pytest.raises(SystemExit, match=f"and {tmp_path} cannot be written: name another folder"):
        options.run(options)
    assert not (tmp_path / "new").exists()


# --- testing notebooks --------------------------------------------------------------------------


def test_test_command_catches_a_changed_output_and_writes_nothing(tmp_path):
    right = new_code_cell(WRITE + "print((folder / 'figures/a.png').write_text('new'))", id="right")
    last_digit = new_code_cell("print(3.14159)", id="last_digit")
    wrong = new_code_cell("print(10.1)", id="wrong")
    cells = [(right, "3"), (last_digit, "3.14160"), (wrong, "10.3")]
    for count, (cell, printed) in enumerate(cells, start=1):
        cell.update(execution_count=count, outputs=[new_output("stream", name="stdout", text=f"{printed}\n")])
    (tmp_path / "notebooks").mkdir()
    nbformat.write(new_notebook(cells=[right, last_digit, wrong]), tmp_path / "notebooks" / "01_wrong.ipynb")
    testing = "testpaths = ['notebooks']\naddopts = ['-p', 'pegpose_lab.lab.notebooks.testing']"
    (tmp_path / "pyproject.toml").write_text(f"[tool.pytest.ini_options]\n{testing}\n")
    sanitizer = Path("pegpose_lab", "tests", "nbval_sanitize.cfg")
    (tmp_path / sanitizer).parent.mkdir(parents=True)
    shutil.copyfile(CHECKOUT / sanitizer, tmp_path / sanitizer)
    run = _start(tmp_path, ["test", "--", "-n", "0", "-p", "no:cacheprovider"])
    closing = run.communicate(timeout=120)[0]
    assert run.returncode == 1, closing
    assert re.search(r"=+ 1 failed, 2 passed in ", closing), closing
    assert "10.1" in closing and "10.3" in closing
    assert "a.png is not what the notebooks make" in closing
    assert not (tmp_path / "figures").exists()


def test_commands_run_again_in_the_environment(monkeypatch):
    became = []
    monkeypatch.setattr(os, "environ", {**os.environ, "PYTHONPATH": "/opt/ros", "MPLBACKEND": "agg"})
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(environment, "set_up", bool)
    monkeypatch.setattr(environment, "is_active", bool)
    monkeypatch.setattr(commands, "_become", lambda command: became.append(command) or 7)
    assert commands.main(["test", "--", "-k", "camera"]) == 7
    assert became == [[str(environment.python()), "-m", "pegpose_lab", "test", "--", "-k", "camera"]]
    assert os.environ["OPENBLAS_NUM_THREADS"] == os.environ["OMP_NUM_THREADS"] == "1"
    assert not {"PYTHONPATH", "MPLBACKEND"} & set(os.environ)


# --- packaging ----------------------------------------------------------------------------------


def test_lock_agrees_with_the_direct_dependencies():
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lock = (CHECKOUT / "environment.txt").read_text(encoding="utf-8")
    pins = dict(re.findall(r"^([\w.-]+)==([\w.]+)", lock, flags=re.MULTILINE))
    wanted = [Requirement(text) for text in project["dependencies"] + project["optional-dependencies"]["dev"]]
    assert [str(item) for item in wanted if not item.specifier.contains(pins.get(item.name, "0"))] == []
    assert project["requires-python"] == ">=" + ".".join(map(str, commands.OLDEST_PYTHON))


def test_lock_names_no_place_to_install_from():
    lock = (CHECKOUT / "environment.txt").read_text(encoding="utf-8")
    assert not re.search(r"--(index-url|extra-index-url|find-links|trusted-host)|file:|://|\s/\w|\s-e ", lock)
    lines = [line for line in lock.splitlines() if line and not line.lstrip().startswith("#")]
    assert [line for line in lines if not re.match(r"[\w.-]+==[\w.]+( ; .+)?$", line)] == []
