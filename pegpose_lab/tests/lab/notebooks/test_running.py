"""Running notebooks: the same bytes twice, nothing half done."""

import os
import re
import shutil
import signal
import sys
import time
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from pegpose_lab import __main__ as commands
from pegpose_lab.lab import animation, front_page, page, plotting
from pegpose_lab.lab.notebooks import running
from pegpose_lab.tests.commands import WRITE, _start


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
    monkeypatch.setattr(page, "write_page", first_pages.append)
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
    assert first_pages == [(checkout / "README.md", readme.parent), checkout]


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


@pytest.mark.parametrize("all_files", [False, True])
def test_an_animation_that_looks_the_same_is_not_rewritten(tmp_path, monkeypatch, all_files):
    """Also when the notebooks are stored anew: they do not contain it."""
    output = tmp_path / "output"

    def save(folder, name, grey):
        monkeypatch.setenv("PEGPOSE_OUTPUT", str(folder))
        picture = np.full((9, 9, 3), 94, np.uint8)
        picture[:, ::4] = grey  # 94 and 95 get neighbouring greys of the palette
        animation.save_animation([picture], name, "grey", duration=100)

    with running.scratch_output() as scratch:
        for name, before, after in (("same", 94, 95), ("other", 94, 190)):
            save(output, name, before)
            save(scratch, name, after)
        save(scratch, "new", 90)
        old = _contents(output)
        fresh = _contents(scratch)
        running._publish(scratch, output, all_files=all_files)
        assert running.changed_files(scratch, output) == []
    now = _contents(output)
    assert now["figures/same.gif"] == old["figures/same.gif"] != fresh["figures/same.gif"]
    assert all(now[f"figures/{name}.gif"] == fresh[f"figures/{name}.gif"] for name in ("other", "new"))
