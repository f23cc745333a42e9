"""The drawn figures: what they draw is geometry, and no text hides another."""

import importlib.util
import itertools
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.patches import FancyArrowPatch
from numpy.testing import assert_allclose

from pegpose_lab.lab import plotting
from pegpose_lab.paper.diagrams import assembly, camera_model, orientation, overview, space
from pegpose_lab.pose import chain
from pegpose_lab.targets import Hub


def draw_orientation(ax):
    orientation.draw_orientation(ax, Hub(), np.deg2rad(-35.0))


SIZES = {
    assembly.draw_assembly: (7.0, 4.6),
    overview.draw_overview: (7.0, 4.4),
    camera_model.draw_camera_model: (7.0, 4.2),
    draw_orientation: (5.0, 4.9),
}


@pytest.fixture
def axes():
    fig, ax = plotting.figure()
    yield ax
    plt.close(fig)


@pytest.mark.parametrize("draw", SIZES, ids=lambda draw: draw.__name__)
def test_texts_are_apart_and_inside_the_figure(draw, axes):
    axes.figure.set_size_inches(*SIZES[draw])
    draw(axes)
    boxes = _text_boxes(axes)
    assert len(boxes) > 5
    for (first, a), (second, b) in itertools.combinations(boxes.items(), 2):
        assert not a.overlaps(b), f"{first} overlaps {second}"
    low, high = axes.figure.bbox.get_points()
    for text, box in boxes.items():
        assert np.all(box.get_points() >= low) and np.all(box.get_points() <= high), text


@pytest.mark.parametrize("draw", SIZES, ids=lambda draw: draw.__name__)
def test_same_drawing_twice(draw):
    pictures = []
    for _ in range(2):
        fig, ax = plotting.figure(*SIZES[draw])
        draw(ax)
        fig.canvas.draw()
        pictures.append(np.asarray(fig.canvas.buffer_rgba()).copy())
        plt.close(fig)
    assert np.array_equal(*pictures)


def test_look_at_has_the_target_on_the_axis_and_up_upwards():
    eye, target = np.array([3.0, -50.0, 20.0]), np.array([10.0, 4.0, 2.0])
    cam_from_world = space.look_at(eye, target, (0, 0, 1))
    assert_allclose(cam_from_world.apply(eye), 0, atol=1e-12)
    assert_allclose(cam_from_world.apply(target), [0, 0, np.linalg.norm(target - eye)], atol=1e-12)
    x, y, _ = cam_from_world.apply(target + [0, 0, 1])
    assert x == pytest.approx(0, abs=1e-12) and y < 0
    assert_allclose(np.linalg.det(cam_from_world.rotation.as_matrix()), 1)


@pytest.mark.parametrize("theta", np.deg2rad([-170.0, -90.0, -35.0, 0.0, 20.0, 90.0, 135.0]))
def test_orientation_draws_theta(theta, axes):
    line1, line2 = orientation.draw_orientation(axes, Hub(), theta)
    (x0, y0), (x1, y1) = line1.get_xydata()
    assert np.arctan2(y1 - y0, x1 - x0) == pytest.approx(theta)
    assert np.hypot(x1 - x0, y1 - y0) == pytest.approx(Hub().pitch_circle_diameter / 2)
    (u0, v0), (u1, v1) = line2.get_xydata()
    assert v1 == v0 and u1 > u0


def test_orientation_is_seen_as_on_the_screen(axes):
    orientation.draw_orientation(axes, Hub(), 0.3)
    axes.figure.canvas.draw()  # sets the aspect
    assert axes.yaxis_inverted() and not axes.xaxis_inverted()
    places = {text.get_text(): axes.transData.transform(text.get_position()) for text in axes.texts}
    middle = axes.transData.transform((0, 0))
    angles = [np.arctan2(*(places[f"peg {number}"] - middle)[::-1]) for number in (1, 2, 3, 4)]
    turns = np.diff(np.unwrap(angles))
    assert_allclose(turns, -np.pi / 2)  # clockwise, in coordinates with y up


@pytest.mark.parametrize("n_pegs", [3, 5, 6])
def test_orientation_of_other_hubs(n_pegs, axes):
    orientation.draw_orientation(axes, Hub(n_pegs=n_pegs), 0.2)
    assert sum(text.get_text().startswith("peg ") for text in axes.texts) == n_pegs


@pytest.mark.parametrize("theta", [np.nan, np.inf, "east"])
def test_orientation_rejects(theta, axes):
    with pytest.raises(ValueError, match="theta"):
        orientation.draw_orientation(axes, Hub(), theta)


def test_camera_model_obeys_equation_3(axes):
    drawn = camera_model.draw_camera_model(axes)
    camera, point = drawn["camera"], drawn["point"]
    x_d, y_d = drawn["distorted"]
    assert_allclose(drawn["undistorted"], drawn["distorted"] * (1 + camera.kappa1 * (x_d**2 + y_d**2)))
    assert_allclose(drawn["undistorted"] / camera.focal_length, point[:2] / point[2])
    assert camera.kappa1 > 0  # barrel: towards the principal point
    moved = 1 - np.linalg.norm(drawn["distorted"]) / np.linalg.norm(drawn["undistorted"])
    assert "exaggerated" in axes.get_xlabel() and f"{moved:.0%}" in axes.get_xlabel()


def test_camera_model_is_drawn_in_perspective(axes):
    drawn = camera_model.draw_camera_model(axes)
    seen = np.append(drawn["undistorted"], drawn["camera"].focal_length)
    origin, image, point = drawn["view"](np.array([np.zeros(3), seen, drawn["point"]]))
    turn = np.linalg.det([image - origin, point - origin])
    assert turn == pytest.approx(0, abs=1e-6)  # one straight ray
    assert any(_holds_points(line, origin, image, point) for line in axes.lines)
    dots = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "o"]
    for place in (image, point):
        assert min(np.linalg.norm(dot - place) for dot in dots) < 1e-9


def test_assembly_arrows_connect_the_frames_of_equations_1_and_2(axes):
    places = assembly.draw_assembly(axes)
    assert set(assembly.TRANSFORMS) == {("R", "C"), ("C", "P"), ("P", "E"), ("C", "E"), ("R", "E")}
    written = {text.get_text().replace("\n", "") for text in axes.texts}
    for (start, end), name in assembly.TRANSFORMS.items():
        assert any(f"{{{start}}}T_{{{end}}}" in text and text.endswith(name) for text in written), name
    arrows = [patch.get_path().vertices for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    near = 0.05 * np.linalg.norm(places["C"] - places["R"])
    for start, end in assembly.TRANSFORMS:
        begins = [arrow for arrow in arrows if np.linalg.norm(arrow[0] - places[start]) < near]
        assert any(np.linalg.norm(arrow - places[end], axis=1).min() < near for arrow in begins), (start, end)


def test_assembly_uses_the_names_of_the_pose_module():
    arguments = chain.robot_from_end_effector.__code__.co_varnames[:3]
    assert [assembly.TRANSFORMS[key] for key in (("R", "C"), ("C", "P"), ("P", "E"))] == list(arguments)
    assert assembly.TRANSFORMS["R", "E"] == "robot_from_end_effector"
    assert assembly.TRANSFORMS["C", "E"] in chain.hub_from_end_effector.__code__.co_varnames


def test_overview_names_modules_that_exist(axes):
    overview.draw_overview(axes)
    names = " ".join(step[2] for step in overview.CALIBRATION_STEPS + overview.FRAME_STEPS).split()
    drawn = " ".join(text.get_text() for text in axes.texts)
    package = Path(importlib.util.find_spec("pegpose_lab").origin).parent
    for name in names:
        assert name in drawn and (package / name).exists() and (package / name).is_dir() == name.endswith("/"), name


def _text_boxes(ax):
    """Where each text is drawn, px."""
    ax.figure.canvas.draw()
    renderer = ax.figure.canvas.get_renderer()
    texts = [text for text in (*ax.texts, ax.xaxis.label) if text.get_text()]
    return {text.get_text(): text.get_window_extent(renderer) for text in texts}


def _holds_points(line, *points):
    data = line.get_xydata()
    return len(data) == len(points) and np.allclose(data, points)
