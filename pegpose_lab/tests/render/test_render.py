"""Renderings show the geometry exactly, with the blur and noise that were asked for."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.special import ndtr

from pegpose_lab import Checkerboard, Hub, TsaiCamera, render_board, render_hub
from pegpose_lab.paper import paper_experiment
from pegpose_lab.render import HubLook, disc_outline, true_disc

PAPER = paper_experiment()
CAMERA = TsaiCamera(24.0, (0.037, 0.037), (319.5, 239.5), (640, 480), kappa1=1e-4)
TILTED = RigidTransform.from_components([2.0, 1.0, 240.0], Rotation.from_euler("xy", [11, -4], degrees=True))
FLAT_LOOK = HubLook(texture=0, shading=0, wall=62, wall_shading=0, background=62, bore=62, screw=62)


def centroid(picture, background, middle, half):
    """Grey-value centroid and summed excess over `background` in a window around `middle`."""
    x0, y0 = np.rint(middle).astype(int)
    window = picture[y0 - half : y0 + half + 1, x0 - half : x0 + half + 1].astype(float) - background
    y, x = np.mgrid[y0 - half : y0 + half + 1, x0 - half : x0 + half + 1]
    return np.array([np.sum(window * x), np.sum(window * y)]) / window.sum(), window.sum()


@pytest.mark.parametrize("blur", [0.0, 0.4, 0.9, 1.5])
@pytest.mark.parametrize("frame", [0, 17])
def test_centroids_of_peg_tops_are_exact(blur, frame):
    hub = Hub(peg_height=0.0)
    pose = PAPER.cam_from_hubs[frame]
    picture = render_hub(PAPER.camera, pose, hub, look=FLAT_LOOK, blur=blur, noise=0)
    for center in hub.peg_centers:
        truth = true_disc(PAPER.camera, pose, center, hub.peg_radius)
        measured, excess = centroid(picture, 62, truth.centroid, int(truth.radius) + 8)
        assert np.abs(measured - truth.centroid).max() < 0.003
        assert np.sqrt(excess / (165 - 62) / np.pi) == pytest.approx(truth.radius, abs=0.003)


def test_true_disc_agrees_with_a_homography_of_the_conic():
    """Without distortion the image of a disc is an ellipse; its centre follows from the projected conic."""
    camera = TsaiCamera(24.0, (0.037, 0.037), (319.5, 239.5), (640, 480))
    center, radius = np.array([20.0, -15.0, 0.0]), 10.0
    rotation = TILTED.rotation.as_matrix()
    to_image = np.diag([24 / 0.037, 24 / 0.037, 1.0]) + [[0, 0, 319.5], [0, 0, 239.5], [0, 0, 0]]
    homography = to_image @ np.column_stack([rotation[:, 0], rotation[:, 1], TILTED.apply(center)])
    inverse = np.linalg.inv(homography)
    conic = inverse.T @ np.diag([1, 1, -(radius**2)]) @ inverse
    expected = np.linalg.solve(conic[:2, :2], -conic[:2, 2])
    disc = true_disc(camera, TILTED, center, radius)
    assert disc.centroid == pytest.approx(expected, abs=1e-4)
    area = np.pi * abs(np.linalg.det(conic)) / np.linalg.det(conic[:2, :2]) ** 1.5
    assert disc.radius == pytest.approx(np.sqrt(area / np.pi), rel=1e-5)
    assert np.hypot(*(disc.centroid - camera.project([center], TILTED)[0])) > 0.01


def test_board_edges_lie_where_the_camera_projects_them():
    """Half-way grey values on the line between two corners, noise-free."""
    board = Checkerboard(5, 4, 29.0)
    pose = TILTED * RigidTransform.from_translation(-board.center)
    picture = render_board(CAMERA, pose, board, blur=0.9, noise=0).astype(float)
    middles = board.object_points.reshape(4, 5, 3)[:, 1:, :] - [14.5, 0, 0]
    x, y = CAMERA.project(middles.reshape(-1, 3), pose).T
    assert map_coordinates(picture, [y, x], order=5) == pytest.approx(125.0, abs=1.5)


def test_corner_squares_follow_the_colour_of_the_first():
    board = Checkerboard(5, 4, 29.0)
    pose = TILTED * RigidTransform.from_translation(-board.center)
    picture = render_board(CAMERA, pose, board, blur=0, noise=0)
    squares = CAMERA.project([[-14.5, -14.5, 0], [14.5, -14.5, 0], [14.5, 14.5, 0], [-14.5, -35, 0]], pose)
    assert [int(picture[int(round(y)), int(round(x))]) for x, y in squares] == [30, 220, 30, 220]


def test_side_walls_lie_between_a_top_and_its_foot():
    hub = Hub()
    look = HubLook(wall=120, wall_shading=0, texture=0, shading=0)
    picture = render_hub(CAMERA, TILTED, hub, look=look, blur=0, noise=0)
    tops = CAMERA.project(hub.peg_centers, TILTED)
    feet = CAMERA.project(hub.peg_centers + [0, 0, hub.peg_height], TILTED)
    seen = np.hypot(*(feet - tops).T) > 6
    assert seen.sum() >= 2
    for center, top, foot in zip(hub.peg_centers[seen], tops[seen], feet[seen], strict=False):
        rim = disc_outline(CAMERA, TILTED, center, hub.peg_radius)
        outermost = rim[np.argmax((rim - top) @ (foot - top))]
        on_wall = outermost + 0.5 * (foot - top)
        assert picture[tuple(np.rint(on_wall[::-1]).astype(int))] == 120


def test_noise_has_the_stated_deviation_and_follows_the_seed():
    hub, look = Hub(), HubLook(texture=0, shading=0)
    quiet = render_hub(CAMERA, TILTED, hub, look=look, noise=0).astype(float)
    noisy = render_hub(CAMERA, TILTED, hub, look=look, noise=5.0, rng=7)
    assert np.std(noisy - quiet) == pytest.approx(np.sqrt(25 + 1 / 12), rel=0.01)
    assert abs(np.mean(noisy - quiet)) < 0.05
    assert np.array_equal(noisy, render_hub(CAMERA, TILTED, hub, look=look, noise=5.0, rng=7))
    assert not np.array_equal(noisy, render_hub(CAMERA, TILTED, hub, look=look, noise=5.0, rng=8))


def blurred_pixel(distance, blur):
    """Share of a pixel's blurred area beyond a straight edge: Phi(t / blur) integrated over the pixel's width."""
    t = np.asarray(distance)[:, None] + [0.5, -0.5]
    integral = t * ndtr(t / blur) + blur * np.exp(-0.5 * (t / blur) ** 2) / np.sqrt(2 * np.pi)
    return integral[:, 0] - integral[:, 1]


@pytest.mark.parametrize("blur", [0.7, 0.9, 1.2])
@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5])
def test_edge_profile_is_a_blurred_step_whatever_its_place_in_a_pixel(blur, phase):
    board = Checkerboard(3, 3, 29.0)
    camera = TsaiCamera(24.0, (0.037, 0.037), (319.5, 239.5), (640, 480))
    pose = RigidTransform.from_translation([-29 + phase * 240 * 0.037 / 24, -29, 240.0])
    picture = render_board(camera, pose, board, blur=blur, noise=0).astype(float)
    x_edge, y_edge = camera.project([[29.0, 14.5, 0]], pose)[0]
    columns = np.arange(int(x_edge) - 6, int(x_edge) + 8)
    profile = 30 + 190 * blurred_pixel(columns - x_edge, blur)
    measured = picture[int(y_edge), columns]
    assert measured == pytest.approx(profile if measured[-1] > 125 else 250 - profile, abs=2.0)


def test_scene_options_change_what_they_name():
    hub = Hub()
    plain = render_hub(CAMERA, TILTED, hub, noise=0, rng=1).astype(int)
    shiny = render_hub(CAMERA, TILTED, hub, noise=0, highlights=80, rng=1).astype(int)
    assert 20 < (shiny - plain).max() <= 80 and (shiny - plain).min() >= 0
    littered = render_hub(CAMERA, TILTED, hub, noise=0, clutter=60, rng=1).astype(int)
    top = CAMERA.project(hub.peg_centers, TILTED).round().astype(int)
    assert np.count_nonzero(littered != plain) > 500 and np.all(
        littered[top[:, 1], top[:, 0]] == plain[top[:, 1], top[:, 0]]
    )
    covered = render_hub(CAMERA, TILTED, hub, noise=0, occlusion=0.6, rng=1).astype(int)
    assert covered[top[0, 1], top[0, 0]] == 31 and covered[top[1, 1], top[1, 0]] == plain[top[1, 1], top[1, 0]]


def test_opencv_cameras_render_the_same_picture():
    hub = Hub()
    ours = render_hub(CAMERA, TILTED, hub, noise=0).astype(int)
    opencv = render_hub(CAMERA.to_opencv(), TILTED, hub, noise=0).astype(int)
    assert np.abs(ours - opencv).max() <= 1


@pytest.mark.parametrize(
    "change",
    [
        {"blur": -1},
        {"noise": np.nan},
        {"clutter": -5},
        {"clutter": 2.5},
        {"clutter": "3"},
        {"clutter": True},
        {"highlights": -1},
        {"occlusion": 2},
        {"rays": 35},
        {"rays": "34"},
        {"rays": None},
        {"blur": "1"},
    ],
)
def test_bad_options_are_named(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        render_hub(CAMERA, TILTED, Hub(), **change)


def test_targets_behind_the_camera_or_upside_down_are_refused():
    behind = RigidTransform.from_translation([0, 0, -300.0])
    with pytest.raises(ValueError, match="behind the camera"):
        render_board(CAMERA, behind, Checkerboard())
    with pytest.raises(ValueError, match="behind the camera"):
        render_hub(CAMERA, behind, Hub())
    below = RigidTransform.from_components([0, 0, 300.0], Rotation.from_euler("x", 180, degrees=True))
    with pytest.raises(ValueError, match="from below"):
        render_hub(CAMERA, below, Hub())
