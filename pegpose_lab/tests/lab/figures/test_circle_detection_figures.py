"""The figures of circle detection: geometry against known ellipses, and artists that hold the data they were given."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.special import ndtr

from pegpose_lab import fit_discs, locate_pegs, paper
from pegpose_lab.lab.figures import circle_detection as figures
from pegpose_lab.lab.plotting import DETECTORS, figure
from pegpose_lab.tests.pictures import draw_ellipses, to_uint8

ELLIPSE = SimpleNamespace(centers=np.array([[80.2, 79.6]]), semi_axes=np.array([[50.0, 40.0]]), angles=np.array([0.4]))


@pytest.fixture
def axes():
    fig, pair = figure(8, 4, 2, 2)
    yield pair
    fig.canvas.draw()
    plt.close(fig)


def test_each_method_has_its_own_colour():
    assert len({color for color, _, _ in figures.LOOKS.values()}) == len(figures.LOOKS)
    ours = [color for name, (color, _, _) in DETECTORS.items() if name == "ours" or name.startswith("find_circles")]
    assert len(set(ours)) == len(ours)


def test_the_evolute_has_its_cusps_on_the_axes():
    points = figures.evolute(ELLIPSE, 0) - ELLIPSE.centers[0]
    (a, b), angle = ELLIPSE.semi_axes[0], ELLIPSE.angles[0]
    along = points @ [np.cos(angle), np.sin(angle)]
    assert along.max() == pytest.approx((a**2 - b**2) / a)
    assert np.hypot(*points.T).max() == pytest.approx((a**2 - b**2) / b, rel=1e-4)


def test_edge_pixels_tell_distance_and_curvature():
    circle = SimpleNamespace(
        centers=np.array([[80.2, 79.6]]), semi_axes=np.array([[50.0, 50.0]]), angles=np.array([0.0])
    )
    y, x = np.mgrid[:160, :160]
    from_center = np.hypot(x - 80.2, y - 79.6)
    pixels = figures.edge_pixels(from_center, circle, 0)
    assert_allclose(pixels.distance, 50 - pixels.grey, atol=1e-9)
    assert_allclose(pixels.curvature, 1 / 50, rtol=1e-9)
    assert len(pixels.distance) == np.sum(np.abs(from_center - 50) < 6)


def test_a_drawn_edge_follows_the_step(axes):
    image = to_uint8(draw_ellipses((160, 160), [(80.2, 79.6, 50, 40, 0.4)]), 1, 0)
    discs = fit_discs(image, SimpleNamespace(centers=[[80.0, 80.0]], radii=[45.0]))
    pixels, s = figures.edge_pixels(image, discs, 0), discs.blurs[0]
    share = ndtr((pixels.distance - s**2 * pixels.curvature / 2) / s)
    model = np.mean(pixels.grey - discs.contrasts[0] * share) + discs.contrasts[0] * share
    assert (pixels.grey - model).std() < 1.3
    figures.plot_edge_profile(axes[0], pixels, model, noise=1.0)
    assert len(axes[0, 0].lines) == 2 and len(axes[0, 1].get_legend().texts) == 3


def test_voting_and_votes(axes):
    figures.plot_voting(axes[0], np.zeros((150, 150), np.uint8), np.array([75.0, 75.0]), 48.0, (35, 60))
    assert len(axes[0, 0].patches) == 16 and len(axes[0, 1].lines) == 33
    figures.plot_votes(
        axes[1, 0], np.eye(150), "votes", peak=(70, 70), truth=(75, 75), curve=figures.evolute(ELLIPSE, 0)
    )
    assert [line.get_label() for line in axes[1, 0].lines] == ["evolute of the ellipse", "highest count", "true centre"]


def test_errors_counts_and_bound(axes):
    keys = [("frame 1", "grey", method) for method in figures.LOOKS if method != "accumulator"]
    figures.plot_center_errors(axes[0, 0], pd.Series([0.1, 0.2, 0.05, 0.01], pd.MultiIndex.from_tuples(keys)))
    assert [text.get_text() for text in axes[0, 0].texts] == ["accumulator finds none"]
    spread = {"two-stage": np.array([0.1, 0.2]), "fit": np.array([0.01, 0.03])}
    figures.plot_against_bound(axes[1], (1.0, 2.0), spread, np.array([0.01, 0.02]), [1.0, 1.5], 0.1)
    assert_allclose(axes[1, 1].containers[0].lines[0].get_ydata(orig=False), [1.0, 1.5])
    fig, others = figure(8, 4, 2, 2)
    counts = {(method, "mask"): np.array([[4, 0], [3, 2]]) for method in ("two-stage", "phase-code")}
    figures.plot_counts(others, [0.8, 0.9], counts | {("two-stage", "grey image"): np.zeros((2, 2))})
    assert_allclose(others[1, 0].lines[0].get_ydata(), [0, 2])
    plt.close(fig)


def test_a_labelled_hub_shows_four_numbers_where_the_pegs_are(axes):
    truth = paper.paper_experiment()
    seen = locate_pegs(truth.hub_frame(0), truth.hub)
    figures.plot_labelled_hub(axes[0, 0], truth.hub_frame(0), seen, "frame 1")
    labels = {text.get_text(): text.xy for text in axes[0, 0].texts}
    assert list(labels) == ["1", "2", "3", "4", "s1", "s2"] and len(axes[0, 0].patches) == 7
    assert_allclose(labels["3"], seen.peg_centers[2])


def test_the_marked_square_is_where_votes_are_shown(axes):
    figures.plot_votes(axes[0, 1], np.ones((150, 150)), "votes", peak=(75, 75), truth=(75, 75))
    figures.mark_votes(axes[0, 0])
    (square,) = axes[0, 0].patches
    x, y, width, height = square.get_bbox().bounds
    assert_allclose([x, x + width], axes[0, 1].get_xlim())
    assert_allclose([y + height, y], axes[0, 1].get_ylim())
