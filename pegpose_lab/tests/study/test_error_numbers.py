"""The numbers that are called an error, of normal residuals, and views seen through another view's camera."""

import numpy as np
import pytest

from pegpose_lab import calibrate_genetic, paper, study


def test_numbers_of_normal_residuals():
    residuals = np.random.default_rng(0).standard_normal((5, 20_000, 2))
    found = study.error_numbers(list(residuals))
    assert found["Eq. 7"] == pytest.approx(np.sqrt(np.pi / 2), rel=0.01)
    assert found["rms"] == pytest.approx(np.sqrt(2), rel=0.01)
    assert found["sd per axis"] == pytest.approx(1, rel=0.01)
    assert found["norm / n"] == pytest.approx(np.linalg.norm(residuals) / 100_000)


def test_unseen_views_leave_the_noise():
    """A pose is fitted to 48 corners, and the camera is nearly right: what is left is the noise of both coordinates."""
    truth, board = paper.paper_experiment(), paper.paper_experiment().board.object_points
    rng = np.random.default_rng(1)
    views = [
        truth.camera.project(board, pose) + 0.02 * rng.standard_normal((len(board), 2))
        for pose in truth.cam_from_boards[:2]
    ]
    fits = [calibrate_genetic(board, view, truth.camera.sensor, rng=0) for view in views]
    unseen = study.single_views_left_out(fits, board, views)
    assert [r.shape for r in unseen] == [(48, 2)] * 2
    assert study.error_numbers(unseen)["rms"] == pytest.approx(0.02 * np.sqrt(2), rel=0.2)
