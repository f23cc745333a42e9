"""f and its interval, mm, from a calibration's own interval or from the scatter of single views."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from pegpose_lab import calibrate_joint, calibrate_zhang, paper
from pegpose_lab.study import focal_interval


def test_one_calibration_states_its_own_interval_in_mm():
    truth, rng = paper.paper_experiment(), np.random.default_rng(0)
    board, pitch = truth.board.object_points, truth.camera.pixel_pitch[0]
    seen = [truth.camera.project(board, pose) for pose in truth.cam_from_boards]
    seen = [points + 0.05 * rng.standard_normal(points.shape) for points in seen]
    joint = calibrate_joint([board] * 5, seen, truth.camera.sensor)
    assert focal_interval([joint], pitch) == (joint.camera.focal_length, *joint.interval("focal_length"))
    zhang = focal_interval([calibrate_zhang([board] * 5, seen, truth.camera.image_size)], pitch)
    assert zhang == pytest.approx(focal_interval([joint], pitch), abs=0.005)


def test_several_views_give_their_mean_and_students_interval_of_it():
    values = [47.0, 48.0, 48.5, 47.5]
    runs = [SimpleNamespace(camera=SimpleNamespace(parameters={"focal_length": f})) for f in values]
    expected = stats.t.interval(0.95, 3, np.mean(values), stats.sem(values))
    assert focal_interval(runs, 1.0) == pytest.approx((np.mean(values), *expected))
