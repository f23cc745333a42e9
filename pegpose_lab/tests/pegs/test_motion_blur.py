"""Motion during the exposure: told by its length where there is one, and by nothing else."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import locate_pegs, study, track_pegs
from pegpose_lab.paper import paper_experiment
from pegpose_lab.pegs.motion_blur import _rigid
from pegpose_lab.render import expose
from pegpose_lab.study.moving_hub import exposed_hub

HUB = paper_experiment().hub


@pytest.mark.parametrize("kind", ["shift", "turn"])
@pytest.mark.parametrize(("blur", "noise"), [(2.0, 1.0), (3.0, 2.0), (5.0, 5.0)])
def test_a_blur_is_told_with_its_length(kind, blur, noise):
    for seed in range(2):
        image, _ = exposed_hub(kind, blur, seed)
        observation = locate_pegs(expose(image, noise, seed), HUB)
        assert observation.motion_blur == pytest.approx(blur, rel=0.3)
        (flag,) = [flag for flag in observation.flags if flag.code == "motion-blur"]
        assert f"{observation.motion_blur:.1f} px" in flag


@pytest.mark.parametrize("scene", [{}, {"highlights": 40.0}, {"highlights": 80.0, "clutter": 20}, {"occlusion": 1.0}])
def test_sharp_frames_are_not_blurred(scene):
    for index, noise in ((0, 1.0), (13, 2.0), (26, 5.0), (40, 10.0)):
        observation = locate_pegs(paper_experiment(noise=noise).hub_frame(index, **scene), HUB)
        assert observation.motion_blur == 0.0


@pytest.mark.parametrize("blur", [0.5, 1.5, 2.5])
def test_a_defocused_image_is_not_blurred_by_motion(blur):
    experiment = paper_experiment(blur=blur)
    for index in (5, 35):
        assert locate_pegs(experiment.hub_frame(index), HUB).motion_blur == 0.0


def test_a_blurred_hub_is_still_followed():
    """Four frames of a hub that turns evenly, exposed all the time: centres are those of the middle of each exposure."""
    start, step = exposed_hub("shift", 0.0, 3)[1], np.deg2rad(1.0)
    places = [start * RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, step * k / 2])) for k in range(9)]
    experiment = paper_experiment()
    from pegpose_lab.render import render_hub

    frames = [render_hub(experiment.camera, places[k], HUB, until=places[k + 2], rng=k) for k in (0, 2, 4, 6)]
    for k, observation in zip((1, 3, 5, 7), track_pegs(frames, HUB), strict=True):
        centers = experiment.camera.project(HUB.peg_centers, places[k])
        off = np.linalg.norm(observation.peg_centers[:, None] - centers, axis=2).min(axis=1)
        assert off.max() < 0.5 and observation.motion_blur > 1.5


def test_the_motion_of_a_rigid_part_is_found_from_its_squares():
    rng = np.random.default_rng(0)
    for _ in range(50):
        z = rng.normal(size=(5, 2)) @ (200, 200j)
        motion = complex(*rng.normal(0, 3, 2)) + 1j * rng.normal(0, 0.01) * (z - z.mean())
        found = _rigid(motion**2, z)
        np.testing.assert_allclose(found**2, motion**2, atol=0.05 * np.abs(motion).max() ** 2)


def test_averaged_images_are_dense_enough():
    """An exposure with four times as many images has its pegs in the same places."""
    from pegpose_lab.render import hub as rendering

    image, middle = exposed_hub("turn", 5.0, 1)
    dense = rendering.STEP
    try:
        rendering.STEP = dense / 4
        finer, _ = exposed_hub("turn", 5.0, 1)
    finally:
        rendering.STEP = dense
    assert np.abs(image - finer).max() < 1.5
    sharp = [locate_pegs(expose(picture, 1.0, 0), HUB).peg_centers for picture in (image, finer)]
    assert np.abs(sharp[0] - sharp[1]).max() < 0.01


def test_the_measured_table_tells_every_blur():
    """Committed: no flag without a motion; from 3 px on every frame is flagged or refused."""
    table = study.load_measured("moving_hub")
    assert (table["trials"] >= 100).all()
    assert (table.loc[table["blur"] == 0, "flagged"] <= 1.0).all()
    blurred = table[(table["blur"] >= 3)]
    assert (blurred["flagged"] + (100 - blurred["found"]) >= 99.0).all()
