"""The uncertainty of projection: its definition, the spread of repeated calibrations, and mrcal's numbers."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Calibration, CalibrationError, TsaiCamera, calibrate_joint, paper, projection_uncertainty
from pegpose_lab.calibration import image_grid
from pegpose_lab.tests.calibration.two_models import MODEL_NAMES, MODELS, tilted_views

POINTS = np.array([[800.0, 600.0], [400, 300], [1500, 100], [0, 1199]])


@pytest.fixture(scope="module", params=MODEL_NAMES)
def calibrated(request):
    camera, options = MODELS[request.param]
    boards, images, _ = tilted_views(camera, 6, 0.1, seed=1)
    return calibrate_joint(boards, images, paper.paper_camera().sensor, **options)


def image_again(points, before, after, distance):
    """The definition, word for word: points to every board by one calibration, back by another, mean, projection."""
    rays = before.camera.rays(points)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    places = []
    for old, new in zip(before.cam_from_object, after.cam_from_object, strict=True):
        if np.isinf(distance):
            places.append((new.rotation * old.rotation.inv()).apply(rays))
        else:
            places.append(new.apply(old.inv().apply(distance * rays)))
    place = np.mean(places, axis=0)
    return after.camera.from_normalized(place[:, :2] / place[:, 2:])


def moved(found, step):
    """A calibration with its parameters moved by a labelled step."""
    own = {name: found.camera.parameters[name] + step[name] for name in step.index if name in found.camera.parameters}
    if "f_y" not in step.index and "f_x" in own:
        own["f_y"] = own["f_x"] * found.camera.parameters["f_y"] / found.camera.parameters["f_x"]
    poses = []
    for view, pose in enumerate(found.cam_from_object):
        turn, shift = ([step[f"{kind}{axis}_{view}"] for axis in "xyz"] for kind in "rt")
        rotation = Rotation.from_rotvec(turn) * pose.rotation
        poses.append(RigidTransform.from_components(pose.translation + shift, rotation))
    return replace(found, camera=found.camera.with_parameters(**own), cam_from_object=poses)


@pytest.mark.parametrize("distance", [np.inf, 300.0, 1000.0])
def test_it_is_the_definition_to_first_order(calibrated, distance):
    names, sigmas = calibrated.covariance.index, np.sqrt(np.diagonal(calibrated.covariance))
    columns = []
    for name, sigma in zip(names, sigmas, strict=True):
        step = pd.Series(0.0, names)
        step[name] = 0.01 * sigma
        ends = [image_again(POINTS, calibrated, moved(calibrated, sign * step), distance) for sign in (1, -1)]
        columns.append((ends[0] - ends[1]) / (0.02 * sigma))
    design = np.stack(columns, axis=-1)
    expected = design @ calibrated.covariance.to_numpy() @ design.transpose(0, 2, 1)
    found = projection_uncertainty(calibrated, POINTS, distance)
    assert_allclose(found.covariances, expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())
    assert_allclose(found.sigmas, np.sqrt(np.linalg.eigvalsh(expected)[:, 1]), rtol=1e-4)


@pytest.mark.parametrize("name", MODEL_NAMES)
def test_repeated_calibrations_spread_as_stated(name):
    """300 calibrations of the same boards with new noise: the sd of 300 is known to 4 %."""
    camera, options = MODELS[name]
    boards, exact, poses = tilted_views(camera, 6, 0.0)
    rng, sensor, trials = np.random.default_rng(5), paper.paper_camera().sensor, 300
    points = np.array([[800.0, 600.0], [500, 400], [1100, 900], [1300, 300]])
    errors, stated = {np.inf: [], 300.0: []}, {np.inf: 0.0, 300.0: 0.0}
    for _ in range(trials):
        found = calibrate_joint(
            boards, [view + 0.1 * rng.standard_normal(view.shape) for view in exact], sensor, **options
        )
        for distance in errors:
            truth = replace(found, camera=camera, cam_from_object=poses)
            errors[distance].append(image_again(points, truth, found, distance) - points)
            stated[distance] += projection_uncertainty(found, points, distance).covariances / trials
    for distance, moves in errors.items():
        spread = np.einsum("tni,tnj->nij", moves, moves) / trials
        ratio = np.sqrt(np.trace(spread, axis1=1, axis2=2) / np.trace(stated[distance], axis1=1, axis2=2))
        assert_allclose(ratio, 1, atol=0.15)


def test_angles_and_mm_belong_to_the_px(calibrated):
    near = projection_uncertainty(calibrated, POINTS, 500.0)
    assert_allclose(near.sigmas_mm, 500 * near.ray_sigmas)
    focal = calibrated.camera.image_and_derivative(np.zeros((1, 2)))[1][0]
    middle = projection_uncertainty(calibrated, [calibrated.camera.principal_point], 500.0)
    assert_allclose(focal @ middle.ray_covariances[0] @ focal.T, middle.covariances[0], rtol=1e-3)
    with pytest.raises(ValueError, match="distance is infinite"):
        _ = projection_uncertainty(calibrated, POINTS).sigmas_mm


def test_a_large_distance_becomes_infinity(calibrated):
    far, infinite = (projection_uncertainty(calibrated, POINTS, distance) for distance in (1e9, np.inf))
    assert_allclose(far.covariances, infinite.covariances, rtol=1e-5)


def test_what_is_estimated_of_the_board_does_not_move_a_fixed_point(calibrated):
    names = [*calibrated.covariance.index[:3], "warp_x", *calibrated.covariance.index[3:]]
    wider = calibrated.covariance.reindex(index=names, columns=names, fill_value=0.0)
    wider.loc["warp_x", "warp_x"] = 4.0
    with_warp = replace(calibrated, covariance=wider)
    expected = projection_uncertainty(calibrated, POINTS, 400.0)
    assert_allclose(projection_uncertainty(with_warp, POINTS, 400.0).covariances, expected.covariances, rtol=1e-9)


def test_one_focal_length_moves_both():
    """f_x alone in the covariance is f_x and f_y that move together."""
    boards, images, _ = tilted_views(MODELS["opencv"][0], 6, 0.1)
    one = calibrate_joint(boards, images, paper.paper_camera().sensor, coefficients=("k1",))
    names = ["f_x", "f_y", *one.covariance.index[1:]]
    share = pd.DataFrame(np.eye(len(names)), names, names)[one.covariance.index].copy()
    share.loc["f_y", "f_x"] = one.camera.parameters["f_y"] / one.camera.parameters["f_x"]
    both = replace(one, covariance=share @ one.covariance @ share.T)
    expected = projection_uncertainty(one, POINTS, 400.0)
    assert_allclose(projection_uncertainty(both, POINTS, 400.0).covariances, expected.covariances, rtol=1e-6)


def test_a_map_covers_the_image(calibrated):
    found = projection_uncertainty(calibrated, distance=300.0, columns=9)
    drawn = found.map("mm")
    assert drawn.values.shape == (7, 9) and drawn.label == "sigma at 300 mm (mm)"
    assert (drawn.x[[0, -1]] == [0, 1599]).all() and (drawn.y[[0, -1]] == [0, 1199]).all()
    assert drawn.values.min() > 0 and drawn.values[3, 4] == found.sigmas_mm[3 * 9 + 4]
    assert found.map("px").values.argmin() in range(9, 54)  # not on the border
    with pytest.raises(ValueError, match="image_points were given"):
        projection_uncertainty(calibrated, POINTS).map()


def test_unusable_calibrations_are_refused(calibrated):
    with pytest.raises(ValueError, match="has no covariance"):
        projection_uncertainty(replace(calibrated, covariance=None))
    with pytest.raises(ValueError, match="has 5 poses, and its covariance 36 rows of poses"):
        projection_uncertainty(replace(calibrated, cam_from_object=calibrated.cam_from_object[1:]))
    for distance in (0, -1.0, np.nan, "far"):
        with pytest.raises(ValueError, match="distance is"):
            projection_uncertainty(calibrated, POINTS, distance)
    with pytest.raises(ValueError, match="image_size"):
        image_grid((1, 1))


def test_a_lens_that_folds_within_its_uncertainty_is_refused():
    """The corner of the image, 4 mm from its middle, has no image with kappa1 lower by a hundredth of its sigma."""
    camera = TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480), kappa1=-0.01)
    names = ["kappa1", *(f"{kind}{axis}_0" for kind in "rt" for axis in "xyz")]
    covariance = pd.DataFrame(np.eye(7) * 1e-6, names, names)
    covariance.loc["kappa1", "kappa1"] = 0.5**2
    found = Calibration(camera, [RigidTransform.from_translation([0, 0, 500.0])], [], covariance=covariance)
    with pytest.raises(CalibrationError, match="within the uncertainty of kappa1"):
        projection_uncertainty(found, [[0.0, 0.0]])


@pytest.mark.parametrize("camera", [MODELS[name][0] for name in MODEL_NAMES], ids=MODEL_NAMES)
def test_a_camera_with_other_parameters(camera):
    for name, value in camera.parameters.items():
        changed = camera.with_parameters(**{name: value + 0.25})
        assert type(changed) is type(camera) and changed.image_size == camera.image_size
        assert_allclose(
            list(changed.parameters.values()), [v + 0.25 * (n == name) for n, v in camera.parameters.items()]
        )
    with pytest.raises(ValueError, match="values has skew"):
        camera.with_parameters(skew=1.0)
