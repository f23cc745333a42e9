"""A folder of images, good and bad, to calibration, poses, files and report."""

import struct

import cv2
import numpy as np
import pandas as pd
import pytest

import pegpose_lab as pl
from pegpose_lab.own_images import Description, read_description, read_picture, run_folder, write_sample
from pegpose_lab.own_images import boards as board_images
from pegpose_lab.paper import paper_experiment


@pytest.fixture(scope="module")
def sample(tmp_path_factory):
    return write_sample(tmp_path_factory.mktemp("sample"))


@pytest.fixture(scope="module")
def run(sample):
    return run_folder(sample, workers=1, progress=False)


def with_orientation(jpeg, orientation):
    """The bytes of a JPEG file with an EXIF orientation."""
    tiff = b"II*\x00\x08\x00\x00\x00" + struct.pack("<H", 1) + struct.pack("<HHII", 0x112, 3, 1, orientation) + bytes(4)
    block = b"Exif\x00\x00" + tiff
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block + jpeg[2:]


# ---- the sample ----


def test_the_sample_gives_camera_and_poses(run):
    experiment = paper_experiment()
    low, high = run.calibration.interval("f_x")
    true = experiment.camera.focal_length / experiment.camera.pixel_pitch[0]
    assert abs(run.calibration.camera.parameters["f_x"] / true - 1) < 2e-4 and low < high
    assert all(one.used for one in run.boards) and len(run.boards) == 5
    from pegpose_lab.own_images.sample import FRAMES

    for number, frame in zip(FRAMES, run.frames, strict=True):
        off = frame.pose.cam_from_hub.translation - experiment.cam_from_hubs[number].translation
        assert np.linalg.norm(off) < 0.1


def test_everything_written_is_read_back(run, sample):
    folder = sample / "pegpose"
    assert {path.name for path in run.files} == {
        "camera.yaml", "camera_info.yaml", "corners.csv", "discs.csv", "poses.csv", "pose.yaml",
        "forecasts.csv", "report.html",
    }  # fmt: skip
    camera = pl.Calibration.load(folder / "camera.yaml")
    assert camera.rms == pytest.approx(run.calibration.rms)
    np.testing.assert_allclose(
        pl.Calibration.load(folder / "camera_info.yaml").camera.camera_matrix, run.calibration.camera.camera_matrix
    )
    corners = pd.read_csv(folder / "corners.csv")
    assert len(corners) == 5 * 48 and corners["image"].nunique() == 5
    assert (pl.read_pose_table(folder / "poses.csv")["status"] == "").all()
    assert pl.read_detection(folder / "pose.yaml").frame_id == "camera"


def test_the_forecast_is_that_of_the_described_wheel(run, sample):
    table = pd.read_csv(sample / "pegpose" / "forecasts.csv")
    told = pl.assembly_forecast(run.frames[2].pose, pl.Hub(), pl.Wheel(clearance=0.1), robot_repeatability=0.05)
    assert table["frame"].tolist() == [one.path.name for one in run.frames]
    assert table.loc[2, "free"] == pytest.approx(told.probabilities["free"])
    assert table.loc[2, "free_clearance_mm"] == pytest.approx(told.free_clearance)
    assert "goes on freely" in (sample / "pegpose" / "report.html").read_text(encoding="utf-8")


def test_the_report_is_one_page_by_itself(run, sample):
    page = (sample / "pegpose" / "report.html").read_text(encoding="utf-8")
    for text in ("http://", "https://", "<script", "file:"):
        assert text not in page
    assert page.count("<img") == page.count("alt=") == 5 + 6 + 1 and len(page) < 3e6
    for one in (*run.boards, *run.frames):
        assert one.path.name in page


def test_a_second_run_takes_the_corners_of_the_first(sample, monkeypatch):
    def never(*_):
        raise AssertionError("searched again")

    monkeypatch.setattr(board_images, "_searched", never)
    again = run_folder(sample, workers=1, progress=False)
    assert [one.fate for one in again.boards] == ["48 of 48 corners"] * 5
    kept = next((sample / "pegpose" / "kept").iterdir())
    kept.write_text("{")  # damaged: only this one is searched again
    monkeypatch.setattr(board_images, "_searched", lambda path, board: board_images.BoardImage(path, "searched"))
    text = (sample / "pegpose.yaml").read_text()
    (sample / "pegpose.yaml").write_text(text.replace("plane: last", ""))  # the damaged one may be that of the plane
    assert sum(one.fate == "searched" for one in run_folder(sample, workers=1, progress=False).boards) == 1
    (sample / "pegpose.yaml").write_text(text)


# ---- images of every kind ----


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    """Four good boards among images that need care or are of no use."""
    folder, experiment = tmp_path_factory.mktemp("odd"), paper_experiment()
    images = [experiment.board_image(k)[::2, ::2] for k in range(5)]
    files = folder / "boards"
    files.mkdir()
    for number in (0, 1):
        cv2.imwrite(str(files / f"good-{number}.png"), images[number])
    cv2.imwrite(str(files / "deep.png"), images[2].astype(np.uint16) * 200 + 300)
    cv2.imwrite(str(files / "colour.tif"), cv2.cvtColor(images[3], cv2.COLOR_GRAY2BGR))
    jpeg = cv2.imencode(".jpg", images[4], [cv2.IMWRITE_JPEG_QUALITY, 97])[1].tobytes()
    (files / "turned.jpg").write_bytes(with_orientation(jpeg, 6))
    (files / "corrupt.jpg").write_bytes(jpeg[:500])
    (files / "empty.png").write_bytes(b"")
    cv2.imwrite(str(files / "large.png"), experiment.board_image(0))
    cv2.imwrite(str(files / "blank.png"), np.full(images[0].shape, 90, np.uint8))
    (files / "notes.txt").write_text("no image")
    (files / "phone.heic").write_bytes(jpeg)
    (folder / "pegpose.yaml").write_text("board: {columns: 8, rows: 6, square: 29.0}\n")
    return folder


def test_each_image_has_a_fate_with_its_name(odd):
    run = run_folder(odd, workers=1, progress=False)
    fates = {one.path.name: one.fate for one in run.boards}
    assert set(fates) == {path.name for path in (odd / "boards").iterdir()} - {"notes.txt"}
    assert fates["good-0.png"] == fates["colour.tif"] == "48 of 48 corners"
    assert "16 bit, scaled to 8" in fates["deep.png"] and "EXIF" in fates["turned.jpg"]
    assert "damaged" in fates["corrupt.jpg"] and "the file is empty" in fates["empty.png"]
    assert "convert it to PNG" in fates["phone.heic"]
    assert "not used: it has 1600 x 1200 px" in fates["large.png"] and fates["blank.png"].startswith("no board")
    assert sum(one.used for one in run.boards) == 5 and run.calibration is not None
    assert all(name in run.summary() for name in fates)


def test_a_turned_image_is_read_as_the_sensor_saw_it(odd):
    picture = read_picture(odd / "boards" / "turned.jpg")
    assert picture.size == (800, 600) and "EXIF" in picture.notes[0]


def test_floats_and_constant_deep_images(tmp_path):
    cv2.imwrite(str(tmp_path / "flat.png"), np.full((20, 30), 4000, np.uint16))
    assert read_picture(tmp_path / "flat.png").image.max() <= 255
    cv2.imwrite(str(tmp_path / "float.tif"), np.linspace(-1, 1, 600, dtype=np.float32).reshape(20, 30))
    image = read_picture(tmp_path / "float.tif").image
    assert image.dtype == np.uint8 and (np.ptp(image)) > 200


# ---- frames, and cameras from files ----


def test_a_camera_from_a_file_and_a_lost_frame(run, sample, tmp_path):
    frames = tmp_path / "frames"
    frames.mkdir()
    for name in ("frame-01.png", "frame-10.png"):
        (frames / name).write_bytes((sample / "frames" / name).read_bytes())
    cv2.imwrite(str(frames / "frame-05.png"), np.full((1200, 1600), 60, np.uint8))
    run.calibration.save(tmp_path / "camera.yaml")
    (tmp_path / "pegpose.yaml").write_text(
        "camera: camera.yaml\npart: {n_pegs: 4, pitch_circle_diameter: 97.05, peg_radius: 10.1}\n"
    )
    found = run_folder(tmp_path, progress=False)
    assert [frame.pose is not None for frame in found.frames] == [True, False, True]
    assert "not found" in found.frames[1].fate
    assert "no pose" not in found.frames[2].fate


def test_a_folder_without_boards_says_so(sample, tmp_path):
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "a.png").write_bytes((sample / "frames" / "frame-01.png").read_bytes())
    text = "board: {columns: 8, rows: 6, square: 29.0}\npart: {n_pegs: 4, pitch_circle_diameter: 97.05, peg_radius: 10.1}\n"
    (tmp_path / "pegpose.yaml").write_text(text)
    found = run_folder(tmp_path, progress=False)
    assert found.calibration is None and "no images of a board" in found.summary()
    assert found.frames[0].observation is not None and found.frames[0].pose is None
    assert "not calibrated" in (tmp_path / "pegpose" / "report.html").read_text()


# ---- descriptions ----

BOARD_AND_PART = (
    "board: {columns: 8, rows: 6, square: 29}\npart: {n_pegs: 4, pitch_circle_diameter: 97, peg_radius: 10}\n"
)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "does not describe a board"),
        ("part: {n_pegs: 4}\n", "does not describe a board"),
        ("board: {columns: 8, rows: 6, squares: 29}\n", "board has a key that is not known, squares"),
        ("board: {columns: 1, rows: 6, square: 9}\n", "board: columns"),
        ("board: 8x6\n", "board is '8x6'"),
        ("board: {columns: 8, rows: 6}\n", "board lacks square"),
        ("board: {columns: 8, rows: 6, square: 29}\npart: {n_pegs: 4, peg_radius: 9}\n", "part lacks pitch_circle"),
        (
            "board: {columns: 8, rows: 6, square: 29}\nring: {n: 4, pitch_radius: 0.05, disc_radius: 0.01}\n",
            "give its measures in mm",
        ),
        ("board: {columns: 8, rows: 6, square: 29}\npart: {centers: [[0, 0]]}\n", "a key that is not known, centers"),
        (
            "camera: a.yaml\nring: {n: 4, pitch_radius: 50, disc_radius: 9}\nwheel: {clearance: 1}\n",
            "a ring has no forecast",
        ),
        ("board: {columns: 8, rows: 6, square: 29}\nframe: x\n", "frame is unknown"),
        ("board: {columns: 8, rows: 6}\npart: {n_pegs: 4}\nring: {n: 4}\n", "both part and ring"),
        ("board: [", "is no YAML"),
        ("board: {columns: 8, rows: 6, square: 29}\nwheel: {clearance: 0.1}\n", "wheel needs a part with equally"),
        (
            BOARD_AND_PART + "wheel: {clearance: -1}\n",
            "wheel: clearance",
        ),
        (
            BOARD_AND_PART + "wheel: 0.1\n",
            "wheel is 0.1",
        ),
        ("board: {columns: 8, rows: 6, square: 29}\nradius_range: [60, 20]\n", "radius_range"),
        ("board: {columns: 8, rows: 6, square: 29}\nradius_range: 60\n", "radius_range is 60"),
        ("board: {columns: 8, rows: 6, square: 29}\nrobot_repeatability: -1\n", "robot_repeatability"),
    ],
)
def test_unusable_descriptions_say_why(tmp_path, text, reason):
    (tmp_path / "pegpose.yaml").write_text(text)
    with pytest.raises(ValueError, match=reason):
        read_description(tmp_path)


def test_a_missing_description_shows_what_to_write(tmp_path):
    with pytest.raises(ValueError, match="columns: 8"):
        run_folder(tmp_path)
    (tmp_path / "pegpose.yaml").write_text("board: {columns: 8, rows: 6, square: 29.0}\n")
    with pytest.raises(ValueError, match="has no images"):
        run_folder(tmp_path)


def test_a_plane_must_be_one_of_the_boards(sample, tmp_path):
    text = (sample / "pegpose.yaml").read_text().replace("plane: last", "plane: nowhere.png")
    for name in ("boards", "frames"):
        (tmp_path / name).symlink_to(sample / name)
    (tmp_path / "pegpose.yaml").write_text(text)
    with pytest.raises(ValueError, match="plane is 'nowhere.png'"):
        run_folder(tmp_path, workers=1, progress=False)


def test_a_wheel_fits_the_part_where_nothing_else_is_said():
    values = {
        "board": {"columns": 8, "rows": 6, "square": 25.0},
        "part": {"n_pegs": 5, "pitch_circle_diameter": 80.0, "peg_radius": 8.0},
        "wheel": {"clearance": 0.2},
    }
    assert Description.of(values).wheel == pl.Wheel(n_holes=5, pitch_circle_diameter=80.0, clearance=0.2)


def test_a_wrong_part_gives_doubtful_poses_that_are_not_passed_on(run, sample, tmp_path):
    """A place that is 3 mm off: the ring is found, and no pose fits."""
    (tmp_path / "frames").symlink_to(sample / "frames")
    run.calibration.save(tmp_path / "camera.yaml")
    text = "camera: camera.yaml\nring: {centers: [[-34, -34], [34, -34], [36, 36], [-34, 34]], disc_radius: 10.1}\n"
    (tmp_path / "pegpose.yaml").write_text(text)
    found = run_folder(tmp_path, progress=False)
    posed = [one for one in found.frames if one.pose is not None]
    assert posed and all(one.doubtful and "doubtful" in one.fate for one in posed)
    assert "pose.yaml" not in {path.name for path in found.files}
    table = pl.read_pose_table(tmp_path / "pegpose" / "poses.csv")
    assert table["flags"].str.contains("misfit").sum() == len(posed) and table["image"][0] == "frame-01.png"
    assert "of them doubtful" in (tmp_path / "pegpose" / "report.html").read_text(encoding="utf-8")


def test_what_an_earlier_run_wrote_does_not_stay(sample, tmp_path):
    (tmp_path / "frames").symlink_to(sample / "frames")
    (tmp_path / "boards").symlink_to(sample / "boards")
    (tmp_path / "pegpose.yaml").write_text((sample / "pegpose.yaml").read_text())
    first = {path.name for path in run_folder(tmp_path, workers=1, progress=False).files}
    (tmp_path / "pegpose.yaml").write_text("board: {columns: 8, rows: 6, square: 29.0}\n")
    second = {path.name for path in run_folder(tmp_path, workers=1, progress=False).files}
    assert {"pose.yaml", "discs.csv", "forecasts.csv"} <= first - second
    assert {path.name for path in (tmp_path / "pegpose").iterdir()} == second | {"kept"}


def test_discs_are_written_for_each_frame(run, sample):
    discs = pd.read_csv(sample / "pegpose" / "discs.csv")
    seen = run.frames[1].observation
    of_frame = discs[discs["image"] == run.frames[1].path.name]
    np.testing.assert_allclose(of_frame[["x", "y"]], seen.peg_centers)
    assert of_frame["disc"].tolist() == [1, 2, 3, 4] and set(of_frame["state"]) == {"measured"}


def test_rings_are_described_too():
    ring = Description.of(
        {"board": {"columns": 8, "rows": 6, "square": 25.0}, "ring": {"n": 5, "pitch_radius": 40.0, "disc_radius": 6.0}}
    )
    assert isinstance(ring.part, pl.RingPattern) and ring.part.n_places == 5


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("board: {columns: 8, rows: 6, square: 0.029}\n", "give its side in mm"),
        ("camera: a.yaml\nring: {n: 4, pitch_radius: 0.05, disc_radius: 0.01}\n", "give its measures in mm"),
        ("camera: a.yaml\nring: {angles: [0, 90, 180, 270], pitch_radius: 50, disc_radius: 9}\n", "radians"),
        ("camera: a.yaml\nring: {n: 4, pitch_radius: 50}\n", "ring lacks disc_radius"),
        ("board: {columns: 8, rows: 6, square: 29}\nring: {n: 4, pitch_radius: 0.5, disc_radius: 0.1}\n", "both in mm"),
        ("camera: a.yaml\nring: {n: 4, disc_radius: 9}\n", "ring lacks pitch_radius"),
        ("camera: a.yaml\nplane: last\n", "plane has no meaning with camera"),
        (BOARD_AND_PART + "lens: equidistant\ncoefficients: [k1, k2]\n", "coefficients has no meaning"),
        (BOARD_AND_PART + "robot_repeatability: 0.1\n", "robot_repeatability has no meaning"),
        (BOARD_AND_PART + "wheel: {n_holes: 5, clearance: 0.1}\n", "5 holes"),
        (BOARD_AND_PART + "boards: [a, b]\n", "expected a text"),
        (BOARD_AND_PART + "coefficients: 4\n", "expected names"),
        (BOARD_AND_PART + "1: 3\nfoo: 2\n", "is unknown"),
        (BOARD_AND_PART + "frames:\n", "frames is empty"),
    ],
)
def test_what_has_no_meaning_is_said(tmp_path, text, reason):
    (tmp_path / "pegpose.yaml").write_text(text)
    with pytest.raises(ValueError, match=reason):
        read_description(tmp_path)


def test_the_last_image_must_show_the_board_if_it_tells_the_plane(sample, tmp_path):
    (tmp_path / "frames").symlink_to(sample / "frames")
    (tmp_path / "boards").mkdir()
    for path in (sample / "boards").iterdir():
        (tmp_path / "boards" / path.name).write_bytes(path.read_bytes())
    cv2.imwrite(str(tmp_path / "boards" / "last.png"), np.full((1200, 1600), 90, np.uint8))
    (tmp_path / "pegpose.yaml").write_text((sample / "pegpose.yaml").read_text())
    with pytest.raises(ValueError, match=r"plane: last.png cannot be used \(no board"):
        run_folder(tmp_path, workers=1, progress=False)


def test_boards_lie_anywhere_and_frames_without_a_part_are_told(sample, tmp_path):
    (tmp_path / "frames").symlink_to(sample / "frames")
    text = f"board: {{columns: 8, rows: 6, square: 29.0}}\nboards: {sample}/boards/*.png\n"
    (tmp_path / "pegpose.yaml").write_text(text)
    found = run_folder(tmp_path, workers=1, progress=False)
    assert sum(one.used for one in found.boards) == 5
    assert {one.fate for one in found.frames} == {"not looked at: no part is described"}


def test_a_missing_calibration_is_named(sample, tmp_path):
    (tmp_path / "frames").symlink_to(sample / "frames")
    (tmp_path / "pegpose.yaml").write_text(
        "camera: nowhere.yaml\nring: {n: 4, pitch_radius: 48.5, disc_radius: 10.1}\n"
    )
    with pytest.raises(ValueError, match=r"camera: .*nowhere.yaml cannot be read"):
        run_folder(tmp_path, progress=False)
