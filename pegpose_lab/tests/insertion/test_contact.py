"""Wedging and jamming: Whitney's closed forms for one peg in the plane, and what several pegs change."""

import numpy as np
import pytest

import pegpose_lab as pl
from pegpose_lab.insertion import Contacts, can_wedge, jamming_load, two_point_contacts, wedging_depth

RADIUS = 10.0
PUSH = np.array([0, 0, 1.0, 0, 0, 0])


def one_peg(length):
    """A peg that touches with its top at x = radius and, `length` further back, at the mouth at x = -radius.

    The origin is at the peg's top, as Whitney's is.
    """
    return Contacts(np.array([[RADIUS, 0, 0], [-RADIUS, 0, length]]), np.array([[1.0, 0, 0], [-1, 0, 0]]))


@pytest.mark.parametrize("friction", [0.05, 0.2, 0.6])
def test_one_peg_wedges_down_to_friction_times_diameter(friction):
    assert can_wedge(one_peg(0.999 * friction * 2 * RADIUS), friction)
    assert not can_wedge(one_peg(1.001 * friction * 2 * RADIUS), friction)


@pytest.mark.parametrize("sideways", [-1.0, 0.0, 0.7, 2.0])
def test_one_peg_jams_on_the_side_of_the_diagram(sideways):
    r"""Whitney's two-point contact: :math:`M / (r F_z) = \lambda + \mu (1 + \lambda) F_x / F_z`, lambda = l / (2 r mu)."""
    friction, length = 0.2, 15.0
    slenderness = length / (2 * RADIUS * friction)
    expected = RADIUS * (slenderness + friction * (1 + slenderness) * sideways)
    start = np.array([sideways, 0, 1.0, 0, expected - 30.0, 0])
    assert jamming_load(one_peg(length), friction, start, [0, 0, 0, 0, 1.0, 0]) == pytest.approx(30.0, abs=1e-4)
    assert jamming_load(one_peg(length), friction, start, [0, 0, 0, 0, -1.0, 0]) == np.inf


def test_units_of_loads_do_not_matter():
    moment = [0, 0, 0, 0, 1.0, 0]
    once = jamming_load(one_peg(15.0), 0.2, PUSH, moment)
    assert jamming_load(one_peg(15.0), 0.2, 1e3 * PUSH, moment) == pytest.approx(1e3 * once)
    assert jamming_load(one_peg(15.0), 0.2, PUSH, np.multiply(1e-3, moment)) == pytest.approx(1e3 * once)


def test_without_friction_nothing_wedges_or_jams():
    assert not can_wedge(one_peg(5.0), 0.0)
    assert jamming_load(one_peg(5.0), 0.0, PUSH, [0, 0, 0, 0, 1.0, 0]) == np.inf


def test_opposite_contacts_wedge():
    assert can_wedge(one_peg(0.0), 0.0)


@pytest.mark.parametrize("n_pegs", [3, 4, 5, 6])
def test_several_pegs_wedge_deeper(n_pegs):
    """The widest pair of a top and a mouth that see each other within their friction cones, by trying all pairs."""
    friction, direction = 0.08, 0.3
    hub = pl.Hub(n_pegs=n_pegs, peg_height=30.0)
    wheel = pl.Wheel(n_holes=n_pegs, thickness=40.0, chamfer=1.0)
    contacts = two_point_contacts(hub, wheel, 30.0, direction)
    side = contacts.normals[0]
    deepest = 0.0
    for top in contacts.points[:n_pegs]:
        for mouth in contacts.points[n_pegs:]:
            apart = (top - mouth)[:2]
            along = abs(apart @ side[:2])
            across = np.linalg.norm(apart) ** 2 - along**2
            deepest = max(deepest, np.sqrt(max((friction * along) ** 2 - across, 0.0)))
    found = wedging_depth(hub, wheel, friction, direction) - 1.0
    assert found >= 2 * friction * (hub.peg_radius + wheel.clearance) * 0.999  # of one peg
    assert found > 0.97 * deepest  # the pyramid of 16 rays has 98 % of the cone


def test_opposite_pegs_wedge_by_their_distance():
    hub, wheel = pl.Hub(), pl.Wheel(chamfer=1.0)
    span = wheel.pitch_circle_diameter + 2 * (hub.peg_radius + wheel.clearance)
    assert wedging_depth(hub, wheel, 0.1) == pytest.approx(1.0 + 0.1 * span, abs=1e-3)
    assert wedging_depth(hub, wheel, 0.3) == hub.peg_height


def test_less_disturbs_several_pegs():
    """Friction at a peg that is far off helps a moment to jam the wheel."""
    hub, wheel = pl.Hub(peg_height=40.0), pl.Wheel(thickness=50.0)
    four = two_point_contacts(hub, wheel, 40.0)
    one = Contacts(four.points[[0, 4]] - [48.525, 0, 0], four.normals[[0, 4]])
    moment = [0, 0, 0, 0, 1.0, 0]
    assert 0 < jamming_load(four, 0.1, PUSH, moment) < 0.9 * jamming_load(one, 0.1, PUSH, moment)


def test_unusable_arguments():
    hub, wheel, here = pl.Hub(), pl.Wheel(), one_peg(5.0)
    with pytest.raises(ValueError, match="depth is 30"):
        two_point_contacts(hub, wheel, 30.0)
    with pytest.raises(ValueError, match="friction"):
        can_wedge(here, -0.1)
    with pytest.raises(ValueError, match="5 holes"):
        wedging_depth(hub, pl.Wheel(n_holes=5), 0.1)
    with pytest.raises(ValueError, match="wrench"):
        jamming_load(here, 0.1, [1.0, 0], PUSH)
    with pytest.raises(ValueError, match="zero in part"):
        jamming_load(here, 0.1, PUSH, np.zeros(6))
    with pytest.raises(ValueError, match="unit vector"):
        can_wedge(Contacts(here.points, 2 * here.normals), 0.1)
