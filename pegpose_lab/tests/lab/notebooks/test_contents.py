"""The map of the notebooks: every notebook has question, answer, picture, and links to its neighbours."""

import re

import nbformat
import pytest

from pegpose_lab.lab.notebooks import contents

PATHS = sorted(contents.NOTEBOOKS.glob("[0-9]*.ipynb"))


def test_every_notebook_is_in_the_map():
    listed = contents.entries()
    assert [entry.name for entry in listed] == [path.stem for path in PATHS[1:]]
    table = contents.as_table(listed)
    assert all(entry.link in table for entry in listed) and table.count("\n") == len(listed) + 1


@pytest.mark.parametrize("path", PATHS[1:], ids=lambda path: path.stem)
def test_first_cell(path):
    entry = contents.entry_of(path)
    assert entry.title.startswith(path.stem[:2]) and entry.question.endswith(("?", ".", ")"))
    assert 40 < len(entry.answer) < 400 and not re.search(r"\d\.\d", entry.answer)  # no number is typed
    assert (contents.NOTEBOOKS / entry.picture).resolve().is_file() and len(entry.alternative) > 20


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_links_lead_to_the_neighbours(path):
    cells = nbformat.read(path, as_version=4).cells
    number = PATHS.index(path)
    for neighbour in PATHS[max(number - 1, 0) : number] + PATHS[number + 1 : number + 2]:
        title = re.search("^# (.+)$", nbformat.read(neighbour, as_version=4).cells[0].source, re.MULTILINE)[1]
        link = f"[{title}]({neighbour.name})" if neighbour != PATHS[0] else f"({neighbour.name})"
        assert link in cells[-1].source
        assert number == 0 or link in cells[0].source
    linked = re.findall(
        r"\]\(([^)#:]+\.ipynb)\)", "".join(cell.source for cell in cells if cell.cell_type == "markdown")
    )
    assert all((contents.NOTEBOOKS / name).is_file() for name in linked)


def test_a_first_cell_without_an_answer_says_so(tmp_path):
    path = tmp_path / "01_a.ipynb"
    nbformat.write(
        nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("# 01 A\n\n**Question.** What?\n\n")]), path
    )
    with pytest.raises(ValueError, match=r"01_a.ipynb has no answer"):
        contents.entry_of(path)
