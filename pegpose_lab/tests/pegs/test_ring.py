"""Rings of a pattern in drawn pictures whose truth is known."""

import numpy as np
import pytest

from pegpose_lab.checks import DetectionError
from pegpose_lab.patterns import RingMark, RingPattern
from pegpose_lab.pegs import locate_pegs, track_pegs
from pegpose_lab.tests.pegs.drawn import drawn, ellipse_centers, homography, ring_discs
from pegpose_lab.tests.pegs.hubs import HUB, rendered

MILD = {"labels-undecided", "place-missing"}


def pattern(n=6, **changes):
    return RingPattern(n, **{"pitch_radius": 50.0, "disc_radius": 7.0, **changes})


def matched(observation, ring, h):
    """Distances (n,) of the true ellipse centres to the nearest observed place, px, and which place that is."""
    truth = ellipse_centers(h, ring.places, ring.disc_radius)
    apart = np.linalg.norm(truth[:, None] - observation.peg_centers, axis=2)
    return apart.min(axis=1), apart.argmin(axis=1)


def codes(observation):
    return {flag.code for flag in observation.flags}


@pytest.mark.parametrize("value, ground, polarity", [(200, 90, "bright"), (30, 90, "dark"), (14, 26, "dark")])
def test_all_places_of_a_ring(value, ground, polarity):
    """Bright, dark, and dark on dark."""
    ring = pattern(polarity=polarity)
    h = homography(ring, np.random.default_rng(1))
    observation = locate_pegs(drawn(ring_discs(ring, value), h, ground=ground, noise=1.5), ring, radius_range=(10, 30))
    off, order = matched(observation, ring, h)
    assert off.max() < 0.25 and sorted(order) == list(range(6))
    assert observation.states == ("measured",) * 6 and observation.visible.min() > 0.8 and codes(observation) <= MILD


def test_a_mixture_of_bright_and_dark_places():
    ring = pattern(polarity="either")
    h = homography(ring, np.random.default_rng(2))
    picture = drawn(ring_discs(ring, [200, 30, 200, 30, 30, 200]), h)
    observation = locate_pegs(picture, ring, radius_range=(10, 30))
    assert matched(observation, ring, h)[0].max() < 0.2 and observation.states == ("measured",) * 6


@pytest.mark.parametrize("seed", range(6))
def test_empty_places_are_told(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(6, 17))
    ring = pattern(n, disc_radius=5.0, max_missing=3)
    missing = set(rng.choice(n, int(rng.integers(1, 4)), replace=False).tolist())
    h = homography(ring, rng, tilt=45)
    picture = drawn(ring_discs(ring, 200, missing), h, rng=seed, texture=1.0)
    observation = locate_pegs(picture, ring, radius_range=(8, 22))
    off, order = matched(observation, ring, h)
    assert off.max() < 1.0
    assert {k for k in range(n) if observation.states[order[k]] == "missing"} == missing
    assert np.isinf(observation.peg_sigmas[order[list(missing)]]).all() and np.isfinite(observation.peg_centers).all()


def test_steep_rings_and_their_homography():
    """Ellipses of axis ratio 2.3."""
    ring = pattern(5, disc_radius=9.0)
    rng = np.random.default_rng(4)
    h = homography(ring, rng, tilt=0.0) @ np.diag([1.0, 1 / 2.3, 1.0])
    observation = locate_pegs(drawn(ring_discs(ring, 200), h), ring, radius_range=(8, 40))
    assert matched(observation, ring, h)[0].max() < 0.3
    assert np.allclose(ellipse_centers(observation.homography, ring.places, 9.0), observation.peg_centers, atol=0.3)
    assert observation.residual < 0.3 and observation.residual_over_sigma < 1.5


def test_sigmas_cover_the_errors():
    ring, pulls = pattern(8), []
    for seed in range(5):
        h = homography(ring, np.random.default_rng(seed))
        observation = locate_pegs(drawn(ring_discs(ring, 200), h, rng=seed, noise=4.0), ring, radius_range=(10, 30))
        truth = ellipse_centers(h, ring.places, ring.disc_radius)
        errors = observation.peg_centers - truth[matched_places(observation, truth)]
        pulls += [e @ np.linalg.solve(c, e) / 2 for e, c in zip(errors, observation.peg_covariances, strict=True)]
    assert 0.5 < np.mean(pulls) < 2.0


def matched_places(observation, truth):
    return np.linalg.norm(observation.peg_centers[:, None] - truth, axis=2).argmin(axis=1)


def test_a_covered_place_is_partial_and_its_centre_that_of_the_ring():
    ring = pattern(6, disc_radius=10.0)
    h = homography(ring, np.random.default_rng(3), tilt=20)
    picture = drawn(ring_discs(ring, 200), h, noise=2.0)
    x, y = ellipse_centers(h, ring.places, 10.0)[2]
    picture[int(y) - 60 : int(y) + 60, int(x) : int(x) + 60] = 90  # half of place 3 is hidden
    observation = locate_pegs(picture, ring, radius_range=(15, 40))
    off, order = matched(observation, ring, h)
    assert observation.states[order[2]] in ("partial", "contradicted") and observation.visible[order[2]] < 0.75
    shift = observation.peg_centers[order[2]] - (x, y)
    assert shift @ np.linalg.solve(observation.peg_covariances[order[2]], shift) < 12
    assert np.delete(off, 2).max() < 0.2


def test_marks_decide_the_labels_and_say_so():
    mark = RingMark((30 * np.cos(0.3), 30 * np.sin(0.3)), 4.0)
    ring = pattern(5, marks=[mark])
    for seed in range(4):
        h = homography(ring, np.random.default_rng(seed))
        picture = drawn([*ring_discs(ring, 200), (*mark.center, mark.radius, 200)], h)
        observation = locate_pegs(picture, ring, radius_range=(10, 30))
        assert observation.labelled_by == "mark" and len(observation.turns) == 1
        np.testing.assert_allclose(observation.peg_centers, ellipse_centers(h, ring.places, 7.0), atol=0.3)
        np.testing.assert_allclose(observation.screw_centers, ellipse_centers(h, [mark.center], 4.0), atol=1.0)


def test_marks_are_measured_as_discs_with_their_sigmas():
    mark, pulls = RingMark((30 * np.cos(0.3), 30 * np.sin(0.3)), 5.0), []
    ring = pattern(5, marks=[mark])
    for seed in range(50):
        h = homography(ring, np.random.default_rng(seed), tilt=25)
        picture = drawn([*ring_discs(ring, 200), (*mark.center, mark.radius, 200)], h, rng=seed, noise=4.0)
        observation = locate_pegs(picture, ring, radius_range=(10, 30))
        assert (observation.screw_sigmas < 0.1).all()
        error = observation.screw_centers - ellipse_centers(h, [mark.center], mark.radius)
        pulls.append(error / observation.screw_sigmas)
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.5


def test_without_a_mark_the_frame_before_decides_and_the_turns_are_told():
    ring = pattern(5, bore=(16.0, "dark"))
    rng = np.random.default_rng(7)
    h = homography(ring, rng)
    frames = []
    for step in range(4):
        spin = np.array(
            [[np.cos(0.1 * step), -np.sin(0.1 * step), 0], [np.sin(0.1 * step), np.cos(0.1 * step), 0], [0, 0, 1]]
        )
        frames.append((h @ spin, drawn([*ring_discs(ring, 200), (0, 0, 16.0, 20)], h @ spin, rng=step)))
    found = list(track_pegs([picture for _, picture in frames], ring, radius_range=(10, 30)))
    assert found[0].labelled_by == "nothing" and len(found[0].turns) == 5 and "labels-undecided" in codes(found[0])
    first = matched(found[0], ring, frames[0][0])[1]
    for (view, _), observation in zip(frames, found, strict=True):
        off, order = matched(observation, ring, view)
        assert off.max() < 0.3 and order.tolist() == first.tolist()
        assert np.linalg.norm(observation.bore_center - ellipse_centers(view, [[0, 0]], 16.0)[0]) < 0.2
    assert {observation.labelled_by for observation in found[1:]} == {"previous frame"}
    for turn in found[0].turns[1:]:
        other = found[0].peg_centers[turn]
        assert sorted(map(tuple, other)) == sorted(map(tuple, found[0].peg_centers))


@pytest.mark.parametrize("turn", [0.0, 33.0])
def test_a_hub_as_a_pattern_has_the_same_pegs(turn):
    """Bore and screws lie deeper than the pegs' tops, and are found where the bore's shift puts them."""
    picture = rendered(turn)
    as_hub, as_ring = locate_pegs(picture, HUB), locate_pegs(picture, HUB.pattern, radius_range=(10, 35))
    labellings = [as_ring.peg_centers[turn] for turn in as_ring.turns]
    assert len(labellings) == 2 and min(np.abs(one - as_hub.peg_centers).max() for one in labellings) < 0.05
    assert np.linalg.norm(as_ring.bore_center - as_hub.bore_center) < 0.1
    apart = np.linalg.norm(as_ring.screw_centers[:, None] - as_hub.screw_centers, axis=2)
    assert apart.min(axis=1).max() < 1.0 and codes(as_ring) == {"labels-undecided"}


def test_three_rings_on_one_pitch_circle_are_rivals():
    ring = pattern(6, disc_radius=4.0)
    angles = np.concatenate([np.arange(6) * np.pi / 3 + turn for turn in (0, 0.26, 0.61)])
    all_three = RingPattern(angles=angles, pitch_radius=50.0, disc_radius=4.0)
    h = homography(ring, np.random.default_rng(5), tilt=20)
    observation = locate_pegs(drawn(ring_discs(all_three, 200), h), ring, radius_range=(6, 18))
    assert {"further-disc", "rival-ring"} <= codes(observation) and len(observation.rivals) == 2
    found = [ellipse_centers(view, ring.places, 4.0) for view in (observation.homography, *observation.rivals)]
    truth = ellipse_centers(h, all_three.places, 4.0)
    assert np.linalg.norm(truth[:, None] - np.concatenate(found), axis=2).min(axis=1).max() < 0.3


def wrong(kind, seed):
    """What is drawn, and what is asked for."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 10))
    if kind == "n":
        return pattern(n, disc_radius=5.0), pattern(n + 1, disc_radius=5.0)
    if kind == "polarity":
        return pattern(n), pattern(n, polarity="dark")
    if kind == "proportions":
        return pattern(n, disc_radius=6.0), pattern(n, disc_radius=rng.choice([3.5, 10.0]))
    if kind == "rectangle":
        return (RingPattern(centers=[[-a, -40], [a, -40], [a, 40], [-a, 40]], disc_radius=8.0) for a in (42.0, 60.0))
    angles = np.cumsum(rng.uniform(0.5, 1.0, 7))
    return (RingPattern(angles=sign * angles, pitch_radius=50.0, disc_radius=6.0) for sign in (1, -1))


@pytest.mark.parametrize("kind", ["n", "polarity", "proportions", "rectangle", "mirrored"])
@pytest.mark.parametrize("seed", range(3))
def test_another_ring_is_refused_or_flagged(kind, seed):
    shown, asked = wrong(kind, seed)
    h = homography(shown, np.random.default_rng(seed), tilt=30)
    radius = 140 * asked.disc_radius / asked.scale
    try:
        observation = locate_pegs(drawn(ring_discs(shown, 200), h), asked, radius_range=(0.5 * radius, 1.6 * radius))
    except DetectionError as error:
        assert "found" in str(error) or "no ring" in str(error)
    else:
        assert codes(observation) - MILD


@pytest.mark.parametrize("texture", [0.0, 3.0])
def test_a_picture_without_a_ring_says_what_was_seen(texture):
    ring = pattern(6)
    with pytest.raises(DetectionError, match=r"discs|places"):
        locate_pegs(drawn([], np.eye(3), texture=texture), ring, radius_range=(10, 30))


def test_without_a_radius_range_the_whole_picture_is_searched():
    ring = pattern(5)
    h = homography(ring, np.random.default_rng(9), tilt=15)
    assert matched(locate_pegs(drawn(ring_discs(ring, 200), h), ring), ring, h)[0].max() < 0.2


def test_unusable_arguments():
    picture, ring = np.zeros((100, 100), np.uint8), pattern(5)
    with pytest.raises(ValueError, match="radius_range"):
        locate_pegs(picture, ring, radius_range=3)
    with pytest.raises(ValueError, match="previous is not a PegObservation of 5 pegs"):
        locate_pegs(picture, ring, previous="frame")
    with pytest.raises(ValueError, match="cut it out"):
        locate_pegs(np.zeros((3, 33_000), np.uint8), ring)


@pytest.mark.parametrize("shape", [(1, 1), (8, 8), (200, 300)])
def test_empty_pictures_are_refused(shape):
    with pytest.raises(DetectionError, match="found 0 bright discs"):
        locate_pegs(np.full(shape, 255, np.uint8), pattern(5))
