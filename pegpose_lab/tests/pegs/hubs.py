"""Rendered hubs, and where their parts are."""

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab.camera import TsaiCamera
from pegpose_lab.pose import project_discs
from pegpose_lab.render import render_hub
from pegpose_lab.targets import Hub

CAMERA = TsaiCamera(50.0, (0.08, 0.08), (319.5, 239.5), (640, 480), kappa1=1e-5)
HUB = Hub()


def pose_of(turn=0.0, tilt=12.0, azimuth=0.4, position=(5.0, -8.0, 300.0)):
    """A hub tilted about an axis in the image, turned about its own (degrees)."""
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0])
    rotation = Rotation.from_rotvec(np.deg2rad(tilt) * axis) * Rotation.from_euler("z", turn, degrees=True)
    return RigidTransform.from_components(position, rotation)


@lru_cache(maxsize=64)
def rendered(turn=0.0, tilt=12.0, hub=HUB, rng=1, **scene):
    """A picture of the hub; do not write into it."""
    return render_hub(CAMERA, pose_of(turn, tilt), hub, rng=rng, **scene)


def truth(pose, hub=HUB, camera=CAMERA):
    """Centres of the images of pegs, screws and bore."""
    parts = (
        (hub.peg_centers, hub.peg_radius),
        (hub.screw_centers, hub.screw_radius),
        ([hub.bore_center], hub.bore_radius),
    )
    return [project_discs(camera, pose, centers, [radius] * len(centers))[0] for centers, radius in parts]


def assert_seen(observation, pose, hub=HUB, camera=CAMERA, shift=0, px=0.3):
    """Everything in its place, peg 1 being the true peg 1 + shift."""
    pegs, screws, bore = truth(pose, hub, camera)
    np.testing.assert_allclose(observation.peg_centers, np.roll(pegs, -shift, axis=0), atol=px)
    order = range(len(screws)) if shift == 0 else [1, 0]
    np.testing.assert_allclose(observation.screw_centers, screws[list(order)], atol=px)
    np.testing.assert_allclose(observation.bore_center, bore[0], atol=px)
    middle = camera.project([[0, 0, 0]], pose)[0]
    assert np.linalg.norm(observation.hub_center - middle) < (1.5 if hub.n_pegs > 3 else 3.0)
