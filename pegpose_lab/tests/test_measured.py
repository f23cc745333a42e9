"""What was measured in real photographs: the committed tables, and that they are current."""

import cv2
import numpy as np
import pandas as pd
import pytest

from pegpose_lab import calibrate_zhang, measured
from pegpose_lab.datasets import dataset
from pegpose_lab.pose import project_discs


def test_counts_of_real_pictures():
    """One set of defaults: every disc is found where the data sets' counts are certain."""
    table = measured.load_counts()
    total = table.groupby("dataset")[["known", "found", "false"]].sum()
    pictures = table.groupby("dataset").size()
    assert pictures.to_dict() == {
        "visp-mire2-a": 12, "visp-grid36-a": 2, "skimage-coins": 1, "conrods-a": 8, "screws4-a": 12,
        "opencv-samples": 2,
    }
    for name in ("visp-mire2-a", "visp-grid36-a", "skimage-coins", "conrods-a"):
        assert total.loc[name, "found"] == total.loc[name, "known"]
    assert total["known"].to_dict() == {
        "visp-mire2-a": 60, "visp-grid36-a": 72, "skimage-coins": 24, "conrods-a": 28, "screws4-a": 27,
        "opencv-samples": 36,
    }
    assert (total.drop("visp-mire2-a")["false"] == 0).all()
    assert total.loc["screws4-a", "found"] >= 20


def test_presence_bits_of_the_screws():
    """The known places are those that the bits in the file names state, and so is what was found, but for misses."""
    table = measured.load_counts().query("dataset == 'screws4-a'")
    bits = [sum(map(int, name.removesuffix(".jpg")[-4:])) for name in table["picture"]]
    assert table["known"].tolist() == bits and len(bits) == 12 and sum(bits) == 27


def test_every_missed_screw_lacks_half_its_rim():
    missed = measured.load_missed().query("dataset == 'screws4-a'")
    seen = measured.load_counts().query("dataset == 'screws4-a' and found > 0")
    assert missed["rim"].max() < seen["rim"].min() and missed["rim"].max() < 0.55


def test_rim_share_is_the_part_of_the_rim_that_steps():
    image = np.full((100, 100), 60, np.uint8)
    image[:, 50:] = 160
    cv2.circle(image, (50, 50), 20, 160, cv2.FILLED)
    assert measured.rim_share(image, 50, 50, 20, "bright") == pytest.approx(0.5, abs=0.05)
    assert measured.rim_share(image, 50, 50, 20, "dark") == 0


def test_tables_are_current(pegpose_data):
    counts, missed = measured.count_circles()
    pd.testing.assert_frame_equal(counts, measured.load_counts())
    pd.testing.assert_frame_equal(missed.round(3), measured.load_missed())


def test_grid_is_current(pegpose_data):
    names, object_points, image_points = measured.measure_grid()
    known_points, known_image, size, known_names = measured.load_grid()
    assert names == known_names and size == (320, 240)
    np.testing.assert_array_equal(object_points, known_points)
    np.testing.assert_allclose(image_points, known_image, atol=1e-3)


def test_shift_of_the_ellipse_centres_of_a_real_grid():
    """Heikkila's shift: 0.16 px in the mean and 0.35 px at most on ViSP's photographs, where f moves by 0.6 px."""
    object_points, image_points, size, _ = measured.load_grid()
    plain = corrected = calibrate_zhang(object_points, image_points, size, radial=1)
    radii = np.full(36, measured.GRID_RADIUS)
    for _ in range(3):
        shifts = [
            project_discs(corrected.camera, pose, points, radii)[0] - corrected.camera.project(points, pose)
            for points, pose in zip(object_points, corrected.cam_from_object, strict=True)
        ]
        centers = [seen - shift for seen, shift in zip(image_points, shifts, strict=True)]
        corrected = calibrate_zhang(object_points, centers, size, radial=1)
    lengths = np.hypot(*np.concatenate(shifts).T)
    moved = corrected.camera.camera_matrix[0, 0] - plain.camera.camera_matrix[0, 0]
    assert lengths.mean() == pytest.approx(0.16, abs=0.005) and lengths.max() == pytest.approx(0.355, abs=0.005)
    assert moved == pytest.approx(0.6, abs=0.05) and abs(corrected.rms - plain.rms) < 1e-3


def test_grid_of_another_picture_is_refused(tmp_path, monkeypatch, pegpose_data):
    first = sorted(dataset("visp_circles").glob("*.jpg"))[0]
    image = cv2.imread(str(first), cv2.IMREAD_GRAYSCALE)
    image[:, :160] = 0
    (tmp_path / "visp_circles").mkdir()
    cv2.imwrite(str(tmp_path / "visp_circles" / "circles-01.jpg"), image)
    monkeypatch.setenv("PEGPOSE_DATA", str(tmp_path))
    with pytest.raises(measured.DetectionError, match="36 discs"):
        measured.measure_grid()


def test_sensitivity_is_current(pegpose_data):
    pd.testing.assert_frame_equal(measured.measure_sensitivity(), measured.load_sensitivity(), rtol=1e-3, atol=1e-2)
