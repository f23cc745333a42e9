"""Exposures of a moving hub: how far centres and poses are off, what their sigmas say, and whether the blur is told."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.spatial.transform import RigidTransform, Rotation
from tqdm import tqdm

from ..checks import DetectionError
from ..files import MEASURED_FOLDER
from ..paper import paper_experiment
from ..pegs import locate_pegs
from ..pose import estimate_pose, project_discs
from ..render import expose, render_hub
from .measured import made_by, write_measured

if TYPE_CHECKING:
    from pathlib import Path

KINDS = ("shift", "turn")
BLURS = (0.0, 1.0, 2.0, 3.0, 5.0, 8.0)  # px, of the pegs during the exposure
NOISES = (1.0, 2.0, 5.0)
PLACES = 10  # of the hub, and the directions of its motion
EXPOSURES = 10  # of each place: 100 trials
DEPTH = 400.0  # mm


def exposed_hub(kind: str, blur: float, seed: int) -> tuple[np.ndarray, RigidTransform]:
    """Render the exposure of a hub that moves, without noise.

    Parameters
    ----------
    kind : {"shift", "turn"}
        Along a random direction in its plane, or about its axis.
    blur : float
        Motion of the pegs' images, px.
    seed : int
        Of place and direction.

    Returns
    -------
    image : (height, width) float32 ndarray
    cam_from_hub : RigidTransform
        In the middle of the exposure.
    """
    experiment, rng = paper_experiment(), np.random.default_rng(seed)
    hub, camera = experiment.hub, experiment.camera
    axis, tilt = rng.uniform(0, 2 * np.pi), np.deg2rad(15) * np.sqrt(rng.random())
    tilted = Rotation.from_rotvec(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))
    turn = Rotation.from_rotvec([0, 0, rng.uniform(-np.pi, np.pi)])
    middle = RigidTransform.from_components([*rng.uniform(-40, 40, 2), DEPTH], tilted * turn)
    step = blur * DEPTH * camera.pixel_pitch[0] / camera.focal_length / 2  # mm, half the motion
    if kind == "shift":
        way = rng.uniform(0, 2 * np.pi)
        half = RigidTransform.from_translation(step * np.array([np.cos(way), np.sin(way), 0.0]))
    else:
        half = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, 2 * step / hub.pitch_circle_diameter]))
    look = {"blur": experiment.blur, "noise": None}
    if blur == 0:
        return render_hub(camera, middle, hub, **look), middle
    return render_hub(camera, middle * half.inv(), hub, until=middle * half, **look), middle


def _trials(kind, blur, seed):
    """Rows of a place: noise, whether it was found and flagged, errors and sigmas of centres (px) and of the pose."""
    experiment = paper_experiment()
    image, middle = exposed_hub(kind, blur, seed)
    half = middle * RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, np.pi]))
    radii = np.full(experiment.hub.n_pegs, experiment.hub.peg_radius)
    rows = []
    for noise, exposure in product(NOISES, range(EXPOSURES)):
        row = {"kind": kind, "blur": blur, "noise": noise, "found": False, "flagged": False, "told": np.nan}
        rows.append(row)
        try:
            seen = locate_pegs(expose(image, noise, [seed, exposure, int(noise)]), experiment.hub)
        except DetectionError as error:
            row["flagged"] = "during the exposure" in str(error)
            continue
        both = [project_discs(experiment.camera, pose, experiment.hub.peg_centers, radii)[0] for pose in (middle, half)]
        centers = min(both, key=lambda c: np.abs(c - seen.peg_centers).max())
        usable = np.isfinite(seen.peg_sigmas)
        off, sigma = (seen.peg_centers - centers)[usable], seen.peg_sigmas[usable]
        pose = estimate_pose(seen, experiment.camera, experiment.hub)
        away = pose.cam_from_hub.translation - middle.translation
        row |= {"found": True, "flagged": seen.motion_blur > 0, "told": seen.motion_blur or np.nan}
        row |= {"square": np.mean(off**2), "variance": np.mean(sigma**2), "held": np.mean(np.abs(off) < 1.96 * sigma)}
        row |= {"lateral": np.sum(away[:2] ** 2), "depth": away[2] ** 2}
    return rows


def moving_hub_table(places: int = PLACES, *, workers: int = 2, progress: bool = True) -> pd.DataFrame:
    """Measure all kinds of motion, blurs and noise levels.

    Returns
    -------
    DataFrame
        kind, blur (px), noise; trials; found, flagged (%); told, the mean of the length that was told (px); rms and sigma of
        the pegs' centres per axis, px; held, % of them within 1.96 sigmas; lateral, depth: rms errors of the pose, mm.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> study.load_measured("moving_hub")["kind"].unique().tolist()
    ['shift', 'turn']
    """
    tasks = list(product(KINDS, BLURS, range(places)))
    done = Parallel(n_jobs=workers, return_as="generator")(delayed(_trials)(*task) for task in tasks)
    rows = [row for found in tqdm(done, total=len(tasks), unit="place", disable=not progress) for row in found]
    groups = pd.DataFrame(rows).groupby(["kind", "blur", "noise"], sort=True)
    means = groups[["square", "variance", "held", "lateral", "depth", "told"]].mean()
    table = 100 * groups[["found", "flagged"]].mean()
    table.insert(0, "trials", groups.size())
    table["told"] = means["told"]
    for name, square in (("rms", "square"), ("sigma", "variance")):
        table[name] = np.sqrt(means[square])
    table["held"] = 100 * means["held"]
    for name in ("lateral", "depth"):
        table[name] = np.sqrt(means[name])
    return table.reset_index()


def write_moving_hub(folder: Path = MEASURED_FOLDER) -> None:
    """Measure exposures of a moving hub and write the table into `folder`."""
    comment = "exposures of a moving hub: centres (px) and poses (mm) against the middle of the exposure; " + made_by(
        "moving_hub"
    )
    digits = {"told": 2, "rms": 4, "sigma": 4, "held": 1, "lateral": 4, "depth": 4}
    write_measured(folder, "moving_hub", moving_hub_table().round(digits), comment)
