"""Do the poses determine the camera at all, and are they pairs in one convention?  What is wrong, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..checks import CalibrationError
from ..flags import Flag
from .pairs import Pairs
from .start import Solution, closed_rotations, closed_solution, rotation_misfit, translation_misfit

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEAST_TURN = 0.01
"""rad, rms turn between two poses about the second axis: less is within a few errors of a measured rotation (0.1 deg)."""
LITTLE_TURN = 0.1
"""rad: with less turn about the second axis, an error of a position counts ten times in the translation."""
MISFIT = 0.25
"""Rms misfit over the rms motion: right pairs are at some hundredths, wrong ones at a half or more."""
FITS = 0.1
"""The same ratio at which another reading of the poses is said to explain them."""
FITS_BETTER = 0.25
"""Misfit of another reading over that of the poses as given: with small turns a swapped convention hides in the misfit."""
MOST_SCALE = 3.0
"""No target is wrong by such a factor; a unit is."""
UNITS = ((1000.0, "m", "mm"), (100.0, "m", "cm"), (10.0, "cm", "mm"), (25.4, "inches", "mm"))
SMALL = 10.0
"""mm: no arm's or camera's distances are all below; in metres all are."""


def demand_in_front(pairs: Pairs, point: NDArray[np.float64]) -> None:
    """Raise ValueError if the target's working point is not in front of the camera in each pose."""
    behind = np.flatnonzero((pairs.b_turns @ point + pairs.b_shifts)[:, 2] <= 0)
    if len(behind):
        raise ValueError(
            f"cam_from_target has the target behind the camera in {len(behind)} of {len(pairs)} poses, first in pose "
            f"{behind[0]}; expected z > 0: are the poses target_from_cam, or is the camera's z axis backward?"
        )


def turns_about_axes(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rms turns (3,) between any two of the rotations (n, 3, 3), about the axes of their scatter, rad, largest first."""
    first, second = np.triu_indices(len(turns), 1)
    between = Rotation.from_matrix(turns[first].transpose(0, 2, 1) @ turns[second])
    vectors = 2 * between.as_quat(canonical=True)[:, :3]
    return np.linalg.svd(vectors / np.sqrt(len(vectors)), compute_uv=False)


def demand_turns(pairs: Pairs) -> list[Flag]:
    """Flags on the robot's turns; CalibrationError if they leave a direction free."""
    turns = turns_about_axes(pairs.a_turns)
    first, second = np.rad2deg(turns[:2])
    if turns[0] < LEAST_TURN:
        raise CalibrationError(
            f"pure translation: the end effector turns by {first:.2g} deg only, and the position of the camera depends on "
            "turns; add poses that are turned by 20 deg and more about two axes"
        )
    if turns[1] < LEAST_TURN:
        raise CalibrationError(
            f"parallel axes: the end effector turns about one axis ({first:.3g} deg, and {second:.2g} deg about others), "
            "along which the camera could be anywhere; add turns of 20 deg and more about another axis"
        )
    if turns[1] < LITTLE_TURN:
        text = (
            f"The end effector turns mostly about one axis ({first:.3g} deg) and by {second:.2g} deg about others: the "
            "camera's position along that axis is weak; add turns about another axis."
        )
        return [Flag("little-turn", text)]
    return []


def misfits(pairs: Pairs) -> tuple[float, float, Solution]:
    """Misfit over motion, of rotations and of translations with a free scale, and the closed solution."""
    turns = closed_rotations(pairs)
    solution = closed_solution(pairs, *turns, True)
    size = np.linalg.norm(turns_about_axes(pairs.b_turns))
    spread = np.sqrt(np.mean(np.sum((pairs.a_shifts - pairs.a_shifts.mean(axis=0)) ** 2, axis=1)))
    spread = max(spread, 1e-12 * max(float(np.abs(pairs.a_shifts).max()), 1e-300))
    return rotation_misfit(pairs, *turns) / max(size, 1e-12), translation_misfit(pairs, solution) / spread, solution


def demand_pairs(robot: RigidTransform, target: RigidTransform, setup: str) -> None:
    """Raise CalibrationError if the poses do not fit each other: a swapped convention, shuffled pairs, or units."""
    turn, shift, solution = misfits(Pairs.stacked(robot, target, setup))
    misfit, reading = _best_other_reading(robot, target, setup)
    explained = misfit < min(FITS, FITS_BETTER * max(turn, shift))
    if max(turn, shift) > MISFIT or explained or solution.scale <= 0:
        hint = reading if explained else "check that pose k of both lists is of one moment (not shuffled), in radians"
        raise CalibrationError(
            f"the poses do not fit each other: {100 * turn:.2g} % of the rotation and {100 * shift:.2g} % of the translation "
            f"between poses is left unexplained; {hint}"
        )
    if not 1 / MOST_SCALE < solution.scale < MOST_SCALE:
        raise CalibrationError(
            f"units: the robot's translations are {solution.scale:.4g} times those of the camera; {_unit(solution.scale)}"
        )


def _best_other_reading(robot, target, setup):
    """The misfit (of rotations or translations, the larger) of what is often mistaken for the poses, and its name."""
    order, other = np.arange(len(robot)), "eye-in-hand" if setup == "eye-to-hand" else "eye-to-hand"
    readings = (
        (f"they fit as {other}, or with robot_from_end_effector inverted", robot.inv(), target),
        ("they fit with cam_from_target inverted: it is target_from_cam", robot, target.inv()),
        ("they fit with the rotations of robot_from_end_effector transposed", _transposed(robot), target),
        ("they fit with the rotations of cam_from_target transposed", robot, _transposed(target)),
        ("they fit with all rotations transposed", _transposed(robot), _transposed(target)),
        ("they fit with cam_from_target one place later", robot, target[np.roll(order, 1)]),
        ("they fit with cam_from_target one place earlier", robot, target[np.roll(order, -1)]),
        ("they fit with cam_from_target in reverse order", robot, target[order[::-1]]),
    )
    return min((max(misfits(Pairs.stacked(a, b, setup))[:2]), text) for text, a, b in readings)


def _transposed(poses):
    return RigidTransform.from_components(poses.translation, poses.rotation.inv())


def _unit(scale):
    """Which units explain the ratio of the robot's translations to the camera's."""
    for factor, large, small in UNITS:
        for ratio, robot, camera in ((factor, small, large), (1 / factor, large, small)):
            if abs(np.log(scale / ratio)) < 0.05:
                return f"are the robot's in {robot} and the camera's in {camera}? both are expected in mm"
    return "both are expected in mm"


def length_flags(pairs: Pairs) -> list[Flag]:
    """A flag if all translations are so small that they must be metres."""
    for name, shifts in (("robot_from_end_effector", pairs.a_shifts), ("cam_from_target", pairs.b_shifts)):
        longest = np.linalg.norm(shifts, axis=1).max()
        if longest < SMALL:
            text = f"All translations of {name} are below {longest:.2g}: are they in metres? mm are expected."
            return [Flag("small-lengths", text)]
    return []
