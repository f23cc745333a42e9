"""What a calibration says, and that its files give it back."""

import cv2
import numpy as np
import pandas as pd
import pytest
import yaml

from pegpose_lab import (
    Calibration,
    Flag,
    calibrate_genetic,
    calibrate_joint,
    calibrate_tsai,
    calibrate_zhang,
)
from pegpose_lab.paper import paper_pose
from pegpose_lab.tests.calibration.views import BOARD, CAMERA, EXPERIMENT, WORLD_BOARD, five_views, view


def test_error_definitions():
    residuals = [np.array([[3.0, 4.0], [0.0, 0.0]]), np.array([[-3.0, 0.0]])]
    calibration = Calibration(CAMERA, [paper_pose()] * 2, residuals)
    assert calibration.mean_distance == pytest.approx(8 / 3)
    assert calibration.rms == pytest.approx(np.sqrt(34 / 3))
    assert calibration.axis_std == pytest.approx([3.0, np.sqrt(16 / 3)])


@pytest.mark.parametrize("method", ["tsai", "genetic", "joint", "zhang", "bent"])
def test_saved_calibrations_come_back(tmp_path, method):
    bent = BOARD + np.sin(BOARD[:, :1] / 25) * [0, 0, 1.0]  # mm
    run = {
        "tsai": lambda: calibrate_tsai(*view(noise=0.1), CAMERA),
        "genetic": lambda: calibrate_genetic(*view(noise=0.1), CAMERA, rng=0, box=0.001, generations=3),
        "joint": lambda: calibrate_joint(*five_views(0.1), CAMERA),
        "zhang": lambda: calibrate_zhang(*five_views(0.1), CAMERA.image_size),
        "bent": lambda: calibrate_joint(*five_views(0.1, board=bent), CAMERA),
    }[method]()
    run.save(tmp_path / "camera.yml")
    back = Calibration.load(tmp_path / "camera.yml")
    assert back.n_parameters == run.n_parameters is not None
    assert [flag.code for flag in back.flags] == [flag.code for flag in run.flags]
    assert back.flags == run.flags and len(back.cam_from_object) == len(run.cam_from_object)
    assert type(back.camera) is type(run.camera)
    for ours, theirs in zip(run.cam_from_object, back.cam_from_object, strict=True):
        assert theirs.as_matrix() == pytest.approx(ours.as_matrix(), rel=1e-12, abs=1e-12)
        points = BOARD if method in ("joint", "zhang", "bent") else WORLD_BOARD
        assert back.camera.project(points, theirs) == pytest.approx(run.camera.project(points, ours), abs=1e-8)
    for ours, theirs in zip(run.residuals, back.residuals, strict=True):
        assert np.array_equal(ours, theirs)
    assert back.freedom == run.freedom and back.sigmas_from == run.sigmas_from
    assert (back.covariance is back.classical_covariance) == (method != "bent")
    for name in ("history", "covariance", "classical_covariance"):
        ours, theirs = getattr(run, name), getattr(back, name)
        assert (ours is None) == (theirs is None)
        if ours is not None:
            pd.testing.assert_frame_equal(ours, theirs, check_exact=True, check_names=False)
    assert [path.name for path in tmp_path.iterdir()] == ["camera.yml"]


@pytest.mark.parametrize(
    "flags",
    [
        ("trail ", " lead", " ", "", "  "),
        ("a" * 5000, "b"),
        ("95 % interval", "100%", "%25", "%", "%%", "50 %ab"),
        ('He said: "no"', '"', "a\\", "'", "it's"),
        ("line 1\nline 2", "tab\t", "\x00", "\x1b"),
        ("ünï €", "\udc80"),
        ("- a", "~", "12", "# no", "%YAML", "[1, 2]", "a: b", "!!x"),
        (("é %" * 1500), " " * 2500, "%" * 1200),
    ],
)
def test_any_flag_comes_back(tmp_path, flags):
    Calibration(CAMERA, [paper_pose()], [np.ones((3, 2))], flags).save(tmp_path / "camera.yml")
    back = Calibration.load(tmp_path / "camera.yml").flags
    assert back == flags and {flag.code for flag in back} == {"unknown"}


def test_flags_of_files_without_codes_are_read_and_wrong_numbers_of_codes_refused(tmp_path):
    flags = Flag("edge-of-box", "one"), Flag('50 % "x"', "two"), "three"
    Calibration(CAMERA, [paper_pose()], [], flags).save(tmp_path / "camera.yml")
    assert [flag.code for flag in Calibration.load(tmp_path / "camera.yml").flags] == [
        "edge-of-box",
        '50 % "x"',
        "unknown",
    ]
    text = (tmp_path / "camera.yml").read_text()
    begin = text.index("flag_codes:")
    (tmp_path / "old.yml").write_text(text[:begin] + "...\n")
    old = Calibration.load(tmp_path / "old.yml").flags
    assert old == ("one", "two", "three") and {flag.code for flag in old} == {"unknown"}
    (tmp_path / "bad.yml").write_text(text.replace("   - unknown\n", "").replace('   - "unknown"\n', ""))
    with pytest.raises(ValueError, match=r"bad\.yml"):
        Calibration.load(tmp_path / "bad.yml")


def test_what_there_is_of_a_calibration_is_saved(tmp_path):
    """A camera alone, as a ROS file gives it, and poses without residuals."""
    calibrate_tsai(*view(), CAMERA).save(tmp_path / "camera.yaml", form="ros")
    Calibration.load(tmp_path / "camera.yaml").save(tmp_path / "camera.yml")
    again = Calibration.load(tmp_path / "camera.yml")
    assert again.residuals == [] and again.cam_from_object == [] and again.camera.image_size == CAMERA.image_size
    Calibration(CAMERA, [paper_pose()], []).save(tmp_path / "camera.yml")
    again = Calibration.load(tmp_path / "camera.yml")
    assert again.cam_from_object[0].as_matrix() == pytest.approx(paper_pose().as_matrix()) and again.residuals == []


def test_opencvs_own_calibration_files_give_the_camera(tmp_path, pegpose_data):
    found = Calibration.load(pegpose_data / "opencv_left" / "left_intrinsics.yml")
    assert found.camera.image_size == (640, 480) and found.residuals == [] and found.flags == ()
    assert found.camera.camera_matrix[:2, 2] == pytest.approx([342.28315473308373, 235.57082909788173], rel=1e-15)
    assert found.camera.dist_coeffs[[0, 4]] == pytest.approx([-0.26637260909660682, 0.23839153080878486], rel=1e-15)
    text = (pegpose_data / "opencv_left" / "left_intrinsics.yml").read_text()
    damages = ("flags: 2", "fisheye_model: 1"), ("image_width: 640", "image_width: 640.5"), ("cols: 1", "cols: 2")
    for old, new in damages:
        (tmp_path / "bad.yml").write_text(text.replace(old, new, 1))
        with pytest.raises(ValueError, match=r"bad\.yml"):
            Calibration.load(tmp_path / "bad.yml")


@pytest.mark.parametrize("counts", ["-3., 99.", "1e9, 48.", "47.5, 48.5", "0., 96.", "48., 47.", "96."])
def test_a_wrong_number_of_points_is_refused(tmp_path, counts):
    Calibration(CAMERA, [paper_pose()] * 2, [np.ones((48, 2))] * 2).save(tmp_path / "camera.yml")
    text = (tmp_path / "camera.yml").read_text()
    assert "data: [ 48., 48. ]" in text
    text = text.replace("data: [ 48., 48. ]", f"data: [ {counts} ]")
    one_count = "cols: {}\n   dt: d\n   data: [ 96"
    (tmp_path / "bad.yml").write_text(text.replace(one_count.format(2), one_count.format(1)))
    with pytest.raises(ValueError, match=r"bad\.yml"):
        Calibration.load(tmp_path / "bad.yml")


def test_opencv_can_read_a_saved_camera(tmp_path):
    run = calibrate_genetic(*view(), CAMERA, rng=0)
    run.save(tmp_path / "camera.yml")
    storage = cv2.FileStorage(str(tmp_path / "camera.yml"), cv2.FileStorage_READ)
    matrix, coefficients = (storage.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients"))
    pose = storage.getNode("extrinsic_parameters").mat()[0]
    points = np.ascontiguousarray(WORLD_BOARD)
    projected = cv2.projectPoints(points, pose[:3], pose[3:], matrix, coefficients)[0].reshape(-1, 2)
    assert projected == pytest.approx(CAMERA.project(WORLD_BOARD, paper_pose()), abs=1e-4)


@pytest.mark.parametrize("method", ["tsai", "zhang"])
def test_ros_camera_info_comes_back(tmp_path, method):
    run = (
        calibrate_tsai(*view(noise=0.1), CAMERA)
        if method == "tsai"
        else calibrate_zhang(*five_views(0.1), CAMERA.image_size, coefficients=("k1", "k2", "p1", "p2", "k3"))
    )
    run.save(tmp_path / "camera.yaml", form="ros")
    info = yaml.safe_load((tmp_path / "camera.yaml").read_text())
    assert (info["image_width"], info["image_height"]) == CAMERA.image_size
    assert info["distortion_model"] == "plumb_bob" and info["projection_matrix"]["cols"] == 4
    back = Calibration.load(tmp_path / "camera.yaml")
    pose = EXPERIMENT.cam_from_boards[1]
    assert back.camera.project(BOARD, pose) == pytest.approx(run.camera.project(BOARD, pose), abs=1e-3)
    with pytest.raises(ValueError, match="no residuals"):
        back.rms  # noqa: B018


def test_a_form_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(ValueError, match="form"):
        calibrate_tsai(*view(), CAMERA).save(tmp_path / "camera.json", form="json")
    assert not list(tmp_path.iterdir())


def test_loading_executes_nothing(tmp_path):
    marker = tmp_path / "executed"
    text = f"!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{marker}']]"
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(ValueError, match="bad.yaml"):
        Calibration.load(tmp_path / "bad.yaml")
    assert not marker.exists()


def test_an_interrupted_save_leaves_the_old_file(tmp_path, monkeypatch):
    run = calibrate_tsai(*view(), CAMERA)
    run.save(tmp_path / "camera.yml")
    before = (tmp_path / "camera.yml").read_bytes()

    def full_disk(*_args, **_options):
        raise OSError("no space left")

    monkeypatch.setattr("pathlib.Path.write_text", full_disk)
    with pytest.raises(OSError, match="no space"):
        run.save(tmp_path / "camera.yml")
    assert (tmp_path / "camera.yml").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hello",
        "%YAML:1.0\n---\nfoo: [1,",
        "%YAML:1.0\n---\nformat: other\n",
        "\0\1\2",
        "!!python/object/apply:os.system",
        "[" * 3000,
        "%YAML:1.0\n---\nformat: " + "[" * 3000,
    ],
)
def test_files_that_are_no_calibration_are_refused(tmp_path, text):
    (tmp_path / "bad.yml").write_text(text)
    with pytest.raises(ValueError, match=r"bad\.yml|format"):
        Calibration.load(tmp_path / "bad.yml")


def test_damaged_files_are_refused(tmp_path):
    calibrate_joint(*five_views(0.1), CAMERA).save(tmp_path / "good.yml")
    lines = (tmp_path / "good.yml").read_text().splitlines(keepends=True)
    tops = [index for index, line in enumerate(lines) if line[0].isalpha()]
    required = (
        "format",
        "camera_model",
        "image_width",
        "image_height",
        "focal_length",
        "kappa1",
        "scale_x",
        "pixel_pitch",
        "principal_point",
        "extrinsic_parameters",
        "points_per_view",
        "residuals",
    )
    for start, end in zip(tops, [*tops[1:], len(lines)], strict=True):
        name = lines[start].split(":")[0]
        for damaged in (lines[:start] + lines[end:], [*lines[:start], f"{name}: nonsense\n", *lines[end:]]):
            if name in required:
                (tmp_path / "bad.yml").write_text("".join(damaged))
                with pytest.raises(ValueError, match=r"bad\.yml|format"):
                    Calibration.load(tmp_path / "bad.yml")
