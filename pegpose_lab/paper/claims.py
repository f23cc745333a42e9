"""Printed value, our value, verdict and reason, for every number that the paper prints.

The printed numbers come from `paper`, ours from the values that notebooks saved (`results.save_values`), and the
rule that joins them from data/paper/claims.csv: a row holds for each id that matches its pattern.  Rules:

=========  =======================================================================================
input      the number was adopted, so nothing can be said of it: the verdict is "input"
within     |ours - paper| <= tolerance
at most    ours <= paper
mean       as within; the tolerance is the 95 % interval of a mean of that many frames (Table 3's sd)
sd         as within; the tolerance is the 95 % interval of a standard deviation of that many frames
share      as within; the tolerance is the binomial 95 % interval for the setup's number of corners
=========  =======================================================================================

A number that meets its rule gets the verdict in the column `met`, and that says what the agreement is worth:

=================================  ===============================================================================
recovered by construction          the rendering was given this number, and the method finds it again: that tests the
                                   method, and says nothing of the authors' board
arithmetic of the printed numbers  it follows from other printed numbers alone, without a picture
reproduced                         nothing was given that fixes it, and our result agrees within the tolerance
not determined                     our result agrees, but depends on something that we chose and the paper does not print
=================================  ===============================================================================

One that does not gets the verdict in the column `otherwise`.  That is "contradicted" only where printed numbers alone
decide; where the result also depends on something that is not printed it is "not determined".  With "range", the
values ``<id>.low`` and ``<id>.high`` tell what our result spans over what is not printed: a printed number inside the
span is "not determined", one outside "contradicted".  The intervals of a mean, an sd and a share take frames and
points for independent, which the paper does not say they are.
"""

from __future__ import annotations

import functools
import re
import textwrap
from fnmatch import fnmatchcase
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.special import ndtri, stdtrit

from .. import files, paper
from ..lab import results

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from pandas import DataFrame, Series

RECOVERED, ARITHMETIC, REPRODUCED = "recovered by construction", "arithmetic of the printed numbers", "reproduced"
VERDICTS = (RECOVERED, ARITHMETIC, REPRODUCED, "contradicted", "not determined", "input")
NOT_COMPUTED = "not computed: run the notebooks"
COLUMNS = ["id", "where", "quantity", "paper", "ours", "difference", "tolerance", "unit", "verdict", "reason"]

_LEVEL = 0.975  # two-sided 95 %
_ROUNDING = 1e-9  # relative; a difference of one printed digit is one digit in spite of binary fractions
_VERDICT_WIDTH, _REASON_WIDTH = 17, 55  # of the terminal table


def claims_table(values: Mapping[str, float] | Series | None = None) -> DataFrame:
    """Return a DataFrame with a row for each printed number.

    Parameters
    ----------
    values : mapping or Series, optional
        Our values {claim id: number}; by default those that `results.load_values` finds.

    Returns
    -------
    DataFrame
        id, where, quantity, paper, ours (NaN where there is none), difference (ours - paper), tolerance, unit,
        verdict and reason.

    Raises
    ------
    ValueError
        If a value has an id that is not known, an id occurs twice, or a value is not finite.
    """
    values = results.load_values() if values is None else pd.Series(values, dtype=float)
    _check_identifiers(values)
    rows = [_claim(identifier, values) for identifier in paper.printed_numbers().index]
    return pd.DataFrame(rows, columns=COLUMNS)


@functools.cache
def _rules():
    """The rules in data/paper/claims.csv."""
    return results.read_csv(files.PAPER_FOLDER / "claims.csv", as_text=True)


def _rule(identifier):
    """The one rule for this id."""
    rules = _rules()
    (index,) = [index for index, pattern in rules["ids"].items() if fnmatchcase(identifier, pattern)]
    return rules.loc[index]


def _check_identifiers(values):
    """Refuse values without a printed number, ids that two notebooks claim, and values that are not numbers."""
    twice = values.index[values.index.duplicated()]
    if len(twice):
        raise ValueError(f"values has two entries for {', '.join(twice.unique())}; expected one for each id")
    unknown = [str(identifier) for identifier in values.index if identifier not in known_identifiers()]
    if unknown:
        raise ValueError(f"values has unknown ids {', '.join(unknown)}; expected ids of data/paper/printed.csv")
    infinite = [str(identifier) for identifier in values.index[~np.isfinite(values)]]
    if infinite:
        raise ValueError(f"values has NaN or infinity for {', '.join(infinite)}; expected finite numbers")


@functools.cache
def known_identifiers() -> frozenset[str]:
    """Return the ids that a saved value may have: those of the printed numbers, and others that the rules need."""
    identifiers = set(paper.printed_numbers().index)
    ranges = [identifier for identifier in identifiers if _rule(identifier)["otherwise"] == "range"]
    templates = " ".join(_rules()["reason"] + _rules()["reason_otherwise"])
    spans = {f"{identifier}.{end}" for identifier in ranges for end in ("low", "high")}
    return frozenset(identifiers | spans | set(re.findall(r"values\[([^\]]+)\]", templates)))


def _claim(identifier, values):
    """One row of the table."""
    row, rule = paper.printed_numbers().loc[identifier], _rule(identifier)
    ours, tolerance = float(values.get(identifier, np.nan)), _tolerance(identifier, rule)
    verdict, reason = _judge(identifier, rule, row["value"], ours, tolerance, values)
    return [
        identifier,
        row["where"],
        row["quantity"],
        row["value"],
        ours,
        ours - row["value"],
        tolerance,
        row["unit"],
        verdict,
        reason,
    ]


def _tolerance(identifier, rule):
    """What |ours - paper| may be, in the number's unit; NaN for an input, 0 for "at most"."""
    kind, frames = rule["rule"], identifier.rpartition(".")[2]
    if kind in ("mean", "sd"):
        first, last = (int(frame) for frame in frames.split("-"))
        count, sd = last - first + 1, paper.printed(f"T3.sd.{frames}")
        mean = stdtrit(count - 1, _LEVEL) * sd / np.sqrt(count)
        return float(mean if kind == "mean" else ndtri(_LEVEL) * sd / np.sqrt(2 * (count - 1)))
    if kind == "share":
        share = paper.printed(identifier) / 100
        return float(100 * ndtri(_LEVEL) * np.sqrt(share * (1 - share) / paper.corner_count()))
    return {"input": np.nan, "at most": 0.0}[kind] if kind != "within" else float(rule["tolerance"])


def _judge(identifier, rule, printed, ours, tolerance, values):
    """Verdict and reason of one number."""
    if rule["rule"] == "input":
        return "input", rule["reason"]
    if np.isnan(ours):
        return "not determined", NOT_COMPUTED
    difference = ours - printed if rule["rule"] == "at most" else abs(ours - printed)
    met = difference <= tolerance + _ROUNDING * abs(printed)
    numbers = _numbers(identifier, printed, ours, values)
    if not met and rule["otherwise"] == "range" and np.isnan(numbers["low"] + numbers["high"]):
        return "not determined", f"{NOT_COMPUTED} ({identifier}.low and .high are missing)"
    try:
        reason = rule["reason" if met else "reason_otherwise"].format(**numbers)
    except KeyError as missing:
        return "not determined", f"{NOT_COMPUTED} ({missing.args[0]} is missing)"
    return rule["met"] if met else _otherwise(rule, printed, numbers), reason


def _numbers(identifier, printed, ours, values):
    """What a reason may quote."""
    low, high = (float(values.get(f"{identifier}.{end}", np.nan)) for end in ("low", "high"))
    functions = (paper.mm_per_pixel, paper.corner_count, paper.corner_stretch)
    derived = {function.__name__: function() for function in functions}
    derived["error"] = paper.printed("E-rms")
    return derived | {"ours": ours, "difference": ours - printed, "low": low, "high": high, "values": values}


def _otherwise(rule, printed, numbers):
    """The verdict on a number that does not meet its rule."""
    if rule["otherwise"] != "range":
        return rule["otherwise"]
    return "not determined" if numbers["low"] <= printed <= numbers["high"] else "contradicted"


def _as_text(table):
    """The table with its numbers as text of at most six digits, and empty text for NaN."""
    text = table.copy()
    for column in ("paper", "ours", "difference", "tolerance"):
        digits = 6 if column in ("paper", "ours") else 3
        text[column] = ["" if np.isnan(value) else f"{value:.{digits}g}" for value in table[column]]
    at_most = [_rule(identifier)["rule"] == "at most" for identifier in table["id"]]
    text.loc[at_most, "tolerance"] = "at most"
    return text


def write_claims(results_folder: str | PathLike[str]) -> DataFrame:
    """Write claims.csv and claims.tex into `results_folder`, from the values saved there; return the table."""
    table = claims_table(results.load_values(results_folder))
    text, folder = _as_text(table), Path(results_folder)
    results.write_csv(folder / "claims.csv", text)
    with files.replacing(folder / "claims.tex") as path:
        path.write_text(results.latex(text), encoding="utf-8")
    return table


def summary(table: DataFrame) -> str:
    """Return one sentence that counts the verdicts."""
    counts = table["verdict"].value_counts()
    recovered, arithmetic, reproduced, contradicted, open_, inputs = (counts.get(verdict, 0) for verdict in VERDICTS)
    return (
        f"{len(table)} numbers: {inputs} inputs, {recovered} recovered by construction, {arithmetic} arithmetic of the "
        f"printed numbers, {reproduced} reproduced, {contradicted} contradicted, {open_} not determined."
    )


def format_table(table: DataFrame) -> str:
    """Return the table as text for a terminal of 140 columns, grouped by place in the paper."""
    lines = []
    for where, group in _as_text(table).groupby("where", sort=False):
        lines += ["", where]
        for row in group.itertuples():
            lines += _terminal_lines(row)
    heading = _terminal_line("", "paper", "ours", "unit", "verdict", "reason")
    return "\n".join([heading, *lines, "", summary(table)])


def _terminal_lines(row):
    """The line of a row, and as many further lines as its verdict and its reason need."""
    texts = (textwrap.wrap(row.verdict, _VERDICT_WIDTH), textwrap.wrap(row.reason, _REASON_WIDTH))
    first, *more = zip_longest(*texts, fillvalue="")
    rest = [_terminal_line("", "", "", "", *parts) for parts in more]
    return [_terminal_line(row.quantity, row.paper, row.ours, row.unit, *first), *rest]


def _terminal_line(quantity, printed, ours, unit, verdict, reason):
    """One line in fixed columns."""
    return f"  {quantity:<33} {printed:>9} {ours:>11}  {unit:<5}  {verdict:<{_VERDICT_WIDTH}}  {reason}".rstrip()


def _markdown(table):
    """The block that stands between the markers of a README: all but the inputs."""
    text = _as_text(table[table["verdict"] != "input"]).drop(columns="id").astype(str)
    rows = results.markdown([text.columns, *text.to_numpy()], "lllrrrrll")
    return f"{summary(table)}\n\n{rows}"


def update_readme(path: str | PathLike[str], table: DataFrame) -> None:
    """Put the table between the markers ``<!-- claims:begin -->`` and ``<!-- claims:end -->`` of a Markdown file.

    Raises
    ------
    ValueError
        If the file does not have exactly one such pair.
    """
    results.update_block(path, "claims", _markdown(table))


def readme_is_current(path: str | PathLike[str], table: DataFrame) -> bool:
    """Return whether the table between the markers is what `update_readme` would write.

    Raises
    ------
    ValueError
        If the file does not have exactly one pair of markers.
    """
    return results.block_is_current(path, "claims", _markdown(table))
