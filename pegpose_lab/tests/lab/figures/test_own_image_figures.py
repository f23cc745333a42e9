"""The figures of the notebook for own images."""

from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Hub, locate_pegs, render_hub
from pegpose_lab.lab import image_plots, plotting
from pegpose_lab.lab.figures import own_images
from pegpose_lab.own_images import BoardImage
from pegpose_lab.paper import paper_camera


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


def test_the_rims_of_a_tilted_hub_are_ellipses_on_its_pegs():
    camera, hub = paper_camera(), Hub()
    cam_from_hub = RigidTransform.from_components([4.0, -3.0, 420.0], Rotation.from_euler("xyz", [30, -20, 25], True))
    image = render_hub(camera, cam_from_hub, hub, rng=0)
    seen = locate_pegs(image, hub)
    turn = np.linspace(0, 2 * np.pi, 400)
    circle = hub.peg_radius * np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    truth = np.stack([camera.project(center + circle, cam_from_hub) for center in hub.peg_centers])
    for rim in image_plots.peg_rims(seen):
        distances = np.linalg.norm(rim[:, None, None] - truth, axis=-1).min(axis=(1, 2))
        assert distances.max() < 1.0
    fig, ax = plotting.figure()
    own_images.plot_found(ax, image, seen)
    assert [text.get_text() for text in ax.texts] == ["1", "2", "3", "4"]
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert all(left < x < right and top < y < bottom for rim in image_plots.peg_rims(seen) for x, y in rim)
    plotting.plt.close(fig)
