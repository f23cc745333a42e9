"""Tables in data/measured: what studies measured once, so that notebooks need neither the images nor the time.

The first line of a table is a comment with the command that makes it, ``python3 -m pegpose_lab measure NAME``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..files import MEASURED_FOLDER
from ..lab import results

if TYPE_CHECKING:
    from pathlib import Path

    from pandas import DataFrame

_TEXT = {"levels": str}  # columns of digits that are not numbers


def made_by(name: str) -> str:
    """Return how a file is made, for its comment; `name` is the argument of `measure`.

    Examples
    --------
    >>> made_by("ga_success")
    'made by: python3 -m pegpose_lab measure ga_success'
    """
    return f"made by: python3 -m pegpose_lab measure {name}"


def write_measured(folder: Path, file: str, table: DataFrame, comment: str, *, float_format: str | None = None) -> None:
    """Write a table as <file>.csv into `folder`, below its comment."""
    results.write_csv(folder / f"{file}.csv", table, comment=comment, float_format=float_format)


def load_measured(file: str, folder: Path = MEASURED_FOLDER) -> DataFrame:
    """Read a table of data/measured, such as ``"circle_counts"``; data/README.md says what each of them holds.

    Raises
    ------
    ValueError
        If there is none of that name.

    Examples
    --------
    >>> "reached" in load_measured("ga_success")
    True
    """
    path = folder / f"{file}.csv"
    if not path.is_file():
        names = ", ".join(sorted(known.stem for known in folder.glob("*.csv")))
        raise ValueError(f"file is {file!r}; expected a table of {folder}: {names}")
    return results.read_csv(path, dtype=_TEXT)
