"""Pegs that lead others: the least displacement against a general solver, and the simplest cases."""

import numpy as np
from scipy.optimize import minimize

import pegpose_lab as pl
from pegpose_lab.insertion.leading import _displacement, led_in

HUB, WHEEL = pl.Hub(), pl.Wheel(clearance=0.3, chamfer=1.0)
PLACES = WHEEL.hole_centers / (WHEEL.pitch_circle_diameter / 2)
TURN = np.column_stack([-PLACES[:, 1], PLACES[:, 0]])


def test_least_displacement():
    """Against sequential quadratic programming: the limits are kept, at displacements within 0.06 mm of the least."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        offsets = rng.standard_normal(2) * 0.5 + rng.standard_normal() * 0.3 * TURN
        room = np.where(rng.random(4) < 0.6, rng.uniform(0.4, 1.0, 4), np.inf)
        found = _displacement(offsets[None], room[None], TURN)[0]
        bound = np.isfinite(room)

        def moved(q, offsets=offsets):
            return offsets + q[:2] + q[2] * TURN

        def slack(q, room=room, bound=bound, moved=moved):
            return (room**2 - np.sum(moved(q) ** 2, axis=1))[bound]

        best = minimize(lambda q: q @ q, np.zeros(3), constraints=[{"type": "ineq", "fun": slack}], method="SLSQP")
        assert (np.linalg.norm(offsets + found, axis=1) < room + 1e-3).all()
        np.testing.assert_allclose(offsets + found, moved(best.x), atol=0.06)


def led(offsets, heights):
    """Whether upright pegs at offsets (4, 2) from their holes' axes and heights (4,), mm, pass."""
    holes = WHEEL.hole_centers[None]
    tops = np.concatenate([holes + offsets, np.reshape(heights, (1, 4, 1))], axis=2)
    reach = HUB.peg_radius + np.linalg.norm(offsets, axis=1)[None]
    return bool(led_in(tops, np.array([[0.0, 0.0, 1.0]]), holes, reach, HUB, WHEEL)[0])


def test_who_comes_first_leads():
    """Peg 3 misses the mouth of its hole, 1.3 mm wide, by 0.1 mm: peg 1 leads it if it comes 0.2 mm earlier or more."""
    offsets = np.array([[1.2, 0], [1.2, 0], [1.4, 0], [1.2, 0]])
    assert [led(offsets, [-ahead, 0, 0, 0]) for ahead in (0.0, 0.15, 0.25, 5.0)] == [False, False, True, True]
    assert not led(offsets, [0, 0, -0.5, 0]) and not led(offsets, [0.5, 0.5, 0, 0.5])  # who misses comes first
    assert led(np.full((4, 2), 0.1), [0, 0, 0, 0]) and not led(np.full((4, 2), 1.0), [0, 0, 0, 0])
