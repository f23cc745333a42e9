"""Makes the environment for all commands: ``.venv`` in the checkout, from ``environment.txt``.

Like ``__main__.py``, this file must run on a bare Python, so it imports only the standard library.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
from contextlib import contextmanager
from pathlib import Path

from ..files import PROJECT_FOLDER as CHECKOUT
from . import progress
from .installers import SetUpError, _has_package, _run_first, _venv_commands

LOCK = CHECKOUT / "environment.txt"
VENV = CHECKOUT / ".venv"
STAMP_NAME = "pegpose_lab.json"

# Measured on Linux with two cores and a local mirror: the times are those of the installers, without the network's.
FETCHED_MB, INSTALLED_MB = 200, 800
SECONDS = {"uv": 5, "pip": 90}


def set_up() -> bool:
    """Make `.venv` or bring it up to date; return whether there was anything to do.

    A stamp in the folder tells for which lock file, Python and checkout it was made.  The stamp is emptied before
    the first change and written after the last one, so an interrupted set-up is never taken for a complete one, and
    the next set-up starts again from the beginning.

    Raises
    ------
    SetUpError
        If the environment cannot be made; an uncaught SetUpError ends the program with its message.
    """
    with _file_errors_in_words():
        return _set_up()


@contextmanager
def _file_errors_in_words():
    """Turn file errors (a folder cannot be written, a disk is full, a file is in the way) into one sentence."""
    try:
        yield
    except OSError as error:
        place = f" ({error.filename})" if error.filename else ""
        raise SetUpError(
            f"Set-up needs to write the folder {VENV}, and cannot: {error.strerror or error}{place}. "
            "Fix that, or copy the project to where you can write, and run this command again."
        ) from error


def _set_up():
    """Do the work of `set_up`; errors of the file system are not handled here."""
    if VENV.exists() and not VENV.is_dir():
        raise SetUpError(f"{VENV} is a file where set-up makes a folder. Move it away, then run this command again.")
    wanted, found = _wanted_stamp(), _read_stamp()
    if found == wanted and _is_whole():
        return False
    update = VENV.exists() and _can_update(found, wanted)
    if VENV.exists() and not update:
        _remove()
    start = time.monotonic()
    _write_stamp({})
    _announce()
    try:
        if not update:
            _make_venv()
        _install()
        _write_path_file()
    except BaseException as error:
        if not update:
            _remove()
        elif isinstance(error, SetUpError):  # the installers change nothing before they have all files
            _write_stamp(found)
        raise
    _write_stamp(wanted)
    print(f"Set-up done in {time.monotonic() - start:.0f} s.", flush=True)
    return True


def _announce():
    """Print what will be fetched, and how long that typically takes."""
    tool = "uv" if shutil.which("uv") else "pip"
    print(
        f"Setting up {VENV} from {LOCK.name} with {tool}: {_pin_count()} packages, {FETCHED_MB} MB to fetch, "
        f"up to {INSTALLED_MB} MB on disk. Typical: {SECONDS[tool]} s, and the time that the network needs.",
        flush=True,
    )


def _pin_count():
    """Number of packages that the lock file pins, for all systems together."""
    return len(re.findall(r"^[\w.-]+==", LOCK.read_text(encoding="utf-8"), re.MULTILINE))


def python() -> Path:
    """The Python of `.venv`."""
    return VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def contrib_folder() -> Path:
    """The folder with opencv-contrib, which cannot share an environment with OpenCV."""
    return VENV / "contrib"


def is_active() -> bool:
    """Whether this process runs in `.venv`."""
    return Path(sys.prefix).resolve() == VENV.resolve()


def _wanted_stamp():
    """The stamp of a current environment: lock file, Python version, checkout."""
    try:
        lock = LOCK.read_bytes()
    except FileNotFoundError:
        raise SetUpError(f"{LOCK} is missing: run this command from a checkout of the project.") from None
    return {
        "lock": hashlib.sha256(lock).hexdigest(),
        "python": sys.implementation.cache_tag,
        "checkout": os.fsencode(CHECKOUT).decode("utf-8", "surrogateescape"),  # the same in every locale
    }


def _read_stamp():
    """The stamp of `.venv`; None if there is none, empty after an interrupted set-up."""
    try:
        return json.loads((VENV / STAMP_NAME).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except ValueError:
        return {}


def _write_stamp(stamp):
    """Replace the stamp in one step; None removes it."""
    VENV.mkdir(exist_ok=True)
    target = VENV / STAMP_NAME
    if stamp is None:
        target.unlink(missing_ok=True)
        return
    part = target.with_suffix(".part")
    part.write_text(json.dumps(stamp), encoding="utf-8")
    os.replace(part, target)


def _can_update(found, wanted):
    """Whether it is enough to install into `.venv`: it is complete, for this Python version, and made here."""
    if found is not None:
        return _is_whole() and {**found, "lock": wanted["lock"]} == wanted
    if _venv_tag() == wanted["python"]:
        return True
    raise SetUpError(
        f"{VENV} was not made by this command and has no working Python {sys.version_info[0]}."
        f"{sys.version_info[1]}. Move it away or delete it, then run this command again."
    )


def _venv_tag():
    """The Python version in a `.venv` of unknown origin; None if it does not run or lacks pip."""
    code = "import pip, sys; print(sys.implementation.cache_tag)"
    try:
        return subprocess.check_output([python(), "-c", code], stderr=subprocess.DEVNULL, text=True).strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def _is_whole():
    return python().exists() and (VENV / "pyvenv.cfg").exists()


def _remove():
    """Delete `.venv`, with the emptied stamp last, so that the rest is recognised as incomplete after an interrupt."""
    _write_stamp({})
    for path in VENV.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name != STAMP_NAME:
            path.unlink()
    shutil.rmtree(VENV)


def _make_venv():
    """Make an empty `.venv` with pip, with the first tool that is found and works."""
    base = getattr(sys, "_base_executable", None) or sys.executable
    has_venv = importlib.util.find_spec("venv") and importlib.util.find_spec("ensurepip")
    commands = _venv_commands(base, VENV, has_venv)
    if not commands:
        version = ".".join(map(str, sys.version_info[:2]))
        raise SetUpError(
            "This Python cannot make virtual environments: its module 'venv' or 'ensurepip' is missing.\n"
            f"On Debian or Ubuntu install it with  sudo apt install python{version}-venv  (or python3-venv),\n"
            "elsewhere install uv (https://docs.astral.sh/uv) or virtualenv. Then run this command again."
        )
    _run_first(commands, f"Making {VENV}")


def _install():
    """Install the lock file's packages and show the progress."""

    def run(command):
        return progress.run(command, _site_packages(), _pin_count())

    _run_first(_install_commands("-r", LOCK), f"Installing {LOCK.name}", run)


def _pip_install(arguments, name, python_there=None):
    """Install into `.venv`, or for another Python, without output."""
    _run_first(_install_commands("--quiet", *arguments, python_there=python_there), f"Installing {name}")


def _install_commands(*arguments, python_there=None):
    """The commands that install into `.venv`, or for another Python: with uv if it is found, and with pip."""
    uv, target = shutil.which("uv"), python_there or python()
    commands = [[target, "-m", "pip", "install", "--disable-pip-version-check", "--no-input", *arguments]]
    if uv:
        commands.insert(0, [uv, "pip", "install", "--python", target, *arguments])
    return commands


def python_of_version(version: str) -> Path | None:
    """Return the Python of an environment like `.venv` for another Python version; None if that is not installed.

    The environment is a folder in `.venv`.  It is made on first use, and again when the lock file changes.
    """
    base = shutil.which(f"python{version}")
    folder = VENV / f"python{version}"
    own = folder / python().relative_to(VENV)
    if base is None or subprocess.call([base, "-c", ""], stderr=subprocess.DEVNULL):
        return None
    stamp, lock = folder / "lock.sha256", _wanted_stamp()["lock"]
    if not stamp.is_file() or stamp.read_text(encoding="ascii") != lock:
        print(f"Setting up {folder} ...", flush=True)
        _run_first(_venv_commands(base, folder, True), f"Making {folder}")
        _pip_install(["-r", LOCK], f"{LOCK.name} for Python {version}", own)
        stamp.write_text(lock, encoding="ascii")
    return own


def add_bench_packages() -> None:
    """Add the packages of the optional group `bench` to `.venv`, and opencv-contrib to a folder in it.

    Their dependencies stay at the versions that the lock file pins.  A package that cannot be installed (no network)
    is named and left out.
    """
    lock = LOCK.read_text(encoding="utf-8")
    opencv = re.search(r"^opencv-python-headless==(\S+)", lock, re.MULTILINE).group(1)
    wanted = [line for line in _bench_group() if not _has_package(line)]
    if wanted:
        _try_to_install(["-c", LOCK, *wanted])
    if not (contrib_folder() / "cv2").is_dir():
        _try_to_install(["--no-deps", "--target", contrib_folder(), f"opencv-contrib-python-headless=={opencv}"])


def _bench_group():
    """The requirements of the optional group `bench` in pyproject.toml."""
    import tomllib  # since Python 3.11; older versions were refused before

    with open(CHECKOUT / "pyproject.toml", "rb") as file:
        return tomllib.load(file)["project"]["optional-dependencies"]["bench"]


def _try_to_install(arguments):
    """Install into `.venv`; print a message if that fails."""
    names = " ".join(str(argument) for argument in arguments)
    print(f"Installing for the benchmark: {names}", flush=True)
    try:
        _pip_install(arguments, names)
    except SetUpError as error:
        print(f"{error}\nThe benchmark goes on without it.", file=sys.stderr, flush=True)


def _site_packages():
    """The folder of `.venv` for packages."""
    return Path(sysconfig.get_path("purelib", "venv", {"base": str(VENV), "platbase": str(VENV)}))


def _write_path_file():
    """Make the checkout importable from every folder, also in kernels.

    Python reads this file in the locale's encoding (3.11, 3.12) and strips blanks.  So the path in it is relative: it
    is ASCII and ends in a dot, whatever the name of the checkout's folder is.
    """
    packages = _site_packages()
    way_up = os.path.relpath(CHECKOUT, packages).replace(os.sep, "/")
    (packages / "pegpose_lab.pth").write_text(f"{way_up}\n", encoding="ascii")
