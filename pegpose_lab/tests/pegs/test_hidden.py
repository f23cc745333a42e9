"""A hub one of whose pegs is hidden, cut off by the image's border, or spoilt."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import pegpose_lab as pl
from pegpose_lab.pose import project_discs

CAMERA = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(399.5, 299.5), image_size=(800, 600))
HUB = pl.Hub()


def hub_pose(rng, tilt=20.0):
    """A pose with the hub near the middle of the image."""
    axis = rng.uniform(0, 2 * np.pi)
    tilted = Rotation.from_rotvec(np.deg2rad(rng.uniform(0, tilt)) * np.array([np.cos(axis), np.sin(axis), 0]))
    turn = Rotation.from_rotvec([0, 0, rng.uniform(-np.pi, np.pi)])
    return RigidTransform.from_components([*rng.uniform(-10, 10, 2), rng.uniform(270, 320)], tilted * turn)


def hidden(image, center, radius, share=1.0, turn=0.0):
    """The image with a dark bar over a disc: `share` of its diameter."""
    along, across = (np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)]))
    reach = radius + 6
    near = center + along * (2 * radius * share - radius)
    corners = [near + across * reach, near - across * reach, center - along * reach - across * reach,
               center - along * reach + across * reach]  # fmt: skip
    covered = image.copy()
    cv2.fillConvexPoly(covered, np.rint(corners).astype(np.int32), 45)
    return covered


def peg_images(pose, hub):
    return project_discs(CAMERA, pose, hub.peg_centers, np.full(hub.n_pegs, hub.peg_radius))


@pytest.mark.parametrize("n_pegs", [4, 5, 6])
def test_any_one_peg_may_be_hidden(n_pegs):
    hub, chi2 = pl.Hub(n_pegs=n_pegs), []
    for seed in range(15):
        rng = np.random.default_rng([n_pegs, seed])
        pose = hub_pose(rng)
        centers, radii = peg_images(pose, hub)
        peg = int(rng.integers(n_pegs))
        image = pl.render_hub(CAMERA, pose, hub, noise=10.0, rng=rng)
        image = hidden(image, centers[peg], radii[peg], rng.choice([0.6, 1.0]), rng.uniform(0, 2 * np.pi))
        observation = pl.locate_pegs(image, hub)
        shift = int(np.argmin(np.linalg.norm(observation.peg_centers[:, None] - centers[None, 0], axis=2).min(axis=1)))
        found = np.roll(np.arange(n_pegs), -shift)  # the labelling is one of those that the screws allow
        missing = np.array(observation.states)[found] == "missing"
        assert missing.tolist() == [k == peg for k in range(n_pegs)]
        assert [flag.code for flag in observation.flags] == ["peg-not-measured"]
        assert (
            np.isinf(observation.peg_covariances[found][peg]).any()
            and np.isinf(observation.peg_sigmas[found][peg]).all()
        )
        off = np.linalg.norm(observation.peg_centers[found] - centers, axis=1)
        assert off[peg] < 0.6  # where the others have it
        estimated = pl.estimate_pose(observation, CAMERA, hub)
        turned = pose * RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, 2 * np.pi * shift / n_pegs]))
        turn = (estimated.cam_from_hub.rotation * turned.rotation.inv()).as_rotvec()
        error = np.append(estimated.cam_from_hub.translation - pose.translation, turn)
        chi2.append(error @ np.linalg.solve(estimated.covariance, error))
    assert 4.0 < np.mean(chi2) < 9.0  # 6 expected of each, with a standard deviation of 0.9 of the mean of 15


def test_the_labels_go_on_while_a_peg_is_hidden():
    """Twenty frames; in every other one another peg is hidden."""
    start, frames, truths = hub_pose(np.random.default_rng(5)), [], []
    for k in range(20):
        pose = start * RigidTransform.from_components([0.8 * k, 0, 0], Rotation.from_rotvec([0, 0, 0.08 * k]))
        centers, radii = peg_images(pose, HUB)
        image = pl.render_hub(CAMERA, pose, HUB, rng=k)
        frames.append(hidden(image, centers[k // 2 % 4], radii[k // 2 % 4]) if k % 2 else image)
        truths.append(centers)
    found = list(pl.track_pegs(frames, HUB))
    shift = int(np.argmin(np.linalg.norm(truths[0] - found[0].peg_centers[0], axis=1)))
    for k, (observation, centers) in enumerate(zip(found, truths, strict=True)):
        assert observation.states.count("missing") == k % 2
        assert np.abs(observation.peg_centers - np.roll(centers, -shift, axis=0)).max() < 1.0


def test_a_peg_beyond_the_border_is_hidden():
    pose = RigidTransform.from_components([95.0, 0.0, 300.0], Rotation.from_rotvec([0, 0, 0.1]))
    centers, radii = peg_images(pose, HUB)
    outside = centers[:, 0] + radii > 800
    assert outside.sum() == 1
    observation = pl.locate_pegs(pl.render_hub(CAMERA, pose, HUB, rng=0), HUB)
    assert observation.states.count("missing") == 1
    estimated = pl.estimate_pose(observation, CAMERA, HUB)
    assert np.abs(estimated.cam_from_hub.translation - pose.translation).max() < 0.2


@pytest.mark.parametrize(("hub", "pegs"), [(HUB, (0, 1)), (HUB, (0, 2)), (pl.Hub(n_pegs=3), (1,))])
def test_more_hidden_pegs_are_refused(hub, pegs):
    pose = hub_pose(np.random.default_rng(0))
    centers, radii = peg_images(pose, hub)
    image = pl.render_hub(CAMERA, pose, hub, rng=0)
    for peg in pegs:
        image = hidden(image, centers[peg], radii[peg])
    with pytest.raises(pl.DetectionError, match=f"at most {hub.n_pegs - len(pegs)} of {hub.n_pegs} pegs around a bore"):
        pl.locate_pegs(image, hub)


@pytest.mark.parametrize("change", [{"peg_radius": 11.5}, {"pitch_circle_diameter": 112.0}, {"bore_radius": 12.0}])
def test_wrong_measures_of_the_hub_are_refused(change):
    """With one peg hidden, too, the others' sizes and places tell."""
    pose = hub_pose(np.random.default_rng(1))
    centers, radii = peg_images(pose, HUB)
    image = hidden(pl.render_hub(CAMERA, pose, HUB, rng=0), centers[2], radii[2])
    with pytest.raises(pl.DetectionError):
        pl.locate_pegs(image, pl.Hub(**change))


def test_a_spoilt_peg_is_told_from_the_whole_ones():
    """A peg that is cut off along a line, so that an ellipse still fits, is off the shape that the others ask for."""
    pose = hub_pose(np.random.default_rng(3))
    centers, radii = peg_images(pose, HUB)
    image = pl.render_hub(CAMERA, pose, HUB, rng=0)
    spoilt = image.astype(float)
    y, x = np.mgrid[:600, :800]
    across = np.hypot((x - centers[1, 0]) / 1.0, (y - centers[1, 1]) / 0.9)
    inside = np.hypot(x - centers[1, 0], y - centers[1, 1]) < radii[1] + 6
    spoilt[inside] = np.where(across[inside] < radii[1] * 0.95, 165, 60)  # a smaller disc in its place
    smooth = cv2.GaussianBlur(spoilt, (0, 0), 0.9)
    spoilt[inside] = smooth[inside] + np.random.default_rng(0).normal(0, 2, inside.sum())
    observation = pl.locate_pegs(np.clip(spoilt, 0, 255).astype(np.uint8), HUB)
    off = np.linalg.norm(observation.peg_centers[:, None] - centers[1], axis=2).min(axis=1)
    assert observation.states[int(np.argmin(off))] == "missing"
    (flag,) = observation.flags
    assert "off the size or shape that follows from the other pegs" in flag
