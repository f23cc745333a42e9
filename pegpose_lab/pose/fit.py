"""Least squares over the six degrees of freedom of a pose, with analytic derivatives.

A pose is a rotation matrix and a translation here.  Its six numbers are (x, y, z, rotation vector) of a small motion
in the frame that has the axes of the camera and its origin at the object's own: see `moved`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from .discs import DiscImages, Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera

ROUNDS = 10
"""Largest number of rounds, each with new shifts of the images' centres; three are enough near the minimum."""

STEPS = 100
"""Largest number of steps in a round far from the minimum."""

LARGEST_DAMPING = 1e9
"""Of the squared Jacobian's diagonal: a step that is damped more moves nothing; rounding forbids it, not the squares."""

NEAR, SETTLED = 1e-2, 1e-6
"""rad, or parts of the object's size: steps within which Newton's method is safe, and after which none is needed: the
error is squared by each, so that SETTLED leaves about 1e-10."""

SLOWER = 1e-3
"""Share of a step of Newton's method that a step of Levenberg and Marquardt's may have at the end: where two poses fit nearly
alike, its steps shrink so slowly that a thousand of them may be left."""


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

    def images(self, pose: Pose, camera: TsaiCamera | OpenCVCamera | FisheyeCamera) -> DiscImages:
        """What the camera would see; ValueError if a disc has no image."""
        return DiscImages.of(camera, pose, self.centers, self.radii)

    @property
    def size(self) -> float:
        """Largest distance of a centre from the origin, mm."""
        return _size(self.centers)


@dataclass(frozen=True, eq=False)
class Fit:
    """A pose at the minimum.

    Attributes
    ----------
    pose : Pose
    images : DiscImages
    residuals : (n, 2) ndarray
        Projected minus measured centres, px.
    gain : (6, 2 n) ndarray
        Derivative of the pose's six numbers by the measured centres, mm/px and rad/px; infinite where they do not
        determine the pose.
    """

    pose: Pose
    images: DiscImages
    residuals: np.ndarray
    gain: np.ndarray

    def covariance(self, noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """(6, 6) of the pose's six numbers, mm and rad, from those (n, 2, 2) of the measured centres, px^2."""
        if not (np.isfinite(self.gain).all() and np.isfinite(noise).all()):
            return np.diag(np.full(6, np.inf))
        gain = self.gain.reshape(6, -1, 2)
        return np.einsum("ikp,kpq,jkq->ij", gain, noise, gain)


def fit_pose(start: Pose, discs: Discs, camera: TsaiCamera | OpenCVCamera | FisheyeCamera) -> Fit:
    r"""Least squares of the directions to the discs.

    With the shifts s(p) of the images' centres from the images of the discs' centres, the measured centres m, and the
    directions d(p) to the discs' centres, Jacobian J, the minimum is where

    .. math:: J^T (d(p) - n(m - s(p))) = 0

    (n undoes the camera).  ValueError if the discs come to lie behind the camera, or have no image.
    """
    pose, normal, by_measured = approach(start, discs, camera, SETTLED)
    images = discs.images(pose, camera)
    return Fit(pose, images, images.centers - discs.measured, _solved(normal, by_measured))


def approach(
    pose: Pose, discs: Discs, camera: TsaiCamera | OpenCVCamera | FisheyeCamera, settled: float
) -> tuple[Pose, NDArray[np.float64], NDArray[np.float64]]:
    """The pose after a step that is no longer than `settled`, and two matrices from where that began.

    They are J^T W (6, 6) with W, the derivative of what is in parentheses above, and minus J^T times that by the
    measured centres (6, 2 n).  Near the minimum the steps are Newton's; farther away Levenberg and Marquardt's, s held.
    """
    for _ in range(ROUNDS):
        images = discs.images(pose, camera)
        directions, jacobian = _directions(pose, discs.centers)
        target = camera.to_normalized(discs.measured - (images.centers - images.points))
        pulls = np.einsum("nk,nkp->np", directions - target, jacobian)
        by_measured = (np.linalg.inv(images.slopes).transpose(0, 2, 1) @ jacobian).reshape(-1, 6).T
        normal = by_measured @ images.by_pose().reshape(-1, 6)
        arms = discs.centers @ pose.rotation.T
        curvature = _curvature(arms, arms[:, 2] + pose.translation[2], pulls)
        newton = _newton(normal + curvature, pulls.sum(axis=0))
        length = _length(newton, discs.size)
        pose = moved(pose, newton) if length <= NEAR else descend(pose, discs.centers, target, SLOWER * settled)
        if length <= settled:
            break
    return pose, normal, by_measured


def _newton(second, gradient):
    """Newton's step, infinite where the squares curve down: from there it would lead to no minimum."""
    try:
        np.linalg.cholesky(second + second.T)
        return -np.linalg.solve(second, gradient)
    except np.linalg.LinAlgError:
        return np.full(6, np.inf)


def _solved(matrix, right):
    """The solution, infinite where the matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.inf)


def _size(points):
    return float(np.sqrt(np.max(np.sum(points**2, axis=1))))


def _length(step, size):
    return max(np.abs(step[:3]).max() / size, np.abs(step[3:]).max())


def _directions(pose, points):
    """Directions x/z and y/z (n, 2) to points (n, 3), mm, and their derivatives (n, 2, 6) by the pose."""
    arms = points @ pose.rotation.T
    x, y, z = (arms + pose.translation).T
    x, y = x / z, y / z
    a, b, c = (arms / z[:, None]).T
    jacobian = np.zeros((len(points), 2, 6))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1 / z
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -x / z, -y / z
    jacobian[:, 0, 3], jacobian[:, 0, 4], jacobian[:, 0, 5] = -x * b, c + x * a, -b
    jacobian[:, 1, 3], jacobian[:, 1, 4], jacobian[:, 1, 5] = -c - y * b, y * a, a
    return np.column_stack([x, y]), jacobian


def _curvature(arms, depths, pulls):
    """The part (6, 6) of the second derivative of half the residuals' squares that comes from the directions' curvature.

    `pulls` (n, 6) are the points' shares in the first derivative, `arms` the points from the object's origin in axes of
    the camera, `depths` their z in its frame, mm.
    """
    by_depth = np.zeros_like(pulls)  # of ln z
    by_depth[:, 2], by_depth[:, 3], by_depth[:, 4] = 1 / depths, arms[:, 1] / depths, -arms[:, 0] / depths
    mixed = -pulls.T @ by_depth
    turning = pulls[:, :3].T @ arms  # of the second order of a turn
    mixed[3:, 3:] += (turning - np.eye(3) * (turning[0, 0] + turning[1, 1] + turning[2, 2])) / 2
    return mixed + mixed.T


def descend(pose: Pose, points: NDArray[np.float64], target: NDArray[np.float64], settled: float) -> Pose:
    """Levenberg-Marquardt on the directions to `points` (n, 3), mm, that should be `target` (n, 2).

    It ends after a step no longer than `settled`.
    """
    size, damping = _size(points), 0.0
    directions, jacobian = _directions(pose, points)
    residuals, jacobian = (directions - target).ravel(), jacobian.reshape(-1, 6)
    for _ in range(STEPS):
        scale = np.sqrt(np.einsum("rp,rp->p", jacobian, jacobian))
        scaled = jacobian / scale
        try:
            step = -np.linalg.solve(scaled.T @ scaled + damping * np.eye(6), scaled.T @ residuals) / scale
        except np.linalg.LinAlgError:
            step = np.full(6, np.nan)
        trial = moved(pose, step)
        directions, new_jacobian = _directions(trial, points)
        new = (directions - target).ravel()
        if new @ new <= residuals @ residuals:
            pose, residuals, jacobian, damping = trial, new, new_jacobian.reshape(-1, 6), damping / 10
            if _length(step, size) <= settled:
                break
        else:
            damping = max(10 * damping, 1e-3)
            if damping > LARGEST_DAMPING:
                break
    return pose
