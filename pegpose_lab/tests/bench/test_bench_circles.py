"""The benchmark of circle measurement: its frames, its bounds and its scores."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from pegpose_lab import fit_discs
from pegpose_lab.bench import bounds, detectors, peers, resources, scenes, score, statistics
from pegpose_lab.render import TrueDisc, raycast
from pegpose_lab.tests.pictures import center_bound, draw_ellipses, to_uint8

CLEAN, TILT, HIGHLIGHTS, CLUTTER, *_ = scenes.SCENES
FAST = ("ours", "HoughCircles GRADIENT", "SimpleBlobDetector", "contours + fitEllipse")


@pytest.fixture(scope="module")
def frames():
    """One frame of each of the four scenes."""
    return {scene.name: scenes.draw_frame(scene, 0) for scene in (CLEAN, TILT, HIGHLIGHTS, CLUTTER)}


@pytest.fixture(scope="module")
def measured():
    """Two clean frames, two levels of noise."""
    return score.measure({CLEAN: (2, (1, 5))}, FAST, workers=1)


# ---- frames and bounds ----


def test_frames_are_what_their_scene_says(frames):
    radii = {name: [disc.truth.radius for disc in frame.discs] for name, frame in frames.items()}
    for name, frame in frames.items():
        assert frame.picture.dtype == np.float32 and frame.picture.shape == (1200, 1600)
        assert [disc.peg for disc in frame.discs] == [1, 2, 3, 4, 0, 0, 0]
        low, high = scenes.RADIUS_RANGE
        assert [low <= radius <= high for radius in radii[name]] == [True] * 4 + [False] * 3
        assert scenes.BLUR[0] ** 2 < frame.edge_width**2 - 1 / 12 < scenes.BLUR[1] ** 2
    assert np.ptp(radii["clean"][:4]) < 1.5 < np.ptp(radii["tilt"][:4])


def test_frames_are_the_same_every_time_and_no_two_are_alike(frames):
    again, other = scenes.draw_frame(CLEAN, 0), scenes.draw_frame(CLEAN, 1)
    assert (again.picture == frames["clean"].picture).all()
    assert (other.picture != again.picture).any()
    assert (frames["tilt"].picture != again.picture).any()


def test_bound_is_the_information_in_a_drawn_disc():
    """The Fisher information summed over the pixels: squared derivatives of the picture over the variance."""
    step, information = 0.02, []
    for dx, dr in ((step, 0), (0, step)):
        discs = [(50.2 + k * dx, 49.7, *[30 + k * dr] * 2, 0) for k in (-1, 1)]
        pictures = [draw_ellipses((101, 101), [disc], oversample=8) for disc in discs]
        slope = (pictures[1] - pictures[0]) / (2 * step)
        information.append((slope**2).sum() / (5**2 + 1 / 12))
    bound = bounds.center_bound(30, 100, np.sqrt(0.9**2 + 1 / 12), 5)
    assert_allclose(1 / np.sqrt(information), [bound, bound / np.sqrt(2)], rtol=0.02)
    assert_allclose(bound, center_bound(30, 100, 0.9, 5))


def test_fits_of_drawn_discs_reach_the_bound():
    """The bound holds for what it is divided into: drawn discs, measured with known noise."""
    rng, errors = np.random.default_rng(3), []
    for _ in range(60):
        x, y = 50 + rng.uniform(-0.5, 0.5, 2)
        image = to_uint8(draw_ellipses((101, 101), [(x, y, 30, 30, 0)]), 5, rng)
        discs = fit_discs(image, SimpleNamespace(centers=[[50.0, 50.0]], radii=[30.0]))
        bound = bounds.center_bound(30, 100, np.sqrt(0.9**2 + 1 / 12), 5)
        errors.append(np.append(discs.centers[0] - [x, y], (discs.radii[0] - 30) * np.sqrt(2)) / bound)
    assert 0.8 < np.sqrt(np.mean(np.square(errors))) < 1.25


def test_whole_edge_is_visible_on_uniform_surroundings(frames):
    for disc in [*frames["clean"].discs[:4], *frames["tilt"].discs[:4]]:
        assert disc.visible == 1
        assert_allclose(disc.arc, 1, atol=0.03)  # equal but for the ellipse's uneven spacing


def test_spots_and_swarf_hide_parts_of_the_edge(frames):
    for name in ("highlights", "clutter"):
        discs = frames[name].discs[:4]
        assert all(0.3 < disc.visible < 1 for disc in discs)
        assert all((disc.arc > 1).all() for disc in discs)


def _circle_points(count=360):
    t = np.arange(count) * (2 * np.pi / count)
    return t, 40 * np.column_stack([np.cos(t), np.sin(t)])


def test_bound_of_an_arc_is_that_of_a_fit_to_it():
    """A simulated fit of centre, radius and shape to noisy edge points of three quarters of a circle."""
    t, outline = _circle_points()
    visible = np.abs(t - np.pi) < 0.75 * np.pi
    share, arc = bounds._arc_shape(visible, outline)
    assert_allclose(share, 0.75, atol=0.01)
    design = np.column_stack([np.cos(t), np.sin(t), np.ones_like(t), np.cos(2 * t), np.sin(2 * t)])
    noise = np.random.default_rng(0).normal(size=(len(t), 4000))
    whole = np.linalg.lstsq(design, noise)[0].std(axis=1)
    part = np.linalg.lstsq(design[visible], noise[visible])[0].std(axis=1)
    assert_allclose(arc, (part / whole)[:3], rtol=0.06)


def test_bound_of_too_short_an_arc_is_infinite():
    t, outline = _circle_points()
    assert np.isinf(bounds._arc_shape(t < 0.2, outline)[1]).all()
    assert np.isinf(bounds._arc_shape(np.zeros(len(t), bool), outline)[1]).all()


# ---- scores ----


def _frame(*discs):
    """A frame with discs x, y, radius; the first two are pegs."""
    truths = [TrueDisc(np.array([x, y]), np.pi * r * r, r) for x, y, r in discs]
    made = [scenes.Disc(t, k + 1 if k < 2 else 0, 1.0, np.array([1.5, 1.5, 2.0])) for k, t in enumerate(truths)]
    return scenes.Frame(None, made, 100.0, 1.0)


def _found(rows, sigmas=None):
    rows = np.reshape(rows, (-1, 3)).astype(float)
    return detectors.Found(rows[:, :2], rows[:, 2], sigmas)


FRAME = _frame((100, 100, 50), (300, 100, 50), (500, 100, 80), (200, 300, 45))


def test_score_counts_each_disc_once_and_the_rest_as_false():
    wrong = [(300, 100, 56), (700, 700, 50), (500, 100, 58)]
    found = _found([(101, 100, 50), (100, 100, 49.5), *wrong, (204, 300, 45)])
    rows, false_positives = score.score(FRAME, found, 5)
    assert [row[:2] for row in rows] == [(1, True), (2, False), (0, True)]  # the bore (80 px) is not expected
    assert_allclose(rows[0][4:6], 0, atol=1e-12)  # the nearer of two
    assert false_positives == 4


@pytest.mark.parametrize("offset", [(5.1, 0, 0), (0, 0, 5.1), (0, 0, -5.1), (-3.7, 3.7, 0)])
def test_what_is_off_by_more_than_a_tenth_is_not_detected(offset):
    rows, false_positives = score.score(FRAME, _found([np.add((100, 100, 50), offset)]), 5)
    assert not rows[0][1] and false_positives == 1
    rows, false_positives = score.score(FRAME, _found([np.add((100, 100, 50), np.multiply(offset, 0.9))]), 5)
    assert rows[0][1] and false_positives == 0


def test_errors_are_divided_by_bound_arc_bound_and_sigma():
    sigmas = np.array([[0.1, 0.2, 0.4]])
    rows, _ = score.score(FRAME, _found([(100.2, 100.2, 50.2)], sigmas), 5)
    bound = bounds.center_bound(50, 100, 1.0, 5)
    peg, found, visible, arc, *errors = rows[0]
    assert (peg, found, visible, arc) == (1, True, 1.0, 1.5)
    ratios = np.array([1, 1, np.sqrt(2)]) * 0.2 / bound
    assert_allclose(errors, [*ratios, *ratios / [1.5, 1.5, 2], 2, 1, 0.5], rtol=1e-6)
    rows, _ = score.score(FRAME, _found([(100.2, 100.2, 50.2)]), 5)
    assert np.isnan(rows[0][-3:]).all()


def test_nothing_found_is_scored_without_a_warning():
    rows, false_positives = score.score(FRAME, _found([]), 5)
    assert [row[1] for row in rows] == [False] * 3 and false_positives == 0
    table = statistics.summarize(
        pd.DataFrame([("clean", 5, 0, peers.OURS, 0.01, 0)], columns=score.FRAME_COLUMNS),
        pd.DataFrame([("clean", 5, 0, peers.OURS, *row) for row in rows], columns=score.DISC_COLUMNS),
    )
    assert table["detection"][0] == 0 and table[["center", "center_rms", "coverage"]].isna().all(axis=None)


def test_statistics_of_normal_errors():
    values = np.random.default_rng(1).normal(size=200_000)
    assert_allclose([statistics._rms(values), statistics._robust_rms(values), statistics._spread(values)], 1, atol=0.01)
    assert_allclose(statistics._coverage(values), 95, atol=0.2)
    assert np.isnan(statistics._coverage(np.full(3, np.nan)))


def test_time_ratio_is_that_of_the_same_frame():
    rows = [("clean", 5, k, name, seconds, 0) for k in range(5) for name, seconds in
            ((peers.OURS, 0.03 * 10**k), (peers.REFERENCE, 0.01 * 10**k))]  # fmt: skip
    frames = pd.DataFrame(rows, columns=score.FRAME_COLUMNS)
    table = statistics.summarize(frames, pd.DataFrame([], columns=score.DISC_COLUMNS).astype({"found": bool}))
    assert_allclose(table["time_ratio"], [3, 1])
    assert_allclose(table["ms"], [3000, 1000])


# ---- methods ----


@pytest.mark.parametrize("name", [n for n, m in peers.COMPARED.items() if m.module == "cv2" or m.share == 1])
def test_every_fast_method_finds_the_clean_pegs(name, frames):
    method = peers.COMPARED[name]
    if peers.missing(method):
        pytest.skip(peers.missing(method))
    found, seconds = peers.run(method, raycast.expose(frames["clean"].picture, 2, 0), scenes.RADIUS_RANGE)
    rows, false_positives = score.score(frames["clean"], found, 2)
    assert all(row[1] for row in rows) and len(rows) == 4
    assert false_positives == 0 and seconds > 0


def test_slow_methods_get_the_first_frames_only(monkeypatch):
    monkeypatch.setattr(peers, "missing", lambda _: "")
    chosen = [name for k in range(200) for name in score._methods_for(peers.COMPARED, k, 200)]
    counts = {name: chosen.count(name) for name in peers.COMPARED}
    assert {counts[name] for name in FAST} == {200}
    assert counts["skimage hough_circle"] == counts["find_circles accumulator"] == 8
    assert counts["find_circles two-stage"] == 20
    assert "skimage hough_circle" in score._methods_for(peers.COMPARED, 0, 1)


# ---- measuring ----


def test_a_run_measures_every_method_on_every_frame(measured):
    frames, discs = measured
    assert len(frames) == 2 * 2 * len(FAST) and len(discs) == 4 * len(frames)
    table = statistics.summarize(frames, discs).set_index(["method", "noise"])
    assert (table["detection"] == 100).all() and (table["frames"] == 2).all() and (table["ms"] > 0).all()
    assert (table.loc[peers.REFERENCE, "time_ratio"] == 1).all()
    for noise in (1, 5):
        ours = table.loc[(peers.OURS, noise)]
        assert 0.3 < ours["center_rms"] < 2 and 0.3 < ours["center_sd"] < 2
        assert table.loc[(peers.REFERENCE, noise), "center_rms"] > 10
    assert table["coverage"].notna().sum() == 2


def test_the_same_frames_give_the_same_errors(measured):
    _, discs = score.measure_frame(CLEAN, 1, (5,), FAST)
    again = pd.DataFrame(discs, columns=score.DISC_COLUMNS)
    before = measured[1].query("frame == 1 and noise == 5").reset_index(drop=True)
    pd.testing.assert_frame_equal(again, before)


def test_larger_pictures_show_the_same_scene():
    small, large = scenes._camera(), resources._scaled(scenes._camera(), 1.5)
    point, pose = [[10.0, -20.0, 3.0]], scenes._pose(TILT, np.random.default_rng(0))
    center = np.add(small.principal_point, 0.5)
    expected = (small.project(point, pose) + 0.5 - center) * 1.5 + center * 1.5 - 0.5
    assert large.image_size == (2400, 1800)
    assert_allclose(large.project(point, pose), expected, atol=1e-9)
