"""Whether a wheel will go on: the pose's uncertainty, carried through the geometry of the insertion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from ..checks import CalibrationError, as_number, as_pose
from .causes import causes_of, offset_derivatives, root_of
from .entry import MEETINGS, meeting_numbers
from .leading import led_in
from .sections import reaches
from .wheel import Wheel, as_pair

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..flags import Flag
    from ..pose import HubPose
    from ..targets import Hub

REPLICATES = 8  # of the point set, each shifted at random: their scatter is the integral's error
POINTS = 512  # of a replicate, a power of two: with 8 of them 4 errors in 4096 lie beyond a 99.9 % clearance


@dataclass(frozen=True, eq=False)
class AssemblyForecast:
    """What is to be expected of an insertion.

    Attributes
    ----------
    probabilities, standard_errors : dict of float
        Of each outcome, "free", "wall", "chamfer" and "blocked" (see `Entry`), and the standard error of the integration.
    limiting_peg : int
        The peg, counted from 1, that most often needs the largest clearance.
    limiting_shares : (n,) ndarray
        How often each peg does.
    free_clearance, free_clearance_error : float
        Clearance, mm, with which 99.9 % (or `quantile`) of the insertions meet nothing, and its standard error.
    entry_clearance : float
        The same for insertions in which every peg comes into the mouth of its hole on a straight path; 0 if the chamfer
        alone is wide enough.
    variance : float
        Mean squared offset, mm^2, of the limiting peg's top from the place in its hole that the plan puts it at.
    shares : dict of float
        The parts of `variance` that each cause adds, mm^2: those of the pose's `budget`, "hand-eye", "robot" and "holes".
    flags : tuple of Flag
        Those of the pose: the forecast is that of the pose as given.

    Examples
    --------
    See `assembly_forecast`; what a result says by itself:

    >>> rates = {"free": 0.9, "wall": 0.05, "chamfer": 0.04, "blocked": 0.01}
    >>> AssemblyForecast(rates, {}, 1, np.ones(4) / 4, 0.6, 0.01, 0.0, 0.02, {"discs": 0.02}).enters
    0.99
    """

    probabilities: dict[str, float]
    standard_errors: dict[str, float]
    limiting_peg: int
    limiting_shares: np.ndarray
    free_clearance: float
    free_clearance_error: float
    entry_clearance: float
    variance: float
    shares: dict[str, float]
    flags: tuple[Flag, ...] = ()

    @property
    def enters(self) -> float:
        """Probability that every peg comes into its hole, by itself or led by the chamfer."""
        return 1.0 - self.probabilities["blocked"]


def assembly_forecast(
    pose: HubPose,
    hub: Hub,
    wheel: Wheel,
    *,
    hand_eye_covariance: ArrayLike | None = None,
    robot_repeatability: float = 0.0,
    hub_from_wheel: RigidTransform | None = None,
    quantile: float = 0.999,
    rng: int | np.random.Generator | None = 0,
) -> AssemblyForecast:
    r"""Forecast the insertion of a wheel that a robot places to an estimated pose of the hub.

    The robot brings the wheel to the planned pose over the estimated hub and moves it along the wheel's axis.  The error of
    the wheel's pose is a normal variable of six dimensions with the sum of the covariances of pose, hand-eye transform and
    robot; the holes' errors come on top.  The probability of an outcome is its integral over them:

    .. math:: P = \int 1[\text{outcome}(e)] \, N(e; 0, C) \, de

    by quasi-Monte Carlo: `REPLICATES` Sobol sets, each shifted at random, in which the outcome is exact (`peg_entry`).

    Parameters
    ----------
    pose : HubPose
        With a covariance.
    hub, wheel : Hub, Wheel
    hand_eye_covariance : (6, 6) array_like, optional
        Of the camera's pose in the robot's frame, in the order of `HubPose.covariance`, mm and rad: a left perturbation in
        axes of the camera at the camera's centre.  The lever arm to the hub is allowed for.
    robot_repeatability : float
        Pose repeatability RP of ISO 9283, mm, as in the robot's data sheet.
    hub_from_wheel : RigidTransform, optional
        The plan: of the wheel with its face at the plane of the peg tops; the identity by default.
    quantile : float
        Of the clearances.
    rng : int, Generator or None
        Of the random shifts.

    Returns
    -------
    AssemblyForecast

    Raises
    ------
    ValueError
        If an argument is unusable, or the wheel does not belong to the hub.
    CalibrationError
        If the pose has no covariance, or an infinite one.

    References
    ----------
    R. Cranley and T. N. L. Patterson, "Randomization of number theoretic methods for multiple integration", SIAM Journal on
    Numerical Analysis 13(6), 1976.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from scipy.spatial.transform import RigidTransform
    >>> import pegpose_lab as pl
    >>> cam_from_hub = RigidTransform.from_translation([0.0, 0.0, 500.0])
    >>> spread = np.diag([0.1, 0.1, 0.5, 0.002, 0.002, 0.001]) ** 2  # of an estimate; see `estimate_pose`
    >>> pose = SimpleNamespace(cam_from_hub=cam_from_hub, covariance=spread, budget={"discs": spread}, flags=())
    >>> forecast = pl.assembly_forecast(pose, pl.Hub(), pl.Wheel(clearance=0.4), robot_repeatability=0.05)
    >>> round(forecast.probabilities["free"], 2), round(forecast.enters, 3)
    (0.99, 1.0)
    >>> bool(0.4 < forecast.free_clearance < 0.55)  # mm, for 99.9 %
    True
    """
    as_pair(hub, wheel)
    quantile = as_number(quantile, "quantile", 0, 1, exclusive=True)
    if hub_from_wheel is not None:
        as_pose(hub_from_wheel, "hub_from_wheel")
    causes = causes_of(pose, hand_eye_covariance, robot_repeatability)
    total = np.sum(list(causes.values()), axis=0)
    if not np.isfinite(total).all():
        raise CalibrationError("the pose is undetermined: its covariance is infinite; measure more pegs")
    normals, disc = _points(hub.n_pegs if wheel.position_tolerance else 0, np.random.default_rng(rng))
    holes = wheel.hole_centers + wheel.position_tolerance / 2 * disc
    tops, axes = placed(normals @ root_of(total).T, hub, hub_from_wheel)
    top, mouth = reaches(tops, axes, holes, hub, wheel)

    radius = hub.peg_radius + wheel.clearance
    numbers = meeting_numbers(radius - top, radius - mouth, wheel.chamfer).max(axis=1)
    shut = numbers == len(MEETINGS) - 1
    at_holes = np.broadcast_to(holes, (len(tops), *holes.shape[-2:]))
    numbers[shut] -= led_in(tops[shut], axes[shut], at_holes[shut], top[shut], hub, wheel)
    numbers = numbers.reshape(REPLICATES, POINTS)
    rates = np.stack([(numbers == k).mean(axis=1) for k in range(len(MEETINGS))])
    errors = rates.std(axis=1, ddof=1) / np.sqrt(REPLICATES)
    needed = np.maximum(top, mouth) - hub.peg_radius  # clearances, mm
    frees = np.quantile(needed.max(axis=1).reshape(REPLICATES, POINTS), quantile, axis=1)
    limiting = np.bincount(needed.argmax(axis=1), minlength=hub.n_pegs) / len(needed)
    peg = int(limiting.argmax())
    derivative = offset_derivatives(hub, hub_from_wheel)[peg]
    shares = {cause: float(np.trace(derivative @ cov @ derivative.T)) for cause, cov in causes.items()}
    if wheel.position_tolerance:
        shares["holes"] = wheel.position_tolerance**2 / 8  # both axes of a uniform disc
    planned, _ = placed(np.zeros((1, 6)), hub, hub_from_wheel)
    moved = tops[:, peg, :2] - planned[:, peg, :2] - (holes - wheel.hole_centers)[..., peg, :]
    return AssemblyForecast(
        probabilities=dict(zip(MEETINGS, rates.mean(axis=1).tolist(), strict=True)),
        standard_errors=dict(zip(MEETINGS, errors.tolist(), strict=True)),
        limiting_peg=peg + 1,
        limiting_shares=limiting,
        free_clearance=max(float(np.quantile(needed.max(axis=1), quantile)), 0.0),
        free_clearance_error=float(frees.std(ddof=1) / np.sqrt(REPLICATES)),
        entry_clearance=max(float(np.quantile(top.max(axis=1), quantile)) - hub.peg_radius - wheel.chamfer, 0.0),
        variance=float(np.mean(np.sum(moved**2, axis=1))),
        shares=shares,
        flags=tuple(pose.flags),
    )


def placed(
    errors: NDArray[np.float64], hub: Hub, hub_from_wheel: RigidTransform | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pegs' tops (m, n, 3), mm, and axes (m, 3) in the frame of a wheel that stands at the planned pose.

    `errors` (m, 6), mm and rad in axes of the hub, take the hub from where it is believed to be to where it is.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> tops, axes = placed(np.array([[0.5, 0, 0, 0, 0, 0]]), pl.Hub(pitch_circle_diameter=100.0), None)
    >>> tops[0, 0].tolist(), axes.tolist()
    ([50.5, 0.0, 0.0], [[0.0, 0.0, 1.0]])
    """
    turns = _rotations(errors[:, 3:])
    tops = hub.peg_centers @ turns.transpose(0, 2, 1) + errors[:, None, :3]
    axes = turns[:, :, 2]
    if hub_from_wheel is not None:
        inverse = hub_from_wheel.inv()
        turn = inverse.rotation.as_matrix()
        tops, axes = tops @ turn.T + inverse.translation, axes @ turn.T
    return tops, axes


def _rotations(vectors):
    """Rotation matrices (m, 3, 3) of rotation vectors (m, 3): 1 + sin t [k] + (1 - cos t) [k]^2."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    half = np.sinc(angle / (2 * np.pi))  # of sin(t/2)/(t/2)
    return np.eye(3) + np.sinc(angle / np.pi) * cross + half**2 / 2 * (cross @ cross)


@lru_cache(maxsize=4)
def _sobol(dimension):
    """The first `POINTS` of the Sobol sequence (POINTS, dimension) in the unit cube."""
    return qmc.Sobol(dimension, scramble=False).random(POINTS)


def _points(n_holes, rng):
    """Standard normals (m, 6) and points of the unit disc (m, n_holes, 2), or 0.0 without holes, m = REPLICATES POINTS."""
    dimension = 6 + 2 * n_holes
    cube = (_sobol(dimension) + rng.random((REPLICATES, 1, dimension))) % 1.0
    cube = np.clip(cube.reshape(-1, dimension), np.finfo(float).eps, 1 - np.finfo(float).eps)
    if not n_holes:
        return ndtri(cube), 0.0
    length, turn = np.sqrt(cube[:, 6::2]), 2 * np.pi * cube[:, 7::2]
    return ndtri(cube[:, :6]), length[..., None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
