"""The drift of a radius under one scale, against the exponents of a small disc far away, and chi squared."""

import numpy as np
import pytest

from pegpose_lab import paper, study

TRUTH = paper.paper_experiment()
ANGLES = np.linspace(0, 2 * np.pi, 73)


def test_radius_goes_with_the_depth_of_the_peg():
    """By area with depth^(-3/2), by major axis with depth^(-1)."""
    plane = TRUTH.cam_from_plane
    major, area, _ = study.radii_over_turn(TRUTH.camera, plane, TRUTH.hub, ANGLES)
    turns = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(len(ANGLES))])
    depth = plane.apply(TRUTH.hub.pitch_circle_diameter / 2 * turns)[:, 2]
    assert np.ptp(np.log(area)) == pytest.approx(1.5 * np.ptp(np.log(depth)), rel=0.1)
    assert np.ptp(np.log(major)) == pytest.approx(np.ptp(np.log(depth)), rel=0.2)


def test_block_means_of_a_known_motion():
    """From 0 to half a turn in 21 frames: the cosine of frame 1, and of 11 to 21, a mean over a quarter turn."""
    means = study.block_means(ANGLES, np.cos(ANGLES), [(0.0, np.pi)], [(1, 1), (11, 21)])
    expected = np.cos(np.linspace(np.pi / 2, np.pi, 11)).mean()
    assert means == pytest.approx(np.array([[1.0, expected]]), abs=2e-3)


def test_chi_squared_of_the_truth_has_its_degrees_of_freedom():
    """A free offset costs one degree of freedom: 3 are left of 4."""
    errors = np.array([0.2, 0.1, 0.1, 0.2])
    noisy = errors * np.random.default_rng(0).standard_normal((4000, 4))
    found = study.chi_squares(noisy, np.zeros(4), errors)
    assert found.offset_free.mean() == pytest.approx(3, rel=0.05)
    assert found.as_scaled.mean() == pytest.approx(4, rel=0.05)
    assert found.offset.std() == pytest.approx(np.sum(errors**-2) ** -0.5, rel=0.05)
