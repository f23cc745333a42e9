"""The difference of two calibrations: the motion that is removed, its best fit, and its stated covariance."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import OpenCVCamera, calibrate_joint, difference, paper
from pegpose_lab.tests.calibration.two_models import MODEL_NAMES, MODELS, tilted_views

PAPER = paper.paper_camera()
OTHER = replace(PAPER, focal_length=48.4, kappa1=1.1 * PAPER.kappa1, principal_point=(806.0, 590.0))


@pytest.mark.parametrize("name", MODEL_NAMES)
@pytest.mark.parametrize("distance", [np.inf, 300.0])
def test_a_camera_does_not_differ_from_itself(name, distance):
    found = difference(MODELS[name][0], MODELS[name][0], distance)
    assert found.rms < 1e-7 and found.b_from_a.rotation.magnitude() < 1e-9
    assert_allclose(found.b_from_a.translation, 0, atol=1e-6)


def test_the_same_lens_in_two_models_does_not_differ():
    assert difference(PAPER, PAPER.to_opencv()).lengths.max() < 1e-3  # px, what `to_opencv` promises


@pytest.mark.parametrize("distance", [np.inf, 300.0])
@pytest.mark.parametrize("radius", [None, 400.0])
def test_the_motion_is_the_best_one(distance, radius):
    """The oracle: scipy's least squares on the definition, from another start."""
    found = difference(PAPER, OTHER, distance, radius=radius)
    points = found.image_points[found.region]
    rays = PAPER.rays(points)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)

    def residuals(motion):
        place = Rotation.from_rotvec(motion[:3]).apply(rays) + motion[3:]
        return (OTHER.from_normalized(place[:, :2] / place[:, 2:]) - points).ravel()

    size = 3 if np.isinf(distance) else 6
    best = least_squares(lambda x: residuals(np.pad(x, (0, 6 - size))), np.full(size, 1e-3), xtol=1e-15, ftol=1e-15)
    ours = np.concatenate([found.b_from_a.rotation.as_rotvec(), found.b_from_a.translation / min(distance, 1e9)])
    assert np.sum(found.differences[found.region] ** 2) <= 2 * best.cost * (1 + 1e-9)
    assert_allclose(ours[:size], best.x[:size], rtol=1e-4, atol=1e-7)
    assert_allclose(found.differences[found.region].ravel(), residuals(ours), atol=1e-9)


def test_at_one_distance_a_longer_f_is_a_shift_along_the_axis():
    straight = OpenCVCamera([[1000, 0, 799.5], [0, 1000, 599.5], [0, 0, 1]], np.zeros(5), (1600, 1200))
    longer = straight.with_parameters(f_x=1010.0, f_y=1010.0)
    near = difference(straight, longer, 500.0)
    assert difference(straight, longer).rms > 10 * near.rms
    assert_allclose(near.b_from_a.translation, [0, 0, 5.0], atol=1.0)


def test_a_circle_gives_the_middle_the_best_fit():
    whole, middle = difference(PAPER, OTHER), difference(PAPER, OTHER, radius=200.0)
    inside = middle.region
    assert 6 <= inside.sum() < len(inside) / 4 and whole.region.all()
    assert middle.lengths[inside].max() < whole.lengths[inside].max()
    assert whole.rms < middle.rms


@pytest.mark.parametrize("name", MODEL_NAMES)
def test_differences_spread_as_stated(name):
    """150 pairs of calibrations of one camera: z is 1, within the spread of 150 trials, wherever the image is."""
    camera, options = MODELS[name]
    squares, ratios = [], []
    for seed in range(150):
        pair = [calibrate_joint(*tilted_views(camera, 5, 0.1, [seed, k])[:2], PAPER.sensor, **options) for k in (0, 1)]
        found = difference(*pair, np.inf, radius=500.0, columns=9)
        squares.append(found.lengths**2)
        ratios.append(found.sigmas**2)
        assert found.covariances.shape == (63, 2, 2)
    z = np.sqrt(np.mean(squares, axis=0) / np.mean(ratios, axis=0))
    assert_allclose(z[found.region], 1, atol=0.15)


def test_against_the_truth_only_one_side_is_uncertain():
    camera, options = MODELS["opencv"]
    found = calibrate_joint(*tilted_views(camera, 5, 0.1)[:2], PAPER.sensor, **options)
    both, one = difference(found, found), difference(found, camera)
    assert_allclose(both.covariances, 2 * difference(found, found.camera).covariances, rtol=1e-6, atol=1e-9)
    assert 0.1 < np.sqrt(np.mean(one.z**2)) < 3
    assert one.map("z").values.shape == (19, 25) and one.map().label == "difference (px)"


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(ValueError, match="a has the image size"):
        difference(PAPER, replace(PAPER, image_size=(640, 480)))
    with pytest.raises(ValueError, match="radius is 30 px: 1 points"):
        difference(PAPER, OTHER, radius=30)
    with pytest.raises(ValueError, match="distance is 0"):
        difference(PAPER, OTHER, 0)
    found = calibrate_joint(*tilted_views(PAPER, 5, 0.1)[:2], PAPER.sensor)
    with pytest.raises(ValueError, match="do not both have a covariance"):
        _ = difference(found, replace(found, covariance=None)).z
    assert isinstance(difference(found, replace(found, covariance=None)).b_from_a, RigidTransform)
