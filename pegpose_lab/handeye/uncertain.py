"""Poses with covariances: products and inverses to first order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..checks import as_pose
from .adjust import cross

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class UncertainPose:
    r"""A pose a_from_b with the covariance of a left perturbation in the axes of frame a, at the origin of b.

    The true pose is :math:`(\exp(\omega) R,\; t + \tau)`, with covariance in the order (x, y, z, rotation vector).

    Attributes
    ----------
    pose : RigidTransform
        mm.
    covariance : (6, 6) ndarray
        mm and rad.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.spatial.transform import RigidTransform
    >>> from pegpose_lab.handeye import UncertainPose
    >>> turning = UncertainPose(RigidTransform.identity(), np.diag([0, 0, 0, 0, 0, 1e-6]))  # 1 mrad about z
    >>> arm = UncertainPose.exact(RigidTransform.from_translation([500.0, 0.0, 0.0]))
    >>> (turning * arm).sigmas.round(4).tolist()  # 0.5 mm sideways at the end of 500 mm
    [0.0, 0.5, 0.0, 0.0, 0.0, 0.001]
    """

    pose: RigidTransform
    covariance: NDArray[np.float64]

    @classmethod
    def checked(cls, pose: RigidTransform, covariance: ArrayLike, name: str = "pose") -> UncertainPose:
        """The pose with a covariance that is (6, 6), finite, symmetric and not negative; ValueError otherwise."""
        covariance = np.array(covariance, np.float64)
        if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
            raise ValueError(f"covariance of {name} has shape {covariance.shape}; expected (6, 6), finite")
        size = np.sqrt(np.abs(np.diag(covariance)))
        scaled = covariance / np.outer(*[np.where(size > 0, size, 1.0)] * 2)
        if not np.allclose(scaled, scaled.T, atol=1e-6) or np.linalg.eigvalsh(scaled)[0] < -1e-6:
            raise ValueError(
                f"covariance of {name} is not one: expected a symmetric matrix without negative eigenvalues"
            )
        return cls(as_pose(pose, name), covariance)

    @classmethod
    def exact(cls, pose: RigidTransform) -> UncertainPose:
        """A pose without error."""
        return cls(as_pose(pose, "pose"), np.zeros((6, 6)))

    @property
    def sigmas(self) -> NDArray[np.float64]:
        """Standard deviations (6,), mm and rad."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0))

    def __mul__(self, other: UncertainPose) -> UncertainPose:
        """a_from_b times b_from_c, whose errors are independent."""
        turn = self.pose.rotation.as_matrix()
        by_self, by_other = np.eye(6), np.zeros((6, 6))
        by_self[:3, 3:] = -cross(turn @ other.pose.translation)
        by_other[:3, :3] = by_other[3:, 3:] = turn
        covariance = by_self @ self.covariance @ by_self.T + by_other @ other.covariance @ by_other.T
        return UncertainPose(self.pose * other.pose, covariance)

    def inv(self) -> UncertainPose:
        """b_from_a."""
        back = self.pose.rotation.as_matrix().T
        change = np.zeros((6, 6))
        change[:3, :3] = change[3:, 3:] = -back
        change[:3, 3:] = -back @ cross(self.pose.translation)
        return UncertainPose(self.pose.inv(), change @ self.covariance @ change.T)
