"""The figures of notebook 12 show the hub where the camera sees it, and the numbers of their tables."""

import numpy as np
from numpy.testing import assert_allclose

from pegpose_lab import estimate_pose, locate_pegs, study
from pegpose_lab.lab import plotting
from pegpose_lab.lab.figures import assembly
from pegpose_lab.paper import paper_experiment
from pegpose_lab.render import true_disc


def test_pegs_and_axes_are_drawn_at_their_places():
    truth = paper_experiment()
    frame = truth.hub_frame(0)
    observation = locate_pegs(frame, truth.hub)
    fig, ax = plotting.figure()
    assembly.plot_located_hub(ax, frame, observation, truth.camera, estimate_pose(observation, truth.camera, truth.hub))
    exact = [
        true_disc(truth.camera, truth.cam_from_hubs[0], peg, truth.hub.peg_radius) for peg in truth.hub.peg_centers
    ]
    for rim, disc in zip(ax.lines[:4], exact, strict=True):
        assert_allclose(rim.get_xydata()[:-1].mean(axis=0), disc.centroid, atol=0.6)
        x, y = (rim.get_xydata() - disc.centroid).T
        area = np.abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2
        assert_allclose(area, disc.area, rtol=0.003)
    x_axis = ax.texts[4]
    assert [text.get_text() for text in ax.texts[5::2]] == ["hub $x$", "hub $y$"]
    assert_allclose(x_axis.xyann, truth.camera.project([[0, 0, 0]], truth.cam_from_hubs[0])[0], atol=0.2)
    assert [text.get_text() for text in ax.texts[:4]] == ["1", "2", "3", "4"]
    plotting.plt.close(fig)


def test_clearances_for_999_per_mille_are_written_beside_their_dots():
    curves = study.load_measured("chain_clearances")
    fig, axes = plotting.figure(9.0, 5.6, 2, 2, sharex=True, sharey="row")
    assembly.plot_clearances(axes, curves, {chain: chain for chain in assembly.WAYS})
    for ax, (_, table) in zip(axes[1], curves.groupby("cell"), strict=True):
        needed = table.groupby("chain")["clearance"].last().loc[list(assembly.WAYS)]
        dots = [line for line in ax.lines if line.get_marker() == "o"]
        assert_allclose([dot.get_xdata()[0] for dot in dots], needed)
        assert [dot.get_color() for dot in dots] == [color for color, _ in assembly.WAYS.values()]
        assert_allclose([float(text.get_text()) for text in ax.texts], needed, atol=0.005)
    assert len({color for color, _ in assembly.WAYS.values()}) == len(assembly.WAYS)
    plotting.plt.close(fig)


def test_rates_are_drawn_as_differences_from_what_was_promised():
    rates = study.load_measured("insertion_rates").query("outcome == 'free'")
    fig, axes = plotting.figure(9.0, 3.6, columns=2)
    assembly.plot_rates(axes, rates)
    for ax, (_, table) in zip(axes, rates.groupby("cell"), strict=True):
        dots = [container.lines[0].get_xdata()[0] for container in ax.containers]
        assert_allclose(dots, table["came"] - table["promised"])
        assert len(ax.get_yticklabels()) == len(table)
    plotting.plt.close(fig)


def test_the_error_of_the_servo_run_has_bars_of_two_sigmas():
    steps = study.load_measured("servo_steps")
    fig, axes = plotting.figure(8.6, 4.8, 2, 2)
    assembly.plot_servo(axes, steps, (0.1, 0.05))
    (errors,) = axes[1, 0].containers
    assert_allclose(errors.lines[0].get_ydata(), steps["distance"] - steps["off"])
    (bars,) = errors.lines[2]
    assert_allclose([np.ptp(bar[:, 1]) for bar in bars.get_segments()], 4 * steps["sigma"])
    assert [text.get_text() for text in fig.legends[0].get_texts()] == ["true", "tolerance", "estimate − truth, ±2σ"]
    plotting.plt.close(fig)


def test_the_taught_places_of_the_pegs_are_inside_the_frame_that_is_shown():
    fig, ax = plotting.figure()
    centers = [[600, 500], [800, 500], [700, 400], [700, 600]]
    assembly.plot_frame(ax, np.zeros((1200, 1600), np.uint8), centers, np.full(4, 20))
    assert_allclose([patch.center for patch in ax.patches], centers)
    assert ax.get_xlim() == (465, 935) and ax.get_ylim() == (735, 265)
    plotting.plt.close(fig)
