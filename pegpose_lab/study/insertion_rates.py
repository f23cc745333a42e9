"""Forecasts of the insertion beside what happens: the rendered chain, robot and wheel drawn, and each wheel put on.

A forecast is right if the share of insertions that it promises is the share that succeeds.  The outcome of a trial comes from
poses alone: the estimated pose is where the robot aims, the errors of hand-eye calibration, robot and holes are drawn from
their stated distributions, and `peg_entry` says what the true pegs meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.special import ndtri
from scipy.stats import binomtest
from tqdm import tqdm

from ..files import MEASURED_FOLDER
from ..insertion import RP_OF_SIGMA, Wheel, assembly_forecast, peg_entry
from ..paper import N_FRAMES, paper_experiment
from .assembly_trials import CHAINS, JOINT, ZHANG, run_frame
from .measured import made_by, write_measured

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..pose import HubPose

SEEDS = 20  # of each frame: 900 trials
QUANTILES = (0.2, 0.5, 0.8)  # of the forecast for one frame, at which the clearances are chosen
CURVE = np.geomspace(0.001, 1.0, 61)  # mm, the clearances of `chain_clearances.csv`
NEEDED = 0.999  # share of insertions that a clearance is to let through
ROBOT_DRAWS = 16  # of an industrial robot's errors with each trial's pose
WIDE = 5.0  # mm, a clearance at which an entry is looked at to see what it needs
TWO_SIDED = float(ndtri(0.975))
AXES = ("x", "y", "z", "tilt_x", "tilt_y", "theta")
QUANTITIES = {"x": ["x"], "y": ["y"], "z": ["z"], "tilt": ["tilt_x", "tilt_y"], "theta": ["theta"]}
RATES = ("promised", "came", "low", "high")
_ERRORS = ["scene", "chain", "free", "seed", "frame", *AXES, *(f"{axis}_sigma" for axis in AXES), "peg_error"]
_NEEDS = ["cell", "chain", "need"]


@dataclass(frozen=True)
class Cell:
    """What stands between the pose and the insertion: repeatability RP (mm), the sigmas of the hand-eye transform (mm, rad),
    the zone of the holes (mm), and how far the hand holds the wheel askew (rad)."""

    name: str
    repeatability: float = 0.0
    hand_eye_shift: float = 0.0
    hand_eye_turn: float = 0.0
    hole_zone: float = 0.0
    tilts: tuple[float, ...] = (0.0,)

    @property
    def hand_eye_covariance(self) -> NDArray[np.float64]:
        """(6, 6), as `assembly_forecast` takes it."""
        return np.diag([self.hand_eye_shift**2] * 3 + [self.hand_eye_turn**2] * 3)


EXACT = Cell("exact robot", tilts=tuple(np.deg2rad([0.0, 0.02, 0.05])))
INDUSTRIAL = Cell("industrial robot", 0.05, 0.02, 5e-5, 0.02, tuple(np.deg2rad([0.0, 0.1, 0.3])))
CELLS = (EXACT, INDUSTRIAL)


def _wheel(cell, clearance):
    """Without a chamfer, so that a peg that misses is blocked."""
    return Wheel(clearance=clearance, chamfer=0.0, position_tolerance=cell.hole_zone)


def _askew(tilt, direction):
    return RigidTransform.from_rotation(
        Rotation.from_rotvec(tilt * np.array([np.cos(direction), np.sin(direction), 0.0]))
    )


def _forecast(pose, cell, clearance, plan, **options):
    return assembly_forecast(
        pose,
        paper_experiment().hub,
        _wheel(cell, clearance),
        hand_eye_covariance=cell.hand_eye_covariance,
        robot_repeatability=cell.repeatability,
        hub_from_wheel=plan,
        **options,
    )


def _drawn_entry(trial, cell, clearance, plan, rng):
    """The `Entry` of one insertion to the estimated pose of a trial, with a robot and a wheel drawn at random."""
    hub = paper_experiment().hub
    off = rng.standard_normal(6) * np.sqrt(np.diag(cell.hand_eye_covariance))
    hand_eye = RigidTransform.from_components(off[:3], Rotation.from_rotvec(off[3:]))
    robot = RigidTransform.from_translation(cell.repeatability / RP_OF_SIGMA * rng.standard_normal(3))
    radius, turn = np.sqrt(rng.random(hub.n_pegs)), rng.uniform(0, 2 * np.pi, hub.n_pegs)
    holes = cell.hole_zone / 2 * (radius * [np.cos(turn), np.sin(turn)]).T
    hub_from_wheel = trial.truth.inv() * robot * hand_eye * trial.pose.cam_from_hub * plan
    return peg_entry(hub_from_wheel, hub, _wheel(cell, clearance), holes)


def _needed(trial, cell, draws, rng):
    """Clearances (draws,), mm, that insertions need to go in freely; infinite without a pose."""
    if trial.pose is None:
        return np.full(draws, np.inf)
    entries = [_drawn_entry(trial, cell, WIDE, RigidTransform.identity(), rng) for _ in range(draws)]
    return np.array([max(WIDE - min(entry.tops.min(), entry.mouths.min()), 0.0) for entry in entries])


def chosen_clearances(pose: HubPose) -> dict[tuple[str, float], list[float]]:
    """Clearances, mm, by cell and tilt, with which the forecast for one pose lets 20, 50 and 80 % go in freely."""
    chosen = {}
    for cell in CELLS:
        for tilt in cell.tilts:
            found = [_forecast(pose, cell, 0.1, _askew(tilt, 0.5), quantile=q).free_clearance for q in QUANTILES]
            chosen[cell.name, tilt] = [float(f"{clearance:.2g}") for clearance in found]
    return chosen


def _insertions(trial, clearances, rng):
    """Rows of forecasts with outcomes: for each cell, tilt and clearance one insertion."""
    for cell in CELLS:
        for tilt in cell.tilts:
            for clearance in clearances[cell.name, tilt]:
                plan = _askew(tilt, rng.uniform(0, 2 * np.pi))
                forecast = _forecast(trial.pose, cell, clearance, plan, rng=rng)
                met = _drawn_entry(trial, cell, clearance, plan, rng).outcome
                for outcome, promised in (("free", forecast.probabilities["free"]), ("enters", forecast.enters)):
                    came = met == "free" if outcome == "free" else met != "blocked"
                    yield cell.name, float(np.rad2deg(tilt)), clearance, outcome, promised, came


def _run(frame, seeds, clearances):
    """Rows of errors, of forecasts with outcomes, and of needed clearances, of a frame's trials."""
    errors, insertions, needs = [], [], []
    for trial in run_frame(frame, seeds):
        numbers = [*trial.error, *trial.sigmas, trial.peg_error]
        errors.append((trial.scene, trial.chain, trial.free, trial.seed, frame, *numbers))
        if trial.scene != "clean" or trial.free:
            continue
        rng = np.random.default_rng([trial.seed, frame, CHAINS.index(trial.chain)])
        for cell, draws in zip(CELLS, (1, ROBOT_DRAWS), strict=True):
            needs += [(cell.name, trial.chain, need) for need in _needed(trial, cell, draws, rng)]
        if trial.chain == JOINT:
            insertions += _insertions(trial, clearances, rng)
    return errors, insertions, needs


def run_trials(
    seeds: int = SEEDS, frames: int = N_FRAMES, *, workers: int = 2, progress: bool = True
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Run all trials: each of the first `frames` frames with each of `seeds` seeds.

    Returns
    -------
    errors : DataFrame
        A row for each pose: scene, chain, free, seed, frame; errors and their sigmas in the axes of the plane, mm and rad
        (`AXES`); peg_error, mm.
    insertions : DataFrame
        A row for each insertion and outcome: cell, tilt (deg), clearance (mm), outcome, promised (a probability), came.
    needs : DataFrame
        A row for each insertion without a tilt: cell, chain, need (mm of clearance to go in freely).

    Examples
    --------
    >>> from pegpose_lab import study
    >>> errors, insertions, needs = study.run_trials(seeds=1, frames=1, workers=1, progress=False)
    >>> sorted(set(needs["cell"]))
    ['exact robot', 'industrial robot']
    """
    of_middle = run_frame(N_FRAMES // 2, range(1))
    example = next(trial for trial in of_middle if (trial.chain, trial.free) == (JOINT, False))
    clearances = chosen_clearances(example.pose)
    jobs = (delayed(_run)(frame, range(1, seeds + 1), clearances) for frame in range(frames))
    done = Parallel(n_jobs=workers, return_as="generator")(jobs)
    found = list(tqdm(done, total=frames, unit="frame", disable=not progress))
    tables = []
    for k, columns in enumerate((_ERRORS, ["cell", "tilt", "clearance", "outcome", "promised", "came"], _NEEDS)):
        tables.append(pd.DataFrame([row for rows in found for row in rows[k]], columns=columns))
    return tuple(tables)


# ---- the tables ----


def interval_table(errors: pd.DataFrame) -> pd.DataFrame:
    """How often the 95 % intervals of the poses held the truth.

    Returns
    -------
    DataFrame
        scene, chain, free, quantity ("tilt" counts both axes), trials; rms error and rms stated sigma (um, thousandths of
        a degree); held, %; peg_error, rms in um, of all quantities the same.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> study.load_measured("pose_intervals")["quantity"].unique().tolist()
    ['x', 'y', 'z', 'tilt', 'theta']
    """
    stated, rows = errors[errors["x_sigma"].notna() & errors["chain"].isin([ZHANG, JOINT])], []
    for (scene, chain, free), group in stated.groupby(["scene", "chain", "free"], sort=True):
        for quantity, axes in QUANTITIES.items():
            unit = 1e3 if quantity in "xyz" else np.rad2deg(1e3)
            error, sigma = group[axes].to_numpy(), group[[f"{axis}_sigma" for axis in axes]].to_numpy()
            held = 100 * np.mean(np.abs(error) < TWO_SIDED * sigma)
            peg_error = 1e3 * np.sqrt(np.mean(group["peg_error"] ** 2))
            numbers = [unit * np.sqrt(np.mean(error**2)), unit * np.sqrt(np.mean(sigma**2)), held, peg_error]
            rows.append([scene, chain, free, quantity, len(group), *numbers])
    return pd.DataFrame(
        rows, columns=["scene", "chain", "free", "quantity", "trials", "rms", "sigma", "held", "peg_error"]
    )


def rate_table(insertions: pd.DataFrame) -> pd.DataFrame:
    """Promised rates beside those that came, with the Wilson 95 % intervals of these.

    Returns
    -------
    DataFrame
        cell, tilt (deg), clearance (mm), outcome, runs, promised, came, low, high (%).

    Examples
    --------
    >>> from pegpose_lab import study
    >>> row = {"cell": "robot", "tilt": 0.0, "clearance": 0.1, "outcome": "free", "promised": 0.5}
    >>> study.rate_table(pd.DataFrame([row | {"came": True}, row | {"came": False}]))["came"].tolist()
    [50.0]
    """
    rows = []
    for key, group in insertions.groupby(["cell", "tilt", "clearance", "outcome"], sort=True):
        interval = binomtest(int(group["came"].sum()), len(group)).proportion_ci(method="wilson")
        rates = [group["promised"].mean(), group["came"].mean(), interval.low, interval.high]
        rows.append([*key, len(group), *(100 * rate for rate in rates)])
    return pd.DataFrame(
        rows, columns=["cell", "tilt", "clearance", "outcome", "runs", "promised", "came", "low", "high"]
    )


def curve_table(needs: pd.DataFrame) -> pd.DataFrame:
    """The share of insertions that go in freely with each clearance of `CURVE`, and the clearance that 99.9 % need.

    Returns
    -------
    DataFrame
        cell, chain, clearance (mm), share; the row of each chain with share `NEEDED` is that clearance, the others have
        the shares of `CURVE`.

    Examples
    --------
    >>> from pegpose_lab import study
    >>> needs = pd.DataFrame({"cell": "robot", "chain": "joint", "need": np.arange(1, 1001) / 1000})
    >>> float(study.curve_table(needs)["clearance"].iloc[-1])
    0.999
    """
    rows = []
    for (cell, chain), group in needs.groupby(["cell", "chain"], sort=True):
        need = np.sort(group["need"].to_numpy())
        shares = np.searchsorted(need, CURVE, side="right") / len(need)
        rows += [[cell, chain, clearance, share] for clearance, share in zip(CURVE, shares, strict=True)]
        rows.append([cell, chain, float(need[int(np.ceil(NEEDED * len(need))) - 1]), NEEDED])
    return pd.DataFrame(rows, columns=["cell", "chain", "clearance", "share"])


def write_assemblies(folder: Path = MEASURED_FOLDER) -> None:
    """Run all trials and write the three tables into `folder`."""
    errors, insertions, needs = run_trials()
    what = f"{N_FRAMES} frames x {SEEDS} seeds, each with a camera calibrated anew from rendered boards"
    made = made_by("assemblies")
    digits = {"rms": 3, "sigma": 3, "held": 1, "peg_error": 3}
    comment = f"95 % intervals of the hub's pose; {what}; rms and sigma in um and thousandths of a degree; {made}"
    write_measured(folder, "pose_intervals", interval_table(errors).round(digits), comment)
    comment = f"forecast and outcome of insertions, %; {what}; tilt in deg, clearance in mm; {made}"
    write_measured(
        folder, "insertion_rates", rate_table(insertions).round(dict.fromkeys(RATES, 2) | {"tilt": 3}), comment
    )
    comment = f"share of insertions that go in freely with a clearance (mm), by the way to the pose; {what}; {made}"
    write_measured(folder, "chain_clearances", curve_table(needs).round({"clearance": 5, "share": 4}), comment)
