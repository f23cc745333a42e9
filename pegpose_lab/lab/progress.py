"""Progress of an installation: counts the packages in the output of pip or uv and shows them in one line.

Like `environment`, this file must run on a bare Python, so it imports only the standard library.
"""

from __future__ import annotations

import re
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

INTERVAL = 10.0  # s between two lines if a line cannot be overwritten
LAST_LINES = 20  # of the installer's output, shown if it fails

_FETCHED = re.compile(r"\s*(?:Collecting|Processing|Requirement already satisfied:|Downloaded|Built) ")
_PREPARED = re.compile(r"Prepared (\d+) packages? ")
_RESOLVED = re.compile(r"Resolved (\d+) packages? ")


class Count:
    """Number of packages fetched and their total, from the output of pip or uv."""

    def __init__(self, total):
        self.total = total  # pins of all systems; the installer tells how many apply to this one
        self.fetched = 0

    def read(self, line: str) -> None:
        """Read one line of output."""
        resolved, prepared = _RESOLVED.match(line), _PREPARED.match(line)
        if resolved:
            self.total = int(resolved.group(1))
        elif prepared:
            self.fetched = int(prepared.group(1))
        elif line.startswith("Ignoring "):
            self.total -= 1
        elif _FETCHED.match(line):
            self.fetched = min(self.fetched + 1, self.total)


def run(command: list[str | Path], folder: Path, total: int) -> int:
    """Run an installer, show how many packages it has fetched and installed, and return its exit code.

    Parameters
    ----------
    command : list
    folder : Path
        Folder for the packages; an installed one has a ``.dist-info`` there.
    total : int
        Number of packages to install.
    """
    count, lines = Count(total), []
    before = _installed(folder)
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
    )
    with process:
        done = threading.Event()
        shower = threading.Thread(target=_show, args=(count, folder, before, done), daemon=True)
        shower.start()
        try:
            for line in process.stdout:
                lines.append(line)
                count.read(line)
        except BaseException:
            process.kill()
            raise
        finally:
            done.set()
            shower.join()
    if process.returncode:
        print("".join(lines[-LAST_LINES:]), file=sys.stderr, flush=True)
    return process.returncode


def _show(count, folder, before, done):
    """Show the count until `done` is set: in one line on a terminal, otherwise in a new line every `INTERVAL`."""
    terminal, start = sys.stdout.isatty(), time.monotonic()
    while not done.wait(0.5 if terminal else INTERVAL):
        installed, seconds = max(0, _installed(folder) - before), time.monotonic() - start
        text = f"  {count.fetched} of {count.total} packages fetched, {installed} installed, {seconds:.0f} s"
        print(f"\r{text}" if terminal else text, end="" if terminal else "\n", flush=True)
    if terminal:
        print("\r\x1b[K", end="", flush=True)


def _installed(folder):
    """Number of packages in a folder."""
    return sum(1 for _ in folder.glob("*.dist-info"))
