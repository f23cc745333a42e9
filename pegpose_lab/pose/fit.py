"""Least squares over the six degrees of freedom of a pose, with analytic derivatives.

A pose is a rotation matrix and a translation here.  Its six numbers are (x, y, z, rotation vector) of a small motion
in the frame that has the axes of the camera and its origin at the object's own: see `moved`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..checks import CalibrationError
from .discs import DiscImages, Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..camera import OpenCVCamera, TsaiCamera

ROUNDS = 10
"""Largest number of rounds, each with new shifts of the images' centres; three are enough near the minimum."""

STEPS = 100
"""Largest number of steps in a round far from the minimum."""

NEAR, SETTLED = 1e-2, 1e-9
"""rad, or parts of the object's size: the steps after which Newton's method is safe, and after which none is needed;
its steps shrink a hundredfold at least, so that what SETTLED leaves is below 1e-11."""


def moved(pose: Pose, step: NDArray[np.float64]) -> Pose:
    """The pose after a step (6,): (x, y, z), mm, and a rotation vector, rad, in axes of the camera.

    The object turns about its own origin and is shifted: a left perturbation in the frame with the axes of the camera
    and its origin at the object's.
    """
    return Pose(cv2.Rodrigues(step[3:])[0] @ pose.rotation, pose.translation + step[:3])


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs of an object: centres (n, 3) and radii (n,), mm, and measured centres of their images (n, 2), px."""

    centers: np.ndarray
    radii: np.ndarray
    measured: np.ndarray

    def images(self, pose: Pose, camera: TsaiCamera | OpenCVCamera) -> DiscImages:
        """What the camera would see; ValueError if a disc has no image."""
        return DiscImages.of(camera, pose, self.centers, self.radii)

    @property
    def size(self) -> float:
        """Largest distance of a centre from the origin, mm."""
        return float(np.sqrt(np.max(np.sum(self.centers**2, axis=1))))


@dataclass(frozen=True, eq=False)
class Fit:
    """A pose at the minimum.

    Attributes
    ----------
    pose : Pose
    residuals : (n, 2) ndarray
        Projected minus measured centres, px.
    gain : (6, 2 n) ndarray
        Derivative of the pose's six numbers by the measured centres, mm/px and rad/px; infinite where they do not
        determine the pose.
    """

    pose: Pose
    residuals: np.ndarray
    gain: np.ndarray

    def covariance(self, noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """(6, 6) of the pose's six numbers, mm and rad, from those (n, 2, 2) of the measured centres, px^2."""
        if not (np.isfinite(self.gain).all() and np.isfinite(noise).all()):
            return np.diag(np.full(6, np.inf))
        gain = self.gain.reshape(6, -1, 2)
        return np.einsum("ikp,kpq,jkq->ij", gain, noise, gain)


def fit_pose(start: Pose, discs: Discs, camera: TsaiCamera | OpenCVCamera, settled: float = SETTLED) -> Fit:
    r"""Least squares of the directions to the discs.

    With the shifts s(p) of the images' centres from the images of the discs' centres, the measured centres m, and the
    directions d(p) to the discs' centres, Jacobian J, the minimum is where

    .. math:: J^T (d(p) - n(m - s(p))) = 0

    (n undoes the camera).  Near it that is solved by Newton's method; farther away by Levenberg and Marquardt's,
    s held.

    Raises
    ------
    CalibrationError
        If the discs come to lie behind the camera, or have no image.
    """
    pose = start
    try:
        for _ in range(ROUNDS):
            images = discs.images(pose, camera)
            directions, jacobian = _directions(pose, discs.centers)
            target = camera.to_normalized(discs.measured - (images.centers - images.points))
            residuals, by_pixel = (directions - target).ravel(), np.linalg.inv(images.slopes)
            normal = jacobian.T @ (by_pixel @ images.by_pose()).reshape(-1, 6)
            newton = _solved(normal + _curvature(pose, discs.centers, residuals), -jacobian.T @ residuals)
            length = _length(newton, discs.size)
            if length <= NEAR:
                pose = moved(pose, newton)
            else:
                pose = descend(pose, discs.centers, target)
            if length <= settled:
                break
        else:
            images = discs.images(pose, camera)
    except ValueError as error:
        raise CalibrationError(
            "no pose puts the hub in front of the camera; check that its pegs are labelled clockwise on the screen"
        ) from error
    by_measured = by_pixel.transpose(0, 2, 1) @ jacobian.reshape(-1, 2, 6)
    gain = _solved(normal, by_measured.reshape(-1, 6).T)
    return Fit(pose, images.centers - discs.measured, gain)


def _solved(matrix, right):
    """The solution, infinite where the matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.inf)


def _length(step, size):
    return max(np.abs(step[:3]).max() / size, np.abs(step[3:]).max())


def _directions(pose, points):
    """Directions x/z and y/z (n, 2) to points (n, 3), mm, and their derivatives (2 n, 6) by the pose."""
    arms = points @ pose.rotation.T
    x, y, z = (arms + pose.translation).T
    x, y = x / z, y / z
    a, b, c = (arms / z[:, None]).T
    jacobian = np.zeros((len(points), 2, 6))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1 / z
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -x / z, -y / z
    jacobian[:, 0, 3], jacobian[:, 0, 4], jacobian[:, 0, 5] = -x * b, c + x * a, -b
    jacobian[:, 1, 3], jacobian[:, 1, 4], jacobian[:, 1, 5] = -c - y * b, y * a, a
    return np.column_stack([x, y]), jacobian.reshape(-1, 6)


def _curvature(pose, points, residuals):
    """The part (6, 6) of the second derivative of half the residuals' squares that comes from directions' curvature."""
    arms = points @ pose.rotation.T
    x, y, z = (arms + pose.translation).T
    pulls = np.empty((len(points), 3))  # derivative by the point, the residuals held
    pulls[:, :2] = residuals.reshape(-1, 2) / z[:, None]
    pulls[:, 2] = -(pulls[:, 0] * x + pulls[:, 1] * y) / z
    by_pose = np.hstack([pulls, np.cross(arms, pulls)])
    depth = np.zeros_like(by_pose)  # derivative of ln z by the pose
    depth[:, 2], depth[:, 3], depth[:, 4] = 1, arms[:, 1], -arms[:, 0]
    mixed = -by_pose.T @ (depth / z[:, None])
    turning = pulls.T @ arms  # of the second order of a turn
    mixed[3:, 3:] += turning / 2 - np.trace(turning) / 2 * np.eye(3)
    return mixed + mixed.T


def descend(pose: Pose, points: NDArray[np.float64], target: NDArray[np.float64]) -> Pose:
    """Levenberg-Marquardt on the directions to `points` (n, 3), mm, that should be `target` (n, 2)."""
    size, damping = float(np.sqrt(np.max(np.sum(points**2, axis=1)))), 0.0
    directions, jacobian = _directions(pose, points)
    residuals = (directions - target).ravel()
    for _ in range(STEPS):
        scale = np.sqrt(np.sum(jacobian**2, axis=0))
        scaled = jacobian / scale
        try:
            step = -np.linalg.solve(scaled.T @ scaled + damping * np.eye(6), scaled.T @ residuals) / scale
        except np.linalg.LinAlgError:
            step = np.full(6, np.nan)
        trial = moved(pose, step)
        directions, new_jacobian = _directions(trial, points)
        new = (directions - target).ravel()
        if new @ new <= residuals @ residuals:
            pose, residuals, jacobian, damping = trial, new, new_jacobian, damping / 10
        else:
            damping = max(10 * damping, 1e-3)
        if _length(step, size) <= NEAR**2 or damping > 1e9:
            break
    return pose
