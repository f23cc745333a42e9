"""The rims of notebook 13 lie on the rims of the pegs, and all of them are shown."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Hub, locate_pegs, render_hub
from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import your_images
from pegpose_lab.paper import paper_camera


def test_the_rims_of_a_tilted_hub_are_ellipses_on_its_pegs():
    camera, hub = paper_camera(), Hub()
    cam_from_hub = RigidTransform.from_components([4.0, -3.0, 420.0], Rotation.from_euler("xyz", [30, -20, 25], True))
    image = render_hub(camera, cam_from_hub, hub, rng=0)
    seen = locate_pegs(image, hub)
    turn = np.linspace(0, 2 * np.pi, 400)
    circle = hub.peg_radius * np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    truth = np.stack([camera.project(center + circle, cam_from_hub) for center in hub.peg_centers])
    for rim in your_images.peg_rims(seen):
        distances = np.linalg.norm(rim[:, None, None] - truth, axis=-1).min(axis=(1, 2))
        assert distances.max() < 1.0
    fig, ax = plotting.figure()
    your_images.plot_found(ax, image, seen)
    assert [text.get_text() for text in ax.texts] == ["1", "2", "3", "4"]
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert all(left < x < right and top < y < bottom for rim in your_images.peg_rims(seen) for x, y in rim)
    plotting.plt.close(fig)
