"""Rendered images of a hub: textured base with bore and screws, pegs, highlights and swarf."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..checks import as_choice, as_count, as_number, as_pose
from .discs import _bounding_box
from .raycast import LATTICES, _cast, _dot, _offset, _View, expose

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from ..targets import Hub

STEP = 0.5  # px, of the motion between two images that are averaged: a fraction of what the lens blurs


@dataclass(frozen=True)
class HubLook:
    """Grey values (0..255) of a hub's parts, and how uneven the base is.

    `texture` is the amplitude of the turning marks on the base, `shading` the relative change of its level
    across the hub's radius, `wall_shading` that of the pegs' side walls around the peg.

    Examples
    --------
    >>> from dataclasses import replace
    >>> replace(HubLook(), texture=0.0).texture  # a smooth hub, for `render_hub(..., look=...)`
    0.0
    """

    peg: float = 165.0
    wall: float = 58.0
    base: float = 62.0
    bore: float = 150.0
    screw: float = 140.0
    background: float = 40.0
    texture: float = 1.5
    shading: float = 0.05
    wall_shading: float = 0.1


def render_hub(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera,
    cam_from_hub: RigidTransform,
    hub: Hub,
    *,
    look: HubLook = HubLook(),
    blur: float = 0.9,
    noise: float | None = 2.0,
    highlights: float = 0.0,
    clutter: int = 0,
    occlusion: float = 0.0,
    until: RigidTransform | None = None,
    rays: int = 34,
    rng: int | Sequence[int] | np.random.Generator | None = None,
) -> NDArray[Any]:
    """Render a hub: textured base with bore and screws, peg tops, and the pegs' side walls in perspective.

    Parameters
    ----------
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera
    cam_from_hub : RigidTransform
    hub : Hub
    look : HubLook
    blur : float
        Standard deviation of the Gaussian blur, px.
    noise : float or None
        Standard deviation of the noise, grey values.  None: neither noise nor rounding, which `expose` can add later.
    highlights : float
        Brightness (grey values) of one specular spot on the rim of each peg top, and of one beside it.
    clutter : int
        Number of bars and discs (swarf) that lie on the base and around the hub, under the pegs.
    occlusion : float
        Part of peg 1's diameter that a dark bar in front of it hides, 0..1.
    until : RigidTransform, optional
        cam_from_hub at the end of the exposure, of a hub that moves evenly from `cam_from_hub` to it: the image is the mean
        of images along that motion, `STEP` px or less apart.
    rays : int
        Rays in a quarter of a pixel at an edge: with 34 the centre of a peg is accurate to about 5e-4 px, with 144, which
        take three times as long, to 1e-4 px.
    rng : seed or Generator
        Places highlights and clutter, then draws the noise.

    Returns
    -------
    (height, width) uint8 ndarray; float32 without noise and rounding

    Raises
    ------
    ValueError
        If the hub is behind the camera or seen from below, or a parameter is unusable.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    >>> image = pl.render_hub(camera, cam_from_hub, hub, rng=0)
    >>> image.shape, image.dtype
    ((300, 400), dtype('uint8'))
    """
    rng = np.random.default_rng(rng)
    blur = as_number(blur, "blur", 0, 100)
    poses = [cam_from_hub] if until is None else _exposed_poses(camera, cam_from_hub, as_pose(until, "until"), hub)
    for pose in poses:
        camera.project(np.vstack([hub.peg_centers, hub.screw_centers]), pose)
        if _View(pose).origin[2] >= 0:
            raise ValueError("cam_from_hub shows the hub from below: its z axis has to point away from the camera")
    spots = _place_spots(hub, as_number(highlights, "highlights", 0), rng)
    swarf = _place_swarf(hub, as_count(clutter, "clutter", 0, 10_000), rng)
    covered = as_number(occlusion, "occlusion", 0, 1)
    rays = as_choice(rays, "rays", LATTICES)

    image = 0.0
    for pose in poses:
        shade = _shader(_View(pose), hub, look, spots, swarf, covered)
        box = _bounding_box(camera, pose, hub, swarf, margin=int(5 * blur) + 3)
        image = image + _cast(camera, shade, blur, box, look.background, rays)
    return expose(image if until is None else image / np.float32(len(poses)), noise, rng)


def _shader(view, hub, look, spots, swarf, covered):
    """The function from directions (2, n) to what these rays meet: grey values and parts (n,)."""

    def shade(directions):
        top, base = view.on_plane(directions, 0.0), view.on_plane(directions, hub.peg_height)
        grey, part = _shade_base(base, hub, look)
        _lay_swarf(base, swarf, grey, part)
        _raise_pegs(top, base, hub, look, grey, part)
        _add_spots(top, spots, grey, part)
        _cover(top, hub, covered, look, grey, part)
        return grey, part

    return shade


def _exposed_poses(camera, start, end, hub):
    """Poses in the middles of equal parts of the exposure, in each of which no peg's rim moves more than `STEP`."""
    motion = (end * start.inv()).as_exp_coords()
    around = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    reach = hub.pitch_circle_diameter / 2 + hub.peg_radius
    rim = reach * np.column_stack([np.cos(around), np.sin(around), np.zeros(16)])
    along = [RigidTransform.from_exp_coords(share * motion) * start for share in np.linspace(0, 1, 5)]
    images = np.array([camera.project(rim, pose) for pose in along])
    parts = max(1, int(np.ceil(np.linalg.norm(np.diff(images, axis=0), axis=2).sum(axis=0).max() / STEP)))
    return [RigidTransform.from_exp_coords((k + 0.5) / parts * motion) * start for k in range(parts)]


# ---- what a ray meets: each function changes `grey` and `part` in place, from the back to the front ----


_BACKGROUND, _BASE, _BORE, _SCREW, _WALL, _COVER, _TOP, _SWARF = 0, 1, 2, 3, 4, 5, 10, 100


def _shade_base(points, hub, look):
    """Base plane: background, turned base with shading and texture, bore, screws."""
    x, y = points
    squared_radius = _dot(points, points)
    on_base = np.flatnonzero(squared_radius < hub.radius**2)
    grey = np.full(len(x), look.background, np.float32)
    grey[on_base] = _turned_metal(x.take(on_base), y.take(on_base), hub, look)
    part = np.zeros(len(x), np.uint8)
    part[on_base] = _BASE
    _paint(squared_radius < hub.bore_radius**2, look.bore, _BORE, grey, part)
    for center in hub.screw_centers:
        offset = _offset(points, center)
        _paint(_dot(offset, offset) < hub.screw_radius**2, look.screw, _SCREW, grey, part)
    return grey, part


def _turned_metal(x, y, hub, look):
    """Level of the base: a slope of brightness, turning marks and a coarser pattern."""
    level = look.base * (1 + look.shading * (0.8 * x + 0.6 * y) / hub.radius)
    if look.texture == 0:
        return level
    marks = np.sin((2 * np.pi / 2.3) * np.sqrt(x * x + y * y))
    return level + look.texture * (marks + 0.7 * np.sin(0.9 * x + 0.4 * y) * np.sin(0.5 * y - 0.7 * x))


def _raise_pegs(top, base, hub, look, grey, part):
    """Pegs: the ray goes from `top` to `base`; it meets a peg top, or a side wall if it passes close enough."""
    longest = np.sqrt(max(_dot(base - top, base - top).max(initial=0), 0))
    reach = hub.peg_radius + float(longest)
    for index, center in enumerate(hub.peg_centers):
        near = np.flatnonzero((np.abs(top[0] - float(center[0])) < reach) & (np.abs(top[1] - float(center[1])) < reach))
        start = _offset(top.take(near, axis=1), center)  # take: several times as fast as an index here
        is_top = _dot(start, start) < hub.peg_radius**2
        on_top, beside = near[is_top], np.flatnonzero(~is_top)
        grey[on_top] = look.peg
        part[on_top] = _TOP + index
        near, start = near.take(beside), start.take(beside, axis=1)
        leg = base.take(near, axis=1) - top.take(near, axis=1)
        along = np.clip(-_dot(start, leg) / np.maximum(_dot(leg, leg), np.float32(1e-30)), 0, 1)
        nearest = start + along * leg
        met = np.flatnonzero(_dot(nearest, nearest) < hub.peg_radius**2)
        on_wall = near.take(met)
        grey[on_wall] = _wall_level(start.take(met, axis=1), leg.take(met, axis=1), hub, look)
        part[on_wall] = _WALL


def _wall_level(start, leg, hub, look):
    """Lambert's law with a lamp towards -x: brightness follows the wall's normal where the ray meets it."""
    a, b, c = _dot(leg, leg), _dot(start, leg), _dot(start, start) - hub.peg_radius**2
    fraction = (-b - np.sqrt(np.maximum(b * b - a * c, 0))) / np.maximum(a, np.float32(1e-30))
    normal_x = (start[0] + fraction * leg[0]) / hub.peg_radius
    return look.wall * (1 - look.wall_shading * normal_x)


def _place_spots(hub, brightness, rng):
    """Specular spots (n, 4): x, y, standard deviation in mm, brightness; first one on each peg, then one beside it."""
    if brightness == 0:
        return np.empty((0, 4))
    angles = rng.uniform(0, 2 * np.pi, 2 * hub.n_pegs)
    distances = np.repeat([0.7, 1.05], hub.n_pegs) + rng.uniform(0, [0.3, 0.25], (hub.n_pegs, 2)).T.ravel()
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    centers = np.tile(hub.peg_centers[:, :2], (2, 1)) + hub.peg_radius * distances[:, None] * along
    sizes = hub.peg_radius * rng.uniform(0.1, 0.25, len(centers))
    return np.column_stack([centers, sizes, np.full(len(centers), brightness)])


def _add_spots(top, spots, grey, part):
    """Specular spots brighten metal: those on a peg (the first half) only its top, the others its surroundings."""
    on_top = (part >= _TOP) & (part < _SWARF)
    on_metal = (part > 0) & ~on_top
    for index, (x, y, size, brightness) in enumerate(spots):
        where = np.flatnonzero(on_top if index < len(spots) // 2 else on_metal)
        offset = _offset(top[:, where], (x, y))
        squared = _dot(offset, offset)
        close = squared < (5 * size) ** 2
        grey[where[close]] += brightness * np.exp(-squared[close] / (2 * size**2))


def _place_swarf(hub, count, rng):
    """Bars and discs (n, 6): x, y, angle, half length, half width (0: a disc), grey value."""
    radius = hub.radius * 1.3 * np.sqrt(rng.uniform(0, 1, count))
    angle = rng.uniform(0, 2 * np.pi, count)
    half_width = np.where(rng.uniform(size=count) < 0.3, 0.0, rng.uniform(0.4, 2.0, count))
    half_length = np.where(half_width == 0, rng.uniform(1, 4, count), rng.uniform(3, 15, count))
    place = [radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0, np.pi, count)]
    return np.column_stack([*place, half_length, half_width, rng.uniform(30, 200, count)])


def _lay_swarf(base, swarf, grey, part):
    """Swarf lies on the base plane."""
    for index, (x, y, angle, half_length, half_width, level) in enumerate(swarf):
        reach = half_length + half_width
        near = np.flatnonzero((np.abs(base[0] - float(x)) < reach) & (np.abs(base[1] - float(y)) < reach))
        offset = _offset(base[:, near], (x, y))
        along = np.abs(_dot(offset, (np.cos(angle), np.sin(angle))))
        across = np.abs(_dot(offset, (-np.sin(angle), np.cos(angle))))
        bar = (along < half_length) & (across < half_width)
        inside = near[bar if half_width > 0 else np.hypot(along, across) < half_length]
        grey[inside] = level
        part[inside] = _SWARF + index % 150


def _cover(top, hub, fraction, look, grey, part):
    """A dark bar along y hides the outer `fraction` of peg 1."""
    if fraction > 0:
        edge = hub.pitch_circle_diameter / 2 + hub.peg_radius * (1 - 2 * fraction)
        _paint((top[0] > edge) & (top[0] < edge + 4 * hub.peg_radius), 0.5 * look.base, _COVER, grey, part)


def _paint(where, level, number, grey, part):
    grey[where] = level
    part[where] = number
