"""Explorers: the picture follows the controls, errors are shown and not raised, first pictures are whole PNGs."""

import base64
import html

import cv2
import numpy as np
import pytest
from ipywidgets import IntSlider
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import checks
from pegpose_lab.calibration import PENALTY
from pegpose_lab.camera import OpenCVCamera, TsaiCamera
from pegpose_lab.lab.widgets import circles, genetic, hub, intervals, show, threshold
from pegpose_lab.lab.widgets import explorer as explorer_file
from pegpose_lab.lab.widgets.explorer import SHOWN_WIDTH, Explorer
from pegpose_lab.paper import paper_experiment
from pegpose_lab.render import render_hub
from pegpose_lab.targets import Hub

CAMERA = TsaiCamera(48.0, (0.0742, 0.0742), (399.5, 299.5), (800, 600), 1e-5)
PLANE = RigidTransform.from_components([5.0, -4.0, 270.0], Rotation.from_euler("x", 10, degrees=True))
BOUNDS = ((36.0, 60.0), (200.0, 335.0))


def valley(chromosomes):
    """A narrow, rotated valley; no image at the upper left."""
    f, t_z = chromosomes.T
    value = 0.03 + 200 * np.abs(f / t_z - 48 / 267) + np.abs(f - 48) / 48
    return np.where(f / t_z < 0.125, PENALTY, value)


@pytest.fixture(scope="module")
def image():
    pose = PLANE * RigidTransform.from_components([0, 0, 0], Rotation.from_rotvec([0, 0, np.deg2rad(-140.0)]))
    return render_hub(CAMERA, pose, Hub(), rng=0)


@pytest.fixture(params=["threshold", "circle", "genetic", "hub", "interval"])
def explorer(request, image):
    return {
        "threshold": lambda: threshold.threshold_explorer(image),
        "circle": lambda: circles.circle_explorer(image, radius_range=(18, 30)),
        "genetic": lambda: genetic.genetic_explorer(valley, BOUNDS, generations=30),
        "hub": lambda: hub.hub_explorer(CAMERA, Hub(), PLANE),
        "interval": lambda: intervals.interval_explorer(paper_experiment()),
    }[request.param]()


def decode(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


# ---- all explorers ----


def test_first_picture_is_a_png_of_the_stated_size(explorer):
    picture = decode(explorer.picture.value)
    height = {"genetic explorer": 480, "interval explorer": 360}.get(explorer.name, 600)
    if explorer.name == "hub explorer":  # the part that the hub can reach
        height = picture.shape[0]
        assert 300 < height < 600
    assert bytes(explorer.picture.value).startswith(b"\x89PNG")
    assert picture.shape == (height, SHOWN_WIDTH, 3)
    assert explorer.picture.width == str(SHOWN_WIDTH) and explorer.picture.format == "png"
    assert not explorer.failed and explorer.text


def test_children_are_the_controls_over_the_text_and_its_picture(explorer):
    assert explorer.children == (*explorer.controls.values(), explorer.caption, explorer.progress, explorer.picture)
    assert html.unescape(explorer.caption.value).count(explorer.text) == 1
    assert all(control.description for control in explorer.controls.values())


def test_a_bar_is_seen_during_the_update_after_a_slow_one(monkeypatch):
    seen, clock = [], iter([0.0, 1.0, 1.0, 1.1, 2.0, 2.1])
    control = IntSlider(value=0)

    def draw(_picture, value):
        seen.append(made[0].progress.layout.visibility if made else "new")
        return str(value)

    made = []
    monkeypatch.setattr(explorer_file.time, "perf_counter", lambda: next(clock))
    made.append(Explorer("any", lambda **_: np.zeros((4, 8, 3), np.uint8), draw, {"value": control}))
    control.value = 1
    control.value = 2
    assert seen == ["new", "visible", "hidden"] and made[0].progress.layout.visibility == "hidden"


def test_every_control_changes_the_picture(explorer):
    changes = {
        "automatic": False,
        "threshold": 55,
        "min_area": 900,
        "radius_range": (17, 40),
        "sensitivity": 0.7,
        "method": "phase-code",
        "population": 20,
        "alpha": 0.2,
        "seed": 7,
        "generation": 12,
        "angle": -120.0,
        "shift": 8.0,
        "bow": 0.2,
        "correlation": 100,
    }
    for name, control in explorer.controls.items():
        before, text = explorer.picture.value, explorer.text
        control.value = changes[name]
        if explorer.name.startswith("threshold") and name == "automatic":
            continue  # the slider stands at Otsu's threshold: the same parts
        assert explorer.picture.value != before or explorer.text != text, name
        assert not explorer.failed


def test_going_back_gives_the_first_picture_again(explorer):
    name, control = list(explorer.controls.items())[-1]
    first, text, value = decode(explorer.picture.value), explorer.text, control.value
    control.value = {"min_area": 900, "method": "phase-code", "generation": 12, "shift": 8.0, "correlation": 100}[name]
    control.value = value
    assert explorer.text == text
    apart = np.abs(decode(explorer.picture.value).astype(int) - first)
    assert apart.max() < 64 and apart.mean() < 0.01  # a followed hub is measured alike, to a fraction of its sigma


def test_repr_is_short_and_the_same_in_every_run(explorer):
    assert len(repr(explorer)) < 110 and "0x" not in repr(explorer)
    assert repr(explorer).startswith(explorer.name)


def test_show_is_one_output_with_widget_picture_and_text(explorer, monkeypatch):
    shown = []
    monkeypatch.setattr(explorer_file, "display", lambda *arguments, **options: shown.append((arguments, options)))
    show(explorer)
    (((bundle,), options),) = shown
    assert options["raw"] and bundle["application/vnd.jupyter.widget-view+json"]["model_id"] == explorer.model_id
    assert base64.b64decode(bundle["image/png"]) == bytes(explorer.picture.value)
    assert bundle["text/plain"] == f"{explorer!r}\n{explorer.text}"


def test_a_threshold_that_does_nothing_is_disabled():
    controls = threshold.threshold_explorer(
        np.full((60, 300), 200, np.uint8) + np.eye(60, 300, dtype=np.uint8)
    ).controls
    assert controls["threshold"].disabled
    controls["automatic"].value = False
    assert not controls["threshold"].disabled


# ---- errors ----


@pytest.mark.parametrize("error", [ValueError, checks.DetectionError, checks.CalibrationError])
def test_errors_are_shown_as_text(error):
    backdrop = np.full((60, 300, 3), 200, np.uint8)

    def draw(picture, level):
        picture[:] = 10
        if level > 1:
            raise error("nothing found <in 3 & more>; " + "try again " * 40)
        return "fine"

    slider = circles.ipywidgets.IntSlider(0, 0, 5)
    explorer = Explorer("trial", lambda level: backdrop, draw, {"level": slider})
    good = explorer.picture.value
    slider.value = 3
    assert explorer.failed and explorer.text.startswith("No result: nothing found")
    picture = decode(explorer.picture.value)
    assert (picture == 100).all()  # the dimmed backdrop, without what was drawn before the error
    assert "&lt;in 3 &amp; more&gt;" in explorer.caption.value
    slider.value = 0
    assert not explorer.failed and explorer.picture.value == good


def test_other_errors_are_not_hidden():
    def draw(picture, level):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        Explorer("trial", lambda level: np.zeros((9, 9, 3), np.uint8), draw, {"level": circles.ipywidgets.IntSlider()})


def test_constant_picture_is_an_error_text():
    constant = np.full((300, 400), 90, np.uint8)
    explorer = threshold.threshold_explorer(constant)
    assert explorer.failed and "constant" in explorer.text
    explorer.controls["automatic"].value = False
    assert not explorer.failed
    assert "no circles" in circles.circle_explorer(constant).text


@pytest.mark.parametrize("make", [threshold.threshold_explorer, circles.circle_explorer])
@pytest.mark.parametrize("image", [np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4)), np.zeros((0, 4), np.uint8)])
def test_unusable_picture(make, image):
    with pytest.raises(ValueError, match="image"):
        make(image)


# ---- single explorers ----


def test_threshold_explorer_paints_the_parts(image):
    explorer = threshold.threshold_explorer(image)
    assert "7 parts" in explorer.text
    explorer.controls["automatic"].value = False
    explorer.controls["threshold"].value = 255
    assert explorer.text == f"threshold 255: 0 parts of {explorer.controls['min_area'].value} px or more"
    grey = decode(explorer.picture.value)[:600]
    assert (grey.max(axis=2) == grey.min(axis=2)).all()


def test_threshold_explorer_starts_at_otsu(image):
    explorer = threshold.threshold_explorer(image)
    assert explorer.controls["threshold"].value == cv2.threshold(image, 0, 255, cv2.THRESH_OTSU)[0]


@pytest.mark.parametrize("factor", [1, 2])
def test_circle_explorer_speaks_in_pixels_of_the_image(factor, image):
    large = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_LINEAR)
    explorer = circles.circle_explorer(large, radius_range=(18 * factor, 30 * factor))
    assert "4 circles" in explorer.text
    low, high = (float(part) for part in explorer.text.split("radii ")[1].split(" px")[0].split(" to "))
    assert 18 * factor <= low <= high <= 30 * factor
    expected = 10.1 / 270 * 48 / 0.0742 * factor
    assert abs((low + high) / 2 - expected) < 0.08 * expected


def test_circle_explorer_draws_where_the_pegs_are(image):
    explorer = circles.circle_explorer(image, radius_range=(18, 30))
    pose = PLANE * RigidTransform.from_components([0, 0, 0], Rotation.from_rotvec([0, 0, np.deg2rad(-140.0)]))
    picture = decode(explorer.picture.value)
    for x, y in np.rint(CAMERA.project(Hub().peg_centers, pose)).astype(int):
        assert np.ptp(picture[y - 2 : y + 3, x - 2 : x + 3].astype(int), axis=2).max() > 100  # the coloured centre


def test_genetic_explorer_runs_each_setting_once():
    calls = []

    def search(**options):
        calls.append(options)
        rng = np.random.default_rng(options["rng"])
        low, high = np.transpose(BOUNDS)
        return rng.uniform(low, high, (options["generations"] + 1, options["population_size"], 2))

    explorer = genetic.genetic_explorer(valley, BOUNDS, search=search, generations=30)
    for generation in (0, 7, 30):
        explorer.controls["generation"].value = generation
    explorer.controls["seed"].value = 3
    explorer.controls["seed"].value = 0
    assert calls == [
        {"population_size": 60, "alpha": 0.75, "generations": 30, "rng": 0},
        {"population_size": 60, "alpha": 0.75, "generations": 30, "rng": 3},
    ]


def test_genetic_explorer_draws_population_and_valley():
    def search(population_size, generations, **_):
        return np.tile([[54.0, 234.0]], (generations + 1, population_size, 1))

    explorer = genetic.genetic_explorer(valley, BOUNDS, search=search, generations=3)
    picture = decode(explorer.picture.value)
    painted = (picture < 250).any(axis=2)
    frame = np.argwhere(painted[:, 100:-100].all(axis=1))[[0, -1], 0]  # first and last row of the axes
    sides = np.argwhere(painted[frame[0] : frame[1]].all(axis=0))[[0, -1], 0]
    x = sides[0] + 0.75 * (sides[1] - sides[0])
    y = frame[1] - 34 / 135 * (frame[1] - frame[0])  # T_z grows upwards
    dot = picture[round(y) - 1 : round(y) + 2, round(x) - 1 : round(x) + 2].astype(int)
    assert np.abs(dot - [0x00, 0x5E, 0xD5]).max() < 30  # the colour "genetic", in OpenCV's order
    assert np.abs(picture[frame[0] + 5, sides[0] + 5].astype(int) - 230).max() <= 1  # low f, high T_z: no image
    assert "f = 54.000 mm, T_z = 234.000 mm" in explorer.text


def test_genetic_explorer_ends_in_the_valley():
    explorer = genetic.genetic_explorer(valley, BOUNDS, generations=60)
    explorer.controls["generation"].value = 60
    best = float(explorer.text.split("best ")[1].split(" px")[0])
    explorer.controls["generation"].value = 0
    assert best < 0.25 < float(explorer.text.split("best ")[1].split(" px")[0])


def test_hub_explorer_finds_the_truth_it_rendered():
    explorer = hub.hub_explorer(CAMERA, Hub(), PLANE)
    for name, value in (("angle", -140.0), ("angle", -110.0), ("shift", 12.0)):
        explorer.controls[name].value = value
        truth, estimate, error = (_numbers(line) for line in explorer.text.splitlines())
        np.testing.assert_allclose(truth, [explorer.controls["angle"].value, explorer.controls["shift"].value, 0])
        np.testing.assert_allclose(estimate, truth, atol=0.1)
        np.testing.assert_allclose(error, 1000 * (np.array(estimate) - truth), atol=5.1)  # two decimals are shown


def test_hub_explorer_says_when_the_labels_are_a_half_turn_off():
    explorer = hub.hub_explorer(CAMERA, Hub(), PLANE, angle=40.0)  # screw 1 to the right: taken for screw 2
    truth, estimate, remark = explorer.text.splitlines()
    assert "half turn" in remark
    assert abs(_numbers(estimate)[0] - _numbers(truth)[0]) == pytest.approx(180, abs=0.1)


def test_hub_explorer_refuses_a_jump_and_recovers():
    explorer = hub.hub_explorer(CAMERA, Hub(), PLANE)
    explorer.controls["angle"].value = -50.0
    assert explorer.failed
    explorer.controls["angle"].value = -130.0
    assert not explorer.failed and "half turn" not in explorer.text


def test_smaller_camera_sees_the_same():
    points = np.array([[10.0, 20, 300], [-60, 40, 280], [0, 0, 250]])
    small = hub._smaller(CAMERA, 400)
    pose = RigidTransform.identity()
    expected = (CAMERA.project(points, pose) + 0.5) / 2 - 0.5
    np.testing.assert_allclose(small.project(points, pose), expected, atol=1e-9)
    assert small.image_size == (400, 300)
    opencv = hub._smaller(CAMERA.to_opencv(), 400)
    assert isinstance(opencv, OpenCVCamera)
    np.testing.assert_allclose(opencv.project(points, pose), expected, atol=1e-3)


def _numbers(line):
    """theta, x and y of a line of text."""
    return [float(part.split()[0]) for part in line.split("= ")[1:]]
