"""The rendered experiment is the paper's, as far as the paper is printed."""

import numpy as np
import pytest

from pegpose_lab.paper import N_FRAMES, numbers, paper_camera, paper_experiment, paper_pose
from pegpose_lab.render import disc_outline


@pytest.fixture(scope="module")
def experiment():
    return paper_experiment()


def test_the_camera_is_the_consistent_reading():
    camera = paper_camera()
    assert camera.pixel_pitch[0] == pytest.approx(0.0371, abs=5e-5)
    assert camera.focal_length / camera.pixel_pitch[0] == pytest.approx(1292, abs=0.5)
    assert camera.image_size == (1600, 1200) and camera.principal_point == (799.5, 599.5)
    corner = np.hypot(*camera.to_sensor([(0, 0)])[0])
    assert camera.kappa1 * corner**2 == pytest.approx(0.015, abs=5e-4)


def test_the_pose_is_table_1_on_so3():
    rotation = paper_pose().rotation.as_matrix()
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.abs(rotation - numbers.table1_rotation()).max() < 1.5e-3
    assert paper_pose().translation.tolist() == [-945.2, 663.51, 267.38]


def test_five_boards_are_seen_whole_in_five_orientations(experiment):
    assert len(experiment.cam_from_boards) == numbers.printed("setup.orientations")
    tilts = []
    for pose in experiment.cam_from_boards:
        corners = experiment.camera.project(experiment.board.object_points, pose)
        assert corners.min() > 60 and np.all(corners.max(axis=0) < np.array([1600, 1200]) - 60)
        tilts.append(np.degrees(pose.rotation.as_rotvec())[:2])
    gaps = [np.hypot(*(tilts[a] - tilts[b])) for a in range(4) for b in range(a)]
    assert min(gaps) > 10


def test_the_first_board_is_seen_at_the_depth_that_table_1_implies(experiment):
    middle = experiment.cam_from_boards[0].apply(experiment.board.center)
    assert middle[2] == pytest.approx(372, abs=1)
    assert np.hypot(*middle[:2]) < 1


def test_frame_1_looks_as_table_2_says(experiment):
    table = numbers.table2()
    pixels = experiment.camera.project(experiment.hub.peg_centers, experiment.cam_from_hubs[0])
    assert pixels.mean(axis=0) == pytest.approx(table[["x_px", "y_px"]].to_numpy().mean(axis=0), abs=6)
    assert np.abs(pixels - table[["x_px", "y_px"]].to_numpy()).max() < 25  # the plane's tilt is not in Table 2
    middle = experiment.camera.project([[0.0, 0.0, 0.0]], experiment.cam_from_hubs[0])[0]
    printed = table[["x_px", "y_px"]].to_numpy()
    assert middle == pytest.approx(printed.mean(axis=0), abs=1e-6)
    arms = np.array([pixels[0] - middle, printed[0] - middle])
    assert abs(np.rad2deg(np.diff(np.arctan2(arms[:, 1], arms[:, 0])).item())) < 1


def test_every_peg_is_seen_whole_in_every_frame(experiment):
    assert len(experiment.cam_from_hubs) == N_FRAMES == numbers.printed("setup.frames")
    for pose in experiment.cam_from_hubs:
        for center in experiment.hub.peg_centers:
            rim = disc_outline(experiment.camera, pose, center, experiment.hub.peg_radius)
            assert rim.min() > 10 and np.all(rim.max(axis=0) < (1590, 1190))


def test_the_hub_only_turns_about_z_and_shifts_along_x(experiment):
    plane_from_cam = experiment.cam_from_plane.inv()
    for theta, shift, pose in zip(experiment.thetas, experiment.shifts, experiment.cam_from_hubs, strict=False):
        hub = plane_from_cam * pose
        assert hub.translation == pytest.approx([shift, 0, 0], abs=1e-9)
        turn = np.angle(np.exp(1j * (hub.rotation.as_rotvec()[2] - theta)))
        assert turn == pytest.approx(0, abs=1e-9) and hub.rotation.as_rotvec()[:2] == pytest.approx([0, 0], abs=1e-9)


def test_pictures_follow_the_seed_and_the_index(experiment):
    first = experiment.hub_frame(0, rng=1)
    assert first.shape == (1200, 1600) and first.dtype == np.uint8
    assert np.array_equal(first, experiment.hub_frame(0, rng=1))
    assert not np.array_equal(first, experiment.hub_frame(0, rng=2))
