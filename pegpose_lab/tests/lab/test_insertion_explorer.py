"""The explorer of the insertion: what its sliders say about the chance to go in."""

import re

from pegpose_lab.lab.widgets import insertion_explorer
from pegpose_lab.paper import paper_experiment


def free(explorer):
    return float(re.search(r"([\d.]+) % go in freely", explorer.text)[1])


def test_insertion_explorer_follows_its_sliders():
    explorer = insertion_explorer(paper_experiment())
    controls, first = explorer.controls, bytes(explorer.picture.value)
    assert "comes from: robot" in explorer.text
    start = free(explorer)
    controls["clearance"].value = -2.0
    assert free(explorer) < start - 20 and bytes(explorer.picture.value) != first
    controls["repeatability"].value = 0.0
    assert free(explorer) > 95 and "comes from: calibration" in explorer.text
    controls["noise"].value = 10.0
    assert free(explorer) < 60
    controls["clearance"].value, controls["noise"].value, controls["tilt"].value = -1.0, 2.0, 0.5
    assert free(explorer) < 5
    controls["tilt"].value = 0.1
    assert free(explorer) > 95
