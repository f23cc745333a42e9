"""The bars of notebook 10 are as long as their counts."""

import pandas as pd

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
