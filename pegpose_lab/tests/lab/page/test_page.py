"""The result page: current, by itself, small, and with sliders whose states say what the tables say."""

import json
import re

import pytest

from pegpose_lab.files import PROJECT_FOLDER
from pegpose_lab.lab import results
from pegpose_lab.lab.page import page_text
from pegpose_lab.lab.page.figures import figures
from pegpose_lab.lab.page.sliders import sliders
from pegpose_lab.study import load_measured

RESULTS = PROJECT_FOLDER / "data" / "results"


@pytest.fixture(scope="module")
def page():
    return (PROJECT_FOLDER / "figures" / "index.html").read_text(encoding="utf-8")


def test_the_page_is_what_the_results_make(page):
    """Written by ``reproduce``; the same bytes each time."""
    assert page == page_text(PROJECT_FOLDER) == page_text(PROJECT_FOLDER)


def test_the_page_needs_nothing_else(page):
    assert len(page.encode()) <= 5_000_000
    assert not re.search(r'src="(?!data:)', page)
    links = re.findall(r'href="(?!#)([^"]+)"', page)
    assert len(links) > 20 and all((PROJECT_FOLDER / "figures" / link).is_file() for link in links)
    without_namespace = page.replace("http://www.w3.org/2000/svg", "")
    for text in ("http://", "https://", "fetch(", "import(", "@import", "url("):
        assert text not in without_namespace
    assert page.count("data:image/gif") == 1
    assert page.count("<img ") == page.count('<img alt="') > 15 and 'alt=""' not in page
    assert 'name="viewport"' in page and "@media print" in page


def test_every_printed_number_is_in_the_page(page):
    claims = results.read_csv(RESULTS / "claims.csv", as_text=True)
    table = page[page.index('id="claims"') :]
    assert table.count("<tr>") == len(claims) + 1
    assert set(re.findall("<dt>(.+?)</dt>", table)) == set(claims["verdict"])


def test_a_narrow_screen_has_the_name_of_each_column(page):
    cells = re.findall(r"<td[^>]*>", page)
    assert cells and all('data-column="' in cell for cell in cells)


def test_figures_are_there_and_have_words():
    shown = figures()
    assert len({one.name for one in shown}) == len(shown) > 15
    for one in shown:
        assert (PROJECT_FOLDER / "figures" / f"{one.name}.png").is_file()
        assert (PROJECT_FOLDER / "notebooks" / f"{one.notebook}.ipynb").is_file()
        assert len(one.alternative) > 15 and len(one.caption) > 15
        assert one.cell > 0 and f"cell [{one.cell}]" in one.source
        assert all((PROJECT_FOLDER / name).is_file() for name in one.tables)


def test_a_figure_names_the_tables_of_its_section():
    (tilt,) = (one for one in figures() if one.name == "09_tilt")
    assert (
        tilt.source.startswith("notebooks/09_uncertainty.ipynb, cell [")
        and "data/results/09_sigma_over_tilt.csv" in tilt.tables
    )


def test_sliders_have_states_that_can_be_drawn(page):
    listed = sliders(RESULTS)
    assert len(listed) >= 6 and len({one.name for one in listed}) == len(listed)
    stored = json.loads(re.search(r'<script type="application/json" id="states">(.+?)</script>', page, re.DOTALL)[1])
    for one in listed:
        assert len(one.states) >= 5 and 0 <= one.start < len(one.states) and stored[one.name]["states"] == one.states
        for state in one.states:
            assert state["text"]
            for _, share, text, color in state.get("bars", []):
                assert 0 <= share <= 1 and text and color.startswith("#")
        assert len({json.dumps(state) for state in one.states}) > len(one.states) / 2


def test_the_clearance_slider_says_what_the_table_says():
    (slider,) = [one for one in sliders(RESULTS) if one.name == "clearance"]
    curves = load_measured("chain_clearances").query("cell == 'exact robot' and chain == 'joint'").iloc[:-1]
    for state, clearance, share in zip(slider.states, curves["clearance"], curves["share"], strict=True):
        assert f"{clearance:.2g} mm" in state["text"]
        assert [bar[1] for bar in state["bars"] if bar[0] == "joint"] == [pytest.approx(share)]


def test_the_frames_slider_has_all_frames():
    (slider,) = [one for one in sliders(RESULTS) if one.name == "frames"]
    assert len(slider.states) == 45 and all(len(state["circles"]) == 4 for state in slider.states)
