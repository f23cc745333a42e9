"""The influence of each constant of the disc fit: each is halved and doubled, one at a time, on separate frames.

``python3 -m pegpose_lab measure disc_constants`` writes data/measured/disc_constants.csv, in about four minutes on two
idle cores; `pegpose_lab.discs` has the constants' units and reasons.

Every scene has `FRAMES` frames, with the noise of the benchmark's tables, numbered from `FIRST_FRAME`.  Their pegs,
bore and screws are measured, starting from circles that are wrong by up to `OFF` of the radius.  Columns: the accepted
share (%), the rms error of the centre relative to that with the committed value, the rms of error over stated sigma in
the scene where that is largest, and the largest move of a centre that stays accepted, in its sigmas.
"""

from __future__ import annotations

import importlib
import pkgutil
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from tqdm import tqdm

from .. import discs, study
from ..discs import fit_discs
from ..files import MEASURED_FOLDER
from ..render import expose
from .scenes import SCENES, SEED, TARGET_NOISE, draw_frame
from .score import WORKERS, one_thread
from .statistics import _rms

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from .scenes import Scene

NAME = "disc_constants"
FIRST_FRAME, FRAMES = 30_000, 10
OFF = 0.1
LAYOUT = {
    "N_RAYS", "RAY_POINTS", "REMAP_LIMIT", "GROUP", "CHUNK", "MOST_KEPT", "QUANTISATION",
    "N_SECTORS", "SECTOR_ROW", "LONGER_ROW", "PARTS",
}  # fmt: skip
"""Constants without a choice: layouts of arrays, limits of other libraries, and values that follow from others."""


def constants() -> dict[str, float]:
    """Return the constants of the disc fit with their values."""
    found = {}
    for module in _modules():
        values = vars(module).items()
        found |= {name: value for name, value in values if name.isupper() and not name.startswith(("_", "TYPE_"))}
    del found["REASONS"]  # words, not numbers
    return dict(sorted(found.items()))


def _modules():
    """The files of `pegpose_lab.discs`."""
    return [importlib.import_module(f"{discs.__name__}.{file.name}") for file in pkgutil.iter_modules(discs.__path__)]


@contextmanager
def changed(name: str, value: float) -> Iterator[None]:
    """Temporarily change a constant in every file of the disc fit that uses it.

    Raises
    ------
    ValueError
        If there is no constant of that name.
    """
    before = constants()
    if name not in before:
        raise ValueError(f"name is {name!r}; expected one of {', '.join(before)}")
    users = [module for module in _modules() if hasattr(module, name)]
    for module in users:
        setattr(module, name, value)
    try:
        yield
    finally:
        for module in users:
            setattr(module, name, before[name])


def tried() -> list[tuple[str, float]]:
    """Return the constants with half and twice their value; whole numbers stay whole."""
    values = []
    for name, value in constants().items():
        if name not in LAYOUT:
            values += [(name, value // 2 if isinstance(value, int) else value / 2), (name, value * 2)]
    return values


# ---- measuring ----


def measure_constants(frames: int = FRAMES, *, workers: int = WORKERS) -> pd.DataFrame:
    """Measure the frames with each of the tried values.

    Returns
    -------
    DataFrame
        Columns constant, value, tried, accepted, error, z, move; the first row is for the committed values.
    """
    jobs = [(scene, FIRST_FRAME + k) for scene in SCENES for k in range(frames)]
    work = Parallel(n_jobs=workers, return_as="generator")(delayed(_measure_frame)(*job) for job in jobs)
    parts = list(tqdm(work, total=len(jobs), unit="frame", desc="frames", disable=None))
    fits = {key: [part[key] for part in parts] for key in parts[0]}
    base, committed, rows = _Fits.of(fits[None], jobs), constants(), []
    for key in fits:
        name, value = key or ("none", np.nan)
        rows.append((name, committed.get(name, np.nan), value, *_Fits.of(fits[key], jobs).compared(base)))
    return pd.DataFrame(rows, columns=["constant", "value", "tried", "accepted", "error", "z", "move"])


def _measure_frame(scene: Scene, number: int) -> dict[tuple[str, float] | None, NDArray[np.float64]]:
    """For each tried value: errors of x, y and their sigmas (n, 4) of a frame's discs, NaN if not accepted."""
    frame = draw_frame(scene, number)
    image = expose(frame.picture, TARGET_NOISE, [SEED, *scene.name.encode(), number])
    truth = np.array([[*disc.truth.centroid, disc.truth.radius] for disc in frame.discs])
    off = np.random.default_rng([SEED, number]).uniform(-OFF, OFF, truth.shape) * truth[:, 2:]
    circles = SimpleNamespace(centers=(truth + off)[:, :2], radii=(truth + off)[:, 2])

    def fit():
        found = fit_discs(image, circles)
        rows = np.hstack([found.centers - truth[:, :2], found.sigmas[:, :2]])
        return np.where(found.accepted[:, None], rows, np.nan)

    with one_thread():
        fits = {None: fit()}
        for name, value in tried():
            with changed(name, value):
                fits[name, value] = fit()
    return fits


@dataclass(frozen=True, eq=False)
class _Fits:
    """Errors and sigmas (n, 2) of all discs, and the scene (n,) of each."""

    errors: np.ndarray
    sigmas: np.ndarray
    scenes: np.ndarray

    @classmethod
    def of(cls, parts, jobs):
        rows = np.concatenate(parts)
        scenes = np.repeat([scene.name for scene, _ in jobs], [len(part) for part in parts])
        return cls(rows[:, :2], rows[:, 2:], scenes)

    def compared(self, base):
        """Accepted share (%), rms error relative to `base`, largest rms of error over sigma, largest move in sigmas."""
        both = np.isfinite(self.errors[:, 0]) & np.isfinite(base.errors[:, 0])
        if not both.any():
            return 0.0, np.nan, np.nan, np.nan
        ratio = _rms(self.errors[both]) / _rms(base.errors[both])
        scaled = (self.errors / self.sigmas)[both]
        z = max(_rms(scaled[self.scenes[both] == scene]) for scene in np.unique(self.scenes[both]))
        move = np.abs((self.errors - base.errors) / base.sigmas)[both].max()
        return 100 * np.isfinite(self.errors[:, 0]).mean(), ratio, z, move


def write_disc_constants(folder: Path = MEASURED_FOLDER) -> None:
    """Measure with each of the tried values, and write the table into `folder`."""
    table = measure_constants()
    comment = (
        f"the disc fit with each constant halved and doubled, {FRAMES} frames of each scene, noise {TARGET_NOISE}: "
        "accepted in %, rms centre error over that of the committed values, rms error over sigma in the worst scene, "
        f"largest move in sigmas; {study.made_by(NAME)}"
    )
    table = table.round({"accepted": 1, "error": 3, "z": 2, "move": 2, "value": 6, "tried": 6})
    study.write_measured(folder, NAME, table, comment)
    print(table.to_string(index=False))
