"""Figures of notebook 01: what is drawn is what was given."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from numpy.testing import assert_allclose

from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import segmentation as draw


def test_grey_values_are_those_of_the_rows():
    image = np.arange(80, dtype=np.uint8).reshape(8, 10)
    fig, ax = plotting.figure()
    draw.plot_grey_values(ax, image, {2: "red", 5: "green"}, 40, (3, 8))
    assert_allclose(ax.lines[0].get_ydata(), image[2, 3:9])
    assert_allclose(ax.lines[1].get_ydata(), image[5, 3:9])
    assert_allclose(ax.lines[2].get_ydata(), 40)
    plt.close(fig)


def test_pegs_of_a_mask_have_a_colour_of_their_own():
    image, mask = np.zeros((6, 9), np.uint8), np.zeros((6, 9), bool)
    mask[1:3, 1:3] = mask[4, 5:8] = True
    pegs = mask & (np.arange(6) < 3)[:, None]
    fig, axes = plotting.figure(3.0, 4.0, rows=2)
    draw.plot_masks(axes, image, [(mask, pegs, "1 peg")], "image", (0, 8, 0, 5))
    drawn = axes[1].images[0]
    colors = drawn.cmap(drawn.norm(drawn.get_array()))[..., :3]
    assert_allclose(colors[pegs], np.tile(to_rgb(draw.PEG), (4, 1)))
    assert len(np.unique(colors.reshape(-1, 3), axis=0)) == 3
    assert [ax.get_title() for ax in axes] == ["image", "1 peg"]
    plt.close(fig)


def test_a_threshold_below_half_way_cuts_outside_the_edge():
    fig, ax = plotting.figure()
    draw.plot_edge(ax, {"outside": 60.0, "inside": 160.0}, 1.0, 84.13)
    profile, _, level, cut = ax.lines
    assert_allclose(np.interp(cut.get_xdata()[0], profile.get_xdata(), profile.get_ydata()), 84.13, atol=0.1)
    assert cut.get_xdata()[0] < 0 and level.get_xdata()[1] == cut.get_xdata()[0]
    plt.close(fig)


def test_the_bias_is_drawn_as_a_range_and_as_a_line_for_each_peg():
    thresholds, bias = np.arange(3.0), np.array([[0.1, 0.3], [0.0, 0.2], [-0.1, 0.1]])
    fig, (left, right) = plotting.figure(columns=2)
    draw.plot_mask_bias(left, thresholds, bias, bias.mean(axis=1))
    draw.plot_bias_left(right, thresholds, bias - 0.2)
    outline = left.collections[0].get_paths()[0].vertices
    assert_allclose([outline[:, 1].min(), outline[:, 1].max()], [-0.1, 0.3])
    assert_allclose([line.get_ydata() for line in right.lines[:2]], (bias - 0.2).T)
    plt.close(fig)
