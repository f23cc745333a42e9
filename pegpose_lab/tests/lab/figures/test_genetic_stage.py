"""Figures of the genetic stage: what is drawn is what was computed."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binomtest

from pegpose_lab import calibrate_genetic, calibrate_tsai, study
from pegpose_lab.calibration import TwoStageObjective
from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import genetic_stage
from pegpose_lab.paper import paper_experiment

TRUTH = paper_experiment()
BOARD, POSE = TRUTH.board.object_points, TRUTH.cam_from_boards[0]
IMAGE = TRUTH.camera.project(BOARD, POSE)
OPTIMUM = np.array([TRUTH.camera.focal_length, POSE.translation[2]])


@pytest.fixture
def axes():
    fig, drawn = plotting.figure(9, 3, columns=3)
    yield drawn
    fig.draw_without_rendering()
    plt.close(fig)


def test_a_cell_has_the_lowest_value_in_it():
    """A floor that is far narrower than a cell is found in each row, in the column where it runs."""
    x, t_z = np.linspace(0, 8, 9), np.linspace(100, 104, 5)
    values = genetic_stage.lowest_in_cells(lambda c: np.abs(c[:, 0] - (c[:, 1] - 100)), x, t_z, lambda x, t_z: x)
    assert values.shape == (4, 8) and values.argmin(axis=1).tolist() == [0, 1, 2, 3]
    assert values.min(axis=1).max() <= 0.5 / genetic_stage.FINER + 1e-9


@pytest.mark.parametrize("genes", ["printed", "magnification"])
def test_the_valley_is_lowest_at_the_optimum(axes, genes):
    linear = calibrate_tsai(BOARD, IMAGE, TRUTH.camera)
    objective = TwoStageObjective(BOARD, IMAGE, linear)
    run = calibrate_genetic(BOARD, IMAGE, TRUTH.camera, rng=0, genes=genes, generations=25)
    mean_c2 = None if genes == "printed" else objective.c2.mean()
    box = np.outer(OPTIMUM, [0.75, 1.25])
    image = genetic_stage.plot_run(axes, objective, run, box, OPTIMUM, mean_c2=mean_c2)
    left, right, low, high = image.get_extent()
    first = OPTIMUM[0] if mean_c2 is None else OPTIMUM[0] / (OPTIMUM[1] + mean_c2)
    assert_allclose([(left + right) / 2, (low + high) / 2], [first, OPTIMUM[1]])
    row, column = np.unravel_index(np.argmin(image.get_array()), image.get_array().shape)
    assert max(abs(row + 0.5 - genetic_stage.CELLS / 2), abs(column + 0.5 - genetic_stage.CELLS / 2)) < 3
    assert axes[0].texts[-1].get_text() == ("genes (f, $T_z$)" if genes == "printed" else "genes (m, $T_z$)")
    dots = [line for line in axes[2].lines if line.get_label() == "population"]
    assert len(dots[0].get_xdata()) == len(run.populations[25])
    assert_allclose(dots[0].get_ydata(), run.populations[25][:, 1])


def test_bars_have_binomial_intervals(axes):
    genetic_stage.plot_success(axes[0], ["a", "b"], {"s": ([5, 10], 10)}, {"s": "red"})
    bars, errors = axes[0].containers[1], axes[0].containers[0]
    assert [bar.get_width() for bar in bars] == [50, 100]
    (segments,) = (collection.get_segments() for collection in errors.lines[2])
    low, high = binomtest(5, 10).proportion_ci(method="wilson")
    assert_allclose(segments[0][:, 0], [100 * low, 100 * high])
    assert_allclose(segments[1][1, 0], 100)


def test_every_variant_has_its_bars(axes):
    names = ("none (default)", "none", "Eq. 4", "Eqs. 9, 10", "Eqs. 4, 9, 10")
    labels = {variant: ("(f, T_z)", name) for variant, name in zip(study.VARIANTS, names, strict=True)}
    genetic_stage.plot_success_of_views(axes[0], study.success_shares(study.load_measured("ga_success")), labels)
    assert [len(bars) for bars in axes[0].containers[1::2]] == [5, 5, 5]
    assert [bars[0].get_width() for bars in axes[0].containers[1::2]] == [100, 100, 100]
    assert axes[0].get_yticklabels()[2].get_text() == "(f, $T_z$): Eq. 4 printed"
    counts = pd.Series([1, 2], pd.MultiIndex.from_product([["(m, T_z)"], ["Eq. 4", "none"]]))
    genetic_stage.plot_success_of_view(axes[1], counts, {"another": 3}, 4)
    assert axes[1].get_yticklabels()[-1].get_text() == "(f, $T_z$): another"
    assert [bar.get_width() for bar in axes[1].containers[1]] == [25, 50, 75]


def test_operators_are_drawn_by_name(axes):
    history = pd.DataFrame({"generation": range(5), "spread_0": [0.3, 0.2, 0.1, 0.01, 0.0]})
    genetic_stage.plot_spread(axes[0], dict.fromkeys("abc", history), ("k", "r", "b"), generations=3)
    assert [text.get_text() for text in axes[0].texts] == ["a", "b", "c"] and len(axes[0].lines[0].get_xdata()) == 4
    children = {("printed", "0.4, 0.6"): np.full(9, 0.5), ("corrected", "0.4, 0.6"): np.full(9, 0.3)}
    genetic_stage.plot_children(axes[1], children, (0.4, 0.6))
    assert len(axes[1].collections) == 2 and len(axes[1].lines) == 2
    genetic_stage.plot_mutants(axes[2], {"printed": np.array([0.1, 0.5]), "corrected": np.array([0.5, 0.9])})
    assert {"box", "printed", "corrected"} == set(axes[2].get_legend_handles_labels()[1])


def test_places_across_hold_the_bottom():
    f = genetic_stage.places_across((36.0, 60.0), 47.9)
    assert (np.diff(f) >= 0).all() and 47.9 in f and f[0] == 36.0 and f[-1] == 60.0
    assert np.min(np.diff(f)[np.diff(f) > 0]) < 1e-5


def test_both_readings_of_equation_6(axes):
    f = np.linspace(40, 60, 5)
    genetic_stage.plot_across_valley(axes[0], f, {"shared": np.array([1e6, 1, 0.1, 1, 9]), "own": np.ones(5)})
    assert axes[0].lines[0].get_ydata().max() == 100
    genetic_stage.plot_own_kappa1(axes[1], f, {"at": np.full(5, 1e-5), "off": np.full(5, 1e-3)}, 1.1e-5)
    assert_allclose(axes[1].lines[1].get_ydata(), 100)
    assert len({line.get_color() for line in axes[1].lines}) == 3


def test_noise_has_a_point_for_each_source(axes):
    names = [f"{sd}{stage} E (px)" for stage in ("linear", "two-stage") for sd in ("", "sd of ")]
    levels = pd.DataFrame([[0.01, 100, 0.2, 0.0, 0.013, 0.002]] * 2, columns=["noise (px)", "trials", *names])
    sources = pd.DataFrame({"corners": list(genetic_stage.CORNERS), "noise (px per axis)": 0.02, "E (px)": 0.025})
    genetic_stage.plot_noise(*axes[:2], levels, sources, printed={"two stages": "0.0310"})
    labels = axes[0].get_legend_handles_labels()[1]
    assert labels == ["linear, simulated noise", "two-stage, simulated noise", *genetic_stage.CORNERS]
    assert axes[0].texts[0].get_text() == "printed: two stages, 0.0310 px"
    looks = list(genetic_stage.CORNERS.values())
    assert len({color for color, _ in looks}) == len({marker for _, marker in looks}) == len(looks)
