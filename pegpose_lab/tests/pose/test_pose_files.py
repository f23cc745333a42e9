"""Poses as files: ROS's Detection3D and the CSV of a sequence, read back."""

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import RigidTransform, Rotation

import pegpose_lab as pl
from pegpose_lab.pose import pose_table, table_poses

CAMERA = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
HUB = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)


@pytest.fixture(scope="module")
def poses():
    """Two estimated poses, the second in the plane only."""
    truth = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0.1, -0.2, 0.3]))
    observation = pl.locate_pegs(pl.render_hub(CAMERA, truth, HUB, rng=0), HUB)
    flat = pl.estimate_pose(observation, CAMERA, HUB, plane=truth)
    return [pl.estimate_pose(observation, CAMERA, HUB), flat]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "pose.yaml"


def test_a_detection_is_read_back_to_the_last_digits(poses, path):
    pl.write_detection(path, poses[0], "camera_optical_frame", class_id="wheel-hub", stamp=1234567890.25)
    found = pl.read_detection(path)
    away = found.pose.inv() * poses[0].cam_from_hub
    assert np.abs(away.translation).max() < 1e-10 and away.rotation.magnitude() < 1e-12
    np.testing.assert_allclose(found.covariance, poses[0].covariance, rtol=1e-12)
    assert (found.frame_id, found.class_id, found.stamp, found.score) == (
        "camera_optical_frame",
        "wheel-hub",
        1234567890.25,
        1.0,
    )
    np.testing.assert_allclose(found.size, [97.05 + 20.2, 97.05 + 20.2, 0.0], atol=0.3)


def test_a_detection_has_the_units_and_the_order_of_ros(poses, path):
    pl.write_detection(path, poses[0], "camera")
    message = yaml.safe_load(path.read_text())
    (result,) = message["results"]
    assert set(message) == {"header", "results", "bbox", "id"}
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "camera"}
    assert result["hypothesis"] == {"class_id": "hub", "score": 1.0}
    assert result["pose"]["pose"]["position"]["z"] == pytest.approx(poses[0].cam_from_hub.translation[2] / 1000)
    turn = result["pose"]["pose"]["orientation"]
    same = Rotation.from_quat([turn[name] for name in "xyzw"])
    assert (same.inv() * poses[0].cam_from_hub.rotation).magnitude() < 1e-12
    rows = np.reshape(result["pose"]["covariance"], (6, 6))  # row-major: x with x, x with y, ...
    assert rows[0, 4] == pytest.approx(poses[0].covariance[0, 4] / 1000)  # m rad
    assert rows[2, 2] == pytest.approx(poses[0].covariance[2, 2] / 1e6)  # m^2
    assert rows[5, 5] == pytest.approx(poses[0].covariance[5, 5])  # rad^2


def test_the_covariance_is_that_of_turns_in_the_named_frame(poses, path):
    """Poses drawn from the file's covariance, as ROS reads it, have the scatter that the estimate states."""
    pl.write_detection(path, poses[0], "camera")
    found, rng = pl.read_detection(path), np.random.default_rng(0)
    drawn = rng.multivariate_normal(np.zeros(6), found.covariance, size=20_000)
    moved = Rotation.from_rotvec(drawn[:, 3:]) * found.pose.rotation
    peg = moved.apply(HUB.peg_centers[0]) + drawn[:, :3] + found.pose.translation
    arm = poses[0].cam_from_hub.rotation.apply(HUB.peg_centers[0])
    design = np.hstack([np.eye(3), [[0, arm[2], -arm[1]], [-arm[2], 0, arm[0]], [arm[1], -arm[0], 0]]])
    np.testing.assert_allclose(peg.std(axis=0), np.sqrt(np.diag(design @ poses[0].covariance @ design.T)), rtol=0.03)


def test_a_pose_without_covariance_is_written_as_unknown(poses, path):
    pose = pl.pose.HubPose(**{**vars(poses[0]), "covariance": None})
    pl.write_detection(path, pose, "camera")
    assert np.isinf(np.diag(pl.read_detection(path).covariance)).all()


@pytest.mark.parametrize(
    "names", [{"frame_id": ""}, {"frame_id": "camera", "class_id": 3}, {"frame_id": "c", "stamp": -1}]
)
def test_unusable_names_write_nothing(poses, path, names):
    with pytest.raises(ValueError, match="frame_id|class_id|stamp"):
        pl.write_detection(path, poses[0], **names)
    assert not path.exists()


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("frame_id", "frame", "it has no 'frame_id'"),
        ("results:", "result:", "it has no 'results'"),
        ("covariance: [", "covariance: [1.0, ", "has 37 numbers; expected 36"),
        ("position: {x: ", "position: {x: .nan, u: ", "not finite"),
        ("orientation: {x: ", "orientation: {x: a, u: ", "could not convert"),
        ("header:", "{", "it is no YAML"),
    ],
)
def test_a_damaged_file_says_why(poses, path, old, new, reason):
    pl.write_detection(path, poses[0], "camera")
    text = yaml.safe_dump(yaml.safe_load(path.read_text()), default_flow_style=None, width=10_000, sort_keys=False)
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=reason):
        pl.read_detection(path)


def test_of_several_messages_and_hypotheses_the_first_and_likeliest_is_read(poses, path):
    pl.write_detection(path, poses[0], "camera")
    message = yaml.safe_load(path.read_text())
    likely = message["results"][0]
    unlikely = {"hypothesis": {"class_id": "bowl", "score": 0.2}, "pose": likely["pose"]}
    message["results"] = [unlikely, likely]
    path.write_text("---\n" + yaml.safe_dump(message) + "---\n{}\n")
    assert pl.read_detection(path).class_id == "hub"


def test_a_sequence_is_read_back_to_the_last_bit(poses, tmp_path):
    entries, times = [poses[0], "no peg:\n3 circles, expected 4", poses[1]], [0.0, 0.1, 0.2]
    pl.write_pose_table(tmp_path / "poses.csv", entries, times=times)
    table, written = pl.read_pose_table(tmp_path / "poses.csv"), pose_table(entries, times=times)
    assert table.equals(written)
    assert table["status"].tolist() == ["", "no peg: 3 circles, expected 4", ""]
    found, covariances = table_poses(table)
    assert found[1] is None and np.isnan(covariances[1]).all()
    for number, pose in ((0, poses[0]), (2, poses[1])):
        np.testing.assert_allclose(found[number].as_matrix(), pose.cam_from_hub.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(covariances[number], pose.covariance, rtol=1e-12)
        assert table.loc[number, ["x", "y", "theta"]].tolist() == [pose.x, pose.y, pose.theta]


def test_unusable_sequences(poses, tmp_path):
    with pytest.raises(ValueError, match=r"times has 1 values and poses 2"):
        pose_table(poses, times=[0.0])
    with pytest.raises(ValueError, match=r"poses\[0\] is NoneType"):
        pose_table([None])
    with pytest.raises(ValueError, match="pose is LostFrame"):
        pl.write_detection(tmp_path / "pose.yaml", pl.LostFrame(1, "found 0 discs"), "camera")
    assert pose_table([pl.LostFrame(1, "found 0 discs")])["status"].tolist() == ["found 0 discs"]
    (tmp_path / "other.csv").write_text("frame,x\n1,2\n")
    with pytest.raises(ValueError, match="it has no column y"):
        pl.read_pose_table(tmp_path / "other.csv")
