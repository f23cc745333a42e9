"""Residuals of sheets of discs have the size of the errors that were put in."""

import numpy as np
import pytest

from pegpose_lab.study import board_adjustment, disc_pulls, load_measured

CAMERA = np.array([496.0, 497.0, 715.0, 545.0, 0.4, -0.01, 0.002, 1e-4, -2e-4])
POSES = [
    [0.3, 0.2, 0.05, -130, -90, 420], [-0.3, 0.25, 0.1, -120, -80, 450], [0.25, -0.35, -0.1, -140, -100, 430],
    [-0.2, -0.3, 0.2, -130, -70, 500], [0.4, 0.1, -0.2, -150, -90, 520], [0.1, 0.45, 0.3, -110, -110, 480],
]  # fmt: skip


def test_a_board_is_adjusted_to_the_noise():
    rng, noise = np.random.default_rng(4), 0.03
    places = board_adjustment._PLACES + rng.normal(0, 0.3, (12, 2))
    views = [board_adjustment._images(CAMERA, np.array(pose, float), places) for pose in POSES]
    views = [view + rng.normal(0, noise, view.shape) for view in views]
    views[2][5] = np.nan
    left = board_adjustment.board_residuals(views)
    assert [len(view) for view in left] == [12, 12, 11, 12, 12, 12]
    assert np.concatenate(left).std() == pytest.approx(noise, rel=0.2)


def test_a_disc_is_projected_with_its_bias():
    """A tilted disc's centroid is not the image of its centre; points far on the plane are."""
    pose = np.array([0.6, 0.0, 0.0, -130.0, -90.0, 400.0])
    camera = np.array([500.0, 500.0, 720.0, 540.0, 0, 0, 0, 0, 0])
    centroid = board_adjustment._images(camera, pose, board_adjustment._PLACES)[0]
    cos, sin = np.cos(0.6), np.sin(0.6)
    center = np.array([720 + 500 * -130 / 400, 540 + 500 * -90 / 400])
    depth = 400.0
    expected = np.array(
        [cos * sin * 35**2 / depth * 500 / depth * cos]
    )  # first order: r^2 sin cos / z, towards the near side
    assert np.hypot(*(centroid - center)) == pytest.approx(expected.item() / cos, rel=0.35)


def test_smooth_residuals_have_the_size_of_the_errors():
    rng = np.random.default_rng(1)
    places = np.stack(np.mgrid[:10, :10], axis=-1).reshape(-1, 2).astype(float)
    image = 200 + 30 * places / (1 + 0.01 * places[:, :1]) + 0.02 * places**2
    errors = rng.normal(0, 0.05, places.shape)
    errors[7] += 3.0  # one dot is something else
    left = disc_pulls.smooth_residuals(places, image + errors)
    assert 1.4826 * np.median(np.abs(left)) == pytest.approx(0.05, rel=0.15) and np.abs(left[7]).min() > 2


def test_sigmas_hold_on_the_photographed_sheets():
    table = load_measured("disc_pulls").set_index("dataset")
    assert list(table.index) == [sheet.dataset for sheet in disc_pulls.SHEETS]
    assert table["pull"].between(0.8, 1.5).all() and (table["coverage"] > 78).all()
    seen = (table["measured"] + table["partial"]) / table["discs"]
    assert (seen > 0.97).all() and seen["discocal-left"] == 1 and seen["open3dv-dots"] == 1
    assert table["others"].sum() <= 10
