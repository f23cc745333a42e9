"""The two poses of a plane: both are fitted, and the likelihood decides."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..flags import Flag
from .discs import Pose
from .fit import NEAR, descend, fit_pose, weights_of_directions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from .fit import Discs, Fit

UNLIKELY = 100.0
"""A pose whose chi squared is larger by this is e^50 times less likely: none that explains the pegs, too."""

CLEAR = 3.0
"""ln of the ratio of likelihoods (of 20 to 1) below which a second pose is flagged."""


def mirrored_fit(fit: Fit, discs: Discs, camera: TsaiCamera | OpenCVCamera | FisheyeCamera) -> Fit | None:
    """The fit of the other pose, tilted the other way; None if there is none that explains the discs, too.

    From far away a plane looks as its mirror image, with its normal n on the other side of the line of sight s:
    n' = 2 (n s) s - n.
    """
    rotation, translation = fit.pose
    sight = translation / np.linalg.norm(translation)
    axis = np.cross(rotation[:, 2], sight)
    sine = np.linalg.norm(axis)
    if sine < NEAR:
        return None
    turn = cv2.Rodrigues(axis / sine * 2 * np.arctan2(sine, rotation[:, 2] @ sight))[0]
    target = camera.to_normalized(discs.measured - (fit.images.centers - fit.images.points))
    start = Pose(turn @ rotation, translation)
    start = descend(start, discs.centers, target, NEAR, weights_of_directions(discs, fit.images))
    if _same(start, fit.pose):
        return None
    try:
        if discs.cost(discs.images(start, camera)) > fit.cost + 2 * UNLIKELY:  # not yet at the minimum
            return None
        other = fit_pose(start, discs, camera)
    except (ValueError, np.linalg.LinAlgError):  # behind the camera
        return None
    return None if _same(other.pose, fit.pose) or other.cost > fit.cost + UNLIKELY else other


def _same(first, second):
    return np.abs(first.rotation - second.rotation).max() < 2 * NEAR


def choose(fits: Sequence[Fit | None], others: Sequence[float]) -> tuple[Fit, Fit | None, float]:
    """The likelier of two fits, the other one, and ln of the ratio of their likelihoods (infinite without the other).

    `others` are the costs of further parts, chi squared.
    """
    first, second = fits
    if second is None:
        return first, None, np.inf
    more = second.cost + others[1] - first.cost - others[0]
    return (first, second, more / 2) if more >= 0 else (second, first, -more / 2)


def flags_of(ratio: float) -> tuple[Flag, ...]:
    """A flag if the likelihoods do not decide clearly; `ratio` as of `choose`."""
    if ratio >= CLEAR:
        return ()
    text = (
        f"Another pose, tilted the other way, is only {np.exp(ratio):.1f} times less likely (`alternative`): give the "
        "plane, or bring the camera closer."
    )
    return (Flag("two-poses", text),)
