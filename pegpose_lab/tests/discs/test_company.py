"""A disc's result follows from the picture and its own circle, whatever else is measured in the same call."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Hub, fit_discs
from pegpose_lab.paper import paper_camera
from pegpose_lab.render import HubLook, render_hub, true_disc

HUB = Hub(radius=80.0)
PLAIN = HubLook(texture=0.0, shading=0.0, wall=62.0, wall_shading=0.0)
KINDS = {
    "default look": {"look": HubLook()},
    "highlights": {"look": PLAIN, "highlights": 40.0},
    "clutter": {"look": HubLook(), "highlights": 40.0, "clutter": 28},
}
DISTANCES = (240.0, 430.0)  # mm: radii of 12 to 90 px in all


def _frame(kind, distance):
    """A picture of a hub, and circles (7, 3) near its pegs, bore and screws."""
    rng = np.random.default_rng([11, int(distance), *kind.encode()])
    turn = Rotation.from_euler("zx", [rng.uniform(0, 360), 11.0], degrees=True)
    pose, camera = RigidTransform.from_components([5.0, -3.0, distance], turn), paper_camera()
    image = render_hub(camera, pose, HUB, blur=0.9, noise=rng.choice([0.5, 2, 5]), rng=rng, **KINDS[kind])
    discs = [(center, HUB.peg_radius) for center in HUB.peg_centers] + [(HUB.bore_center, HUB.bore_radius)]
    discs += [(center, HUB.screw_radius) for center in HUB.screw_centers]
    truths = [true_disc(camera, pose, *disc) for disc in discs]
    circles = np.array([[*truth.centroid, truth.radius] for truth in truths])
    return image, circles + rng.uniform(-1.5, 1.5, circles.shape)


def _fit(image, circles):
    return fit_discs(image, SimpleNamespace(centers=circles[:, :2], radii=circles[:, 2]))


@pytest.mark.parametrize("kind", KINDS)
def test_one_circle_alone_equals_its_row_among_many(kind):
    radii = []
    for distance in DISTANCES:
        image, circles = _frame(kind, distance)
        # a mixed company, also of circles that are cut or show nothing
        others = np.array([[100.0, 80.0, 12.0], [3.0, 3.0, 30.0], [800.0, 600.0, 90.0]])
        together, upside_down = _fit(image, np.vstack([circles, others])), _fit(image, circles[::-1])
        for i, circle in enumerate(circles):
            alone = _fit(image, circle[None])
            assert alone.accepted[0]
            radii.append(alone.radii[0])
            for many, row in ((together, i), (upside_down, len(circles) - 1 - i)):
                assert alone.reasons[0] == many.reasons[row]
                for name in ("centers", "semi_axes", "angles"):
                    np.testing.assert_allclose(getattr(many, name)[row], getattr(alone, name)[0], rtol=0, atol=1e-6)
                for name in ("sigmas", "chi2", "contrasts", "blurs", "noises"):
                    np.testing.assert_allclose(getattr(many, name)[row], getattr(alone, name)[0], rtol=1e-6)
    assert min(radii) < 14 and max(radii) > 85
