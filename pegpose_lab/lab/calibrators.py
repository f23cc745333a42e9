"""The environments of other calibration tools, which the benchmark runs beside ours.

They cannot share `.venv`: calibsense and lensboy need opencv-contrib, which excludes opencv-python-headless, and
mrcal has wheels for Python 3.12 and 3.13 only.  So each has an environment of its own in `.venv`.  Debian's mrcal is
used where it is installed.  Like ``__main__.py``, this file must run on a bare Python.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from . import environment
from .installers import SetUpError, _run_first, _venv_commands

DEBIAN = "mrcal, Debian"
DEBIAN_PYTHON = "/usr/bin/python3"


class Tool(NamedTuple):
    """What pip installs, its further options, and the Python versions that it needs (none: any)."""

    requirements: tuple[str, ...]
    options: tuple[str, ...] = ()
    pythons: tuple[str, ...] = ()


# mrcal with the dependencies that it needs here: pyfltk would have to be compiled, and only draws.
TOOLS = {
    "mrcal": Tool(
        (
            "mrcal==2.5.2.post1",
            "numpysane>=0.45",
            "numpy>=2",
            "packaging>=24",
            "opencv-python-headless>=4.8",
            "scipy>=1.11",
        ),
        ("--no-deps",),
        ("3.12", "3.13"),
    ),
    "calibsense": Tool(("calibsense==0.1.0a1",)),
    "lensboy": Tool(("lensboy==4.0.3",)),
}


def calibrator_python(name: str) -> Path | str | None:
    """Return the Python that has a tool, or None if it is not installed; `name` is of `TOOLS`, or `DEBIAN`."""
    if name == DEBIAN:
        command = [DEBIAN_PYTHON, "-I", "-c", "import mrcal"]
        try:
            return None if subprocess.call(command, stderr=subprocess.DEVNULL) else DEBIAN_PYTHON
        except OSError:
            return None
    return _python(name) if _is_whole(name) else None


def missing(name: str) -> str:
    """Return in words why a tool cannot run, or "" if it can."""
    if calibrator_python(name):
        return ""
    if name == DEBIAN:
        return "Debian's packages mrcal and python3-mrcal are not installed"
    needs = " or ".join(TOOLS[name].pythons)
    return f"{name} is not installed" + (f"; it needs Python {needs}" if needs else "")


def add_calibrators() -> None:
    """Install the tools that are missing; one that cannot be installed is named and left out."""
    for name, tool in TOOLS.items():
        if _is_whole(name):
            continue
        print(f"Installing for the benchmark: {' '.join(tool.requirements)}", flush=True)
        try:
            _install(name, tool)
        except SetUpError as error:
            print(f"{error}\nThe benchmark goes on without it.", file=sys.stderr, flush=True)


def _install(name, tool):
    """Make a tool's environment."""
    folder, base = _folder(name), _base(tool.pythons)
    if base is None:
        raise SetUpError(f"{name} needs Python {' or '.join(tool.pythons)}, which is not found.")
    folder.parent.mkdir(parents=True, exist_ok=True)
    _run_first(_venv_commands(base, folder, True), f"Making {folder}")
    environment._pip_install([*tool.options, *tool.requirements], name, _python(name))
    _stamp(name).write_text("\n".join(tool.requirements), encoding="ascii")


def _base(versions):
    """A Python of one of the versions, this one if any will do; None if there is none."""
    if not versions or ".".join(map(str, sys.version_info[:2])) in versions:
        return getattr(sys, "_base_executable", None) or sys.executable
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))  # its shims refuse versions that are not chosen
    for version in versions:
        for found in (shutil.which(f"python{version}"), *sorted(pyenv.glob(f"versions/{version}.*/bin/python"))):
            if found and not subprocess.call([found, "-c", ""], stderr=subprocess.DEVNULL):
                return found
    return None


def _folder(name):
    return environment.VENV / "calibrators" / name


def _stamp(name):
    """The file that says which requirements are installed there; it is written last."""
    return _folder(name) / "requirements.txt"


def _is_whole(name):
    """Whether a tool is there, in the version of `TOOLS`."""
    stamp = _stamp(name)
    return stamp.is_file() and stamp.read_text(encoding="ascii") == "\n".join(TOOLS[name].requirements)


def _python(name):
    return _folder(name) / environment.python().relative_to(environment.VENV)
