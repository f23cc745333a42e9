"""Pegs: found in the paper's frames and among clutter, and what is said when something is missing."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pegpose_lab.checks import DetectionError
from pegpose_lab.paper import paper_experiment
from pegpose_lab.pegs import locate_pegs, track_pegs
from pegpose_lab.pegs.hidden import _seen_pegs
from pegpose_lab.pegs.measure import _check_fits, _flags_of, _homography
from pegpose_lab.pegs.rings import _rings_around
from pegpose_lab.pose import estimate_pose
from pegpose_lab.render import HubLook, render_hub
from pegpose_lab.targets import Hub
from pegpose_lab.tests.pegs.hubs import CAMERA, HUB, assert_seen, pose_of, rendered, truth


def paint(image, center, radius, value):
    """A copy of the picture with a disc painted over."""
    return cv2.circle(image.copy(), tuple(np.rint(center).astype(int).tolist()), radius, value, -1)


# ---- the paper's frames ----


def test_paper_frames():
    """Every part found and labelled in every frame, pegs to 0.02 px rms, the chain within 0.01 mm."""
    experiment = paper_experiment()
    chosen = [0, 1, 14, 29, 43, 44]
    frames = (experiment.hub_frame(index) for index in chosen)
    errors, distances = [], []
    for index, observation in zip(chosen, track_pegs(frames, experiment.hub), strict=True):
        pose = experiment.cam_from_hubs[index]
        assert_seen(observation, pose, experiment.hub, experiment.camera)
        assert observation.flags == ()
        errors.append(observation.peg_centers - truth(pose, experiment.hub, experiment.camera)[0])
        found = estimate_pose(observation, experiment.camera, experiment.hub, plane=experiment.cam_from_plane)
        distances.append(np.linalg.norm(found.cam_from_hub.translation - pose.translation))
        assert abs(found.peg_radii - experiment.hub.peg_radius).max() < 0.01
        assert found.rms < 0.05
    assert np.sqrt(np.mean(np.square(errors))) < 0.02
    assert max(distances) < 0.01


# ---- labels ----


@pytest.mark.parametrize("tilt", [0, 25])
def test_scale_and_tilt_need_not_be_known(tilt):
    for depth in (250.0, 600.0):
        pose = pose_of(turn=10, tilt=tilt, position=(0.0, 0.0, depth))
        image = render_hub(CAMERA, pose, HUB, rng=1)
        screws = truth(pose)[1]
        assert_seen(locate_pegs(image, HUB), pose, shift=0 if screws[0, 0] < screws[1, 0] else 2)


@settings(max_examples=30)
@given(st.integers(3, 8), st.floats(0, 6.2), st.floats(0, 0.5), st.floats(5, 200))
def test_an_affine_ring_is_a_ring(n, turn, tilt, size):
    """The Fourier test finds size, turn and tilt of any affine image of a regular polygon, and no other ring."""
    hub = Hub(n_pegs=n, peg_radius=5.0)
    matrix = (
        size / 48.5 * np.array([[1, 0], [0, np.cos(tilt)]]) @ Rotation.from_rotvec([0, 0, turn]).as_matrix()[:2, :2]
    )
    centers = np.vstack([hub.peg_centers[:, :2] @ matrix.T, [0, 0]])
    scale = np.sqrt(np.linalg.det(matrix))
    circles = SimpleNamespace(centers=centers, radii=np.append(np.full(n, 5 * scale), hub.bore_radius * scale * 0.95))
    shuffled = np.random.default_rng(n).permutation(n)
    ring = _rings_around(circles, n, shuffled[None], hub)[0]
    np.testing.assert_array_equal(np.sort(ring.pegs), np.arange(n))
    spots = ring.place(hub.peg_angles)
    np.testing.assert_allclose(np.column_stack([spots.real, spots.imag]), centers[ring.pegs], atol=1e-9 * size)
    assert ring.scale == pytest.approx(hub.pitch_circle_diameter / 2 * scale)
    centers[0] *= 1.5
    assert n == 3 or not _rings_around(circles, n, shuffled[None], hub)


# ---- clutter ----


def test_swarf_and_highlights_never_mislabel():
    """Each picture is labelled rightly or refused, and most are not refused."""
    labelled = 0
    for seed in range(5):
        image = rendered(20.0 * seed, rng=seed, clutter=40, highlights=60.0 * (seed % 2))
        screws = truth(pose_of(20.0 * seed))[1]
        try:
            observation = locate_pegs(image, HUB)
        except DetectionError:
            continue
        labelled += 1
        pegs = truth(pose_of(20.0 * seed))[0]
        shift = 0 if screws[0, 0] < screws[1, 0] else 2
        np.testing.assert_allclose(observation.peg_centers, np.roll(pegs, -shift, axis=0), atol=0.5)
    assert labelled >= 3


def test_a_screw_that_touches_swarf():
    image = rendered(0).copy()
    screws = truth(pose_of(0))[1]
    outward = screws[0] - truth(pose_of(0))[2][0]
    start, end = screws[0] - 1.2 * np.array([-outward[1], outward[0]]) * 0.3, screws[0]
    cv2.line(image, np.rint(start).astype(int).tolist(), np.rint(end).astype(int).tolist(), 140, 5)
    assert_seen(locate_pegs(image, HUB), pose_of(0), shift=0 if screws[0, 0] < screws[1, 0] else 2, px=2.0)


def test_bright_swarf_on_the_bore():
    image = rendered(0).copy()
    x, y = np.rint(truth(pose_of(0))[2][0]).astype(int)
    image[y - 12 : y - 4, x - 14 : x + 14] = 230
    image[y + 5 : y + 12, x - 14 : x + 14] = 230
    observation = locate_pegs(image, HUB)
    np.testing.assert_allclose(observation.bore_center, (truth(pose_of(0))[2][0]), atol=0.5)


@pytest.mark.parametrize("occlusion", [0.1, 0.2, 0.3, 0.35, 0.5, 0.9])
def test_a_partly_hidden_peg_is_measured_well_or_refused(occlusion):
    try:
        observation = locate_pegs(rendered(0, occlusion=occlusion), HUB)
    except DetectionError:
        assert occlusion > 0.1
    else:
        expected = np.roll(truth(pose_of(0))[0], -2, axis=0)
        np.testing.assert_allclose(observation.peg_centers, expected, atol=0.3)


def test_pegs_are_judged_by_their_neighbours():
    """Shapes of the true homography pass; one of another size, or longer one way, does not."""
    pose = pose_of(30)
    origin, x, y = CAMERA.project([[0, 0, 0], [10, 0, 0], [0, 10, 0]], pose)
    hub = Hub()
    matrix = np.column_stack([x - origin, y - origin]) / 10  # affine: far from the camera
    centers = origin + hub.peg_centers[:, :2] @ matrix.T
    shapes = np.tile(hub.peg_radius**2 * matrix @ matrix.T, (4, 1, 1))
    parts = np.column_stack([centers, np.linalg.det(shapes) ** 0.25])
    homography, whole = _homography(centers, hub), [""] * 4
    assert _seen_pegs(homography, parts, shapes, whole, hub)[1] == whole
    for change in (np.diag([0.92, 0.92]), np.diag([1.0, 0.92]), np.diag([1.08, 1.0])):
        wrong = shapes.copy()
        wrong[2] = change @ wrong[2] @ change
        by_others, reasons = _seen_pegs(homography, parts, wrong, whole, hub)
        assert [bool(reason) for reason in reasons] == [False, False, True, False]
        np.testing.assert_allclose(by_others / by_others[2, 2], homography / homography[2, 2], atol=0.01)
        with pytest.raises(DetectionError, match="peg 3 is"):
            _seen_pegs(homography, parts, wrong, ["", "edge hidden", "", ""], hub)


def test_three_pegs_and_a_screw_must_be_measured():
    names = ["peg 1", "peg 2", "peg 3", "bore", "screw 1", "screw 2"]
    _check_fits(["", "", "", "chi2", "chi2", ""], names, 3)
    with pytest.raises(DetectionError, match=r"peg 3 \(no edge\)"):
        _check_fits(["", "", "no edge", "", "", ""], names, 3)
    with pytest.raises(DetectionError, match="screw 1"):
        _check_fits(["", "", "", "", "chi2", "chi2"], names, 3)


def test_a_part_that_is_not_measured_has_a_flag_with_a_code():
    flags = _flags_of(["peg 1", "bore", "screw 1", "screw 2"], ["", "chi2", "", "edge hidden"])
    assert [flag.code for flag in flags] == ["bore-not-measured", "screw-not-measured"]
    assert [flag.text for flag in flags] == ["bore: chi2", "screw 2: edge hidden"]


# ---- something is missing ----


def test_missing_parts_are_named():
    pegs, screws, bore = truth(pose_of(0))
    image = rendered(0)
    with pytest.raises(DetectionError, match="at most 2 of 4 pegs"):
        locate_pegs(paint(paint(image, pegs[1], 32, 62), pegs[3], 32, 62), HUB)
    with pytest.raises(DetectionError, match="4 of 4 pegs and the bore, but 1 of 2 screws"):
        locate_pegs(paint(image, screws[1], 14, 62), HUB)
    with pytest.raises(DetectionError, match="of 4 pegs around a bore"):
        locate_pegs(paint(image, bore[0], 50, 62), HUB)


def test_discs_like_screws_in_other_gaps_are_refused():
    hub = Hub(screw_angles=(np.pi / 4, 5 * np.pi / 4))
    places = truth(pose_of(0), hub)[1]
    image = rendered(0)
    for place in places:
        image = paint(image, place, 9, 140)
    with pytest.raises(DetectionError, match="several gaps"):
        locate_pegs(image, HUB)


def test_nothing_to_see():
    with pytest.raises(DetectionError, match="constant"):
        locate_pegs(np.full((100, 100), 8, np.uint8), HUB)


@settings(max_examples=15)
@given(st.integers(1, 60), st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_noise_is_no_hub(height, width, seed):
    image = np.random.default_rng(seed).integers(0, 256, (height, width)).astype(np.uint8)
    with pytest.raises(DetectionError):
        locate_pegs(image, HUB)


@pytest.mark.parametrize(
    "image", [np.zeros((0, 5), np.uint8), np.zeros((50, 50)), np.zeros((50, 50, 3), np.uint8), None]
)
def test_unusable_images(image):
    with pytest.raises(ValueError, match="image"):
        locate_pegs(image, HUB)


def test_unusable_previous():
    with pytest.raises(ValueError, match="previous"):
        locate_pegs(rendered(0), HUB, previous=SimpleNamespace(peg_centers=np.zeros((3, 2))))


@pytest.mark.parametrize("background", [160, 220, 240])
def test_a_peg_before_a_bright_background_is_not_said_to_leave_the_image(background):
    """Its fit runs away along the background's edge, and may then end outside."""
    experiment = paper_experiment()
    look = HubLook(background=background)
    image = render_hub(
        experiment.camera,
        experiment.cam_from_hubs[0],
        experiment.hub,
        look=look,
        blur=experiment.blur,
        noise=experiment.noise,
        rng=1,
    )
    seen = locate_pegs(image, experiment.hub)
    assert seen.states == ("missing", "measured", "measured", "measured")
    assert len(seen.flags) == 1 and "leaves the image" not in seen.flags[0]
