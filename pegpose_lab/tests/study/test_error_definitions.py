"""The definitions of a calibration's error agree with the package's own properties and find the noise."""

import numpy as np
import pytest

from pegpose_lab import calibrate_joint, paper
from pegpose_lab.study import DEFINITIONS, errors_by_definition


def test_they_are_the_properties_of_a_calibration_and_sigma_is_the_noise():
    truth, rng = paper.paper_experiment(), np.random.default_rng(0)
    board = truth.board.object_points
    seen = [truth.camera.project(board, pose) for pose in truth.cam_from_boards]
    seen = [points + 0.1 * rng.standard_normal(points.shape) for points in seen]
    run = calibrate_joint([board] * 5, seen, truth.camera.sensor)
    found = errors_by_definition(run.residuals, run.n_parameters)
    expected = [run.mean_distance, run.rms, *run.axis_std, run.rms / np.sqrt(5 * len(board))]
    assert [found[name] for name in DEFINITIONS] == pytest.approx(expected)
    assert found["sigma"] == pytest.approx(0.1, rel=0.1)  # 446 degrees of freedom: 3.3 % is one standard deviation


def test_there_is_no_sigma_without_the_number_of_parameters():
    assert np.isnan(errors_by_definition([np.ones((4, 2))])["sigma"])
