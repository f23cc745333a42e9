"""Rings of notebook 10 stand where they were found, and its bars are as long as their counts."""

import pandas as pd
from numpy.testing import assert_allclose

from pegpose_lab import study
from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import real_parts


def test_bars_add_up_to_the_known_discs_and_the_false_circles():
    counts = pd.DataFrame(
        {"pictures": [2, 1], "known": [36, 24], "found": [21, 24], "false": [5, 0], "measured": [15, 20],
         "partial": [3, 4], "false_measured": [1, 0]},
        index=["heap", "coins"],
    )  # fmt: skip
    fig, axes = plotting.figure(9, 3, columns=2, sharey=True)
    real_parts.plot_counts(axes, counts)
    widths = [[[bar.get_width() for bar in part] for part in ax.containers] for ax in axes]
    assert widths[0] == [[15, 20], [3, 4], [3, 0], [15, 0]] and widths[1] == [[4, 0], [1, 0]]
    assert [text.get_text() for text in axes[0].texts] == ["21 of 36", "24 of 24"]
    assert [label.get_text() for label in axes[0].get_yticklabels()] == ["heap\n(2 images)", "coins\n(1 image)"]
    fig.draw_without_rendering()
    plotting.plt.close(fig)


def test_every_place_of_a_ring_has_its_circle_and_its_number_inside_the_panel():
    rings, places = study.load_measured("real_rings"), study.load_measured("real_ring_places")
    fig, axes = plotting.figure(8.4, 6.4, 2, 3)
    real_parts.plot_rings(axes.flat, rings, places, study.load_measured("real_ring_circles"))
    for ax, picture in zip(axes.flat, rings["picture"], strict=True):
        seen = places[places["picture"] == picture]
        assert_allclose([patch.center for patch in ax.patches[-len(seen) :]], seen[["x", "y"]])
        *numbers, scale = ax.texts
        assert [text.get_text() for text in numbers] == seen["place"].astype(str).tolist()
        assert scale.get_text().endswith(" px")
        (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
        for (x, y), r in zip(seen[["x", "y"]].to_numpy(), seen["r"], strict=True):
            assert left < x - r < x + r < right and top < y - r < y + r < bottom
        assert all(left < text.xy[0] < right and top < text.xy[1] < bottom for text in numbers)
    shown = [text.get_text() for text in fig.legends[0].get_texts()]
    assert shown == ["measured", "partial", "circles found without the ring"]  # no place is contradicted
    plotting.plt.close(fig)


def test_pulls_stand_beside_the_aim():
    fig, ax = plotting.figure(5, 2)
    real_parts.plot_pulls(ax, pd.DataFrame({"dataset": ["a", "b"], "pull": [1.1, 1.4]}), (0.8, 1.3))
    assert_allclose(ax.lines[-1].get_xdata(), [1.1, 1.4])
    assert [text.get_text() for text in fig.legends[0].get_texts()][0] == "aim: 0.8 to 1.3"
    fig.draw_without_rendering()
    plotting.plt.close(fig)


def test_places_without_a_disc_are_dashed():
    fig, ax = plotting.figure(5, 5)
    real_parts.plot_states(ax, [[10.0, 20.0], [40.0, 20.0]], [5.0, 6.0], ["measured", "missing"])
    assert [patch.get_linestyle() for patch in ax.patches] == ["-", "--"]
    assert [text.get_text() for text in ax.texts] == ["1 measured", "2 missing"]
    plotting.plt.close(fig)
