"""Saves and reads the notebooks' results: tables as CSV and LaTeX, and single values for the claims.

Everything is written below one folder: the one in the environment variable ``PEGPOSE_OUTPUT``, or else the checkout.
A file is written under a temporary name and then renamed, so a reader never sees half a file.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from ..checks import as_number
from ..files import replacing, results_folder

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from os import PathLike
    from typing import Any

    from pandas import DataFrame, Series


def read_csv(path: str | PathLike[str], *, as_text: bool = False, **options: Any) -> DataFrame:
    """Read a CSV file of the project; lines that begin with # are comments.

    Parameters
    ----------
    path : path
    as_text : bool
        Keep every cell as text, also empty ones.
    **options
        Options of `pandas.read_csv`: ``dtype``, ``index_col``.

    Returns
    -------
    DataFrame
    """
    if as_text:
        options |= {"dtype": str, "keep_default_na": False}
    lines = Path(path).read_text(encoding="utf-8").splitlines(keepends=True)
    return pd.read_csv(io.StringIO("".join(line for line in lines if not line.startswith("#"))), **options)


def write_csv(
    path: str | PathLike[str], table: DataFrame, *, comment: str = "", float_format: str | None = None
) -> None:
    """Write a DataFrame without its index as a CSV file, below an optional comment line; no partial file is left."""
    body = table.to_csv(index=False, float_format=float_format, lineterminator="\n")
    first = f"# {' '.join(comment.split())}\n" if comment else ""
    with replacing(path) as temporary:
        temporary.write_text(first + body, encoding="utf-8", newline="\n")


def save_table(name: str, table: DataFrame, *, decimals: int = 4) -> None:
    """Write a DataFrame as data/results/<name>.csv and .tex, numbers rounded to `decimals`."""
    write_table(results_folder(), name, table, decimals=decimals)


def write_table(folder: str | PathLike[str], name: str, table: DataFrame, *, decimals: int = 4) -> None:
    """Write a DataFrame as <name>.csv and .tex into `folder`, numbers rounded to `decimals`."""
    folder = Path(folder)
    rounded = table.round(decimals)
    numbers = rounded.select_dtypes("float").columns
    rounded[numbers] += 0.0  # turns -0.0 into 0.0
    write_csv(folder / f"{name}.csv", rounded)
    with replacing(folder / f"{name}.tex") as path:
        path.write_text(latex(rounded), encoding="utf-8")


def load_table(name: str) -> DataFrame:
    """Read back data/results/<name>.csv, which an earlier notebook saved.

    Raises
    ------
    FileNotFoundError
        If it has not been saved; the message names the file.
    """
    path = results_folder() / f"{name}.csv"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing: run the notebook whose number it bears first")
    return read_csv(path)


def save_values(notebook: str, values: Mapping[str, float], *, digits: int = 6) -> None:
    """Write our values for the paper's numbers, {claim id: number}, as data/results/<notebook>_values.csv.

    Raises
    ------
    ValueError
        If a value is not a finite number.
    """
    values = {identifier: as_number(value, f"values[{identifier!r}]") for identifier, value in values.items()}
    rows = pd.DataFrame({"id": list(values), "ours": [float(f"{value:.{digits}g}") for value in values.values()]})
    write_csv(results_folder() / f"{notebook}_values.csv", rows)


def load_values(folder: str | PathLike[str] | None = None) -> Series:
    """Read back every saved value below `folder` (data/results by default) as one Series, indexed by claim id."""
    folder = Path(folder) if folder else results_folder()
    tables = [read_csv(path, index_col="id")["ours"] for path in sorted(folder.glob("*_values.csv"))]
    return pd.concat(tables) if tables else pd.Series(dtype=float, name="ours")


def latex(table: DataFrame) -> str:
    """Return a DataFrame as a booktabs tabular, numbers to six digits."""
    return table.to_latex(index=False, escape=True, float_format="{:g}".format, na_rep="nan")


def update_block(path: str | PathLike[str], name: str, text: str) -> None:
    """Write `text` between the markers ``<!-- name:begin -->`` and ``<!-- name:end -->`` of a Markdown file.

    Raises
    ------
    ValueError
        If the file does not have exactly one pair of these markers.
    """
    _, updated = _with_block(path, name, text)
    with replacing(path) as temporary:
        temporary.write_text(updated, encoding="utf-8", newline="\n")


def block_is_current(path: str | PathLike[str], name: str, text: str) -> bool:
    """Return whether `update_block` would leave the file unchanged; raises like `update_block`."""
    before, updated = _with_block(path, name, text)
    return before == updated


def _with_block(path, name, text):
    """The present text of the file, and the same with `text` between its markers."""
    begin_mark, end_mark = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    before = Path(path).read_text(encoding="utf-8")
    begin, end = before.find(begin_mark), before.find(end_mark)
    if before.count(begin_mark) != 1 or before.count(end_mark) != 1 or end < begin:
        raise ValueError(f"path {path} has no single pair of lines {begin_mark} and {end_mark} for the table")
    return before, f"{before[:begin]}{begin_mark}\n{text}\n{before[end:]}"


def markdown(rows: Iterable[Sequence[Any]], alignment: str) -> str:
    """Return a Markdown table; the first of `rows` is the header, and `alignment` has an l or r for each column."""
    rules = [{"l": "---", "r": "---:"}[letter] for letter in alignment]
    first, *more = ([str(cell).replace("|", r"\|") for cell in row] for row in rows)
    return "\n".join("| " + " | ".join(row) + " |" for row in [first, rules, *more])
