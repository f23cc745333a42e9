"""The folders of the project, and writing files so that they are replaced completely or not at all."""

from __future__ import annotations

import os
import secrets
import stat
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

PROJECT_FOLDER = Path(__file__).resolve().parents[1]
PAPER_FOLDER = PROJECT_FOLDER / "data" / "paper"
MEASURED_FOLDER = PROJECT_FOLDER / "data" / "measured"


def output_folder() -> Path:
    """The folder in which figures/ and data/results/ are written."""
    return Path(os.environ.get("PEGPOSE_OUTPUT") or PROJECT_FOLDER)


def results_folder(root: Path | None = None) -> Path:
    """The folder of the tables and values that notebooks write and read, in `root` (default: `output_folder`)."""
    return (root or output_folder()) / "data" / "results"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` if the block succeeds, else remove it.

    The result is as with a plain `open`: a symbolic link still points to the replaced file, an existing file keeps
    its mode and owner, and a new file gets the mode that the umask gives.
    """
    path = Path(os.path.realpath(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    before = path.stat() if path.exists() else None
    part = _new_file_beside(path, stat.S_IMODE(before.st_mode) if before else 0o666)
    try:
        yield part
        if before:
            _give_back(part, before)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _new_file_beside(path, mode):
    """Make an empty hidden file in the folder of `path`, readable only by those who may read `path`."""
    part = path.with_name(f".{secrets.token_hex(8)}{path.suffix}")
    os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode | stat.S_IWUSR))  # less the umask
    return part


def _give_back(part, before):
    """Give a file the owner and mode in `before`, as far as the file system supports them."""
    now = part.stat()
    if (now.st_uid, now.st_gid) != (before.st_uid, before.st_gid):
        with suppress(OSError):
            os.chown(part, before.st_uid, before.st_gid)
    if now.st_mode != before.st_mode:
        with suppress(OSError):
            os.chmod(part, stat.S_IMODE(before.st_mode))
