"""The forecast against insertions drawn one by one, its budget against causes switched off, and its own error."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import binomtest

import pegpose_lab as pl
from pegpose_lab.insertion import RP_OF_SIGMA
from pegpose_lab.insertion.entry import MEETINGS, meeting_numbers
from pegpose_lab.insertion.leading import led_in
from pegpose_lab.insertion.sections import reaches
from pegpose_lab.tests.insertion.solids import CAM_FROM_HUB, covariance, perturbed, pose_with

HUB = pl.Hub()
BUDGET = {
    "discs": covariance([0.05, 0.05, 0.3, 0.002, 0.002, 0.0008], 0),
    "part": covariance([0.03, 0.03, 0.1, 0.001, 0.001, 0.0005], 1),
    "calibration": covariance([0.08, 0.08, 0.6, 0.001, 0.001, 0.0004], 2),
    "plane": covariance([0.02, 0.02, 0.1, 0.001, 0.001, 0.0002], 3),
}
HAND_EYE = covariance([0.05, 0.05, 0.05, 1e-4, 1e-4, 1e-4], 4)
ROBOT = 0.1  # mm
CLEARANCES, TILTS = (0.15, 0.3, 0.5), (0.0, 0.006, 0.012)


def plan(tilt):
    return RigidTransform.from_rotation(Rotation.from_rotvec([0.6 * tilt, 0.8 * tilt, 0.0]))


def simulated(runs, wheel, hub_from_wheel, rng, singles=0):
    """What `runs` insertions meet (runs,): every cause drawn by itself, every pose composed in full."""

    def draws(cov):
        return rng.multivariate_normal(np.zeros(6), cov, runs, method="eigh")

    true = perturbed(CAM_FROM_HUB, sum(draws(cov) for cov in BUDGET.values()))
    cam_error = perturbed(RigidTransform.identity(), draws(HAND_EYE))  # of the camera in the robot's frame
    robot = RigidTransform.from_translation(rng.standard_normal((runs, 3)) * ROBOT / RP_OF_SIGMA)
    cam_from_wheel = cam_error * CAM_FROM_HUB * robot * hub_from_wheel
    wheel_from_hub = cam_from_wheel.inv() * true
    tops = np.stack([wheel_from_hub.apply(np.tile(center, (runs, 1))) for center in HUB.peg_centers], axis=1)
    holes = np.tile(wheel.hole_centers, (runs, 1, 1))
    length, turn = wheel.position_tolerance / 2 * np.sqrt(rng.random((runs, 4))), 2 * np.pi * rng.random((runs, 4))
    holes += np.stack([length * np.cos(turn), length * np.sin(turn)], axis=-1)
    axes = wheel_from_hub.rotation.apply([0.0, 0.0, 1.0])
    top, mouth = reaches(tops, axes, holes, HUB, wheel)
    radius = HUB.peg_radius + wheel.clearance
    numbers = meeting_numbers(radius - top, radius - mouth, wheel.chamfer).max(axis=1)
    numbers = np.where(numbers == 3, 3 - led_in(tops, axes, holes, top, HUB, wheel), numbers)
    for k in range(singles):
        entry = pl.peg_entry(wheel_from_hub[k].inv(), HUB, wheel, holes[k] - wheel.hole_centers)
        np.testing.assert_allclose(entry.tops, radius - top[k], atol=1e-9)
        assert entry.outcome == MEETINGS[numbers[k]]
    return numbers


def forecast(wheel, hub_from_wheel=None, budget=BUDGET, **changes):
    known = {"hand_eye_covariance": HAND_EYE, "robot_repeatability": ROBOT} | changes
    return pl.assembly_forecast(pose_with(**budget), HUB, wheel, hub_from_wheel=hub_from_wheel, **known)


def test_rates_are_those_of_drawn_insertions():
    """Three clearances by three tilts, five times 400 insertions each: 95 % of the Wilson intervals hold the forecast."""
    rng, inside = np.random.default_rng(0), []
    for clearance in CLEARANCES:
        for tilt in TILTS:
            wheel = pl.Wheel(clearance=clearance, chamfer=0.4, position_tolerance=0.1)
            expected = forecast(wheel, plan(tilt)).probabilities
            for _ in range(5):
                met = simulated(400, wheel, plan(tilt), rng)
                for k, name in enumerate(MEETINGS):
                    interval = binomtest(int((met == k).sum()), 400).proportion_ci(method="wilson")
                    inside.append(interval.low <= expected[name] <= interval.high)
    assert len(inside) == 180 and np.mean(inside) > 0.91  # 0.95 less 2.4 standard errors


def test_drawn_insertions_are_those_of_single_wheels():
    wheel = pl.Wheel(clearance=0.15, chamfer=0.2, position_tolerance=0.2)
    simulated(50, wheel, plan(0.01), np.random.default_rng(1), singles=50)


def test_standard_errors_are_honest():
    """Forecasts with other random shifts scatter as stated about that of many points."""
    wheel = pl.Wheel(clearance=0.3, chamfer=0.2)
    found = [forecast(wheel, plan(0.006), rng=seed) for seed in range(40)]
    for name in MEETINGS:
        rates = np.array([one.probabilities[name] for one in found])
        stated = np.sqrt(np.mean([one.standard_errors[name] ** 2 for one in found]))
        assert 0.6 < rates.std(ddof=1) / stated < 1.5
    clearances = np.array([one.free_clearance for one in found])
    stated = np.sqrt(np.mean([one.free_clearance_error**2 for one in found]))
    assert 0.5 < clearances.std(ddof=1) / stated < 2.0 and stated < 0.05 * clearances.mean()


def test_shares_sum_to_the_variance_and_go_with_their_causes():
    """Without a cause the variance, of drawn errors without linearisation, falls by the cause's share."""
    wheel = pl.Wheel(clearance=0.3, position_tolerance=0.15)
    whole = forecast(wheel)
    assert set(whole.shares) == {*BUDGET, "hand-eye", "robot", "holes"}
    assert sum(whole.shares.values()) == pytest.approx(whole.variance, rel=0.02)
    peg = whole.limiting_peg
    for cause, share in whole.shares.items():
        without = {
            "budget": {name: cov for name, cov in BUDGET.items() if name != cause},
            "hand_eye_covariance": None if cause == "hand-eye" else HAND_EYE,
            "robot_repeatability": 0.0 if cause == "robot" else ROBOT,
        }
        rest = forecast(pl.Wheel(clearance=0.3) if cause == "holes" else wheel, **without)
        assert cause not in rest.shares
        if rest.limiting_peg == peg:
            assert whole.variance - rest.variance == pytest.approx(share, abs=0.02 * whole.variance)
        else:
            assert sum(rest.shares.values()) == pytest.approx(rest.variance, rel=0.02)


def test_the_clearance_is_enough():
    """With it, 99.9 % of the insertions are free; a chamfer that is wide enough needs none."""
    needed = forecast(pl.Wheel(clearance=0.3)).free_clearance
    again = forecast(pl.Wheel(clearance=needed))
    assert again.probabilities["free"] == pytest.approx(0.999, abs=3e-4)
    met = simulated(20_000, pl.Wheel(clearance=needed), plan(0.0), np.random.default_rng(3))
    assert np.mean(met == 0) == pytest.approx(0.999, abs=1.5e-3)
    assert forecast(pl.Wheel(chamfer=3.0)).entry_clearance == 0.0
    bare = forecast(pl.Wheel(chamfer=0.0))
    assert bare.probabilities["chamfer"] == 0.0 and 0 < bare.entry_clearance < bare.free_clearance


def test_the_limiting_peg():
    """A turn error adds to a planned shift at two pegs; a hand-eye error counts by its lever arm."""
    budget = {"discs": np.diag([0, 0, 0, 0, 0, 1e-3]) ** 2}
    still = {"hand_eye_covariance": None, "robot_repeatability": 0.0}
    moved = forecast(pl.Wheel(), RigidTransform.from_translation([0.2, 0.0, 0]), budget=budget, **still)
    # a turn moves pegs 2 and 4 along the planned shift, which is to their longer side for one of them
    assert moved.limiting_peg in (2, 4) and moved.limiting_shares[[1, 3]].sum() > 0.99
    assert moved.limiting_shares.sum() == pytest.approx(1.0)
    turned = np.diag([0, 0, 0, 1e-3, 0, 0]) ** 2
    found = forecast(pl.Wheel(), budget=budget, hand_eye_covariance=turned, robot_repeatability=0.0)
    assert found.shares["hand-eye"] == pytest.approx((1e-3 * 500) ** 2, rel=0.1)


def test_an_enormous_error_is_a_forecast_too():
    found = forecast(pl.Wheel(), budget={"discs": np.diag([1e3, 1e3, 1e3, 2.0, 2.0, 2.0]) ** 2})
    numbers = [*found.probabilities.values(), found.free_clearance, found.entry_clearance, found.variance]
    assert np.isfinite(numbers).all() and found.probabilities["blocked"] > 0.9


def test_it_is_fast():
    """20 ms of the processor's time; others may use it meanwhile."""
    wheel, times = pl.Wheel(position_tolerance=0.1), []
    for _ in range(20):
        start = time.process_time()
        forecast(wheel)
        times.append(time.process_time() - start)
    assert min(times) < 0.020


def test_from_a_picture():
    camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    pose = pl.estimate_pose(pl.locate_pegs(pl.render_hub(camera, cam_from_hub, HUB, rng=0), HUB), camera, HUB)
    found = pl.assembly_forecast(pose, HUB, pl.Wheel(clearance=1.0))
    assert set(found.shares) == {"discs"} and found.enters > 0.99 and found.flags == pose.flags


def test_unusable_arguments():
    pose, wheel = pose_with(**BUDGET), pl.Wheel()
    for changes, words in [
        ({"hand_eye_covariance": np.eye(3)}, r"hand_eye_covariance has shape \(3, 3\)"),
        ({"hand_eye_covariance": -np.eye(6)}, "hand_eye_covariance is no covariance"),
        ({"hand_eye_covariance": np.triu(np.ones((6, 6)))}, "hand_eye_covariance is no covariance"),
        ({"robot_repeatability": -0.1}, "robot_repeatability"),
        ({"quantile": 1.0}, "quantile"),
        ({"hub_from_wheel": np.eye(4)}, "hub_from_wheel"),
    ]:
        with pytest.raises(ValueError, match=words):
            pl.assembly_forecast(pose, HUB, wheel, **changes)
    with pytest.raises(ValueError, match="5 holes"):
        pl.assembly_forecast(pose, HUB, pl.Wheel(n_holes=5))
    for unknown, words in [(None, "no covariance"), (np.diag(np.full(6, np.inf)), "infinite")]:
        pose.covariance, pose.budget = unknown, {}
        with pytest.raises(pl.CalibrationError, match=words):
            pl.assembly_forecast(pose, HUB, wheel)
