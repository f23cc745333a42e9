"""Flat discs on an even ground: images in which the Cramér-Rao bound of a centre is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import TsaiCamera
from ..render import HubLook, render_hub, true_disc
from ..targets import Hub

if TYPE_CHECKING:
    from numpy.typing import NDArray

RADIUS = 48.0  # mm, and px: the camera sees 1 mm as 1 px
TILT, SHIFT = 0.19, 0.5  # rad about x and y, and px: the largest of each
CAMERA = TsaiCamera(1000.0, pixel_pitch=(1.0, 1.0), principal_point=(239.5, 239.5), image_size=(480, 480))
PLATE = Hub(
    n_pegs=8, pitch_circle_diameter=340.0, peg_radius=RADIUS, bore_radius=RADIUS, radius=230.0, screw_radius=1.0,
    screw_circle_diameter=170.0, peg_height=0.0,
)  # fmt: skip
LOOK = HubLook(
    peg=160.0, bore=160.0, base=60.0, wall=60.0, screw=60.0, background=60.0, texture=0.0, shading=0.0
)  # contrast 100


@dataclass(frozen=True)
class FlatDiscs:
    """An image without noise (480, 480), grey values, and the centres (9, 2) and radii (9,) of its discs, px."""

    image: NDArray[np.float64]
    centers: NDArray[np.float64]
    radii: NDArray[np.float64]


def flat_discs(rng: object, *, blur: float) -> FlatDiscs:
    """Render nine bright discs of radius 48 px and contrast 100, tilted at random, on an even ground.

    The tilt about x and about y is up to 0.19 rad (11 degrees), the turn about z up to 6 rad, the shift up to half a
    pixel in each direction, all uniform.

    Parameters
    ----------
    rng : seed or numpy.random.Generator
        As for `numpy.random.default_rng`.
    blur : float
        Standard deviation of the image's Gaussian blur, px.

    Returns
    -------
    FlatDiscs
        `render.expose` adds noise to its image and rounds it.

    Examples
    --------
    >>> discs = flat_discs(0, blur=0.9)
    >>> discs.image.shape, discs.centers.shape, bool(abs(discs.radii - 48).max() < 3)
    ((480, 480), (9, 2), True)
    """
    rng = np.random.default_rng(rng)
    turn = Rotation.from_rotvec([*rng.uniform(-TILT, TILT, 2), rng.uniform(0, 6)])
    pose = RigidTransform.from_components([*rng.uniform(-SHIFT, SHIFT, 2), CAMERA.focal_length], turn)
    image = render_hub(CAMERA, pose, PLATE, look=LOOK, blur=blur, noise=None)
    places = np.vstack([PLATE.peg_centers, PLATE.bore_center])
    exact = [true_disc(CAMERA, pose, center, RADIUS) for center in places]
    return FlatDiscs(image, np.array([disc.centroid for disc in exact]), np.array([disc.radius for disc in exact]))
