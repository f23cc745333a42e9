"""The explorer of intervals: what it counts is what was simulated."""

from pegpose_lab.lab.widgets import interval_explorer
from pegpose_lab.paper import paper_experiment


def test_interval_explorer_counts_the_intervals_that_hold():
    """Correlated errors: the stated intervals hold more often; a bow: none does, and the flag says so."""
    explorer = interval_explorer(paper_experiment())
    assert "flags: none" in explorer.text
    explorer.controls["correlation"].value = 200
    stated, classical = (int(explorer.text.split(words)[1].split()[0]) for words in ("is in ", "and in "))
    assert stated > classical and "clustered-sigmas" in explorer.text
    explorer.controls["correlation"].value, explorer.controls["bow"].value = 0, 0.4
    assert "the truth is in 0 of 8" in explorer.text and "misfit-board (8 of 8)" in explorer.text
