"""The map of the notebooks: what each asks, its answer, its picture, and the way to the one before and after.

A notebook's first cell has its title, a line of links, the question, the answer and a picture:

    # 03 Title
    [...](...) · ...
    **Question.** ...
    **Answer.** ...
    ![what the picture shows](../figures/name.png)
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import nbformat

from ...files import PROJECT_FOLDER

if TYPE_CHECKING:
    from pathlib import Path

NOTEBOOKS = PROJECT_FOLDER / "notebooks"
START = "00_start_here"


@dataclass(frozen=True)
class Entry:
    """A notebook in the map.

    Attributes
    ----------
    name : str
        Of the file, without its ending.
    title, question, answer : str
        Markdown.
    picture, alternative : str
        File of its picture, relative to ``notebooks/``, and what it shows.

    Examples
    --------
    >>> Entry("03_tsai_calibration", "03 Stage 1", "What?", "This.", "../figures/a.png", "A").link
    '[03 Stage 1](03_tsai_calibration.ipynb)'
    """

    name: str
    title: str
    question: str
    answer: str
    picture: str
    alternative: str

    @property
    def link(self) -> str:
        """The title as a link to the notebook."""
        return f"[{self.title}]({self.name}.ipynb)"


def entry_of(path: Path) -> Entry:
    """Read the first cell of a notebook.

    Raises
    ------
    ValueError
        If it lacks a part; the message names it.

    Examples
    --------
    >>> entry_of(NOTEBOOKS / "12_assembly.ipynb").title
    '12 Will the wheel go on?'
    """
    text = nbformat.read(path, as_version=4).cells[0].source
    parts = {}
    for name, pattern in (
        ("title", r"^# (.+)$"),
        ("question", r"\*\*Question\.\*\* (.+?)(?=\n\n)"),
        ("answer", r"\*\*Answer\.\*\* (.+?)(?=\n\n)"),
        ("picture", r"!\[.+\]\((.+?)\)"),
        ("alternative", r"!\[(.+)\]\("),
    ):
        found = re.search(
            pattern, f"{text}\n\n", re.MULTILINE | re.DOTALL if name in ("question", "answer") else re.MULTILINE
        )
        if found is None:
            raise ValueError(f"{path.name} has no {name} in its first cell; see the text of this module")
        parts[name] = " ".join(found[1].split())
    return Entry(path.stem, **parts)


def entries() -> list[Entry]:
    """All notebooks but the first, in order.

    Examples
    --------
    >>> [entry.name for entry in entries()][:2]
    ['01_segmentation', '02_circle_detection']
    """
    return [entry_of(path) for path in sorted(NOTEBOOKS.glob("[0-9]*.ipynb")) if path.stem != START]


def as_table(listed: list[Entry]) -> str:
    """The map as a Markdown table: picture, link with the question, answer.

    Examples
    --------
    >>> print(as_table([Entry("03_a", "03 A", "What?", "This.", "../figures/a.png", "A")]))
    | | question | answer |
    | --- | --- | --- |
    | <img src="../figures/a.png" alt="A" width="160"> | **[03 A](03_a.ipynb)** What? | This. |
    """
    rows = []
    for entry in listed:
        picture = f'<img src="{entry.picture}" alt="{entry.alternative}" width="160">'
        rows.append(f"| {picture} | **{entry.link}** {entry.question} | {entry.answer} |")
    return "\n".join(["| | question | answer |", "| --- | --- | --- |", *rows])
