"""Tracking: labels over many turns, lost frames, and the limits that are stated."""

import numpy as np
import pytest

from pegpose_lab import Hub, LostFrame, estimate_pose
from pegpose_lab.pegs import largest_turn, locate_pegs, track_pegs
from pegpose_lab.tests.pegs.hubs import CAMERA, HUB, assert_seen, pose_of, rendered, truth

EMPTY = np.full((480, 640), 40, np.uint8)


def first_shift(turn, hub=HUB):
    """How many pegs the first frame's labels are turned: the first screw is the one further left."""
    screws = truth(pose_of(turn), hub)[1]
    return 0 if screws[0, 0] < screws[1, 0] else hub.n_pegs // 2


def codes(observation):
    return [flag.code for flag in observation.flags]


@pytest.mark.parametrize("step", [5.0, 35.0, 70.0, -70.0])
def test_labels_are_carried_through_more_than_a_turn(step):
    turns = 10 + step * np.arange(int(np.ceil(420 / abs(step))) + 1) if abs(step) > 30 else 10 + step * np.arange(45)
    for turn, observation in zip(turns, track_pegs((rendered(float(t)) for t in turns), HUB), strict=True):
        assert_seen(observation, pose_of(turn), shift=first_shift(10.0))
        assert codes(observation) == []


def test_labels_follow_a_hub_whose_screws_say_nothing():
    hub = Hub(screw_angles=tuple(np.pi / 4 + np.pi / 2 * np.arange(4)))  # a screw in each gap: four equal labellings
    turns = 12 + 30.0 * np.arange(13)
    found = list(track_pegs((rendered(float(t), hub=hub) for t in turns), hub))
    before = truth(pose_of(turns[0]), hub)[0]
    shift = int(np.argmin(np.linalg.norm(before - found[0].peg_centers[0], axis=1)))
    for turn, observation in zip(turns, found, strict=True):
        expected = np.roll(truth(pose_of(turn), hub)[0], -shift, axis=0)
        np.testing.assert_allclose(observation.peg_centers, expected, atol=0.3)


@pytest.mark.parametrize(
    ("equal", "hub"), [(2, HUB), (4, Hub(screw_angles=tuple(np.pi / 4 + np.pi / 2 * np.arange(4))))]
)
def test_the_stated_limit_is_where_labels_end_to_be_carried(equal, hub):
    limit = np.degrees(largest_turn(equal))
    first = locate_pegs(rendered(0.0, 0.0, hub=hub), hub)
    shift = int(np.argmin(np.linalg.norm(truth(pose_of(0.0, 0.0), hub)[0] - first.peg_centers[0], axis=1)))
    inside = locate_pegs(rendered(float(limit - 2), 0.0, hub=hub), hub, previous=first)
    expected = np.roll(truth(pose_of(limit - 2, 0.0), hub)[0], -shift, axis=0)
    np.testing.assert_allclose(inside.peg_centers, expected, atol=0.3)
    _, beyond = track_pegs([rendered(0.0, 0.0, hub=hub), rendered(float(limit + 2), 0.0, hub=hub)], hub)
    assert "labels-undecided" in codes(beyond)


def test_marks_allow_any_turn():
    hub = Hub(screw_angles=(-np.pi / 4,))
    assert largest_turn(1) == np.pi
    for turn, observation in zip(
        (0, 90, 250), track_pegs([rendered(float(t), hub=hub) for t in (0, 90, 250)], hub), strict=True
    ):
        np.testing.assert_allclose(observation.peg_centers, truth(pose_of(turn), hub)[0], atol=0.3)
        assert codes(observation) == []


def test_tracking_goes_on_after_lost_frames():
    turns = [0.0, 20.0, None, None, 60.0, 80.0]
    frames = [EMPTY if turn is None else rendered(turn) for turn in turns]
    found = list(track_pegs(frames, HUB))
    assert [bool(one) for one in found] == [True, True, False, False, True, True]
    lost = found[2]
    assert isinstance(lost, LostFrame) and lost.number == 3 and found[3].number == 4 and lost.reason
    for turn, observation in zip(turns, found, strict=True):
        if turn is not None:
            assert_seen(observation, pose_of(turn), shift=first_shift(0.0))
    assert (
        codes(found[4]) == ["labels-over-gap"]
        and "2 lost frames" in found[4].flags[0]
        and "77 deg" in found[4].flags[0]
    )
    assert codes(found[5]) == []


def test_the_first_frames_may_be_lost():
    found = list(track_pegs([EMPTY, rendered(0.0)], HUB))
    assert not found[0] and codes(found[1]) == []


def test_a_lost_frame_has_no_pose():
    with pytest.raises(ValueError, match="observation is LostFrame"):
        estimate_pose(LostFrame(1, "found 0 discs"), CAMERA, HUB)


def test_a_frame_that_is_no_image_is_an_error():
    with pytest.raises(ValueError, match="image"):
        list(track_pegs([rendered(0.0), np.zeros((4, 4, 3, 2))], HUB))
