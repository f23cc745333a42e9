"""The valley of stage 2's objective: its floor over T_z, and the lowest point of the box, by ever narrower scans."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...flags import Flag
from .objective import PENALTY

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .objective import TwoStageObjective

SCANNED_F = 41
"""Number of f values with which the scan for the floor at one T_z starts."""

NARROWED = 9
"""Number of points of each later scan; it is a quarter as wide as the one before."""

STARTS = 3
"""Number of valleys along T_z that `lowest` narrows."""


FLOOR, FLOOR_SCANS = 17, 3
"""Number of T_z values across the box, and of narrower scans of f, for the floor that a `Valley` keeps."""

NEAR_SCANS = 8
"""Number of narrower scans of f near the end of a run, for an f to 1e-6 of the box."""

NEAR = 0.25 ** np.arange(1, 7)
"""Distances from an end of a run, in widths of the box along T_z, at which the floor is compared with it."""

SHORT = 5e-5
"""px; a run stopped short if the floor is lower than its end by more than this anywhere it is looked at."""


class Valley:
    """The floor of the objective in a box, by which the ends of runs of the genetic algorithm are judged."""

    def __init__(self, objective, lower, upper):
        self.objective, self.lower, self.upper = objective, lower, upper

    @cached_property
    def floor(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """f (n,) and T_z (n,) on the floor, mm, where the camera sees all points."""
        t_z = np.linspace(self.lower[1], self.upper[1], FLOOR)
        f, values = valley_floor(self.objective, t_z, (self.lower[0], self.upper[0]), FLOOR_SCANS)
        self.least = values.min()
        return f[values < PENALTY], t_z[values < PENALTY]

    @cached_property
    def lowest(self) -> tuple[NDArray[np.float64], float]:
        """The lowest chromosome in the box, and its value, px."""
        return lowest(self.objective, self.lower, self.upper, 101, 6, 8)

    def judge(self, chromosome: NDArray[np.float64], value: float) -> tuple[Flag, ...]:
        """A flag if the box has a lower point than a run's best chromosome, whose Eq. 7 is `value`, px.

        The floor is looked at across the box and near the chromosome's T_z, which finds other valleys and a slope along
        this one; only then the lowest point is searched.
        """
        _ = self.floor
        steps = NEAR * (self.upper[1] - self.lower[1])
        near = np.clip(chromosome[1] + np.concatenate([steps, -steps]), self.lower[1], self.upper[1])
        values = valley_floor(self.objective, near, (self.lower[0], self.upper[0]), NEAR_SCANS)[1]
        if min(self.least, values.min()) > value - SHORT:
            return ()
        best, least = self.lowest
        text = (
            f"The algorithm stopped short of the optimum of its box: it ended at f = {chromosome[0]:.5g} mm, "
            f"T_z = {chromosome[1]:.5g} mm with a mean distance of {value:.5g} px, and f = {best[0]:.5g} mm, "
            f"T_z = {best[1]:.5g} mm have {least:.5g} px. Take optimum_in_box, or run other seeds or more generations."
        )
        return (Flag("short-of-optimum", text),)


def lowest(
    objective: TwoStageObjective,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    scanned: int,
    coarse: int,
    fine: int,
) -> tuple[NDArray[np.float64], float]:
    """The chromosome (f, T_z) of a box with the smallest Eq. 7, and that value, px.

    The floor is scanned at `scanned` values of T_z (`coarse` narrower scans of f at each); its `STARTS` deepest valleys
    are narrowed by `fine` scans of both.
    """
    f_range = lower[0], upper[0]
    t_z = np.linspace(lower[1], upper[1], scanned)
    values = valley_floor(objective, t_z, f_range, coarse)[1]
    padded = np.pad(values, 1, constant_values=np.inf)
    valleys = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    starts = valleys[np.argsort(values[valleys])][:STARTS]
    low, high = t_z[np.maximum(starts - 1, 0)], t_z[np.minimum(starts + 1, scanned - 1)]
    found, values = narrow(lambda t: valley_floor(objective, t, f_range, fine)[1], low, high, NARROWED, fine)
    t_z = found[values.argmin()]
    return np.array([valley_floor(objective, t_z, f_range, fine)[0], t_z]), float(values.min())


def valley_floor(
    objective: TwoStageObjective, t_z: NDArray[np.float64], f_range: tuple[float, float], scans: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For each T_z (any shape): the f in its range, ends included, with the smallest Eq. 7, and that value, px."""
    shape, t_z = np.shape(t_z), np.ravel(t_z)

    def at(f):
        chromosomes = np.stack([f, np.broadcast_to(t_z[:, None], f.shape)], axis=-1)
        return objective(chromosomes.reshape(-1, 2)).reshape(f.shape)

    f, values = narrow(at, *(np.full(len(t_z), end) for end in f_range), SCANNED_F, scans)
    return f.reshape(shape), values.reshape(shape)


def narrow(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    points: int,
    scans: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The minimum of a function of (n, k) between low (n,) and high (n,), both included: its place and value, (n,)."""
    for count in (points, *[NARROWED] * scans):
        places = np.linspace(low, high, count, axis=1)
        values = function(places)
        best = values.argmin(axis=1)[:, None]
        low, high = (np.take_along_axis(places, np.clip(best + k, 0, count - 1), 1)[:, 0] for k in (-1, 1))
    return np.take_along_axis(places, best, 1)[:, 0], np.take_along_axis(values, best, 1)[:, 0]
