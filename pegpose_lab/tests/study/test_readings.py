"""The two readings of each ambiguous place: numbers that theory or a simulation of errors knows."""

import numpy as np
import pytest

from pegpose_lab import Hub, calibrate_tsai, paper, study
from pegpose_lab.calibration import TwoStageObjective

TRUTH = paper.paper_experiment()
BOARD = TRUTH.world_from_board.apply(TRUTH.board.object_points)


@pytest.fixture(scope="module")
def view():
    """Corners of view 1 with some noise, px, and their stage 1."""
    noise = 0.005 * np.random.default_rng(0).standard_normal((len(BOARD), 2))
    corners = TRUTH.camera.project(TRUTH.board.object_points, TRUTH.cam_from_boards[0]) + noise
    return corners, calibrate_tsai(BOARD, corners, TRUTH.camera.sensor)


def test_eq6_is_flat_per_point_and_finds_the_depth_per_chromosome(view):
    found = study.eq6_readings(BOARD, *view, 0.25)
    assert found.per_point_range < 1e-9 < found.per_point
    assert found.highest > 10 * found.lowest
    assert found.depth == pytest.approx(paper.printed("T1-ga.Tz"), rel=0.01)


def test_equal_chromosomes_never_move_without_mutation(view):
    corners, linear = view
    objective = TwoStageObjective(BOARD, corners, linear)
    start = [linear.camera.focal_length, linear.cam_from_object[0].translation[2]]
    found = study.eq4_readings(objective, start, 0.25)
    assert found.equal_spread == pytest.approx(0, abs=1e-9)
    assert found.equal_error == pytest.approx(objective([start])[0], abs=1e-9)
    assert found.uniform_error < 0.5 * found.equal_error


@pytest.mark.parametrize("alpha", [0.25, 0.75])
def test_widths_of_eq9(alpha):
    found = study.eq9_readings(alpha)
    assert found["A"] == pytest.approx((abs(1 - 2 * alpha), 1 + 2 * alpha), abs=0.01)
    assert found["B"] == pytest.approx((1 + 2 * alpha, 1 + 2 * alpha), abs=0.01)


def test_eq10_leaves_the_box_as_it_is_printed_only():
    found = study.eq10_readings()
    assert found["A"][0] > 10 and found["A"][1] == 0
    assert found["B"][0] == 0 and found["B"][1] == pytest.approx(50, abs=2)


def test_eq7_recovers_the_sigma_of_normal_errors():
    numbers = study.error_numbers([0.02 * np.random.default_rng(0).standard_normal((100_000, 2))])
    assert study.eq7_readings(numbers["Eq. 7"])["A"] == pytest.approx(0.02, rel=0.01)
    assert study.eq7_readings(numbers["rms"])["B"] == pytest.approx(0.02, rel=0.01)
    with pytest.raises(ValueError, match="error"):
        study.eq7_readings(0)


def test_eq11_by_slopes_knows_less_than_half_a_turn():
    found = study.eq11_readings()
    assert found.two_arguments == found.angles == 360
    assert found.slopes == 179 and not found.vertical_by_slopes  # -89 to 89 degrees: a vertical line has no slope


@pytest.mark.parametrize(("n", "half"), [(4, (3, 4, 1, 2)), (6, (4, 5, 6, 1, 2, 3))])
def test_a_half_turn_maps_pegs_on_pegs(n, half):
    found = study.label_readings(Hub(n_pegs=n))
    assert found.half_turn == half and found.misfit < 1e-9 and found.followed_below == 90
