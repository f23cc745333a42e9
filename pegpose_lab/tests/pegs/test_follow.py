"""A hub or ring near where it was in the frame before is measured without a search, or searched: never silently wrong."""

import cv2
import numpy as np
import pytest

from pegpose_lab.checks import DetectionError
from pegpose_lab.pegs import follow, locate, locate_pegs, ring
from pegpose_lab.pegs.moved import _motion
from pegpose_lab.render import render_hub
from pegpose_lab.tests.pegs.drawn import drawn, ellipse_centers, homography, ring_discs
from pegpose_lab.tests.pegs.hubs import CAMERA, HUB, assert_seen, pose_of, rendered, truth
from pegpose_lab.tests.pegs.test_ring import matched, pattern

MARKED = HUB.pattern


def searched(image, target, **arguments):
    """The observation without a frame before it."""
    return locate_pegs(image, target, **arguments)


@pytest.fixture
def followed(monkeypatch):
    """A list of what the shorter way returns, hub by hub: None where it gives up."""
    results = []
    for module, name in ((locate, "_followed_hub"), (locate, "_locate_ring"), (ring, "_followed_ring")):
        whole = getattr(module, name)

        def spy(*arguments, whole=whole, name=name):
            result = whole(*arguments)
            if name != "_locate_ring":
                results.append(result)
            return result

        monkeypatch.setattr(module, name, spy)
    return results


# ---- the motion ----


@pytest.mark.parametrize("sign", [1, -1])
def test_the_motion_of_discs_between_two_frames(sign):
    places = np.array([[150.0, 120.0], [300.0, 130.0], [290.0, 260.0], [160.0, 250.0]])
    turn, step = np.exp(0.06j), 9 - 5j
    now = (places @ (1, 1j) - (220 + 190j)) * turn + 220 + 190j + step
    image = np.full((400, 460), 120, np.uint8)
    for place in now:
        center = round(16 * place.real), round(16 * place.imag)
        cv2.circle(image, center, 16 * 24, 120 + 70 * sign, -1, cv2.LINE_AA, shift=4)
    noise = np.random.default_rng(0).normal(0, 4, image.shape)
    image = np.clip(image + noise, 0, 255).astype(np.uint8)
    a, b = _motion(image, places, np.full(4, 24.0), np.full(4, sign))
    assert np.abs(a * (places @ (1, 1j)) + b - now).max() < 0.5 and abs(a - turn) < 0.01
    a, b = _motion(image, places, np.full(4, 24.0), np.zeros(4))
    assert np.abs(a * (places @ (1, 1j)) + b - now).max() < 0.5
    assert _motion(image, places, np.full(4, 24.0), np.full(4, -sign)) is None
    assert _motion(image, places + [[70, 0], [0, 0], [0, 0], [0, 0]], np.full(4, 24.0), np.full(4, sign)) is None


def test_places_beyond_the_picture_have_no_motion():
    assert (
        _motion(np.zeros((50, 50), np.uint8), np.array([[-90.0, 10.0], [10, 400]]), np.array([8.0, 8]), np.ones(2))
        is None
    )


# ---- hubs ----


@pytest.mark.parametrize("turn", [3.0, 7.0])
def test_a_followed_hub_is_as_accurate_as_a_searched_one(turn, followed):
    errors = []
    for seed in range(12):
        poses = [pose_of(20.0 + seed), pose_of(20.0 + seed + turn, position=(7.0, -6.0, 301.0))]
        frames = [render_hub(CAMERA, pose, HUB, rng=seed) for pose in poses]
        first = searched(frames[0], HUB)
        alone, after = searched(frames[1], HUB), locate_pegs(frames[1], HUB, previous=first)
        assert followed[-1] is after and after.labelled_by == "previous frame" and after.states == alone.states
        true = truth(poses[1])[0]
        for one in (alone, after):
            apart = np.linalg.norm(one.peg_centers[:, None] - true, axis=2)
            errors.append(one.peg_centers - true[apart.argmin(axis=1)])
        shifts = [np.linalg.norm(one.peg_centers - first.peg_centers, axis=1).max() for one in (after,)]
        assert max(shifts) < first.peg_radii.max()
    alone, after = np.array(errors[::2]), np.array(errors[1::2])
    assert np.sqrt((after**2).mean()) < 1.1 * np.sqrt((alone**2).mean())


@pytest.mark.parametrize("position", [(25.0, -8.0, 300.0), (-20.0, 12.0, 330.0)])
def test_a_hub_that_jumped_is_searched(position, followed):
    first, pose = searched(rendered(0), HUB), pose_of(0, position=position)
    observation = locate_pegs(render_hub(CAMERA, pose, HUB, rng=3), HUB, previous=first)
    assert followed[-1] is None
    shift = 0 if np.allclose(first.peg_centers, truth(pose_of(0))[0], atol=1) else 2
    assert_seen(observation, pose, shift=shift)


@pytest.mark.parametrize("turn", [15.0, 30.0, 40.0])
def test_a_turned_hub_keeps_its_labels(turn):
    first = searched(rendered(0), HUB)
    shift = 0 if np.allclose(first.peg_centers, truth(pose_of(0))[0], atol=1) else 2
    assert_seen(locate_pegs(rendered(turn), HUB, previous=first), pose_of(turn), shift=shift)


def test_a_covered_peg_is_missing_as_it_is_without_a_frame_before():
    first, image = searched(rendered(0), HUB), rendered(2.0).copy()
    x, y = np.rint(truth(pose_of(2.0))[0][1]).astype(int)
    cv2.circle(image, (int(x), int(y)), 34, 62, -1)
    covered, alone = locate_pegs(image, HUB, previous=first), locate_pegs(image, HUB)
    for observation in (covered, alone):
        assert sorted(observation.states) == ["measured"] * 3 + ["missing"]
    assert covered.states[3 if first_is_turned(first) else 1] == "missing"
    np.testing.assert_array_equal(np.sort(covered.peg_centers, axis=0), np.sort(alone.peg_centers, axis=0))
    assert_seen(locate_pegs(rendered(4.0), HUB, previous=first), pose_of(4.0), shift=2 if first_is_turned(first) else 0)


def first_is_turned(first):
    return not np.allclose(first.peg_centers, truth(pose_of(0))[0], atol=1)


def test_a_covered_screw_is_searched(followed):
    first, image = searched(rendered(0), HUB), rendered(2.0).copy()
    x, y = np.rint(truth(pose_of(2.0))[1][1]).astype(int)
    cv2.circle(image, (int(x), int(y)), 14, 62, -1)
    with pytest.raises(DetectionError, match="1 of 2 screws"):
        locate_pegs(image, HUB, previous=first)
    assert followed == [None]


def test_an_observation_without_all_parts_is_not_followed():
    first = searched(rendered(0), HUB)
    assert follow._has_all_parts(first, HUB)
    assert not follow._has_all_parts(ring.replace(first, bore_sigma=np.full(2, np.inf)), HUB)
    assert not follow._has_all_parts(object(), HUB)


# ---- rings ----


def frames_of(target, step=4.0, seed=0):
    """Two pictures of a ring that moved by `step` px and turned by a degree, and its homographies."""
    h = homography(target, np.random.default_rng(seed), tilt=20)
    spin = np.array([[np.cos(0.02), -np.sin(0.02), 0], [np.sin(0.02), np.cos(0.02), 0], [0, 0, 1]])
    moved = np.array([[1, 0, step], [0, 1, -step / 2], [0, 0, 1]]) @ h @ spin
    return h, moved, [drawn(ring_discs(target, 200), view, rng=k) for k, view in enumerate((h, moved))]


def test_a_followed_ring_is_the_searched_one(followed):
    target = pattern(6)
    _, view, pictures = frames_of(target)
    first = searched(pictures[0], target, radius_range=(10, 30))
    after = locate_pegs(pictures[1], target, radius_range=(10, 30), previous=first)
    alone = searched(pictures[1], target, radius_range=(10, 30))
    assert followed[-1] is after and after.states == alone.states and after.labelled_by == "previous frame"
    apart = np.linalg.norm(after.peg_centers[:, None] - alone.peg_centers, axis=2).min(axis=1)
    assert apart.max() < 0.5 * alone.peg_sigmas.min()
    assert matched(after, target, view)[0].max() < 0.1


def test_a_ring_that_jumped_is_searched(followed):
    target = pattern(6)
    _, view, pictures = frames_of(target, step=70.0)
    first = searched(pictures[0], target, radius_range=(10, 30))
    after = locate_pegs(pictures[1], target, radius_range=(10, 30), previous=first)
    assert followed[-1] is None and matched(after, target, view)[0].max() < 0.2


def test_a_place_that_is_covered_meanwhile_is_not_measured():
    target = pattern(6, disc_radius=10.0, max_missing=1)
    _, view, pictures = frames_of(target)
    first = searched(pictures[0], target, radius_range=(15, 40))
    x, y = ellipse_centers(view, target.places, 10.0)[2]
    for width, states in ((60, ("partial", "contradicted")), (0, ("missing",))):
        picture = pictures[1].copy()
        left = int(x) if width else int(x) - 60
        picture[int(y) - 60 : int(y) + 60, left : int(x) + 60] = 90
        after = locate_pegs(picture, target, radius_range=(15, 40), previous=first)
        off, order = matched(after, target, view)
        assert after.states[order[2]] in states and np.delete(off, 2).max() < 0.2
