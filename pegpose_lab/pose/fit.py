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
    """Discs of an object: centres (n, 3) and radii (n,), mm; measured centres (n, 2) and radii (n,) of their images, px;
    and the information (n, 3, 3) about these three numbers, px^-2: the inverse of their covariance, 0 for a radius that
    is not to be used."""

    centers: np.ndarray
    radii: np.ndarray
    measured: np.ndarray
    measured_radii: np.ndarray
    information: np.ndarray

    def images(self, pose: Pose, camera: TsaiCamera | OpenCVCamera | FisheyeCamera) -> DiscImages:
        """What the camera would see; ValueError if a disc has no image."""
        return DiscImages.of(camera, pose, self.centers, self.radii)

    def residuals(self, images: DiscImages) -> NDArray[np.float64]:
        """Projected minus measured (n, 3): centres and radii, px."""
        return np.column_stack([images.centers - self.measured, images.radii - self.measured_radii])

    def cost(self, images: DiscImages) -> float:
        """Chi squared: the residuals' squares in units of their variances."""
        residuals = self.residuals(images)
        return float(np.einsum("nk,nkl,nl->", residuals, self.information, residuals))

    def chosen(self, rows: NDArray[np.bool_]) -> Discs:
        """Some of them."""
        return Discs(*(values[rows] for values in vars(self).values()))

    def joined(self, others: Discs) -> Discs:
        """These and others, the centres of all with the same information, 1 px^-2."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        *values, information = (np.concatenate(pair) for pair in pairs)
        return Discs(*values, np.tile(np.diag([1.0, 1.0, 0.0]), (len(information), 1, 1)))

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
    cost : float
        Chi squared.
    gain : (6, n, 3) ndarray
        Derivative of the pose's six numbers by the measured centres and radii, mm/px and rad/px; infinite where they do
        not determine the pose.
    """

    pose: Pose
    images: DiscImages
    cost: float
    gain: np.ndarray

    def covariance(self, noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """(6, 6) of the pose's six numbers, mm and rad, from those (n, 3, 3) of the measured centres and radii, px^2."""
        if not np.isfinite(self.gain).all():
            return np.diag(np.full(6, np.inf))
        return np.einsum("ikp,kpq,jkq->ij", self.gain, noise, self.gain)


def fit_pose(start: Pose, discs: Discs, camera: TsaiCamera | OpenCVCamera | FisheyeCamera) -> Fit:
    r"""Weighted least squares of the discs' images over the pose: maximum likelihood if the noise is normal.

    With the centres and radii m(p) of the images, those measured, m, and their information W, it minimises

    .. math:: \chi^2 = \sum_k (m_k(p) - m_k)^T W_k (m_k(p) - m_k).

    ValueError if the discs come to lie behind the camera, or have no image.
    """
    pose, normal, weighted = approach(start, discs, camera, SETTLED)
    images = discs.images(pose, camera)
    gain = _solved(normal, weighted.reshape(-1, 6).T)
    return Fit(pose, images, discs.cost(images), gain.reshape(6, -1, 3))


def fit_in_plane(
    start: Pose, discs: Discs, camera: TsaiCamera | OpenCVCamera | FisheyeCamera, frame: NDArray[np.float64]
) -> Fit:
    """The same over x, y and a turn about z of a plane whose axes are the columns of `frame` (3, 3), in the camera's."""
    motion = np.zeros((6, 3))
    motion[:3, :2], motion[3:, 2] = frame[:, :2], frame[:, 2]
    pose = start
    for _ in range(ROUNDS):
        images = discs.images(pose, camera)
        by_motion = images.by_pose() @ motion
        weighted = discs.information @ by_motion
        normal = np.einsum("nkp,nkq->pq", by_motion, weighted)
        gradient = np.einsum("nk,nkp->p", discs.residuals(images), weighted)
        step = motion @ -_solved(normal, gradient)
        if not np.isfinite(step).all():
            break
        pose = moved(pose, step)
        if _length(step, discs.size) <= SETTLED:
            break
    images = discs.images(pose, camera)
    gain = motion @ _solved(normal, weighted.reshape(-1, 3).T)
    return Fit(pose, images, discs.cost(images), gain.reshape(6, -1, 3))


def approach(
    pose: Pose, discs: Discs, camera: TsaiCamera | OpenCVCamera | FisheyeCamera, settled: float
) -> tuple[Pose, NDArray[np.float64], NDArray[np.float64]]:
    """The pose after a step that is no longer than `settled`, and two arrays from where that began.

    They are the normal matrix (6, 6) and the weighted derivatives (n, 3, 6) of the measured numbers.  Near the minimum
    the steps are Newton's; farther away Levenberg and Marquardt's on the directions to the discs' centres, while the
    shifts of the images' centres are held.
    """
    for _ in range(ROUNDS):
        images = discs.images(pose, camera)
        by_pose, residuals = images.by_pose(), discs.residuals(images)
        weighted = discs.information @ by_pose
        normal = by_pose.reshape(-1, 6).T @ weighted.reshape(-1, 6)
        gradient = np.einsum("nk,nkp->p", residuals, weighted)
        pulls = np.einsum("nk,nkl->nl", residuals, discs.information)[:, None, :2] @ images.slopes
        pulls = (pulls @ _directions(pose, discs.centers)[1])[:, 0]
        arms = discs.centers @ pose.rotation.T
        newton = _newton(normal + _curvature(arms, arms[:, 2] + pose.translation[2], pulls), gradient)
        length = _length(newton, discs.size)
        if length <= NEAR:
            pose = moved(pose, newton)
        else:
            target = camera.to_normalized(discs.measured - (images.centers - images.points))
            pose = descend(pose, discs.centers, target, SLOWER * settled, weights_of_directions(discs, images))
        if length <= settled:
            break
    return pose, normal, weighted


def weights_of_directions(discs: Discs, images: DiscImages) -> NDArray[np.float64]:
    """Matrices (n, 2, 2) that weigh the directions to the discs: their squares are the information about these, 1."""
    information = images.slopes.transpose(0, 2, 1) @ discs.information[:, :2, :2] @ images.slopes
    return np.linalg.cholesky(information).transpose(0, 2, 1)


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


def descend(
    pose: Pose,
    points: NDArray[np.float64],
    target: NDArray[np.float64],
    settled: float,
    roots: NDArray[np.float64] | None = None,
) -> Pose:
    """Levenberg-Marquardt on the directions to `points` (n, 3), mm, that should be `target` (n, 2).

    `roots` (n, 2, 2) multiply the residuals; by default all count alike.  It ends after a step no longer than `settled`.
    """
    roots = np.eye(2) if roots is None else roots
    size, damping = _size(points), 0.0

    def weighted(pose):
        directions, jacobian = _directions(pose, points)
        return (roots @ (directions - target)[..., None]).ravel(), (roots @ jacobian).reshape(-1, 6)

    residuals, jacobian = weighted(pose)
    for _ in range(STEPS):
        scale = np.sqrt(np.einsum("rp,rp->p", jacobian, jacobian))
        scaled = jacobian / scale
        try:
            step = -np.linalg.solve(scaled.T @ scaled + damping * np.eye(6), scaled.T @ residuals) / scale
        except np.linalg.LinAlgError:
            step = np.full(6, np.nan)
        trial = moved(pose, step)
        new, new_jacobian = weighted(trial)
        if new @ new <= residuals @ residuals:
            pose, residuals, jacobian, damping = trial, new, new_jacobian, damping / 10
            if _length(step, size) <= settled:
                break
        else:
            damping = max(10 * damping, 1e-3)
            if damping > LARGEST_DAMPING:
                break
    return pose
