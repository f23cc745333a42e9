r"""How well a calibration projects: the uncertainty of the image of a point that is fixed in front of the camera.

The sigmas of f and the principal point do not answer that, because the camera frame of a calibration is itself
uncertain: a shift of the principal point is nearly a turn of the camera, and the poses of the boards turn with it.  So
the point is held by the boards.  It is taken to each board's frame with the calibrated pose, and back with another
possible pose; the mean over the views is projected with the other possible lens.  With a rotation vector
:math:`w_v` and a shift :math:`t'_v` of the pose of view v at :math:`t_v`, a point p in the camera frame moves by

.. math:: \delta p = \frac{1}{V} \sum_v \left( w_v \times (p - t_v) + t'_v \right) = \bar w \times p + \bar s,
    \qquad \bar s = \frac{1}{V} \sum_v (t'_v + t_v \times w_v),

which is one small rigid motion of the camera, the common motion of the poses, and its image moves by
:math:`\delta q = J_\theta \delta\theta + J_p \delta p`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..camera import by_direction, by_turn, lens_covariance, lens_derivative
from ..checks import as_choice, as_number, as_points, undetermined_if_singular
from .image_map import COLUMNS, ImageMap, image_grid
from .result import pose_names

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from .result import Calibration


@dataclass(frozen=True, eq=False)
class ProjectionUncertainty:
    """The uncertainty of projection at points of the image (`projection_uncertainty`).

    Attributes
    ----------
    image_points : (n, 2) ndarray
        px.
    distance : float
        mm from the camera, along the rays; may be infinite.
    covariances : (n, 2, 2) ndarray
        Of the image point, px^2.
    ray_covariances : (n, 2, 2) ndarray
        The same as angles of the viewing ray, rad^2: the first axis is the one nearest to the camera's x, the second
        nearest to y, both perpendicular to the ray.
    grid : (x, y) or None
        The axes of the grid over the image, px, if the points are one.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab.calibration import ProjectionUncertainty
    >>> at = ProjectionUncertainty(np.zeros((1, 2)), 1000.0, 0.09 * np.eye(2)[None], 4e-8 * np.eye(2)[None])
    >>> at.sigmas.round(3).tolist(), at.sigmas_mm.round(3).tolist()  # px, and mm at 1 m
    ([0.3], [0.2])
    """

    image_points: NDArray[np.float64]
    distance: float
    covariances: NDArray[np.float64]
    ray_covariances: NDArray[np.float64]
    grid: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def sigmas(self) -> NDArray[np.float64]:
        """Standard deviations in the worst direction, px, (n,)."""
        return worst_sigmas(self.covariances)

    @property
    def ray_sigmas(self) -> NDArray[np.float64]:
        """Standard deviations of the viewing rays in the worst direction, rad, (n,)."""
        return worst_sigmas(self.ray_covariances)

    @property
    def covariances_mm(self) -> NDArray[np.float64]:
        """Of the point at `distance`, perpendicular to its ray, mm^2, (n, 2, 2), in the axes of `ray_covariances`.

        Raises
        ------
        ValueError
            If the distance is infinite.
        """
        if not np.isfinite(self.distance):
            raise ValueError("distance is infinite, where an error has no size in mm; use ray_covariances (rad^2)")
        return self.distance**2 * self.ray_covariances

    @property
    def sigmas_mm(self) -> NDArray[np.float64]:
        """Standard deviations in the worst direction, mm, (n,); ValueError if the distance is infinite."""
        return worst_sigmas(self.covariances_mm)

    def map(self, quantity: str = "px") -> ImageMap:
        """The worst-direction sigmas over the image.

        Parameters
        ----------
        quantity : {"px", "mm", "mrad"}

        Returns
        -------
        ImageMap

        Raises
        ------
        ValueError
            If the points are not a grid, or the distance is infinite and mm are asked for.
        """
        quantity = as_choice(quantity, "quantity", ("px", "mm", "mrad"))
        if self.grid is None:
            raise ValueError("image_points were given, and are no grid; ask for a map without them")
        values = {"px": self.sigmas, "mrad": 1e3 * self.ray_sigmas}.get(quantity)
        values = self.sigmas_mm if values is None else values
        where = "at infinity" if np.isinf(self.distance) else f"at {self.distance:g} mm"
        return ImageMap.of_points(*self.grid, values, f"sigma {where} ({quantity})")


@undetermined_if_singular()
def projection_uncertainty(
    calibration: Calibration, image_points: ArrayLike | None = None, distance: float = np.inf, *, columns: int = COLUMNS
) -> ProjectionUncertainty:
    r"""Return how uncertain the image of a point is that is fixed in front of the camera, over the image.

    .. math:: \mathrm{Cov}(q) = G\, \mathrm{Cov}(\theta, \bar w, \bar s)\, G^T, \qquad
        G = \left( J_\theta, \; -J_d [d]_\times, \; J_d / \rho \right),

    for the ray d (a unit vector) of the image point at the distance :math:`\rho`; the module's text has
    :math:`\bar w` and :math:`\bar s`, the poses' common motion.

    Parameters
    ----------
    calibration : Calibration
        With a covariance of the lens and of all poses.  Another covariance is used by
        ``dataclasses.replace(calibration, covariance=...)``.
    image_points : (n, 2) array_like, optional
        px; None for a grid over the image.
    distance : float
        mm from the camera along the ray.  The uncertainty depends on it: it is mostly smallest where the boards were.
    columns : int
        Of the grid.

    Returns
    -------
    ProjectionUncertainty
        In px, in rad, and in mm at the distance.  It is what noise of the corners does, like the covariance; a lens
        that does not follow the model, or a bent board, adds to it.

    Raises
    ------
    ValueError
        If there is no covariance or none of the poses, a point has no ray, or the image size is not known.
    CalibrationError
        If the lens model has no image of a point within the uncertainty of its parameters.

    Examples
    --------
    >>> from pegpose_lab import calibrate_joint, paper, projection_uncertainty
    >>> truth, rng = paper.paper_experiment(), np.random.default_rng(0)
    >>> board = truth.board.object_points
    >>> images = [truth.camera.project(board, pose) + 0.1 * rng.normal(size=(48, 2)) for pose in truth.cam_from_boards]
    >>> found = calibrate_joint([board] * 5, images, truth.camera)
    >>> at = projection_uncertainty(found, [[800, 600], [0, 0]], distance=300.0)
    >>> bool(at.sigmas[0] < at.sigmas[1] < 1), bool(at.sigmas_mm[0] < 0.01)
    (True, True)

    References
    ----------
    D. Kogan, "mrcal: projection uncertainty", https://mrcal.secretsauce.net/uncertainty.html (there: "mean-pcam").
    """
    distance = as_length(distance, "distance")
    camera, grid = calibration.camera, None
    if image_points is None:
        *grid, image_points = image_grid(camera.image_size, columns)
    image_points = as_points(image_points, 2, "image_points")
    joint = _with_common_motion(calibration)
    rays = unit_rays(camera, image_points)
    own = joint.iloc[:-6, :-6]
    by_lens = lens_derivative(camera, own, rays[:, :2] / rays[:, 2:])
    by_ray = by_direction(camera, rays)
    design = np.concatenate([by_lens, by_turn(by_ray, rays), by_ray / distance], axis=2)
    covariances = design @ joint.to_numpy() @ design.transpose(0, 2, 1)
    to_angles = np.linalg.inv(by_ray @ _perpendicular(rays))
    ray_covariances = to_angles @ covariances @ to_angles.transpose(0, 2, 1)
    return ProjectionUncertainty(
        image_points, distance, covariances, ray_covariances, None if grid is None else tuple(grid)
    )


def as_length(length: float, name: str) -> float:
    """Return a length that may be infinite; ValueError if it is not positive."""
    return np.inf if np.ndim(length) == 0 and length == np.inf else as_number(length, name, 0, exclusive=True)


def unit_rays(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera, image_points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The viewing directions (n, 3) of image points as unit vectors."""
    rays = camera.rays(image_points)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def worst_sigmas(covariances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviations (n,) in the worst direction of covariances (n, 2, 2)."""
    return np.sqrt(np.maximum(np.linalg.eigvalsh(covariances)[:, -1], 0))


def _perpendicular(rays):
    """Two unit vectors (n, 3, 2) perpendicular to each ray and to each other; the first is nearest to x."""
    first = np.array([1.0, 0.0, 0.0]) - rays[:, :1] * rays
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(rays, first)], axis=2)


def _with_common_motion(calibration):
    """The covariance of the lens and of the poses' common motion: a DataFrame, with six rows for the motion."""
    import pandas as pd

    covariance, poses = calibration.covariance, calibration.cam_from_object
    if covariance is None:
        raise ValueError("calibration has no covariance; use that of calibrate_joint or calibrate_zhang")
    expected = pose_names(len(poses))
    found = [name for name in covariance.index if re.fullmatch(r"[rt][xyz]_\d+", name)]
    if not poses or set(found) != set(expected):
        raise ValueError(
            f"calibration has {len(poses)} poses, and its covariance {len(found)} rows of poses; expected six for each"
        )
    own = lens_covariance(calibration.camera, covariance)
    k, count = len(own), len(poses)
    gather = np.zeros((k + 6, k + 6 * count))
    gather[:k, :k] = np.eye(k)
    for view, pose in enumerate(poses):
        block = gather[k:, k + 6 * view : k + 6 * view + 6]
        x, y, z = pose.translation
        block[range(6), range(6)] = 1 / count
        block[3:, :3] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / count  # t x w
    names = [*own.index, *expected]
    motion = [f"mean_{name}" for name in ("rx", "ry", "rz", "tx", "ty", "tz")]
    whole = gather @ covariance.loc[names, names].to_numpy() @ gather.T
    return pd.DataFrame(whole, [*own.index, *motion], [*own.index, *motion])
