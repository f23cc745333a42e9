"""Which figures the page shows, with captions, and where in the notebooks each is made."""

from __future__ import annotations

import re
from dataclasses import dataclass

import nbformat

from ..notebooks.contents import NOTEBOOKS, Entry, entries

CAPTIONS = {
    "fig01_assembly": "Fig. 1: the fixed camera sees the hub, the robot holds the wheel; Eqs. 1 and 2 as arrows.",
    "fig02_overview": "Fig. 2: the method's steps, on a rendered frame.",
    "fig04_camera_model": "Fig. 4: the camera model with radial distortion (Eq. 3).",
    "fig05_orientation": "Fig. 5: the orientation θ, from the hub's centre to peg 1 (Eq. 11).",
    "fig06_error_histogram": "Fig. 6: re-projection distances; the printed limit is dotted.",
    "fig07_error_scatter": "Fig. 7: re-projection errors in x and y.",
}
"""Of the paper's figures."""

FURTHER = {
    "01_backgrounds": "Where one threshold finds the pegs, and where it does not.",
    "02_cramer_rao": "Error of a disc's centre over the noise, beside the smallest error that noise and blur allow.",
    "04_valley": "The genetic algorithm on the map of its objective: a narrow valley over f and T_z, and over m and T_z.",
    "04_success": "How often the genetic algorithm reaches the optimum, with 95 % intervals.",
    "05_focal_by_detector": "The focal length with its 95 % interval, by corner detector and camera model.",
    "09_halves": "Are the stated standard deviations of a camera true? Halves of the views against each other, on photographs.",
    "10_photographs": "Known discs found, missed and found falsely in photographs.",
    "12_rates": "The promised share of insertions against what happened in rendered trials.",
}
"""Besides the picture of each notebook."""

OWN = "13_your_images"
_SAVED = re.compile(r'save_table\(\s*"(\w+)"')
_LOADED = re.compile(r'load_measured\(\s*"(\w+)"')


@dataclass(frozen=True)
class Shown:
    """A figure of the page.

    Attributes
    ----------
    name : str
        Of its file, without the ending.
    alternative, caption : str
    question : str
        That the caption answers; empty for a figure that is not the picture of a notebook.
    notebook : str
        That makes it, without the ending.
    cell : int
        Execution number of the cell.
    tables : tuple of str
        Files of the same section of the notebook, written or read.
    """

    name: str
    alternative: str
    caption: str
    notebook: str
    cell: int
    tables: tuple[str, ...]
    question: str = ""

    @property
    def source(self) -> str:
        """Where it comes from, in a line."""
        return "; ".join(
            [f"notebooks/{self.notebook}.ipynb, cell [{self.cell}]", f"figures/{self.name}.png", *self.tables]
        )


def figures() -> list[Shown]:
    """The paper's figures, then each notebook's picture with its question and answer as caption, and further ones.

    Examples
    --------
    >>> first = figures()[0]
    >>> first.name, first.notebook
    ('fig01_assembly', '06_peg_pose')
    """
    listed = [entry for entry in entries() if entry.name != OWN]  # which is of the reader's images, not of the results
    captions, questions = CAPTIONS.copy(), {}
    for entry in listed:
        picture = entry.picture.rsplit("/", 1)[-1].removesuffix(".png")
        if captions.setdefault(picture, entry.answer) == entry.answer:
            questions[picture] = _question(entry)
        captions |= {name: text for name, text in FURTHER.items() if name[:2] == entry.name[:2]}
    made = {shown["name"]: shown for entry in listed for shown in _made_in(entry.name)}
    return [
        Shown(caption=caption, question=questions.get(name, ""), **made[name]) for name, caption in captions.items()
    ]


def _question(entry: Entry) -> str:
    end = "" if entry.title.endswith(("?", "!")) else "."
    return f"{entry.title}{end} {entry.question}"


def _made_in(notebook):
    """Name, alternative text, cell and tables of each figure of a notebook."""
    section, found, texts = 0, [], {}
    for cell in nbformat.read(NOTEBOOKS / f"{notebook}.ipynb", as_version=4).cells:
        if cell.cell_type == "markdown":
            section += len(re.findall(r"^## ", cell.source, re.MULTILINE))
            continue
        texts[section] = texts.get(section, "") + cell.source
        for output in cell.outputs:
            text = output.get("data", {}).get("text/plain", "")
            if text.startswith("figures/"):
                name = text.partition("\n")[0].removeprefix("figures/").removesuffix(".png")
                alternative = output.metadata["image/png"]["alt"]
                found.append((section, {"name": name, "alternative": alternative, "cell": cell.execution_count}))
    return [shown | {"notebook": notebook, "tables": _tables(texts[where])} for where, shown in found]


def _tables(source):
    """Files that a section writes and reads."""
    written = [f"data/results/{name}.csv" for name in _SAVED.findall(source)]
    return tuple(dict.fromkeys([*written, *(f"data/measured/{name}.csv" for name in _LOADED.findall(source))]))
