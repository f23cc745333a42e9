"""The loop: look, decide whether the part is where it has to be, and move it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from ..checks import CalibrationError, DetectionError, as_count, as_covariance, as_number, as_pose
from .law import correction, remaining

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..pose import HubPose

MOST_BLIND = 3  # frames in a row in which the part may not be found: noise may hide it once, an empty view does not
MOST_LOOKS = (
    8  # frames that are averaged while the part stands still: what a texture does to an edge, no more frames remove
)
NEAR = 0.5  # of the tolerance: where no more may be left, another look gains more than another motion
CLEAR = 2.0  # sigmas: by how much a rest has to be larger to be more than noise
STALLED = 8  # motions without a smaller rest: with gain 0.7 the rest shrinks to a ten-thousandth in them


@dataclass(frozen=True, eq=False)
class ServoRun:
    """How a run of visual servoing went.

    Attributes
    ----------
    outcome : str
        "reached"; or why not: "not-seen" (the part was not found), "too-uncertain" (the pose's own uncertainty, or the goal's,
        is larger than the tolerance allows), "no-progress" (the rest no longer shrinks), "diverging" (it grows beyond twice
        what it was at the start), "steps-used-up".
    reason : str
        The same as a sentence, with numbers.
    poses : tuple of RigidTransform
        cam_from_part as estimated at each place, after each motion: of the last frame there.
    errors : (k, 6) ndarray
        What was left at each place (`remaining`), mm and rad: the mean over its frames.
    covariances : (k, 6, 6) ndarray
        Of `errors`.
    frames : int
        Frames looked at, also those without the part.

    Examples
    --------
    >>> run = ServoRun("reached", "", (), np.array([[3.0, 4.0, 0, 0, 0, 0.01]]), np.zeros((1, 6, 6)), 1)
    >>> run.reached, run.distances.tolist()
    (True, [5.0])
    """

    outcome: str
    reason: str
    poses: tuple[RigidTransform, ...]
    errors: NDArray[np.float64]
    covariances: NDArray[np.float64]
    frames: int

    @property
    def reached(self) -> bool:
        """Whether the part is inside the tolerance, at the confidence that was asked for."""
        return self.outcome == "reached"

    @property
    def distances(self) -> NDArray[np.float64]:
        """Lengths (k,) of the shifts that were left, mm."""
        return np.linalg.norm(self.errors[:, :3], axis=1)

    @property
    def angles(self) -> NDArray[np.float64]:
        """Angles (k,) of the turns that were left, rad."""
        return np.linalg.norm(self.errors[:, 3:], axis=1)


def visual_servo(
    observe: Callable[[], HubPose],
    move: Callable[[RigidTransform], None],
    goal: RigidTransform,
    *,
    goal_covariance: ArrayLike | None = None,
    symmetry: int = 1,
    gain: float = 0.7,
    distance: float = 0.1,
    angle: float = np.deg2rad(0.05),
    confidence: float = 0.95,
    max_steps: int = 40,
) -> ServoRun:
    r"""Move a part until its pose in the image is the wanted one (position-based visual servoing).

    In each frame the rest is :math:`e = (\tau, \omega)` (`remaining`) with the covariance of the pose, and of the goal.  The
    loop stops where the true rest is inside the tolerance with the asked confidence:

    .. math:: |\tau| + q \sqrt{\lambda_{max}(C_\tau)} \le d, \quad |\omega| + q \sqrt{\lambda_{max}(C_\omega)} \le a

    with q the quantile of a chi of three degrees of freedom at (1 + confidence) / 2, so that both hold together.
    Where it is not clear that more than half the tolerance is left, it looks again, up to eight times, and averages;
    else it commands the `correction`.

    Parameters
    ----------
    observe : callable
        Takes an image and returns the part's pose with covariance, such as that of `estimate_pose`.  `DetectionError` and
        `CalibrationError` count as a frame in which the part is not seen.
    move : callable
        Is given a motion in the camera's frame and has the robot make it, as well as it can.
    goal : RigidTransform
        The wanted cam_from_part, the paper's C_T*_P.
    goal_covariance : (6, 6) array_like, optional
        Of the goal, in the order and frame of `HubPose.covariance`.  A goal that was taught by the same camera shares the
        errors of its calibration: these cancel, if poses are estimated with the camera in place of the `Calibration`.
    symmetry : int
        As for `remaining`.
    gain : float
        Share of the rest that a motion is to take.  With an error beta of the hand-eye rotation the loop converges for gains
        below 2 cos(beta).
    distance, angle : float
        The tolerance, mm and rad.
    confidence : float
    max_steps : int

    Returns
    -------
    ServoRun

    Raises
    ------
    ValueError
        If an argument is unusable, or a pose has no covariance.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> places = [RigidTransform.from_components([30.0, 20.0, 420.0], Rotation.from_rotvec([0, 0.1, 0.4]))]
    >>> run = pl.visual_servo(
    ...     observe=lambda: SimpleNamespace(cam_from_hub=places[-1], covariance=1e-8 * np.eye(6)),
    ...     move=lambda motion: places.append(motion * places[-1]),
    ...     goal=RigidTransform.from_translation([0.0, 0.0, 400.0]),
    ... )
    >>> run.outcome, run.distances.round(2).tolist()
    ('reached', [41.23, 12.37, 3.71, 1.11, 0.33, 0.1, 0.03])
    """
    goal = as_pose(goal, "goal")
    limits = np.array(
        [as_number(distance, "distance", 0, exclusive=True), as_number(angle, "angle", 0, exclusive=True)]
    )
    confidence = as_number(confidence, "confidence", 0, 1, exclusive=True)
    quantile = float(np.sqrt(chi2.ppf((1 + confidence) / 2, 3)))
    taught = np.zeros((6, 6)) if goal_covariance is None else as_covariance(goal_covariance, "goal_covariance")
    max_steps, poses, places, frames = as_count(max_steps, "max_steps", 1), [], [], 0
    while True:
        try:
            place, looks = _looked(observe, goal, symmetry, taught, quantile, limits)
        except _NotSeenError as error:
            ended, frames = ("not-seen", str(error)), frames + error.frames
            break
        frames += looks
        poses.append(place.pose)
        places.append(place)
        ended = _ended(places, quantile, limits)
        if ended is None and len(places) > max_steps:
            ended = "steps-used-up", f"after {max_steps} steps {place} are left; allow more steps or a larger gain"
        if ended is not None:
            break
        move(correction(place.pose, place.error, gain))
    errors, covariances = [place.error for place in places], [place.covariance for place in places]
    return ServoRun(*ended, tuple(poses), np.reshape(errors, (-1, 6)), np.reshape(covariances, (-1, 6, 6)), frames)


# ---- looking ----


@dataclass(frozen=True, eq=False)
class _Place:
    """What is known of the rest at one place: the last pose, the rest and its covariance."""

    pose: RigidTransform
    error: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @property
    def rest(self):
        """Lengths (2,) of shift and turn, mm and rad."""
        return np.array([np.linalg.norm(self.error[:3]), np.linalg.norm(self.error[3:])])

    @property
    def unsure(self):
        """Largest standard deviations (2,) of shift and turn."""
        blocks = self.covariance[:3, :3], self.covariance[3:, 3:]
        return np.array([np.sqrt(np.linalg.eigvalsh(b)[-1]) if np.isfinite(b).all() else np.inf for b in blocks])

    def is_inside(self, quantile, limits):
        """Whether the true rest is inside the tolerance, with the confidence of the quantile."""
        return bool((self.rest + quantile * self.unsure <= limits).all())

    def may_be_near(self, limits):
        """Whether it is not clear that more than half the tolerance is left."""
        return bool((self.rest - CLEAR * self.unsure <= NEAR * limits).all())

    def __str__(self):
        return f"{self.rest[0]:.3g} mm and {np.rad2deg(self.rest[1]):.3g} deg"


class _NotSeenError(Exception):
    """The part was not found in `frames` frames in a row."""

    def __init__(self, frames, reason):
        super().__init__(f"the part was not found in {MOST_BLIND} frames: {reason}")
        self.frames = frames


def _looked(observe, goal, symmetry, taught, quantile, limits):
    """The part at its place, looked at until it is sure to be inside, or clearly is not; and how many frames that took."""
    errors, covariances, frames = [], [], 0
    for _ in range(MOST_LOOKS):
        pose, tried = _found(observe, frames)
        frames += tried
        errors.append(remaining(pose.cam_from_hub, goal, symmetry))
        covariances.append(_covariance_of(pose))
        covariance = np.mean(covariances, axis=0) / len(covariances) + taught
        place = _Place(pose.cam_from_hub, np.mean(errors, axis=0), covariance)
        if place.is_inside(quantile, limits) or not place.may_be_near(limits):
            break
    return place, frames


def _found(observe, before):
    """The pose in the first frame that shows the part, and how many frames that took."""
    for tried in range(1, MOST_BLIND + 1):
        try:
            return _as_pose(observe()), tried
        except (DetectionError, CalibrationError) as error:
            reason = str(error)
    raise _NotSeenError(before + MOST_BLIND, reason)


def _as_pose(pose):
    if not hasattr(pose, "cam_from_hub"):
        raise ValueError(f"observe returned {type(pose).__name__}; expected a HubPose, or a DetectionError raised")
    return pose


def _covariance_of(pose):
    """The pose's covariance; without bound where another pose, tilted the other way, explains the image, too."""
    if getattr(pose, "covariance", None) is None:
        raise ValueError("observe returned a pose without a covariance; expected one from pegs measured with sigmas")
    if any(flag.code == "two-poses" for flag in getattr(pose, "flags", ())):
        return np.diag(np.full(6, np.inf))
    return as_covariance(pose.covariance, "covariance of the observed pose")


# ---- deciding ----


def _ended(places, quantile, limits):
    """Outcome and reason if the run ends at the last place, else None."""
    place = places[-1]
    if place.is_inside(quantile, limits):
        return "reached", f"{place} are left"
    unsure = place.unsure
    if place.may_be_near(limits) and (quantile * unsure > (1 - NEAR) * limits).any():
        return "too-uncertain", (
            f"pose and goal are known to {unsure[0]:.3g} mm and {np.rad2deg(unsure[1]):.3g} deg (sigma), too coarse for a "
            f"tolerance of {limits[0]:g} mm and {np.rad2deg(limits[1]):g} deg; move the camera nearer, teach the goal with "
            "more frames, or allow more"
        )
    size = np.array([(place.rest / limits).max() for place in places])
    if size[-1] > 2 * size[0] and len(size) > 2:
        grown = f"the rest grew from {places[0]} to {place}"
        return "diverging", f"{grown}; lower the gain, or check the hand-eye transform"
    if len(size) > STALLED and size[-STALLED:].min() >= size[:-STALLED].min():
        scatter = np.sqrt(np.mean([place.rest**2 for place in places[-STALLED:]], axis=0))
        return "no-progress", (
            f"the rest stays at {scatter[0]:.3g} mm and {np.rad2deg(scatter[1]):.3g} deg (rms of {STALLED} motions): the robot "
            "does not repeat its motions well enough, or its hand-eye transform is far off; allow more, or lower the gain"
        )
    return None
