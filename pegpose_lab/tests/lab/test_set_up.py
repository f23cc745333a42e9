"""Set-up: made once, made anew where it is broken, by whatever tool there is."""

import ast
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import nbformat
import pytest
from conftest import data_folder
from nbformat.v4 import new_code_cell, new_notebook, new_output
from packaging.requirements import Requirement

from pegpose_lab import __main__ as commands
from pegpose_lab.lab import environment, front_page, installers, plotting, progress
from pegpose_lab.lab.notebooks import running

CHECKOUT = environment.CHECKOUT


# --- set-up -------------------------------------------------------------------------------------


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout with a lock only."""
    (tmp_path / "environment.txt").write_text("numpy==2.4.6\n")
    monkeypatch.setattr(commands, "CHECKOUT", tmp_path)
    monkeypatch.setattr(environment, "CHECKOUT", tmp_path)
    monkeypatch.setattr(environment, "LOCK", tmp_path / "environment.txt")
    monkeypatch.setattr(environment, "VENV", tmp_path / ".venv")
    return tmp_path


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
    monkeypatch.setattr(
        environment.importlib.util, "find_spec", lambda name: None if name == "ensurepip" else object()
    )
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


# --- a bare Python ------------------------------------------------------------------------------


def test_commands_start_on_a_bare_python():
    code = (
        f"import sys; sys.path.insert(0, {str(CHECKOUT)!r}); import pegpose_lab, pegpose_lab.__main__;"
        "print({name.partition('.')[0] for name in sys.modules} - set(sys.stdlib_module_names))"
    )
    ran = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=True)
    assert ast.literal_eval(ran.stdout) <= {"pegpose_lab", "__main__"}


@pytest.mark.parametrize("module", [
        "__init__", "__main__", "lab/__init__", "lab/environment", "lab/installers", "lab/progress", "lab/notebooks/__init__",
        "lab/notebooks/exploring",
    ])
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


@pytest.mark.parametrize("line", ["reproduce --output", "bench --output"])
def test_output_that_cannot_be_written_is_told_before_the_work(tmp_path, monkeypatch, line):
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    options = commands._parse([*line.split(), str(tmp_path / "new" / "output")])
    with pytest.raises(SystemExit, match=f"and {tmp_path} cannot be written: name another folder"):
        options.run(options)
    assert not (tmp_path / "new").exists()


# --- running notebooks --------------------------------------------------------------------------


WRITE = """import os
from pathlib import Path
folder = Path(os.environ["PEGPOSE_OUTPUT"])
"""


def _notebook(path, *cells):
    path.parent.mkdir(exist_ok=True)
    cells = [new_code_cell(source, id=f"cell-{k}") for k, source in enumerate(cells)]
    nbformat.write(new_notebook(cells=cells), path)
    return path


def _contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def old_output(tmp_path):
    """An output folder with a figure and a table of an earlier run."""
    output = tmp_path / "output"
    for name in ("figures/old.png", "data/results/old.csv"):
        (output / name).parent.mkdir(parents=True)
        (output / name).write_text("old")
    return output


def test_two_runs_leave_the_same_bytes(tmp_path):
    early = _notebook(
        tmp_path / "notebooks" / "06_early.ipynb",
        WRITE + "(folder / 'data/results/early.csv').write_text('x\\n2\\n')",
        "for k in range(3):\n    print(k, flush=True)",
    )
    reader = _notebook(
        tmp_path / "notebooks" / "07_reader.ipynb",
        WRITE + "(folder / 'figures/late.png').write_bytes((folder / 'data/results/early.csv').read_bytes())",
        "import sys\nprint(sys.prefix)",
        "import uuid\nwidget = {'application/vnd.jupyter.widget-view+json': {'model_id': uuid.uuid4().hex}}\n"
        "display(widget | {'text/plain': 'IntSlider()'}, raw=True)",
    )
    stored = []
    for run in ("a", "b"):
        running.reproduce([reader, early], tmp_path / run, update=True)
        stored.append((_contents(tmp_path / "notebooks"), _contents(tmp_path / run)))
    assert stored[0] == stored[1]
    assert stored[0][1] == {"data/results/early.csv": b"x\n2\n", "figures/late.png": b"x\n2\n"}
    executed = nbformat.read(reader, as_version=4)
    assert [cell.execution_count for cell in executed.cells] == [1, 2, 3]
    assert executed.cells[1].outputs[0].text == f"{sys.prefix}\n"
    assert executed.cells[2].outputs[0].data == {"text/plain": "IntSlider()"}
    assert set(executed.metadata) == {"kernelspec", "language_info"}


def test_failing_notebook_is_named_and_leaves_everything_as_it_was(checkout, old_output, capsys):
    writes = WRITE + "(folder / 'figures/old.png').write_text('new')"
    _notebook(checkout / "notebooks" / "01_good.ipynb", writes)
    _notebook(checkout / "notebooks" / "02_bad.ipynb", writes, "radius = 10.1\nassert radius < 10, 'too large'")
    before = _contents(checkout)
    options = commands._parse(["reproduce", "--output", str(old_output), "--update-notebooks"])
    assert commands._reproduce(options) == 1
    message = capsys.readouterr().err
    assert re.search(r"02_bad\.ipynb, code cell 2:", message)
    assert "assert radius < 10, 'too large'" in message
    assert "AssertionError: too large" in message
    assert "\x1b" not in message
    assert _contents(checkout) == before


def test_claims_follow_the_run(checkout, tmp_path_factory, capsys, monkeypatch):
    first_pages = []
    monkeypatch.setattr(front_page, "write", lambda readme, folder: first_pages.append((readme, folder)))
    readme = checkout / "data" / "results" / "README.md"
    readme.parent.mkdir(parents=True)
    readme.write_text("before <!-- claims:begin --><!-- claims:end --> after")
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    assert commands._report(commands._parse(["reproduce", "--output", str(elsewhere)])) == 0
    assert (elsewhere / "data" / "results" / "claims.csv").is_file()
    assert "Table 2" not in readme.read_text()
    table = capsys.readouterr().out
    assert commands._report(commands._parse(["reproduce", "--output", str(checkout)])) == 0
    assert capsys.readouterr().out == table
    assert "Table 2" in table
    assert readme.read_text().startswith("before <!-- claims:begin -->") and "Table 2" in readme.read_text()
    assert first_pages == [(checkout / "README.md", readme.parent)]


def test_kernel_that_dies_is_reported(tmp_path):
    notebook = _notebook(tmp_path / "01_dies.ipynb", "import os\nos._exit(3)")
    with pytest.raises(running.NotebookError, match=r"01_dies\.ipynb, code cell 1: .*[Kk]ernel died"):
        running.reproduce([notebook], tmp_path / "output")
    assert not (tmp_path / "output").exists()


def test_known_results_are_there_to_read(tmp_path):
    known = tmp_path / "known"
    known.mkdir()
    (known / "early.csv").write_text("x\n")
    with running.scratch_output(known) as scratch:
        assert _contents(scratch) == {"data/results/early.csv": b"x\n"}
    assert not scratch.exists()


def test_files_are_moved_only_when_all_are_copied(tmp_path, old_output, monkeypatch):
    with running.scratch_output() as scratch:
        for name in ("figures/old.png", "data/results/old.csv", "data/results/z.csv"):
            (scratch / name).write_text("new")
        copy = shutil.copyfile

        def full_disk(source, target):
            copy(source, target)
            if Path(source).name == "z.csv":
                raise OSError("No space left on device")

        before = _contents(old_output)
        with monkeypatch.context() as patch, pytest.raises(OSError, match="No space"):
            patch.setattr(shutil, "copyfile", full_disk)
            running._publish(scratch, old_output)
        assert _contents(old_output) == before
        running._publish(scratch, old_output)
        assert set(_contents(old_output).values()) == {b"new"}


def test_what_says_the_same_is_not_rewritten(tmp_path):
    output = tmp_path / "output"
    stored = {"data/results/a.csv": "f\n1.25\n", "data/results/b.csv": "f\n1.25\n", "figures/fig.pdf": "old"}
    fresh = {"data/results/a.csv": "f\n1.26\n", "data/results/b.csv": "f\n1.27\n", "data/results/c.csv": "f\n1.25\n"}
    with running.scratch_output() as scratch:
        for folder, files in ((output, stored), (scratch, fresh)):
            for name, text in files.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_text(text)
        for folder in (output, scratch):
            fig, _ = plotting.figure(1, 1)
            fig.savefig(folder / "figures" / "fig.png", metadata={"Description": "same"})
        (scratch / "figures" / "fig.pdf").write_text("new")  # other bytes, but the figure of that name agrees
        assert running.changed_files(scratch, output) == [Path("data/results/b.csv"), Path("data/results/c.csv")]
        running._publish(scratch, output)
        assert (output / "data/results/a.csv").read_text() == stored["data/results/a.csv"]
        assert (output / "data/results/b.csv").read_text() == fresh["data/results/b.csv"]
        assert (output / "figures/fig.pdf").read_text() == "old"
        running._publish(scratch, output, all_files=True)
        assert (output / "data/results/a.csv").read_text() == fresh["data/results/a.csv"]
        assert (output / "figures/fig.pdf").read_text() == "new"


@pytest.mark.skipif(os.name == "nt", reason="signals of this kind do not exist on Windows")
def test_interrupted_run_leaves_everything_as_it_was(tmp_path, old_output):
    before = _contents(old_output)
    numbers = (signal.SIGINT, signal.SIGTERM)
    runs = {number: _start_slow_run(tmp_path / number.name, old_output) for number in numbers}
    for number, run in runs.items():
        kernel = tmp_path / number.name / "kernel"
        _wait(kernel.exists)
        pid = int(kernel.read_text())
        run.send_signal(number)
        message, _ = run.communicate(timeout=60)
        assert run.returncode == 128 + number, message
        assert _contents(old_output) == before
        assert not list((tmp_path / number.name / "scratch").glob("pegpose_*"))
        assert not _is_alive(pid)


def _start_slow_run(checkout, output):
    """Start to reproduce a notebook that writes half a picture and then takes its time."""
    (checkout / "scratch").mkdir(parents=True)
    _notebook(
        checkout / "notebooks" / "01_slow.ipynb",
        WRITE + "(folder / 'figures/old.png').write_text('half a pict')",
        f"started = Path({str(checkout)!r}, 'started')\nstarted.write_text(str(os.getpid()))\n"
        "started.rename(started.with_name('kernel'))",
        "import time\ntime.sleep(100)",
    )
    return _start(checkout, ["reproduce", "--output", str(output)], TMPDIR=str(checkout / "scratch"))


def _start(checkout, arguments, **variables):
    """Start a command in a process of its own, on a checkout that needs no set-up.

    A shell's background job ignores Ctrl-C, and so do its children: the command is given Python's own handler.
    """
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import sys; from pathlib import Path; from pegpose_lab import __main__ as commands; from pegpose_lab.lab import environment\n"
        "environment.set_up, environment.VENV = bool, Path(sys.prefix)\n"
        f"commands.CHECKOUT = Path({str(checkout)!r})\n"
        f"sys.exit(commands.main({arguments!r}))"
    )
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=CHECKOUT,
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def _wait(condition, patience=60.0):
    """Wait until something has happened; fail if it never does."""
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def _is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


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


@pytest.mark.parametrize("variables", [{"CI": "true"}, {"CI": "true", "PEGPOSE_DATA": ""}])
def test_missing_data_fail_on_ci(variables):
    with pytest.raises(pytest.fail.Exception, match="never skipped"):
        data_folder(variables)


def test_missing_data_skip_elsewhere(tmp_path):
    with pytest.raises(pytest.skip.Exception, match="PEGPOSE_DATA"):
        data_folder({})
    with pytest.raises(pytest.fail.Exception, match="no folder"):
        data_folder({"PEGPOSE_DATA": str(tmp_path / "nowhere")})
    assert data_folder({"PEGPOSE_DATA": str(tmp_path)}) == tmp_path


def test_notebooks_under_test_do_not_write_into_the_checkout():
    output = Path(os.environ["PEGPOSE_OUTPUT"])
    assert (output / "figures").is_dir()
    assert CHECKOUT not in (output, *output.parents)
