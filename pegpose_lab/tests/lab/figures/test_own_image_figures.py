"""The figures of the notebook for own images."""

from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np

from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import own_images
from pegpose_lab.own_images import BoardImage


def test_corners_are_drawn_where_they_lie_and_only_of_used_images(tmp_path: Path):
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.full((60, 80), 120, np.uint8))
    corners = np.array([[10.0, 20.0], [30.0, 20.0], [30.0, 40.0]])
    used = BoardImage(path, "3 of 3 corners", (80, 60), np.arange(3), corners, used=True)
    left_out = BoardImage(path, "not found", (80, 60))
    fig, (left, right) = plotting.figure(6.0, 3.0, 1, 2)
    own_images.plot_board(left, used)
    own_images.plot_coverage(right, [used, left_out])
    for ax in (left, right):
        (line,) = ax.lines
        np.testing.assert_array_equal(line.get_xydata(), corners)
    assert right.get_ylim() == (59.5, -0.5) and right.get_title() == "3 corners of 1 images"
    plt.close(fig)
