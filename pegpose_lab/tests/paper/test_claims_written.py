"""The forms in which the claims table is written."""

import numpy as np
import pandas as pd
import pytest

from pegpose_lab.lab import results
from pegpose_lab.paper import claims
from pegpose_lab.tests.paper.agreeing_values import COMMITTED, PROJECT, as_printed, once_reproduced


def test_written_claims_read_back(tmp_path, monkeypatch):
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))
    results.save_values("08_paper_audit", as_printed())
    folder = tmp_path / "data" / "results"
    table = claims.write_claims(folder)
    read = pd.read_csv(folder / "claims.csv", keep_default_na=False, dtype=str)
    assert read["id"].tolist() == table["id"].tolist()
    assert np.array_equal(read["paper"].astype(float), table["paper"])
    assert read["verdict"].tolist() == table["verdict"].tolist()
    assert not read.isin(["nan"]).any(axis=None)
    first = [(folder / name).read_bytes() for name in ("claims.csv", "claims.tex")]
    claims.write_claims(folder)
    assert first == [(folder / name).read_bytes() for name in ("claims.csv", "claims.tex")]
    lines = (folder / "claims.tex").read_text(encoding="utf-8").splitlines()
    assert sum(line.endswith(r"\\") for line in lines) == len(table) + 1
    assert {path.name for path in folder.iterdir()} == {"08_paper_audit_values.csv", "claims.csv", "claims.tex"}


def test_interrupted_writing_leaves_the_old_table(tmp_path, monkeypatch):
    claims.write_claims(tmp_path)
    before = (tmp_path / "claims.tex").read_bytes()

    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(results, "latex", interrupt)
    with pytest.raises(KeyboardInterrupt):
        claims.write_claims(tmp_path)
    assert (tmp_path / "claims.tex").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("offset", [None, 0, -1000])
def test_terminal_table_fits_and_holds_everything(offset):
    values = {} if offset is None else {name: value + offset for name, value in as_printed().items()}
    table = claims.claims_table(values)
    text = claims.format_table(table)
    assert max(len(line) for line in text.splitlines()) <= 140
    words = " ".join(text.split())
    for quantity in table["quantity"]:
        assert quantity in words
    start = text.splitlines()[0].index("verdict")
    column = [line[start : start + 17].strip() for line in text.removesuffix(claims.summary(table)).splitlines()[1:]]
    in_order = [verdict for _, rows in table.groupby("where", sort=False) for verdict in rows["verdict"]]
    assert " ".join(filter(None, column)) == " ".join(in_order)
    assert text.endswith(claims.summary(table))
    assert "nan" not in words


def test_summary_counts_every_row():
    values = as_printed() | {"T2.X1": 0.0, "T2.Y1": 0.0, "E-rms": 1.0, "T1-ga.f": 1.0}
    assert claims.summary(claims.claims_table(values)) == (
        "62 numbers: 22 inputs, 15 recovered by construction, 7 arithmetic of the printed numbers, "
        "6 reproduced, 2 contradicted, 10 not determined."
    )


@pytest.fixture
def readme(tmp_path):
    """A README with the markers and text on both sides."""
    path = tmp_path / "README.md"
    path.write_text("# Title\n\n<!-- claims:begin -->\noutdated\n<!-- claims:end -->\n\nµ after\n", encoding="utf-8")
    return path


def test_readme_is_updated_between_its_markers(readme):
    table = claims.claims_table(as_printed())
    assert not claims.readme_is_current(readme, table)
    claims.update_readme(readme, table)
    assert claims.readme_is_current(readme, table)
    text = readme.read_text(encoding="utf-8")
    assert text.startswith("# Title\n\n<!-- claims:begin -->\n62 numbers") and "outdated" not in text
    assert text.endswith("<!-- claims:end -->\n\nµ after\n")
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == (table["verdict"] != "input").sum() + 2
    assert {line.count(" | ") for line in rows} == {8}
    assert "| Table 1, stage 2 | focal length f | 47.95 | 47.95 | 0 | 0.24 | mm | recovered by construction |" in text


def test_readme_is_outdated_by_one_changed_value(readme):
    claims.update_readme(readme, claims.claims_table(as_printed()))
    changed = claims.claims_table(as_printed() | {"E-rms": 0.0311})
    assert not claims.readme_is_current(readme, changed)
    claims.update_readme(readme, changed)
    assert claims.readme_is_current(readme, changed)


@pytest.mark.parametrize("text", ["none", "<!-- claims:end --> <!-- claims:begin -->", "<!-- claims:begin -->"])
def test_readme_without_a_pair_of_markers_is_left_alone(readme, text):
    readme.write_text(text)
    with pytest.raises(ValueError, match="no single pair"):
        claims.update_readme(readme, claims.claims_table({}))
    assert readme.read_text() == text


@once_reproduced
def test_committed_claims_are_complete():
    table = claims.claims_table(results.load_values(COMMITTED))
    missing = table.loc[table["reason"].str.startswith(claims.NOT_COMPUTED), "id"]
    assert missing.empty, f"no value of ours for {', '.join(missing)}"


@once_reproduced
def test_committed_claims_are_current(tmp_path):
    table = claims.claims_table(results.load_values(COMMITTED))
    for path in COMMITTED.glob("*_values.csv"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    claims.write_claims(tmp_path)
    for name in ("claims.csv", "claims.tex"):
        assert (COMMITTED / name).read_bytes() == (tmp_path / name).read_bytes()
    assert claims.readme_is_current(PROJECT / "data" / "results" / "README.md", table)
