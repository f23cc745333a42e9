"""Circle measurement for the benchmark: ours beside the peers' and beside the physical limit, in one run.

Frames of a hub with four pegs are rendered with exact truth, without noise once for each pose and with noise for
each level; every method gets the same frames, one after the other, in an order that rotates.  All of it is seeded.

Definitions
-----------
truth
    centroid and radius sqrt(area/pi) of a disc's exact image (`render.true_disc`).
expected
    the hub's bright discs (pegs, bore, screws) whose true radius lies in the radius range that every method is
    given.  Only pegs are scored for accuracy.
detected
    an expected disc for which a circle is reported that is off by 10 % of the radius at most, in its centre and
    in its radius.  A circle counts for one disc only.
false positive
    any other circle that is reported with a radius in the range: a second one on the same disc, too.
bound
    the Cramer-Rao bound of a whole disc's edge, per axis (sigma/A) sqrt(2 s/(sqrt(pi) r)) for the centre, and
    that over sqrt(2) for the radius, with s^2 = blur^2 + 1/12, sigma^2 = noise^2 + 1/12, A the pegs' grey value
    less the base's.
bound of the visible arc
    the same information summed over the part of the edge where the noise-free picture shows a clean edge: within
    3 s of the rim it departs from B + A Phi(d/s) by less than 5 % of A.  Unknowns: centre, radius and the
    ellipse's shape.
error / bound
    the median of |error| / bound over axes, pegs and frames, times 1.4826: for a normal distribution the rms, but
    it does not see rare large errors.  The plain rms stands beside it.
honesty
    the standard deviation of (estimate - truth) / stated sigma, and the share within +-1.96 of it.
time
    processor time of one thread; the ratio to `detectors.REFERENCE` is the median over frames of the ratio in the
    same frame.
"""

import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.special import ndtr
from tqdm import tqdm

from .. import paper
from ..render import HubLook, TrueDisc, disc_outline, expose, render_hub, true_disc
from ..targets import Hub
from . import detectors

RADIUS_RANGE = (40.0, 60.0)  # px, for 1600 x 1200 px; the pegs have 46 to 51
TOLERANCE = 0.1  # of the radius: what counts as detected
DEPTH = 267.0  # mm, of the hub's centre
SHIFT = (60.0, 35.0)  # mm, largest in x and y
BLUR = (0.7, 1.2)  # px
HONEST = 1.959964  # sigmas that hold 95 % of a normal distribution
CLEAN_EDGE = 0.05  # of the contrast: what a clean edge may depart from the blurred step
WORKERS = 2
SEED = 20

HUB = Hub(radius=80.0)  # large enough for a peg's surroundings to be its base from every side
UNIFORM = replace(HubLook(), texture=0.0, shading=0.0, wall=HubLook().base, wall_shading=0.0)


@dataclass(frozen=True)
class Scene:
    """What a frame shows: least and largest tilt (deg), grey values; the rest as for `render_hub`."""

    name: str
    tilt: tuple
    look: HubLook = UNIFORM
    highlights: float = 0.0
    clutter: int = 0


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
    Scene("default look", TILTED, HubLook()): (
        "tilt, with turning marks, shading and darker side walls; nothing else"
    ),
}
MAIN, OTHER = tuple(SCENES)[:4], tuple(SCENES)[4:]
TARGET_NOISE = 5  # of the tables and the aims, grey values


# ---- frames ----


@dataclass(frozen=True)
class Disc:
    """A true disc; `peg` is its number, 0 for bore and screws; `visible` and `arc` as in `_arc_shape`."""

    truth: TrueDisc
    peg: int
    visible: float = 0.0
    arc: np.ndarray = None


@dataclass(frozen=True)
class Frame:
    """A noise-free picture, float32, with its discs, contrast and edge width s (px)."""

    picture: np.ndarray
    discs: list
    contrast: float
    edge_width: float


def draw_frame(scene, number, camera=None):
    """Render frame `number` of a scene, without noise; pose and blur come from the frame's own seed.

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
        camera, pose, HUB, look=scene.look, blur=blur, noise=None,
        highlights=scene.highlights, clutter=scene.clutter, rays=144, rng=rng,
    )
    contrast, width = scene.look.peg - scene.look.base, np.sqrt(blur**2 + 1 / 12)
    discs = []
    for peg, center in enumerate(HUB.peg_centers, 1):
        outline = disc_outline(camera, pose, center, HUB.peg_radius, 360)
        visible, arc = _arc_shape(_clean_edge(picture, outline, scene.look.base, contrast, width), outline)
        discs.append(Disc(true_disc(camera, pose, center, HUB.peg_radius), peg, visible, arc))
    others = [(HUB.bore_center, HUB.bore_radius), *((center, HUB.screw_radius) for center in HUB.screw_centers)]
    discs += [Disc(true_disc(camera, pose, *other), 0) for other in others]
    return Frame(picture, discs, contrast, width)


@cache
def _camera():
    return paper.paper_camera()


def _pose(scene, rng):
    """A turn, a tilt about some axis, a shift; so every sub-pixel phase occurs."""
    tilt, axis = np.deg2rad(rng.uniform(*scene.tilt)), rng.uniform(0, 2 * np.pi)
    tilted = Rotation.from_rotvec([tilt * np.cos(axis), tilt * np.sin(axis), 0.0])
    turned = Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)])
    place = [*rng.uniform(-1, 1, 2) * SHIFT, DEPTH * rng.uniform(0.98, 1.02)]
    return RigidTransform.from_components(place, tilted * turned)


# ---- bounds ----


def center_bound(radius, contrast, edge_width, noise):
    """Cramer-Rao bound, px per axis, of the centre of a whole disc; the radius's is 1/sqrt(2) of it."""
    sigma = np.sqrt(noise**2 + 1 / 12)
    return sigma / contrast * np.sqrt(2 * edge_width / (np.sqrt(np.pi) * radius))


def _clean_edge(picture, outline, base, contrast, width):
    """At which points of an outline the noise-free picture shows the blurred step and nothing else."""
    tangent = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]]) / np.hypot(*tangent.T)[:, None]
    outwards = np.sign(np.sum(normal * (outline - outline.mean(axis=0))))
    distance = np.linspace(-3 * width, 3 * width, 19)
    points = outline[:, None] + outwards * distance[:, None] * normal[:, None]
    x, y = np.moveaxis(points, 2, 0).astype(np.float32)
    profile = cv2.remap(picture, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    departure = np.abs(profile - base - contrast * ndtr(-distance / width))
    return departure.max(axis=1) < CLEAN_EDGE * contrast


def _arc_shape(visible, outline):
    """The visible share of an edge, and how much larger than the whole edge's the bounds of x, y and r are.

    An edge of length dl tells its place along the normal with an information that is proportional to dl.  Where
    the normal has the direction t, the edge moves by (cos t, sin t, 1, cos 2t, sin 2t) for a change of x, y,
    radius and the two numbers of the ellipse's shape.  Infinite where too little is visible to tell them apart.
    """
    offset = outline - outline.mean(axis=0)
    t = np.arctan2(offset[:, 1], offset[:, 0])
    moves = np.stack([np.cos(t), np.sin(t), np.ones_like(t), np.cos(2 * t), np.sin(2 * t)], axis=1)
    seen = moves[visible]
    information = seen.T @ seen / len(moves)
    if np.linalg.cond(information) > 1e6:
        return visible.mean(), np.full(3, np.inf)
    return visible.mean(), np.sqrt(np.diag(np.linalg.inv(information))[:3] / [2, 2, 1])


# ---- one frame ----


_KEY = ("scene", "noise", "frame", "method")
FRAME_COLUMNS = (*_KEY, "seconds", "false_positives")
_ERRORS = ("x", "y", "r", "arc_x", "arc_y", "arc_r", "z_x", "z_y", "z_r")  # over bound, arc's bound, stated sigma
DISC_COLUMNS = (*_KEY, "peg", "found", "visible", "arc", *_ERRORS)


@contextmanager
def one_thread():
    """Let OpenCV work on one thread."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def measure_frame(scene, number, noises, methods):
    """Give one frame, with each level of noise, to each method.

    Parameters
    ----------
    scene : Scene
    number : int
    noises : sequence of float
    methods : sequence of str
        Keys of `detectors.METHODS`.

    Returns
    -------
    frames, discs : lists of tuples
        With the columns `FRAME_COLUMNS` and `DISC_COLUMNS`; a row for each method, noise (and expected disc).
    """
    frame, frames, discs = draw_frame(scene, number), [], []
    with one_thread():
        _warm_up(tuple(methods))
        for noise in noises:
            image = expose(frame.picture, noise, [SEED, *scene.name.encode(), number, int(1000 * noise)])
            for name in np.roll(methods, number).tolist():
                found, seconds = detectors.run(detectors.METHODS[name], image, RADIUS_RANGE)
                key = (scene.name, noise, number, name)
                rows, false_positives = score(frame, found, noise)
                frames.append((*key, seconds, false_positives))
                discs += [(*key, *row) for row in rows]
    return frames, discs


@cache
def _warm_up(methods):
    """Let each method run once in this process, on a part of a frame, so that no first call is timed."""
    image = np.ascontiguousarray(expose(draw_frame(MAIN[0], 10**6).picture, 5, 0)[300:900, 500:1100])
    for name in methods:
        detectors.run(detectors.METHODS[name], image, RADIUS_RANGE)


def score(frame, found, noise):
    """Compare what a method found with a frame's discs, as the module's text defines it.

    Parameters
    ----------
    frame : Frame
    found : peers.Found
    noise : float
        Of the picture, grey values.

    Returns
    -------
    rows : list of tuples
        The columns of `DISC_COLUMNS` after the key; a row for each expected disc.
    false_positives : int
    """
    low, high = RADIUS_RANGE
    expected = [disc for disc in frame.discs if low <= disc.truth.radius <= high]
    free, rows = np.ones(len(found), bool), []
    for disc in expected:
        index = _match(disc.truth, found, free)
        if index is None:
            rows.append((disc.peg, False, disc.visible, np.nan, *[np.nan] * 9))
            continue
        free[index] = False
        rows.append((disc.peg, True, *_errors(frame, disc, found, index, noise)))
    return rows, int(free.sum())


def _match(truth, found, free):
    """The free circle nearest to a disc, if it is near enough."""
    apart = np.hypot(*(found.centers - truth.centroid).T)
    reach = TOLERANCE * truth.radius
    usable = free & (apart <= reach) & (np.abs(found.radii - truth.radius) <= reach)
    return int(np.where(usable, apart, np.inf).argmin()) if usable.any() else None


def _errors(frame, disc, found, index, noise):
    """Visible share, arc bound over bound, and errors of x, y, r over bound, arc's bound and stated sigma."""
    error = np.array([*(found.centers[index] - disc.truth.centroid), found.radii[index] - disc.truth.radius])
    bound = center_bound(disc.truth.radius, frame.contrast, frame.edge_width, noise) * np.sqrt([1, 1, 0.5])
    arc = np.full(3, np.inf) if disc.arc is None else disc.arc
    sigmas = np.full(3, np.nan) if found.sigmas is None else found.sigmas[index]
    larger = np.sqrt((arc[0] ** 2 + arc[1] ** 2) / 2)
    return disc.visible, larger, *error / bound, *error / bound / arc, *error / sigmas


# ---- many frames ----


def measure(cells, methods, *, workers=WORKERS):
    """Measure frames in parallel processes.

    Parameters
    ----------
    cells : dict
        Scene: (number of frames, levels of noise).
    methods : sequence of str
        Keys of `detectors.METHODS`.
    workers : int

    Returns
    -------
    frames, discs : DataFrames
        As in `measure_frame`.
    """
    tasks = [
        (scene, number, noises, _methods_for(methods, number, frames))
        for scene, (frames, noises) in cells.items()
        for number in range(frames)
    ]
    done = Parallel(n_jobs=workers, return_as="generator")(delayed(measure_frame)(*task) for task in tasks)
    pairs = list(tqdm(done, total=len(tasks), unit="frame", desc="frames", disable=None))
    columns = (FRAME_COLUMNS, DISC_COLUMNS)
    return tuple(
        pd.DataFrame([row for pair in pairs for row in pair[part]], columns=columns[part]) for part in (0, 1)
    )


def _methods_for(methods, number, frames):
    """The methods that get frame `number`: slow ones get the first few only (`Method.share`), one at least."""
    return [
        name for name in methods
        if not detectors.missing(detectors.METHODS[name]) and number < max(1, round(detectors.METHODS[name].share * frames))
    ]


def summarize(frames, discs):
    """The table of results: a row for each scene, noise and method; the module's text says what is what."""
    reference = frames[frames["method"] == detectors.REFERENCE].set_index(["scene", "noise", "frame"])["seconds"]
    rows, key = [], ["scene", "noise", "method"]
    parts = dict(list(discs.groupby(key, sort=False)))
    for (scene, noise, method), part in frames.groupby(key, sort=False):
        cell = _cell(part, parts.get((scene, noise, method), discs[:0]), reference)
        rows.append({"scene": scene, "noise": noise, "method": method} | cell)
    table = pd.DataFrame(rows)
    order = table[["scene", "method"]].apply(lambda column: column.map(_ORDER))
    return table.iloc[np.lexsort((order["method"], table["noise"], order["scene"]))].reset_index(drop=True)


# scenes and methods in the order of the tables
_ORDER = {name: k for k, name in enumerate([*(scene.name for scene in SCENES), *detectors.METHODS])}


def _cell(frames, discs, reference):
    """One row's numbers."""
    seconds = frames.set_index(["scene", "noise", "frame"])["seconds"]
    ratio = seconds / reference.reindex(seconds.index)
    pegs = discs[(discs["peg"] > 0) & discs["found"]]
    center, radius = pegs[["x", "y"]].to_numpy().ravel(), pegs["r"].to_numpy()
    z_center, z_radius = pegs[["z_x", "z_y"]].to_numpy().ravel(), pegs["z_r"].to_numpy()
    return {
        "frames": len(frames),
        "ms": 1e3 * seconds.median(),
        "time_ratio": ratio.median(),
        "detection": 100 * discs["found"].mean(),
        "false_positives": frames["false_positives"].mean(),
        "center": _robust_rms(center),
        "center_rms": _rms(center),
        "radius": _robust_rms(radius),
        "radius_rms": _rms(radius),
        "visible": 100 * discs.loc[discs["peg"] > 0, "visible"].mean(),
        "arc_bound": _median(pegs["arc"]),
        "center_arc": _robust_rms(pegs[["arc_x", "arc_y"]].to_numpy().ravel()),
        "radius_arc": _robust_rms(pegs["arc_r"].to_numpy()),
        "center_sd": _spread(z_center),
        "radius_sd": _spread(z_radius),
        "coverage": _coverage(np.concatenate([z_center, z_radius])),
    }


def _median(values):
    return float(np.median(values)) if len(values) else np.nan


def _robust_rms(values):
    return 1.4826 * _median(np.abs(values))


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def _spread(values):
    """Standard deviation; NaN for methods that state no sigma."""
    return float(np.std(values)) if len(values) else np.nan


def _coverage(values):
    """Per cent of the values within 1.96; NaN for methods that state no sigma."""
    return 100 * float(np.mean(np.abs(values) < HONEST)) if len(values) and np.isfinite(values).all() else np.nan


# ---- memory and size ----


def peak_memory(method):
    """Megabytes that a method needs for one 1600 x 1200 px frame above a process with all imports.

    A fresh process loads the frame, lets the method run on a small part of it, and tells by how much the peak
    of its memory during the whole frame lies above what it held before.
    """
    with tempfile.TemporaryDirectory(prefix="pegpose_") as folder:
        path = Path(folder, "frame.npy")
        np.save(path, expose(draw_frame(MAIN[1], 0).picture, 5, 0))
        code = "import sys; from pegpose_lab.bench import score; score.tell_memory(*sys.argv[1:])"
        served = method.module == detectors.CONTRIB_MODULE
        variables = detectors.contrib_variables() if served else dict(os.environ)
        command = [sys.executable, "-c", code, method.name, path]
        return float(subprocess.run(command, env=variables, check=True, capture_output=True, text=True).stdout)


def tell_memory(name, path):
    """Print what `peak_memory` asks for; runs in a process of its own."""
    cv2.setNumThreads(1)
    image, method = np.load(path), detectors.METHODS[name]
    detectors.run(method, np.ascontiguousarray(image[:200, :200]), RADIUS_RANGE)
    before = _memory("VmRSS")
    detectors.run(method, image, RADIUS_RANGE)
    print(max(_memory("VmHWM") - before, 0.0))


def _memory(field):
    """Resident memory now (VmRSS) or its peak (VmHWM), MB.

    Elsewhere than on Linux the peak stands for both.  On Linux getrusage's peak is that of the parent process, if
    that was larger.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return int(status.split(field + ":")[1].split()[0]) / 1024
    except OSError:
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def measure_sizes(sizes, *, methods=(detectors.OURS, detectors.REFERENCE), repeats=3):
    """Time against the picture's size: the same scene with more pixels, radii and range in proportion.

    Parameters
    ----------
    sizes : sequence of float
        Megapixels.
    methods : sequence of str
    repeats : int

    Returns
    -------
    DataFrame
        megapixels, method, ms (median), ms_per_megapixel, pegs (detected, of four).
    """
    rows = []
    with one_thread():
        for size in tqdm(sizes, unit="size", desc="sizes ", disable=None):
            camera = _scaled(_camera(), np.sqrt(1e6 * size / np.prod(_camera().image_size)))
            frame = draw_frame(MAIN[0], 0, camera)
            image = expose(frame.picture, 5, 0)
            scale = camera.image_size[0] / _camera().image_size[0]
            limits = tuple(scale * radius for radius in RADIUS_RANGE)
            times, pegs = {name: [] for name in methods}, {}
            for _ in range(repeats + 1):
                for name in methods:
                    found, seconds = detectors.run(detectors.METHODS[name], image, limits)
                    times[name].append(seconds)
                    pegs[name] = _detected_pegs(frame, found)
            for name, seconds in times.items():
                ms = 1e3 * float(np.median(seconds[1:]))  # the first run warms up
                rows.append((image.size / 1e6, name, ms, ms / (image.size / 1e6), pegs[name]))
    return pd.DataFrame(rows, columns=["megapixels", "method", "ms", "ms_per_megapixel", "pegs"])


def _detected_pegs(frame, found):
    """How many of the frame's pegs a method detected."""
    free = np.ones(len(found), bool)
    return sum(_match(disc.truth, found, free) is not None for disc in frame.discs if disc.peg)


def _scaled(camera, scale):
    """The same camera with `scale` times the pixels along each axis."""
    width, height = (round(scale * length) for length in camera.image_size)
    pitch = tuple(np.divide(camera.pixel_pitch, scale).tolist())
    middle = ((width - 1) / 2, (height - 1) / 2)
    return replace(camera, image_size=(width, height), pixel_pitch=pitch, principal_point=middle)


def growth(sizes, method=detectors.OURS):
    """Exponent of time over size: the slope of ln(ms) over ln(megapixels)."""
    rows = sizes[sizes["method"] == method]
    return exponent(rows["megapixels"], rows["ms"])


def exponent(size, time):
    """Slope of ln(time) over ln(size): 1 where time grows linearly."""
    return float(np.polyfit(np.log(size), np.log(time), 1)[0])


# ---- methods ----


def describe_methods(methods, memory):
    """Package, version, settings, memory (MB; NaN where the name is not in `memory`) of each method, and why it is
    missing if it is."""
    rows = []
    for name in methods:
        method = detectors.METHODS[name]
        reason = detectors.missing(method)
        megabytes = np.nan if reason or name not in memory else peak_memory(method)
        rows.append((name, method.package, detectors.version(method), method.settings, megabytes, reason))
    return pd.DataFrame(rows, columns=["method", "package", "version", "settings", "memory_mb", "missing"])
