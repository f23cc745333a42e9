"""Emulated processors: they really are other processors, and what differs there is told."""

import os
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

from pegpose_lab.lab.environment import CHECKOUT
from pegpose_lab.lab.notebooks import processors
from pegpose_lab.lab.notebooks.processors import Machine, Outcome


def _ask(machine, code):
    """What a Python on an emulated machine prints."""
    environment = os.environ | machine.variables
    return subprocess.check_output([machine.python, "-c", code], text=True, env=environment, cwd=CHECKOUT).strip()


@pytest.fixture(scope="module")
def machines():
    return {machine.name: machine for machine in processors.emulated_machines()}


def test_at_least_five_machines(machines):
    assert {"Haswell", "Sandybridge", "Nehalem", "numpy baseline", "OpenCV baseline", "two threads"} <= set(machines)


@pytest.mark.parametrize("name", ["numpy baseline", processors.OTHER])
def test_numpy_does_without_its_vector_units(machines, name):
    code = (
        "import warnings; warnings.simplefilter('error')\n"
        "from numpy._core._multiarray_umath import __cpu_dispatch__ as d, __cpu_features__ as f\n"
        "print([name for name in d if f[name]])"
    )
    assert _ask(machines[name], code) == "[]"


@pytest.mark.parametrize("name", ["OpenCV baseline", processors.OTHER])
def test_opencv_does_without_its_vector_units(machines, name):
    code = "import cv2; print([n for n in cv2.getCPUFeaturesLine().split() if n[0] == '*' and n[-1] != '?'], cv2.ipp.useIPP())"
    assert _ask(machines[name], code) == "[] False"


@pytest.mark.parametrize("name", ["Haswell", "Sandybridge", "Nehalem"])
def test_openblas_takes_the_kernels_of_that_machine(machines, name):
    code = (
        "import ctypes, glob, os, numpy\n"
        "folder = os.path.join(os.path.dirname(os.path.dirname(numpy.__file__)), 'numpy.libs')\n"
        "library = ctypes.CDLL(glob.glob(os.path.join(folder, 'libscipy_openblas*'))[0])\n"
        "corename = library.scipy_openblas_get_corename64_\n"
        "corename.restype = ctypes.c_char_p\n"
        "print(corename().decode())"
    )
    assert _ask(machines[name], code) == name


# ---- names ----


@pytest.fixture
def pythons(monkeypatch):
    """Python 9.8, which is installed, and 9.9, which is not."""
    places = {"9.8": Path("there", "python")}
    monkeypatch.setattr(processors, "PYTHONS", ("9.8", "9.9"))
    monkeypatch.setattr(processors.environment, "python_of_version", places.get)


def test_emulated_machines_and_pythons_are_chosen_by_name(pythons):
    chosen = processors.choose_machines(["Python 9.8", "two threads"])
    assert [machine.name for machine in chosen] == ["Python 9.8", "two threads"]
    assert chosen[0].python == str(Path("there", "python"))


@pytest.mark.parametrize(
    ("name", "words"),
    [("Python 9.9", "Python 9.9 is not installed"), ("Python 9.7", "there are: .*Nehalem, Python 9.8, Python 9.9")],
)
def test_a_name_without_a_machine_is_refused(pythons, name, words):
    with pytest.raises(SystemExit, match=words):
        processors.choose_machines([name])


def test_all_machines_without_a_name(machines, monkeypatch):
    python = Machine("Python 9.8", {}, "there")
    monkeypatch.setattr(processors, "other_pythons", lambda: [python])
    assert [machine.name for machine in processors.choose_machines()] == [*machines, "Python 9.8"]


# ---- a run ----


CELL = """\
import os
from pathlib import Path
folder = Path(os.environ["PEGPOSE_OUTPUT"])
(folder / "data/results/a.csv").write_text(os.environ["VALUE"] + "\\n")
print(float(os.environ["VALUE"]), "mm")
"""


@pytest.fixture
def checkout(tmp_path):
    """A checkout with one notebook, which prints and saves 1.25."""
    cell = new_code_cell(CELL, id="cell", execution_count=1)
    cell.outputs = [new_output("stream", name="stdout", text="1.25 mm\n")]
    for name, text in {
        "data/results/a.csv": "1.25\n",
        "pyproject.toml": '[tool.pytest.ini_options]\ntestpaths = ["notebooks"]\n'
        'addopts = ["-p", "pegpose_lab.lab.notebooks.testing"]\n',
        "notebooks/01_one.ipynb": nbformat.writes(new_notebook(cells=[cell])),
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("value", "failed", "changed"), [("1.25", 0, []), ("1.26", 0, []), ("1.27", 1, ["data/results/a.csv"])]
)
def test_a_run_tells_what_differs(checkout, value, failed, changed):
    machine = Machine("other", {"VALUE": value, "PYTHONPATH": str(CHECKOUT)}, sys.executable)
    outcome = processors.run_on(machine, checkout, ["--nbval", "--nbval-current-env"])
    assert (outcome.failed, outcome.changed) == ({"01_one": failed}, changed)
    assert outcome.passed == (not failed) and outcome.seconds > 0


def test_a_run_of_nothing_does_not_pass(checkout):
    machine = Machine("other", {"PYTHONPATH": str(CHECKOUT)}, sys.executable)
    assert not processors.run_on(machine, checkout, ["--nbval", "-k", "nothing"]).passed


def test_table():
    outcomes = [
        Outcome("Haswell", {"01_one": 0, "tests": 0}, [], 61.2),
        Outcome("Nehalem", {"01_one": 2}, ["data/results/a.csv"], 70.0),
    ]
    assert processors.table(outcomes).splitlines() == [
        "machine  01        tests    rewritten  processor s",
        "Haswell  passed    passed   0          61",
        "Nehalem  2 failed  not run  1          70",
    ]
