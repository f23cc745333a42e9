"""Cross-validation by halves: right sigmas give z of 1, wrong models more, and refusals are counted."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pegpose_lab import CalibrationError, FisheyeCamera, calibrate_joint, calibrate_tsai, paper, split_halves
from pegpose_lab.tests.calibration.two_models import MODEL_NAMES, MODELS, tilted_views

SENSOR = paper.paper_camera().sensor


def joint(**options):
    return lambda *views: calibrate_joint(*views, SENSOR, **options)


def classical(**options):
    """The same with the sigmas of independent errors, which a wrong lens makes too small."""

    def calibrate(*views):
        found = calibrate_joint(*views, SENSOR, **options)
        return replace(found, covariance=found.classical_covariance)

    return calibrate


@pytest.mark.parametrize("name", MODEL_NAMES)
def test_halves_of_independent_sets_agree_within_their_sigmas(name):
    """One split of each of 120 sets: an rms z of 1, known to 6 %, and 95 % within 1.96."""
    camera, options = MODELS[name]
    tables = [
        split_halves(*tilted_views(camera, 10, 0.1, [seed])[:2], joint(**options), repeats=1, columns=5, rng=seed)
        for seed in range(120)
    ]
    for parameter in tables[0].summary.index[:-1]:
        z = np.array([found.table[f"z {parameter}"].item() for found in tables])
        assert_allclose(np.sqrt(np.mean(z**2)), 1, atol=0.2)
        assert np.mean(np.abs(z) <= 1.96) >= 0.9
    lengths, sigmas = (np.concatenate([getattr(found, name) for found in tables]) for name in ("lengths", "sigmas"))
    assert_allclose(np.sqrt(np.mean(lengths**2) / np.mean(sigmas**2)), 1, atol=0.2)


def test_halves_show_a_lens_that_does_not_follow_the_model():
    camera = MODELS["opencv"][0]
    boards, images, _ = tilted_views(camera, 10, 0.1)
    wrong = split_halves(boards, images, classical(coefficients=()), repeats=10, rng=0)
    right = split_halves(boards, images, classical(**MODELS["opencv"][1]), repeats=10, rng=0)
    stated = split_halves(boards, images, joint(coefficients=()), repeats=10, rng=0)
    assert wrong.summary.loc["projection", "rms_z"] > 2 > right.summary.loc["projection", "rms_z"]
    assert stated.summary.loc["projection", "rms_z"] < 0.6 * wrong.summary.loc["projection", "rms_z"]
    assert wrong.map().values.mean() > 3 * right.map().values.mean()
    assert wrong.map("z").label == "difference of halves (sigmas)"


def test_the_table_has_a_row_for_each_split():
    boards, images, _ = tilted_views(paper.paper_camera(), 6, 0.1)
    found = split_halves(boards, images, joint(), repeats=4, columns=7, rng=1)
    assert found.table.columns.tolist() == [
        "z focal_length", "z kappa1", "z c_x", "z c_y", "difference", "expected",
    ]  # fmt: skip
    assert len(found.table) == 4 and found.lengths.shape == found.sigmas.shape == (4, 35)
    assert_allclose(found.table["difference"], np.sqrt(np.mean(found.lengths**2, axis=1)))
    again = split_halves(boards, images, joint(), repeats=4, columns=7, rng=1)
    assert_allclose(again.table, found.table)


def test_halves_that_cannot_be_calibrated_are_counted():
    boards, images, _ = tilted_views(paper.paper_camera(), 6, 0.1)
    calls = []

    def now_and_then(*views):
        calls.append(len(views[0]))
        if len(calls) < 3:
            raise CalibrationError("too little tilt")
        return calibrate_joint(*views, SENSOR)

    found = split_halves(boards, images, now_and_then, repeats=5, rng=0)
    assert found.refused == ("too little tilt",) * 2 and len(found.table) == 3
    assert set(calls) == {3}

    def never(*views):
        raise CalibrationError("too little tilt")

    with pytest.raises(
        CalibrationError, match="none of 2 splits of 6 views can be calibrated and compared; .*: too little tilt"
    ):
        split_halves(boards, images, never, repeats=2)


def test_halves_whose_lens_folds_inside_the_image_are_counted():
    boards, images, _ = tilted_views(paper.paper_camera(), 6, 0.1)
    calls = []

    def folds_once(*views):
        calls.append(joint()(*views))
        if len(calls) > 1:
            return calls[-1]
        camera = FisheyeCamera([[1300, 0, 799.5], [0, 1300, 599.5], [0, 0, 1]], [-2.0, 0, 0, 0], SENSOR.image_size)
        return replace(calls[-1], camera=camera)

    found = split_halves(boards, images, folds_once, repeats=2, rng=0)
    assert len(found.table) == 1 and "cannot be compared over the whole image" in found.refused[0]
    for options in ({"radius": -1.0}, {"distance": 0.0}, {"columns": 1}):
        with pytest.raises(ValueError, match=next(iter(options))):
            split_halves(boards, images, joint(), repeats=1, **options)


def test_unusable_views_are_refused():
    boards, images, _ = tilted_views(paper.paper_camera(), 6, 0.1)
    with pytest.raises(ValueError, match="object_points has 3 views; expected at least 4"):
        split_halves(boards[:3], images[:3], joint())
    with pytest.raises(ValueError, match="repeats is 0"):
        split_halves(boards, images, joint(), repeats=0)
    with pytest.raises(ValueError, match="covariance"):
        split_halves(boards, images, lambda p, q: calibrate_tsai(p[0], q[0], SENSOR), repeats=1)
