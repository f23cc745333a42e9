"""The digest of a figure: a change that a reader could see changes it, one that no one can see does not."""

import doctest

import matplotlib.pyplot as plt
import numpy as np
import pytest

from pegpose_lab.lab import figure_digest as module
from pegpose_lab.lab import plotting
from pegpose_lab.lab.figure_digest import figure_digest
from pegpose_lab.lab.notebooks.agreement import texts_agree


def test_docstring():
    assert doctest.testmod(module).failed == 0


def _scene(change=lambda left, right: None, noise=0.0):
    """A digest of two axes with every kind of artist, after a change."""
    rng = np.random.default_rng(0)
    fig, (left, right) = plotting.figure(8.0, 3.0, 1, 2)
    x = np.linspace(0, 1, 40)
    left.plot(x, x**2 - 0.4 + noise, "o-", label="curve")
    left.axhline(0.25, color="red")
    left.hist(rng.normal(0.5, 0.1, 200), bins=np.linspace(0, 1, 11), label="bars")
    left.fill_between(x, -x, x, color="0.8")
    left.annotate("peak 0.5", (0.5, 0.2))
    left.legend()
    left.set(xlabel="x (mm)", ylabel="y (px)", title="left")
    right.imshow(rng.random((8, 8)) + noise)
    right.quiver([1, 2], [1, 2], [0.5, 0.1], [0.2, -0.3 + noise], angles="xy", scale_units="xy", scale=0.5)
    right.contour(np.add.outer(np.arange(8.0), np.arange(8.0)) + noise, levels=[3, 7])
    right.scatter([3, 4, 5], [3, 3, 4], c=[1, 2, 3], cmap="cividis")
    right.set_yticks([0, 7], ["top", "bottom"])
    plotting.plot_circles(right, [[2, 2], [5, 5]], [1, 2])
    fig.suptitle("both")
    change(left, right)
    fig.draw_without_rendering()
    text = figure_digest(fig)
    plt.close(fig)
    return text


CHANGES = {
    "sign of a curve": lambda left, right: left.lines[0].set_ydata(-left.lines[0].get_ydata()),
    "order of a curve": lambda left, right: left.lines[0].set_ydata(left.lines[0].get_ydata()[::-1]),
    "colour": lambda left, right: left.lines[0].set_color("black"),
    "marker": lambda left, right: left.lines[0].set_marker("s"),
    "label of an axis": lambda left, right: left.set_xlabel("x (um)"),
    "limit": lambda left, right: left.set_xlim(-0.2, 1.3),
    "inverted axis": lambda left, right: left.invert_yaxis(),
    "scale": lambda left, right: left.set_yscale("symlog"),
    "title": lambda left, right: left.set_title("right"),
    "legend dropped": lambda left, right: left.get_legend().remove(),
    "legend entry": lambda left, right: left.get_legend().get_texts()[0].set_text("other"),
    "line moved": lambda left, right: left.lines[1].set_ydata([30, 30]),
    "curve hidden": lambda left, right: left.lines[0].set_visible(False),
    "bar": lambda left, right: left.patches[4].set_height(1.0),
    "area": lambda left, right: left.collections[0].remove(),
    "text": lambda left, right: left.texts[0].set_text("peak 0.7"),
    "text moved": lambda left, right: left.texts[0].set_position((0.1, 0.2)),
    "arrows": lambda left, right: right.collections[0].set_UVC([-0.5, -0.1], [0.2, -0.3]),
    "scale of arrows": lambda left, right: setattr(right.collections[0], "scale", 0.25),
    "image turned": lambda left, right: right.images[0].set_data(np.asarray(right.images[0].get_array())[::-1]),
    "colour map": lambda left, right: right.images[0].set_cmap("viridis"),
    "range of colours": lambda left, right: right.images[0].set_clim(0, 2),
    "scattered values": lambda left, right: right.collections[2].set_array([3, 2, 1]),
    "tick labels": lambda left, right: right.set_yticks([0, 7], ["bottom", "top"]),
    "circle": lambda left, right: right.patches[0].set_radius(1.4),
    "heading": lambda left, right: left.figure.suptitle("all"),
    "axes hidden": lambda left, right: right.set_visible(False),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_visible_change_is_told(change):
    assert not texts_agree(_scene(), _scene(CHANGES[change]))


def test_rounding_is_not_told():
    assert texts_agree(_scene(), _scene(noise=1e-12))


def test_an_empty_figure_and_empty_artists_have_a_digest():
    fig, ax = plotting.figure()
    ax.plot([], [])
    ax.plot([np.nan], [1.0])
    ax.scatter([], [])
    fig.draw_without_rendering()
    assert figure_digest(fig).count("nothing") == 3
    plt.close(fig)


def test_what_lies_far_outside_is_told_as_outside():
    texts = []
    for far in (0.0, 1e-9):  # the first has no place on a logarithmic axis at all
        fig, ax = plotting.figure()
        ax.loglog([far, 1.0, 10.0], [1.0, 1.0, 10.0])
        ax.set(xlim=(0.5, 20), ylim=(0.5, 20))
        fig.draw_without_rendering()
        texts.append(figure_digest(fig))
        plt.close(fig)
    assert texts[0] == texts[1] and "-2.000" in texts[0]


def test_limits_are_told_to_a_hundredth_of_the_axis():
    fig, ax = plotting.figure()
    ax.set(xlim=(960, 959), ylim=(1e-20, 40))
    fig.draw_without_rendering()
    x, y = (line for line in figure_digest(fig).splitlines() if " to " in line)
    assert "9.6000e+02 to 9.5900e+02" in x and "0.0e+00 to 4.00e+01" in y
    ax.set(xscale="log", xlim=(0.12345, 1e4), ylim=(-39.97, 0))
    x, y = (line for line in figure_digest(fig).splitlines() if " to " in line)
    assert "1.23e-01 to 1.00e+04" in x and "-4.00e+01 to 0.0e+00" in y
    plt.close(fig)
