"""Explorers of one question each: what their texts say is what was computed, and every control changes it."""

import re

import numpy as np
import pytest

from pegpose_lab.lab import widgets
from pegpose_lab.paper import paper_experiment


def number(explorer, pattern):
    return float(re.search(pattern, explorer.text)[1])


def test_tilt_and_views_tell_f_and_the_residual_does_not():
    explorer = widgets.views_explorer(paper_experiment())
    width, rms = r"± ([\d.]+) %", r"rms ([\d.]+) px"
    before, residual = number(explorer, width), number(explorer, rms)
    explorer.controls["tilt"].value = 5
    assert number(explorer, width) > 2 * before and number(explorer, rms) == pytest.approx(residual, rel=0.05)
    few = number(explorer, width)
    explorer.controls["views"].value = 12
    assert number(explorer, width) < 0.85 * few
    explorer.controls["noise"].value = 0.2
    assert number(explorer, rms) == pytest.approx(2 * residual, rel=0.1) and not explorer.failed


def test_an_assumed_principal_point_moves_f_and_depth():
    experiment = paper_experiment()
    explorer = widgets.principal_point_explorer(experiment)
    f = r"both stages f = ([\d.]+) mm"
    assert number(explorer, f) == pytest.approx(experiment.camera.focal_length, abs=0.05)
    explorer.controls["dy"].value = 40
    assert abs(number(explorer, f) - experiment.camera.focal_length) > 1.0
    first = bytes(explorer.picture.value)
    explorer.controls["dx"].value = 40
    assert bytes(explorer.picture.value) != first and not explorer.failed
    moved = widgets.principal_point_explorer(experiment, start=(40, 40))
    assert moved.text == explorer.text and [control.value for control in moved.controls.values()] == [40, 40]


def test_the_bias_of_an_ellipse_grows_with_tilt_and_radius_and_falls_with_depth():
    """To lowest order the shift is f r^2 sin(tilt) cos(tilt) / z^2."""
    explorer = widgets.eccentricity_explorer(paper_experiment())
    camera = paper_experiment().camera
    shift = r"lies ([\d.]+) px"
    for tilt, radius, depth in ((12, 10.1, 370), (40, 10.1, 370), (40, 20.0, 370), (40, 20.0, 800), (0, 20.0, 800)):
        for name, value in (("tilt", tilt), ("radius", radius), ("depth", depth)):
            explorer.controls[name].value = value
        angle, pixels = np.deg2rad(tilt), camera.focal_length / camera.pixel_pitch[0]
        expected = pixels * (radius / depth) ** 2 * np.sin(angle) * np.cos(angle)
        assert number(explorer, shift) == pytest.approx(expected, rel=0.03, abs=2e-3)


def test_one_distortion_for_each_point_leaves_nothing_to_find():
    explorer = widgets.equation6_explorer(paper_experiment())
    assert "varies by less than 1e-09 px" in explorer.text
    assert number(explorer, r"shared: E from ([\d.]+) px") < 0.05 and number(explorer, r"to ([\d.]+) px$") > 0.5
    at_truth = number(explorer, r"at T_z = ([\d.]+) mm")
    first = bytes(explorer.picture.value)
    explorer.controls["f"].value = 10.0
    assert "varies by less than 1e-09 px" in explorer.text
    assert number(explorer, r"at T_z = ([\d.]+) mm") > at_truth and bytes(explorer.picture.value) != first
    explorer.controls["noise"].value = 0.2
    assert number(explorer, r"shared: E from ([\d.]+) px") > 0.1 and not explorer.failed
