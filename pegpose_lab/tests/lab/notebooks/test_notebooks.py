"""Every notebook is stored as one run from top to bottom, in a form that the next run repeats.

What the cells print is compared by nbval; here is tested what nbval does not see: outputs that are missing,
cells that were run out of order, what belongs to one machine only.
"""

import ast
import base64
import re

import nbformat
import pytest
from IPython.core.inputtransformer2 import TransformerManager
from nbconvert import HTMLExporter

from pegpose_lab.lab.environment import CHECKOUT
from pegpose_lab.lab.notebooks.running import to_text

NOTEBOOKS = sorted((CHECKOUT / "notebooks").glob("*.ipynb"))
PRINTING = {"print", "display", "show_figure"}
MACHINE_PATH = re.compile(r"(?<![\w.])/(home|root|Users|tmp|work|opt|usr|var|mnt|private)/|\b[A-Z]:\\")


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem, scope="module")
def notebook(request):
    return nbformat.read(request.param, as_version=4)


def _code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_all_steps_are_there():
    assert [path.stem[:2] for path in NOTEBOOKS] == [f"{k:02d}" for k in range(len(NOTEBOOKS))]
    assert {
        "00_start_here",
        "01_segmentation",
        "02_circle_detection",
        "03_tsai_calibration",
        "04_genetic_stage",
        "05_zhang_baseline",
        "06_peg_pose",
        "07_error_histograms",
        "08_paper_audit",
        "09_uncertainty",
        "10_real_parts",
        "11_other_tools",
        "12_assembly",
        "13_your_images",
    } <= {path.stem for path in NOTEBOOKS}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_by_the_command(path):
    """As ``reproduce --update-notebooks`` writes it: no time stamps, versions or widget models."""
    text = path.read_text(encoding="utf-8")
    assert text == to_text(nbformat.reads(text, as_version=4)), (
        "run: python3 -m pegpose_lab reproduce --update-notebooks"
    )


def test_is_valid(notebook):
    nbformat.validate(notebook)
    assert len({cell.id for cell in notebook.cells}) == len(notebook.cells)


def test_is_one_run_from_top_to_bottom(notebook):
    counts = [cell.execution_count for cell in _code_cells(notebook)]
    assert counts == list(range(1, len(counts) + 1))


def test_printing_cells_have_outputs(notebook):
    silent = [cell.source for cell in _code_cells(notebook) if _prints(cell.source) and not cell.outputs]
    assert silent == []


def test_has_no_errors_and_no_warnings(notebook):
    outputs = [output for cell in _code_cells(notebook) for output in cell.outputs]
    assert [output for output in outputs if output.output_type == "error" or output.get("name") == "stderr"] == []


def test_every_cell_is_tested(notebook):
    for cell in _code_cells(notebook):
        assert "NBVAL_SKIP" not in cell.source
        assert not {"nbval-skip", "raises-exception"} & set(cell.metadata.get("tags", []))


def test_names_no_path_of_a_machine(notebook):
    texts = [cell.source for cell in notebook.cells]
    for output in (output for cell in _code_cells(notebook) for output in cell.outputs):
        texts.append(output.get("text", ""))
        texts += [str(value) for kind, value in output.get("data", {}).items() if kind.startswith("text/")]
    assert [text for text in texts if MACHINE_PATH.search(text) or str(CHECKOUT) in text] == []


def test_the_figure_in_the_notebook_is_the_saved_figure(notebook):
    for output in _figures(notebook):
        name = output.data["text/plain"].partition("\n")[0]
        assert base64.b64decode(output.data["image/png"]) == (CHECKOUT / name).read_bytes(), name


def test_every_figure_is_shown_when_it_is_finished(notebook):
    """The inline backend shows what a cell leaves open, be it finished or not."""
    outputs = [output for cell in _code_cells(notebook) for output in cell.outputs]
    assert [output.data["text/plain"] for output in outputs if _is_left_open(output)] == []


def test_every_saved_figure_is_shown_once():
    names = [
        output.data["text/plain"].partition("\n")[0]
        for path in NOTEBOOKS
        for output in _figures(nbformat.read(path, as_version=4))
    ]
    assert sorted(names) == sorted(f"figures/{path.name}" for path in (CHECKOUT / "figures").glob("*.png"))


def test_every_animation_is_shown_once_and_is_small():
    """By Markdown with an alternative text, so that no notebook contains its bytes."""
    prose = "\n".join(cell.source for path in NOTEBOOKS for cell in nbformat.read(path, as_version=4).cells)
    shown = re.findall(r"!\[([^\]]+)\]\(\.\./figures/(\w+\.gif)\)", prose)
    files = sorted((CHECKOUT / "figures").glob("*.gif"))
    assert sorted(name for _, name in shown) == [path.name for path in files]
    assert all(len(text.split()) >= 5 for text, _ in shown) and all(path.stat().st_size <= 2**20 for path in files)


def test_every_figure_says_what_it_shows(notebook):
    told = [output.metadata.get("image/png", {}).get("alt", "") for output in _figures(notebook)]
    assert all(len(text.split()) >= 5 for text in told)


def test_a_notebook_has_few_cells(notebook):
    assert len(notebook.cells) <= 36


def _figures(notebook):
    """The outputs of `plotting.show_figure`."""
    outputs = [output for cell in _code_cells(notebook) for output in cell.outputs if "data" in output]
    return [output for output in outputs if output.data.get("text/plain", "").startswith("figures/")]


def _is_left_open(output):
    return output.get("data", {}).get("text/plain", "").startswith("<Figure size")


def _prints(source):
    """Whether a cell prints each time it runs: a call of a printing function outside functions and branches."""
    nodes = list(ast.parse(TransformerManager().transform_cell(source)).body)
    for node in nodes:
        if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", None)) in PRINTING:
            return True
        if not isinstance(node, (ast.If, ast.Try, ast.FunctionDef, ast.ClassDef, ast.Lambda)):
            nodes.extend(ast.iter_child_nodes(node))
    return False


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("print(1)", True),
        ("%matplotlib inline\nfor k in range(2):\n    plotting.show_figure(fig, k)", True),
        ("x = 1\nfig, ax = figure()", False),
        ("def show():\n    print(1)", False),
        ("if found:\n    print(1)", False),
    ],
)
def test_printing_cells_are_recognised(source, expected):
    assert _prints(source) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("/home/ann/x", True),
        (r"C:\Users\ann", True),
        ("see '/tmp/x'", True),
        ("data/results/x.csv", False),
        ("mm/px/", False),
    ],
)
def test_paths_of_machines_are_recognised(text, expected):
    assert bool(MACHINE_PATH.search(text)) == expected


def test_is_exported_without_a_kernel(notebook):
    """``jupyter nbconvert --to html`` shows the pictures of widgets in their place."""
    page, _ = HTMLExporter().from_notebook_node(notebook)
    explorers = [cell for cell in _code_cells(notebook) if "widgets.show(" in cell.source]
    assert "Error displaying widget" not in page and "Loading widget" not in page
    for cell in explorers:
        (output,) = cell.outputs
        assert output.data["image/png"].replace("\n", "")[:200] in page.replace("\n", "")
