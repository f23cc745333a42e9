"""The hub of notebook 12 is drawn where the camera sees it."""

from matplotlib.patches import Circle
from numpy.testing import assert_allclose

from pegpose_lab import estimate_pose, locate_pegs
from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import assembly
from pegpose_lab.paper import paper_experiment


def test_pegs_and_axes_are_drawn_at_their_places():
    truth = paper_experiment()
    frame = truth.hub_frame(0)
    observation = locate_pegs(frame, truth.hub)
    fig, ax = plotting.figure()
    assembly.plot_located_hub(ax, frame, observation, truth.camera, estimate_pose(observation, truth.camera, truth.hub))
    centers = [patch.center for patch in ax.patches if isinstance(patch, Circle)]
    exact = truth.camera.project(truth.hub.peg_centers, truth.cam_from_hubs[0])
    assert_allclose(centers, exact, atol=0.6)  # the centre of a disc's image is not the image of its centre
    x_axis = ax.texts[-2]
    assert_allclose(x_axis.xyann, truth.camera.project([[0, 0, 0]], truth.cam_from_hubs[0])[0], atol=0.2)
    assert [text.get_text() for text in ax.texts[:4]] == ["1", "2", "3", "4"]
    plotting.plt.close(fig)
