"""Many runs of visual servoing: from random starts, with hand-eye errors, and with tolerances too small to be reached."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.spatial.transform import RigidTransform, Rotation
from tqdm import tqdm

from ..files import MEASURED_FOLDER
from ..servo import remaining, visual_servo
from .measured import made_by, write_measured
from .servo_cell import HALF_TURN, Cell, goal_pose, start_pose

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

STARTS, RENDERED_STARTS, SWEPT = 1000, 20, 100
TOLERANCE = (0.1, 0.05)  # mm, deg
CONFIDENCE = 0.999  # that a run which says "reached" is inside: of 1,000 runs one may not be
HAND_EYE = (5.0, 3.0)  # mm and deg: sigma per axis of the hand-eye error of a run, far worse than a calibrated robot's
BIASES = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)  # deg
TOLERANCES = (0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005)  # mm


def servo_run(
    seed: int,
    *,
    noise: float = 2.0,
    rendered: bool = False,
    repeatability: float = 0.05,
    bias: float | None = None,
    distance: float = TOLERANCE[0],
    gain: float = 0.7,
) -> dict[str, Any]:
    """One run from a random start.

    Parameters
    ----------
    seed : int
    noise, rendered, repeatability
        As for `servo_cell.Cell`.
    bias : float, optional
        Angle, deg, of the hand-eye error about a random axis; by default an error drawn with the sigmas `HAND_EYE`.
    distance : float
        Tolerance, mm; that of the angle goes with it as in `TOLERANCE`.
    gain : float

    Returns
    -------
    dict
        seed, outcome, reason, steps; start (mm), off and off_turn: the true rest at the end, mm and deg; inside, whether
        it is inside the tolerance; run: the `ServoRun`; places: the true poses.
    """  # fmt: skip
    rng = np.random.default_rng([seed, 11])
    start = start_pose(goal_pose(), rng)
    cell = Cell(start, rng, noise, rendered, _hand_eye(bias, rng), repeatability)
    angle = np.deg2rad(TOLERANCE[1]) * distance / TOLERANCE[0]
    run = visual_servo(
        cell.observe, cell.move, cell.goal,
        goal_covariance=cell.goal_covariance, symmetry=HALF_TURN, gain=gain, distance=distance, angle=angle,
        confidence=CONFIDENCE,
    )  # fmt: skip
    rest = remaining(cell.place, goal_pose(), HALF_TURN)
    off, turn = np.linalg.norm(rest[:3]), np.linalg.norm(rest[3:])
    return {
        "seed": seed,
        "outcome": run.outcome,
        "reason": run.reason,
        "steps": len(cell.places) - 1,
        "start": float(np.linalg.norm(start.translation - goal_pose().translation)),
        "off": float(off),
        "off_turn": float(np.rad2deg(turn)),
        "inside": bool(off <= distance and turn <= angle),
        "run": run,
        "places": cell.places,
    }


def _hand_eye(bias, rng):
    if bias is None:
        shift, turn = rng.standard_normal((2, 3)) * np.array([[HAND_EYE[0]], [np.deg2rad(HAND_EYE[1])]])
        return RigidTransform.from_components(shift, Rotation.from_rotvec(turn))
    axis = rng.standard_normal(3)
    return RigidTransform.from_rotation(Rotation.from_rotvec(np.deg2rad(bias) * axis / np.linalg.norm(axis)))


def _short(seed, options):
    """A row of `servo_run` without its run."""
    row = servo_run(seed, **options)
    return {name: row[name] for name in ("outcome", "steps", "off", "off_turn", "inside")}


CASES = {
    "starts": [({"noise": noise}, first) for noise in (2.0, 5.0) for first in (0, 10_000)],
    "rendered": [({"noise": 2.0, "rendered": True}, 0)],
    "hand-eye bias": [({"bias": bias}, 20_000) for bias in BIASES],
    "tolerance": [({"distance": distance}, 30_000) for distance in TOLERANCES],
    "repeatability": [({"repeatability": rp}, 40_000) for rp in (0.0, 0.02, 0.1, 0.2, 0.5)],
}
"""Of each case the options and the first seed of its rows."""

RUNS = {"starts": STARTS, "rendered": RENDERED_STARTS}


def servo_table(runs: dict[str, int] = RUNS, *, workers: int = 2, progress: bool = True) -> pd.DataFrame:
    """Run all cases.

    Parameters
    ----------
    runs : dict
        How many of each case; `SWEPT` where none is given.
    workers : int
    progress : bool

    Returns
    -------
    DataFrame
        case, noise, bias (deg; NaN: drawn), distance (mm), repeatability (mm), first_seed, runs; how many ended in each
        outcome; false: reached, but truly outside; steps, their median where reached; off, off_turn: the largest true rest
        where reached, mm and deg.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> study.load_measured("servo_runs")["case"].unique().tolist()
    ['starts', 'rendered', 'hand-eye bias', 'tolerance', 'repeatability']
    """
    rows = []
    for case, settings in CASES.items():
        for options, first in settings:
            count = runs.get(case, SWEPT)
            jobs = (delayed(_short)(seed, options) for seed in range(first, first + count))
            done = Parallel(n_jobs=workers, return_as="generator")(jobs)
            found = pd.DataFrame(list(tqdm(done, total=count, desc=f"{case} {options}", disable=not progress)))
            rows.append(_row(case, options, first, found))
    return pd.DataFrame(rows)


OUTCOMES = ("reached", "not-seen", "too-uncertain", "no-progress", "diverging", "steps-used-up")


def _row(case, options, first, found):
    reached = found[found["outcome"] == "reached"]
    settings = {
        "noise": 2.0,
        "bias": np.nan,
        "distance": TOLERANCE[0],
        "repeatability": 0.05,
        "rendered": False,
    } | options
    counts = {outcome: int((found["outcome"] == outcome).sum()) for outcome in OUTCOMES}
    return {
        "case": case, **settings, "first_seed": first, "runs": len(found), **counts,
        "false": int((~reached["inside"]).sum()), "steps": reached["steps"].median(),
        "off": reached["off"].max(), "off_turn": reached["off_turn"].max(),
    }  # fmt: skip


def step_table(seed: int) -> pd.DataFrame:
    """The frames of one rendered run: step; x, y, z, r_x, r_y, r_z of the true cam_from_hub (mm, rad); the estimated rest
    (distance, mm; angle, deg) with what it is unsure by (sigmas), and the true rest."""
    row = servo_run(seed, rendered=True)
    run, rows = row["run"], []
    for step, (place, covariance) in enumerate(zip(row["places"], run.covariances, strict=True)):
        rest = remaining(place, goal_pose(), HALF_TURN)
        sigmas = [np.sqrt(np.linalg.eigvalsh(block)[-1]) for block in (covariance[:3, :3], covariance[3:, 3:])]
        rows.append([
            step, *place.translation, *place.rotation.as_rotvec(), run.distances[step], np.rad2deg(run.angles[step]),
            sigmas[0], np.rad2deg(sigmas[1]), np.linalg.norm(rest[:3]), np.rad2deg(np.linalg.norm(rest[3:])),
        ])  # fmt: skip
    names = ("step", "x", "y", "z", "r_x", "r_y", "r_z", "distance", "angle", "sigma", "sigma_turn", "off", "off_turn")
    return pd.DataFrame(rows, columns=list(names))


def write_servo_runs(folder: Path = MEASURED_FOLDER) -> None:
    """Run all cases and one rendered run, and write the two tables into `folder`."""
    made = made_by("servo_runs")
    comment = f"visual servoing of the hub to a taught goal in a simulated cell, runs by outcome; mm and deg; {made}"
    write_measured(folder, "servo_runs", servo_table().round({"off": 4, "off_turn": 4}), comment)
    comment = f"the frames of one rendered run of visual servoing; mm, r_x to r_z in rad, angles in deg; {made}"
    write_measured(folder, "servo_steps", step_table(0).round(6), comment)
