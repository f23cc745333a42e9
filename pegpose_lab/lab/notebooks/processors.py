"""Runs the notebooks as on other processors, to check that their results do not change.

OpenBLAS (linear algebra), numpy and OpenCV choose their code according to the processor, and each choice adds in
another order.  All three can be set to behave as on another machine; the number of threads and the Python version can
be changed, too.  ``python3 -m pegpose_lab test --processors`` runs every notebook and the tests marked ``digits`` on
each of these machines, and lists the files that ``reproduce`` would rewrite there.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ...files import results_folder
from .. import environment
from . import running

if TYPE_CHECKING:
    from collections.abc import Sequence

PYTHONS = ("3.11", "3.12", "3.13")
"""Versions of Python that the project supports."""

OTHER = "Nehalem"
"""The machine for a quick check: all three libraries use the vector units of 2008, unlike any machine in use now."""


@dataclass(frozen=True)
class Machine:
    """A machine to run on: the variables that emulate it, and the Python that runs there."""

    name: str
    variables: dict = field(default_factory=dict)
    python: str = sys.executable


@dataclass(frozen=True)
class Outcome:
    """The result of a run on one machine.

    Attributes
    ----------
    machine : str
    failed : dict
        Number of failed cells of each notebook, and of failed tests under "tests"; 0 if all passed.
    changed : list of str
        Results and figures that ``reproduce`` would rewrite.
    seconds : float
        Processor time.
    """

    machine: str
    failed: dict
    changed: list
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether something ran, nothing failed and nothing would be rewritten."""
        return bool(self.failed) and not any(self.failed.values()) and not self.changed


def emulated_machines() -> list[Machine]:
    """Return the machines that can be emulated on this one, as a list of `Machine`."""
    numpy_off = {"NPY_DISABLE_CPU_FEATURES": " ".join(_numpy_features())}
    opencv_off = {"OPENCV_CPU_DISABLE": ",".join(_opencv_features()), "OPENCV_IPP": "disabled"}
    cores = [name for name in ("SkylakeX", "Haswell", "Sandybridge") if name != "SkylakeX" or _has_avx512()]
    return [
        *(Machine(name, {"OPENBLAS_CORETYPE": name}) for name in cores),
        Machine("numpy baseline", numpy_off),
        Machine("OpenCV baseline", opencv_off),
        Machine("two threads", {"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2", "MKL_NUM_THREADS": "2"}),
        Machine(OTHER, {"OPENBLAS_CORETYPE": "Nehalem"} | numpy_off | opencv_off),
    ]


def other_pythons(versions: Sequence[str] = PYTHONS) -> list[Machine]:
    """Return a `Machine` for each other version of Python that is installed; its environment is made if necessary."""
    found = {version: environment.python_of_version(version) for version in versions if version != _own_version()}
    here = {"PYTHONPATH": str(environment.CHECKOUT)}  # their kernels find the package there
    return [Machine(f"Python {version}", here, str(python)) for version, python in found.items() if python]


def _own_version():
    return f"{sys.version_info[0]}.{sys.version_info[1]}"


def choose_machines(names: Sequence[str] = ()) -> list[Machine]:
    """Return the machines with these names, emulated ones or other Pythons; without names, all of them.

    Raises
    ------
    SystemExit
        If a name is unknown, or its Python is not installed.
    """
    emulated = {machine.name: machine for machine in emulated_machines()}
    if not names:
        return [*emulated.values(), *other_pythons()]
    pythons = {f"Python {version}": version for version in PYTHONS if version != _own_version()}
    unknown = sorted(set(names) - set(emulated) - set(pythons))
    if unknown:
        raise SystemExit(f"No machine is called {', '.join(unknown)}; there are: {', '.join([*emulated, *pythons])}.")
    found = emulated | {machine.name: machine for machine in other_pythons([pythons[n] for n in names if n in pythons])}
    missing = [name for name in names if name not in found]
    if missing:
        raise SystemExit(f"{', '.join(missing)} is not installed here.")
    return [found[name] for name in names]


def _numpy_features():
    """The vector units of this processor for which numpy has special code."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return [name for name in __cpu_dispatch__ if __cpu_features__[name]]


def _opencv_features():
    """The same for OpenCV, which marks optional units by an asterisk and those that the processor lacks by "?"."""
    import cv2

    names = [name for name in cv2.getCPUFeaturesLine().split() if name.startswith("*") and not name.endswith("?")]
    return [name.lstrip("*") for name in names]


def _has_avx512():
    from numpy._core._multiarray_umath import __cpu_features__

    return __cpu_features__.get("AVX512_SKX", False) or __cpu_features__.get("X86_V4", False)


def run_on(machine: Machine, checkout: Path, pytest_arguments: Sequence[str]) -> Outcome:
    """Run the notebooks and the tests of digits on a machine; return the `Outcome`.

    Parameters
    ----------
    machine : Machine
    checkout : Path
        Folder in which pytest runs; it has the results and figures to compare with.
    pytest_arguments : list of str
        Arguments that run and compare the notebooks, as for the plain test.
    """
    with (
        running.scratch_output(results_folder(checkout)) as output,
        tempfile.TemporaryDirectory(prefix="pegpose_") as folder,
    ):
        report = Path(folder, "report.xml")
        variables = running.output_variables(output) | machine.variables
        command = [machine.python, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}"]
        command += ["-m", "digits", *pytest_arguments]
        before = _children_seconds()
        subprocess.call(command, cwd=checkout, env=os.environ | variables)
        seconds = _children_seconds() - before
        failed = _failures(report) if report.is_file() else {}
        changed = [str(path) for path in running.changed_files(output, checkout)]
    return Outcome(machine.name, failed, changed, seconds)


def _children_seconds():
    """Processor time of all finished child processes, s."""
    times = os.times()
    return times.children_user + times.children_system


def _failures(report):
    """Failed cells of each notebook, and failed tests, from pytest's report."""
    failed = {}
    for case in ElementTree.parse(report).iter("testcase"):
        key = next((part for part in case.get("classname").split(".") if part[:2].isdigit()), "tests")
        failed[key] = failed.get(key, 0) + any(case.find(kind) is not None for kind in ("failure", "error"))
    return failed


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the outcomes as text, with a row for each machine and a column for each notebook."""
    columns = sorted({name for outcome in outcomes for name in outcome.failed})
    head = ["machine", *(name[:2] if name[0].isdigit() else name for name in columns), "rewritten", "processor s"]
    rows = [head]
    for outcome in outcomes:
        cells = [_cell(outcome.failed.get(name)) for name in columns]
        rows.append([outcome.machine, *cells, str(len(outcome.changed)), f"{outcome.seconds:.0f}"])
    widths = [max(len(row[column]) for row in rows) for column in range(len(head))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def _cell(failures):
    """One entry of the table."""
    return "not run" if failures is None else f"{failures} failed" if failures else "passed"
