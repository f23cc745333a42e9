"""Rendered frames of a hub with their exact truth, scene by scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from .. import paper
from ..render import HubLook, TrueDisc, disc_outline, render_hub, true_disc
from ..targets import Hub
from .bounds import _arc_shape, _clean_edge
from .strangers import lay_strangers

if TYPE_CHECKING:
    from ..camera import TsaiCamera

RADIUS_RANGE = (40.0, 60.0)  # px, for 1600 x 1200 px; the pegs have 46 to 51
DEPTH = 267.0  # mm, of the hub's centre
SHIFT = (60.0, 35.0)  # mm, largest shift in x and y
BLUR = (0.7, 1.2)  # px
SEED = 20

HUB = Hub(radius=80.0)  # so large that every peg is surrounded by the base on all sides
UNIFORM = replace(HubLook(), texture=0.0, shading=0.0, wall=HubLook().base, wall_shading=0.0)


@dataclass(frozen=True)
class Scene:
    """The content of a frame: smallest and largest tilt (deg), grey values; the rest as for `render_hub`."""

    name: str
    tilt: tuple
    look: HubLook = UNIFORM
    highlights: float = 0.0
    clutter: int = 0
    strangers: bool = False  # lie between the discs, see `lay_strangers`


TILTED = (10.0, 12.0)
SCENES = {
    Scene("clean", (0.0, 2.0)): "uniform surroundings, tilt 0 to 2 degrees",
    Scene("tilt", TILTED): "the same, tilt 10 to 12 degrees",
    Scene("highlights", TILTED, highlights=40.0): (
        "tilt, and a specular spot of 40 grey values on each peg's rim and one beside it"
    ),
    Scene("clutter", TILTED, highlights=40.0, clutter=28): (
        "highlights, and 28 bars and discs of swarf on the base and around it"
    ),
    Scene("harder", TILTED, highlights=80.0, clutter=55): (
        "clutter, with spots of 80 grey values and 55 pieces of swarf"
    ),
    Scene("strangers", TILTED, highlights=40.0, clutter=28, strangers=True): (
        "clutter, with discs of other sizes (radius 34 and 66 px), squares as wide as pegs, and bars across all of it"
    ),
    Scene("default look", TILTED, HubLook()): ("tilt, with turning marks, shading and darker side walls; nothing else"),
}
MAIN, OTHER = tuple(SCENES)[:4], tuple(SCENES)[4:]
TARGET_NOISE = 5  # grey values, noise of the tables and the aims


# ---- frames ----


@dataclass(frozen=True)
class Disc:
    """A true disc; `peg` is its number (0 for bore and screws); `visible` and `arc` as in `_arc_shape`."""

    truth: TrueDisc
    peg: int
    visible: float = 0.0
    arc: np.ndarray | None = None


@dataclass(frozen=True)
class Frame:
    """A noise-free image, float32, with its discs, contrast and edge width s (px)."""

    picture: np.ndarray
    discs: list
    contrast: float
    edge_width: float


def draw_frame(scene: Scene, number: int, camera: TsaiCamera | None = None) -> Frame:
    """Render frame `number` of a scene without noise; its seed determines the pose and the blur.

    Parameters
    ----------
    scene : Scene
    number : int
    camera : TsaiCamera, optional
        The paper's camera by default.

    Returns
    -------
    Frame
    """
    camera = camera or _camera()
    rng = np.random.default_rng([SEED, *scene.name.encode(), number])
    pose, blur = _pose(scene, rng), rng.uniform(*BLUR)
    picture = render_hub(
        camera,
        pose,
        HUB,
        look=scene.look,
        blur=blur,
        noise=None,
        highlights=scene.highlights,
        clutter=scene.clutter,
        rays=144,
        rng=rng,
    )
    contrast, width = scene.look.peg - scene.look.base, np.sqrt(blur**2 + 1 / 12)
    circles = [(center, HUB.peg_radius) for center in HUB.peg_centers]
    circles += [(HUB.bore_center, HUB.bore_radius), *((center, HUB.screw_radius) for center in HUB.screw_centers)]
    truths = [true_disc(camera, pose, *circle) for circle in circles]
    if scene.strangers:
        picture = lay_strangers(picture, truths, (scene.look.base / 2, scene.look.peg), blur, rng)
    discs = []
    for peg, (center, truth) in enumerate(zip(HUB.peg_centers, truths, strict=False), 1):
        outline = disc_outline(camera, pose, center, HUB.peg_radius, 360)
        visible, arc = _arc_shape(_clean_edge(picture, outline, scene.look.base, contrast, width), outline)
        discs.append(Disc(truth, peg, visible, arc))
    discs += [Disc(truth, 0) for truth in truths[len(discs) :]]
    return Frame(picture, discs, contrast, width)


@cache
def _camera():
    return paper.paper_camera()


def _pose(scene, rng):
    """A random rotation about z, a tilt about a random axis and a shift, so that every sub-pixel phase occurs."""
    tilt, axis = np.deg2rad(rng.uniform(*scene.tilt)), rng.uniform(0, 2 * np.pi)
    tilted = Rotation.from_rotvec([tilt * np.cos(axis), tilt * np.sin(axis), 0.0])
    turned = Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)])
    place = [*rng.uniform(-1, 1, 2) * SHIFT, DEPTH * rng.uniform(0.98, 1.02)]
    return RigidTransform.from_components(place, tilted * turned)
