"""Labels: by the screws, and carried over from frame to frame."""

from types import SimpleNamespace

import numpy as np
import pytest

from pegpose_lab.checks import DetectionError
from pegpose_lab.pegs import locate_pegs, track_pegs
from pegpose_lab.pegs.labels import _choose, _screws_look_alike
from pegpose_lab.targets import MOST_PEGS, Hub
from pegpose_lab.tests.pegs.hubs import HUB, assert_seen, pose_of, rendered, truth


@pytest.mark.parametrize("turn", [0, 37, 95, 171, 230, 301])
def test_first_screw_is_the_one_further_left(turn):
    observation = locate_pegs(rendered(turn), HUB)
    screws = truth(pose_of(turn))[1]
    shift = 0 if screws[0, 0] < screws[1, 0] else 2
    assert_seen(observation, pose_of(turn), shift=shift)
    assert observation.screw_centers[0, 0] < observation.screw_centers[1, 0]


def test_of_two_screws_equally_far_left_the_upper_is_the_first():
    circles = SimpleNamespace(centers=np.zeros((4, 2)), radii=np.ones(4))
    for last_digit in (-1e-12, 0.0, 1e-12):
        upper, lower = np.array([[50.0, 20.0, 5.0], [50.0, 80.0, 5.0]]) + [[last_digit, 0, 0], [0, 0, 0]]
        labellings = [
            SimpleNamespace(pegs=np.arange(4), screws=np.array(pair)) for pair in ((upper, lower), (lower, upper))
        ]
        for order in (labellings, labellings[::-1]):
            assert _choose(order, circles, None).screws[0, 1] == 20.0


def test_labels_run_clockwise_on_the_screen():
    pegs = locate_pegs(rendered(20), HUB).peg_centers
    x, y = (pegs - pegs.mean(axis=0)).T
    assert (np.diff(np.unwrap(np.arctan2(y, x))) > 0).all()  # y down


def test_labels_are_carried_over_a_whole_turn():
    turns = np.arange(0, 361, 60.0) + 70
    frames = [rendered(float(turn)) for turn in turns]
    first = truth(pose_of(turns[0]))[1]
    shift = 0 if first[0, 0] < first[1, 0] else 2
    for turn, observation in zip(turns, track_pegs(frames, HUB), strict=True):
        assert_seen(observation, pose_of(turn), shift=shift)


def test_previous_overrules_the_convention():
    first = locate_pegs(rendered(0), HUB)
    shifted = SimpleNamespace(peg_centers=np.roll(first.peg_centers, 2, axis=0))
    other = locate_pegs(rendered(0), HUB, previous=shifted)
    np.testing.assert_array_equal(other.peg_centers, shifted.peg_centers)
    np.testing.assert_array_equal(other.screw_centers, first.screw_centers[::-1])


def test_a_quarter_turn_between_frames_is_refused():
    first = locate_pegs(rendered(0), HUB)
    with pytest.raises(DetectionError, match="turned too far"):
        locate_pegs(rendered(90), HUB, previous=first)
    _, anew = track_pegs([rendered(0), rendered(90)], HUB)
    assert [flag.code for flag in anew.flags] == ["labels-undecided"] and "turned too far" in anew.flags[0]


@pytest.mark.parametrize("n_pegs", [3, 5, 6, MOST_PEGS])
def test_other_numbers_of_pegs(n_pegs):
    hub = Hub(n_pegs=n_pegs, peg_radius=9.0 if n_pegs < 10 else 7.0)
    for turn in (15, 140, 260):
        observation = locate_pegs(rendered(turn, hub=hub), hub)
        screws = truth(pose_of(turn), hub)[1]
        same = _screws_look_alike(n_pegs // 2, hub) if n_pegs % 2 == 0 else False
        shift = n_pegs // 2 if same and screws[1, 0] < screws[0, 0] else 0
        assert_seen(observation, pose_of(turn), hub, shift=shift)


def test_symmetry_of_screws():
    assert [k for k in range(4) if _screws_look_alike(k, HUB)] == [0, 2]
    assert [k for k in range(4) if _screws_look_alike(k, Hub(screw_angles=(0.7, 1.5)))] == [0]
    four_screws = Hub(screw_angles=tuple(np.pi / 4 + np.pi / 2 * np.arange(4)))
    assert [k for k in range(4) if _screws_look_alike(k, four_screws)] == [0, 1, 2, 3]
