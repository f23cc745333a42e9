"""What was measured in real photographs: the committed tables, and that they are current."""

import cv2
import numpy as np
import pandas as pd
import pytest

from pegpose_lab import calibrate_zhang, checks, segment
from pegpose_lab.bench.score import TOLERANCE
from pegpose_lab.circles import Circles
from pegpose_lab.pose import project_discs
from pegpose_lab.study import circle_counts, load_measured, photographs, segmented_parts
from pegpose_lab.study.datasets import dataset


def test_counts_of_real_pictures():
    """One set of defaults: every disc is found where the data sets' counts are certain."""
    table = load_measured("circle_counts")
    total = table.groupby("dataset")[["known", "found", "false"]].sum()
    pictures = table.groupby("dataset").size()
    assert pictures.to_dict() == {
        "visp-mire2-a": 12,
        "visp-grid36-a": 2,
        "skimage-coins": 1,
        "conrods-a": 8,
        "screws4-a": 12,
        "opencv-samples": 2,
    }
    for name in ("visp-mire2-a", "visp-grid36-a", "skimage-coins", "conrods-a"):
        assert total.loc[name, "found"] == total.loc[name, "known"]
    assert total["known"].to_dict() == {
        "visp-mire2-a": 60,
        "visp-grid36-a": 72,
        "skimage-coins": 24,
        "conrods-a": 28,
        "screws4-a": 27,
        "opencv-samples": 36,
    }
    assert (total.drop(["visp-mire2-a", "screws4-a"])["false"] == 0).all()
    assert circle_counts.NEAR == TOLERANCE


def test_marks_of_the_screws_are_one_block():
    """Their places, by eye, are one pattern, turned, shifted and scaled; bits and order are those of the names."""
    screws = circle_counts.load_known().query("dataset == 'screws4-a'")
    assert len(screws) == 48 and screws["r"].between(47, 51).all()
    patterns = {}
    for name, places in screws.groupby("picture"):
        assert "".join(map(str, places["present"])) == name.removesuffix(".jpg")[-4:]
        x, y = places["x"].to_numpy(), places["y"].to_numpy()
        assert max(x[0], x[2]) < min(x[1], x[3]) and max(y[0], y[1]) < min(y[2], y[3])
        patterns[name] = x - x.mean() + 1j * (y - y.mean())
    reference = patterns["11_1111.jpg"]
    scales = {name: np.vdot(reference, pattern) / np.vdot(reference, reference) for name, pattern in patterns.items()}
    away = {name: np.abs(pattern - scales[name] * reference).max() for name, pattern in patterns.items()}
    assert len(patterns) == 12 and max(away.values()) < 5 and np.median(list(away.values())) < 3


def test_presence_bits_of_the_screws():
    """No screw is found where there is none; most of those that are there are found, and the tables agree."""
    bits = load_measured("screw_bits")
    known = circle_counts.load_known().query("dataset == 'screws4-a'")
    assert list(bits["present"]) == list(known["present"]) and list(bits["picture"]) == list(known["picture"])
    assert len(bits) == 48 and bits["present"].sum() == 27 and set(bits["position"]) == {1, 2, 3, 4}
    assert not bits.query("present == 0")["found"].any() and bits.query("present == 1")["found"].sum() >= 20
    assert (bits["fits"] <= bits["found"]).all()
    counts = load_measured("circle_counts").query("dataset == 'screws4-a'").set_index("picture")
    seen = bits.query("present == 1").groupby("picture")["fits"].sum()
    assert counts["found"].reindex(seen.index).equals(seen)
    missed = load_measured("missed_circles").query("dataset == 'screws4-a'")
    assert (missed["why"] == "off").sum() == (bits["found"] > bits["fits"]).sum()


def test_every_missed_disc_says_why():
    """The words for it; a screw without a candidate steps on less than half of its rim."""
    missed, counts = load_measured("missed_circles"), load_measured("circle_counts")
    assert len(missed) == (counts["known"] - counts["found"]).sum()
    assert set(missed["why"]) <= {"off", "shared", "score", "no candidate"}
    assert missed.query("why == 'no candidate' and dataset == 'screws4-a'")["rim"].max() < 0.5


@pytest.mark.parametrize(
    "default, highest, alone, alone_highest, why",
    [
        (3, None, None, None, "off"),
        (None, 0, 0, 0, "shared"),
        (None, 0, None, 0, "score"),
        (None, None, None, 0, "shared"),
        (None, 3, None, 3, "no candidate"),
        (None,) * 4 + ("no candidate",),
    ],
)
def test_why_a_disc_is_missed(monkeypatch, default, highest, alone, alone_highest, why):
    """With a search that finds the one bright pixel, off by some px or not at all."""
    image = np.zeros((100, 120), np.uint8)
    image[30, 12] = 255

    def search(part, radii, *, polarity, sensitivity=0.85):
        results = (default, highest) if part.shape == image.shape else (alone, alone_highest)
        off = results[int(sensitivity == 1.0)]
        y, x = np.unravel_index(part.argmax(), part.shape)
        rows = np.empty((0, 3)) if off is None else np.array([[x + off, y, 10.0]])
        return Circles(rows[:, :2], rows[:, 2], np.ones(len(rows)))

    monkeypatch.setattr(circle_counts, "find_circles", search)
    monkeypatch.setattr(photographs, "find_circles", search)
    circles = search(image, (8, 12), polarity="bright")
    assert circle_counts._why(image, (12.0, 30.0, 10.0), (8, 12), "bright", circles) == why


def test_match_takes_ten_per_cent_and_each_circle_once():
    circles = Circles(np.array([[50.0, 50.0], [101.9, 100.0]]), np.array([20.0, 20.0]), np.ones(2))
    places = [(50, 52, 20), (50, 49, 20), (100, 100, 20), (100, 100, 17.9), (104, 100, 20)]
    assert circle_counts.match_circles(circles, places).tolist() == [0, -1, 1, -1, -1]
    assert circle_counts.match_circles(circles, places[3:], near=0.2).tolist() == [1, -1]


def test_own_parts_have_the_place_and_the_area_of_a_disc():
    image = np.full((120, 300), 40, np.uint8)
    for x in (50, 150, 175, 250):
        cv2.circle(image, (x, 60), 20, 200, cv2.FILLED)
    places = [(50, 60, 20), (150, 60, 20), (175, 60, 20), (250, 60, 20)]
    parts = segment(image)
    assert len(parts) == 3 and segmented_parts._own_parts(parts, places) == 2
    assert segmented_parts._own_parts(parts, [(57, 60, 20), (250, 60, 24.5), (250, 60, 17)]) == 0


def test_parts_of_their_own():
    """Splitting never loses to Otsu's threshold alone, wins in uneven light, and fails when that is too uneven."""
    parts = load_measured("segmented_parts")
    assert (parts["segment"] >= parts["otsu"]).all() and (parts["segment"] > parts["otsu"]).sum() == 2
    assert parts["known"].tolist() == [24, 4, 4, 4, 4] and parts["light"].tolist()[1:] == list(segmented_parts.LIGHTS)
    assert parts["segment"].tolist() == [24, 4, 4, 4, 2]


def test_rim_share_is_the_part_of_the_rim_that_steps():
    image = np.full((100, 100), 60, np.uint8)
    image[:, 50:] = 160
    cv2.circle(image, (50, 50), 20, 160, cv2.FILLED)
    assert circle_counts.rim_share(image, 50, 50, 20, "bright") == pytest.approx(0.5, abs=0.05)
    assert circle_counts.rim_share(image, 50, 50, 20, "dark") == 0


def test_known_discs_are_what_thresholds_of_cut_outs_show(pegpose_data):
    """Of the sets that were not marked by eye: centroid and sqrt(area / pi) of the part in the middle, holes filled."""
    known = circle_counts.load_known().query("dataset not in ('screws4-a', 'opencv-samples')")
    assert len(known) == 184
    for name, picture, x, y, r, _ in known.itertuples(index=False):
        image = cv2.imread(str(dataset(name) / picture), cv2.IMREAD_GRAYSCALE)
        image = 255 - image if name == "visp-grid36-a" else image
        left, top = max(int(x - 1.5 * r - 3), 0), max(int(y - 1.5 * r - 3), 0)
        cut = image[top : int(y + 1.5 * r) + 4, left : int(x + 1.5 * r) + 4]
        white = cv2.threshold(cut, 0, 255, cv2.THRESH_OTSU)[1]
        outlines = cv2.findContours(white, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
        outline = next(o for o in outlines if cv2.pointPolygonTest(o, (x - left, y - top), False) >= 0)
        inside = np.argwhere(cv2.drawContours(np.zeros_like(white), [outline], -1, 1, cv2.FILLED))
        away = np.hypot(*(inside.mean(axis=0) + (top, left) - (y, x)))
        assert away < 0.02 * r + 0.1 and np.sqrt(len(inside) / np.pi) == pytest.approx(r, rel=0.02, abs=0.1)


def test_tables_are_current(pegpose_data):
    counts, missed = circle_counts.count_circles()
    pd.testing.assert_frame_equal(counts, load_measured("circle_counts"))
    pd.testing.assert_frame_equal(missed.round(3), load_measured("missed_circles"))
    pd.testing.assert_frame_equal(circle_counts.measure_bits(), load_measured("screw_bits"))
    pd.testing.assert_frame_equal(segmented_parts.count_parts(), load_measured("segmented_parts"))


def test_grid_is_current(pegpose_data):
    names, object_points, image_points = photographs.measure_grid()
    known_points, known_image, size, known_names = photographs.load_grid()
    assert names == known_names and size == (320, 240)
    np.testing.assert_array_equal(object_points, known_points)
    np.testing.assert_allclose(image_points, known_image, atol=1e-3)


def test_shift_of_the_ellipse_centres_of_a_real_grid():
    """Heikkila's shift: 0.16 px in the mean and 0.35 px at most on ViSP's photographs, where f moves by 0.6 px."""
    object_points, image_points, size, _ = photographs.load_grid()
    plain = corrected = calibrate_zhang(object_points, image_points, size, coefficients=("k1",))
    radii = np.full(36, photographs.GRID_RADIUS)
    for _ in range(3):
        shifts = [
            project_discs(corrected.camera, pose, points, radii)[0] - corrected.camera.project(points, pose)
            for points, pose in zip(object_points, corrected.cam_from_object, strict=True)
        ]
        centers = [seen - shift for seen, shift in zip(image_points, shifts, strict=True)]
        corrected = calibrate_zhang(object_points, centers, size, coefficients=("k1",))
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
    with pytest.raises(checks.DetectionError, match="36 discs"):
        photographs.measure_grid()


def test_sensitivity_is_current(pegpose_data):
    measured = photographs.measure_sensitivity()
    pd.testing.assert_frame_equal(measured, load_measured("opencv_left_detectors"), rtol=1e-3, atol=1e-2)
