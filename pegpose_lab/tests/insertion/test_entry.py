"""What pegs meet: the exact sections against clouds of points, against closed forms, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import pegpose_lab as pl
from pegpose_lab.insertion.sections import farthest, reaches
from pegpose_lab.tests.insertion.solids import overlap, peg_points

HUB, WHEEL = pl.Hub(), pl.Wheel(clearance=0.3, chamfer=1.0, thickness=25.0)


def draw(rng, shift=0.5, tilt=0.02, turn=0.005):
    turns = rng.standard_normal(3) * [tilt, tilt, turn]
    return RigidTransform.from_components(rng.standard_normal(3) * [shift, shift, 0.2], Rotation.from_rotvec(turns))


def test_farthest_points_of_ellipses():
    """Of any size and place, also where the farthest point is not at the centre's side."""
    rng = np.random.default_rng(0)
    offsets = rng.standard_normal((3000, 2)) * 10.0 ** rng.uniform(-8, 1, (3000, 1))
    offsets[:100, 0], offsets[100:200, 1], offsets[200:230] = 0.0, 0.0, 0.0
    along = rng.uniform(0.5, 2.0, 3000)
    angles = np.linspace(0, 2 * np.pi, 4000)
    dense = np.hypot(
        offsets[:, :1] + np.cos(angles), offsets[:, 1:] + along[:, None] * np.sin(angles)
    ).max(axis=1)  # fmt: skip
    found = farthest(offsets, 1.0, along)
    assert (found > dense - 1e-7).all() and (found < dense + 1e-5).all()


def test_sections_are_those_of_a_cloud_of_points():
    """Free or not, and the depth that is left free, at tilts of up to five degrees."""
    rng, seen = np.random.default_rng(1), set()
    depths = np.linspace(0, HUB.peg_height, 41)
    coarse = depths[1] + 1.2 * HUB.peg_height / 60  # mm: the steps of depth and of the cloud
    for run in range(24):
        pose = draw(rng, (0.1, 0.5)[run % 2], 0.03 * rng.random())
        entry, inverse = pl.peg_entry(pose, HUB, WHEEL), pose.inv()
        axis = inverse.rotation.apply([0, 0, 1.0])
        for k, top in enumerate(inverse.apply(HUB.peg_centers)):
            cloud = peg_points(HUB, top, axis, 61)
            deep = np.array([overlap(cloud, WHEEL.hole_centers[k], depth, HUB, WHEEL) for depth in depths])
            seen.add(entry.meetings[k])
            if min(abs(entry.tops[k]), abs(entry.mouths[k])) < 5e-3:
                continue  # the cloud is too coarse to say
            assert (entry.meetings[k] == "free") == (deep.max() < 0)
            first = depths[np.argmax(deep > 0)]
            if entry.meetings[k] == "wall":
                assert first - coarse < entry.depths[k] < first + 0.05
            if entry.meetings[k] == "blocked":
                assert first - coarse < entry.depths[k] + 2 * HUB.peg_radius * np.hypot(*axis[:2])
    assert seen == {"free", "wall", "chamfer", "blocked"}


def test_two_point_contact_in_the_plane():
    r"""A peg that touches with its top on one side and at the mouth on the other, of closed form.

    :math:`r \cos t + h \tan t + r / \cos t = 2 R` for the height h of the mouth over the top.
    """
    tilt, radius = 0.01, HUB.peg_radius
    height = HUB.peg_height - WHEEL.chamfer
    needed = (radius * np.cos(tilt) + height * np.tan(tilt) + radius / np.cos(tilt)) / 2
    shift = -(needed - radius * np.cos(tilt))
    axis = np.array([np.sin(tilt), 0, np.cos(tilt)])
    top, mouth = reaches(np.array([[shift, 0, 0]]), axis, np.zeros((1, 2)), HUB, WHEEL)
    np.testing.assert_allclose([top[0], mouth[0]], needed, rtol=0, atol=1e-9)


def test_straight_pegs():
    """Without tilt everything is the distance of axes."""
    for shift, meeting in [(0.29, "free"), (0.31, "chamfer"), (1.29, "chamfer"), (1.31, "blocked")]:
        entry = pl.peg_entry(RigidTransform.from_translation([0, shift, 0]), HUB, WHEEL)
        assert entry.meetings == (meeting,) * 4 == (entry.outcome,) * 4 and entry.enters == (meeting != "blocked")
        np.testing.assert_allclose(entry.tops, 0.3 - shift, atol=1e-9)
        np.testing.assert_allclose(entry.mouths, 0.3 - shift, atol=1e-9)
        assert (entry.depths == (HUB.peg_height if meeting == "free" else 0.0)).all()


def test_each_peg_meets_its_own():
    """A turn moves all pegs; one hole out of its place blocks one peg."""
    turn = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, 0.5 / 48.525]))
    assert pl.peg_entry(turn, HUB, WHEEL).meetings == ("chamfer",) * 4
    offsets = np.zeros((4, 2))
    offsets[2, 0] = 1.4
    entry = pl.peg_entry(RigidTransform.identity(), HUB, WHEEL, offsets)
    assert entry.meetings == ("free", "free", "blocked", "free") and entry.outcome == "blocked"


def test_other_pitch_circle_and_number_of_pegs():
    hub = pl.Hub(n_pegs=6, peg_radius=6.0)
    wheel = pl.Wheel(n_holes=6, pitch_circle_diameter=98.05)
    entry = pl.peg_entry(RigidTransform.identity(), hub, wheel)
    np.testing.assert_allclose(entry.tops, 0.0, atol=1e-9)


def test_a_tilt_of_any_direction_counts_alike():
    """For a peg on the axis of its hole; its neighbours are turned with it."""
    rooms = []
    for direction in np.linspace(0, 2 * np.pi, 7):
        axis = np.array([np.sin(0.02) * np.cos(direction), np.sin(0.02) * np.sin(direction), np.cos(0.02)])
        rooms.append(np.ravel(reaches(np.zeros((1, 3)), axis, np.zeros((1, 2)), HUB, WHEEL)))
    np.testing.assert_allclose(rooms, np.tile(rooms[0], (7, 1)), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"n_holes": 2}, "n_holes"),
        ({"clearance": 0.0}, "clearance"),
        ({"chamfer": -1.0}, "chamfer"),
        ({"chamfer": 15.0}, "thickness"),
        ({"position_tolerance": np.nan}, "position_tolerance"),
        ({"pitch_circle_diameter": "97"}, "pitch_circle_diameter"),
    ],
)
def test_unusable_wheels(change, name):
    with pytest.raises(ValueError, match=name):
        pl.Wheel(**change)


def test_unusable_insertions():
    here = RigidTransform.identity()
    for hub, wheel, words in [
        (HUB, pl.Wheel(n_holes=5), "5 holes and hub 4 pegs"),
        (pl.Hub(peg_height=0.5), pl.Wheel(), "peg_height"),
        (HUB, pl.Wheel(clearance=30.0), "radius 41.1 mm"),
    ]:
        with pytest.raises(ValueError, match=words):
            pl.peg_entry(here, hub, wheel)
    with pytest.raises(ValueError, match="hub_from_wheel"):
        pl.peg_entry(np.eye(4), HUB, WHEEL)
    with pytest.raises(ValueError, match="60 degrees"):
        pl.peg_entry(RigidTransform.from_rotation(Rotation.from_rotvec([2.0, 0, 0])), HUB, WHEEL)
    with pytest.raises(ValueError, match=r"\(3, 2\); expected \(4, 2\)"):
        pl.peg_entry(here, HUB, WHEEL, np.zeros((3, 2)))
