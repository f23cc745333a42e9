"""Opens the notebooks in JupyterLab, so that running and saving them does not change the project's results.

Notebooks write to a scratch folder, nothing is saved automatically, and a saved notebook is stored without the data
of its session (`running.clean_before_save`).  A changed notebook can be restored from git.

Like ``__main__.py``, this file must run on a bare Python, so it imports only the standard library.
"""

from __future__ import annotations

import fnmatch
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from ...files import results_folder
from ..environment import CHECKOUT

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

Named = TypeVar("Named", str, Path)
SETTINGS = Path(__file__).with_name("lab_settings")
"""JupyterLab's settings for users without their own: no autosave, no pop-up that asks for news."""

SCRATCH = ("notebooks", "scratch")
WRITTEN = ("figures", "data/results")  # folders that notebooks write, below PEGPOSE_OUTPUT


def scratch_folder(checkout: Path = CHECKOUT) -> Path:
    """Return a folder for the notebooks' output, with fresh copies of the known results and no figures.

    It is ``notebooks/scratch``, which git ignores and which is kept until the next start.  If the checkout cannot be
    written, it is a temporary folder.
    """
    folder = Path(checkout, *SCRATCH)
    try:
        folder.mkdir(exist_ok=True)
        fill(folder, results_folder(checkout), "*.csv")
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="pegpose_lab_"))
        fill(folder, results_folder(checkout), "*.csv")
    return folder


def fill(folder: Path, known_results: Path | None, known: str = "*") -> None:
    """Make the two folders below `folder` anew, with copies of the known results that match a pattern.

    Old files are removed, because they would be taken for the notebooks' results.
    """
    for name in WRITTEN:
        shutil.rmtree(folder / name, ignore_errors=True)
        (folder / name).mkdir(parents=True, exist_ok=True)
    for path in known_results.glob(known) if known_results else ():
        shutil.copyfile(path, results_folder(folder) / path.name)


def jupyterlab_arguments(options: argparse.Namespace, checkout: Path = CHECKOUT) -> list[str]:
    """The command line of JupyterLab from the options of ``lab``; arguments after ``--`` come last, so they win."""
    arguments = [
        f"--ServerApp.root_dir={checkout}",
        "--LabApp.default_url=/lab/tree/notebooks/00_start_here.ipynb",
        f"--LabApp.app_settings_dir={SETTINGS}",
        "--ContentsManager.pre_save_hook=pegpose_lab.lab.notebooks.running.clean_before_save",
    ]
    given = {"no-browser": options.no_browser, "allow-root": options.allow_root}
    arguments += [f"--{name}" for name, wanted in given.items() if wanted]
    arguments += [
        f"--{name}={value}" for name, value in (("ip", options.ip), ("port", options.port)) if value is not None
    ]
    return arguments + options.extra


def root_refused(options: argparse.Namespace) -> bool:
    """Return whether JupyterLab would refuse to start because root runs it without ``--allow-root``."""
    is_root = getattr(os, "geteuid", lambda: 1)() == 0
    return is_root and not options.allow_root and "--allow-root" not in options.extra


def restore(patterns: Sequence[str], checkout: Path = CHECKOUT) -> list[str]:
    """Restore notebooks from git's last commit; return the names of those that were changed.

    Parameters
    ----------
    patterns : list of str
        Names, beginnings of names (``03``) or patterns; they also match a deleted notebook.
    checkout : Path

    Raises
    ------
    SystemExit
        If git is missing, the checkout is not a git repository, or no notebook has such a name; then nothing changes.
    """
    known = _git(checkout, "ls-tree", "-z", "--name-only", "HEAD", "notebooks/").split("\0")
    paths = set()
    for pattern in patterns:
        paths |= set(choose([path for path in known if path.endswith(".ipynb")], pattern))
    changed = _git(checkout, "diff", "-z", "--name-only", "HEAD", "--relative", "--", *sorted(paths)).split("\0")
    changed = sorted(path for path in changed if path)
    if changed:
        _git(checkout, "checkout", "HEAD", "--", *changed)
    return changed


def choose(notebooks: Sequence[Named], pattern: str) -> list[Named]:
    """The paths of notebooks whose names begin with a pattern; SystemExit with all names if there is none."""
    found = [path for path in notebooks if fnmatch.fnmatch(Path(path).stem, Path(pattern).stem + "*")]
    if not found:
        names = ", ".join(Path(path).stem for path in notebooks)
        raise SystemExit(f"No notebook's name begins with {pattern!r}; there are: {names or 'none'}.")
    return found


def _git(checkout, *arguments):
    """The output of a git command in the checkout."""
    if not shutil.which("git"):
        raise SystemExit(
            "Notebooks are restored from git, and git is not installed: install it, or unpack the project anew."
        )
    run = subprocess.run(["git", "-C", str(checkout), *arguments], capture_output=True)
    if run.returncode:
        said = os.fsdecode(run.stderr).strip()
        raise SystemExit(f"Notebooks are restored from git, and {checkout} is not in order for it: git says {said!r}.")
    return os.fsdecode(run.stdout)
