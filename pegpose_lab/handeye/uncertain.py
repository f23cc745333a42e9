"""Poses with covariances: products and inverses to first order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..checks import as_covariance, as_pose
from ..pose import carried_motion
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
        return cls(as_pose(pose, name), as_covariance(covariance, f"covariance of {name}", infinite=False))

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
        by_self, by_other = carried_motion(turn @ other.pose.translation), np.zeros((6, 6))
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
