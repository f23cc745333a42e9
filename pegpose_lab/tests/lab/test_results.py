"""Where results are written, and that they are read back as they were."""

import os

import numpy as np
import pandas as pd
import pytest

from pegpose_lab import files
from pegpose_lab.lab import results


@pytest.fixture
def output(tmp_path, monkeypatch):
    """An output folder of its own; returns its data/results."""
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))
    return tmp_path / "data" / "results"


@pytest.mark.parametrize("value", [None, ""])
def test_output_is_the_checkout_unless_named(monkeypatch, value):
    monkeypatch.delenv("PEGPOSE_OUTPUT", raising=False)
    if value is not None:
        monkeypatch.setenv("PEGPOSE_OUTPUT", value)
    assert files.output_folder() == files.PROJECT_FOLDER
    assert (files.PROJECT_FOLDER / "pegpose_lab" / "files.py").is_file()


def test_output_is_the_named_folder(output, tmp_path):
    assert files.output_folder() == tmp_path


def test_table_as_csv_and_latex(output):
    table = pd.DataFrame({"method_name": ["A & B", "50 %"], "rms": [0.123456, 2.0], "views": [5, 13]})
    results.save_table("05_errors", table)
    assert (output / "05_errors.csv").read_bytes() == b"method_name,rms,views\nA & B,0.1235,5\n50 %,2.0,13\n"
    assert (output / "05_errors.tex").read_text() == (
        "\\begin{tabular}{lrr}\n\\toprule\nmethod\\_name & rms & views \\\\\n\\midrule\n"
        "A \\& B & 0.1235 & 5 \\\\\n50 \\% & 2 & 13 \\\\\n\\bottomrule\n\\end{tabular}\n"
    )
    assert sorted(os.listdir(output)) == ["05_errors.csv", "05_errors.tex"]


def test_table_is_rounded_as_asked_and_not_changed(output):
    table = pd.DataFrame({"f": [47.951234567]})
    results.save_table("wide", table, decimals=7)
    assert pd.read_csv(output / "wide.csv")["f"].tolist() == [47.9512346]
    assert table["f"].tolist() == [47.951234567]


def test_table_is_written_byte_for_byte_again(output):
    table = pd.DataFrame({"name": ["a", "b"], "value": np.random.default_rng(3).normal(size=2)})
    results.save_table("twice", table)
    first = [(output / f"twice.{suffix}").read_bytes() for suffix in ("csv", "tex")]
    results.save_table("twice", table)
    assert first == [(output / f"twice.{suffix}").read_bytes() for suffix in ("csv", "tex")]


def test_failing_table_leaves_the_old_one(output, monkeypatch):
    results.save_table("table", pd.DataFrame({"a": [1.0]}))

    def interrupt(table):
        raise KeyboardInterrupt

    monkeypatch.setattr(results, "latex", interrupt)
    before = (output / "table.tex").read_bytes()
    with pytest.raises(KeyboardInterrupt):
        results.save_table("table", pd.DataFrame({"a": [2.0]}))
    assert (output / "table.tex").read_bytes() == before
    assert sorted(os.listdir(output)) == ["table.csv", "table.tex"]


def test_values_round_trip(output):
    results.save_values("03_tsai_calibration", {"T1-linear.f": 48.02, "T1-R.r2": np.float64(0.004)})
    results.save_values("04_genetic_stage", {"T1-ga.kappa1": 1.0971234567e-5, "acc": 1})
    loaded = results.load_values()
    assert loaded.to_dict() == {"T1-linear.f": 48.02, "T1-R.r2": 0.004, "T1-ga.kappa1": 1.09712e-5, "acc": 1}
    assert loaded.equals(results.load_values(output))
    assert sorted(os.listdir(output)) == ["03_tsai_calibration_values.csv", "04_genetic_stage_values.csv"]


def test_values_keep_the_digits_asked_for(output):
    results.save_values("nine", {"acc": 1 / 3}, digits=9)
    assert results.load_values()["acc"] == 0.333333333


def test_values_are_replaced_by_a_second_run(output):
    results.save_values("nb", {"acc": 0.1, "E-rms": 0.03})
    results.save_values("nb", {"acc": 0.2})
    assert results.load_values().to_dict() == {"acc": 0.2}


def test_no_values_yet(output):
    loaded = results.load_values()
    assert loaded.empty and loaded.dtype == float


def test_tables_are_not_values(output):
    results.save_table("claims", pd.DataFrame({"id": ["acc"], "ours": [0.1]}))
    assert results.load_values().empty


def test_tables_are_read_back(output):
    table = pd.DataFrame({"frame": [1, 2], "x_px": [0.25, 1.5]})
    results.save_table("06_pegs", table)
    pd.testing.assert_frame_equal(results.load_table("06_pegs"), table)
    with pytest.raises(FileNotFoundError, match="07_missing.csv is missing"):
        results.load_table("07_missing")


def test_a_written_csv_file_reads_back_below_its_comment(tmp_path):
    table = pd.DataFrame({"name": ["01", "no. #2"], "value": [0.1, 2.0]})
    results.write_csv(tmp_path / "a.csv", table, comment="two\n  lines", float_format="%.3f")
    assert (tmp_path / "a.csv").read_bytes() == b"# two lines\nname,value\n01,0.100\nno. #2,2.000\n"
    assert results.read_csv(tmp_path / "a.csv", as_text=True)["name"].tolist() == ["01", "no. #2"]
    assert results.read_csv(tmp_path / "a.csv")["value"].tolist() == [0.1, 2.0]
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
