r"""How far two calibrations of one camera differ, in px over the image.

Two calibrations put the camera frame in slightly different places, so their projections can only be compared after
the motion between the frames is fitted and removed.  For the ray :math:`d_a` of an image point q by camera a,

.. math:: \delta q = \mathrm{project}_b(R\, d_a + t / \rho) - q,

with the rotation R, and for points at a finite distance :math:`\rho` also the translation t, that make the sum of
:math:`|\delta q|^2` over a stated region least.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import by_direction, by_turn, lens_covariance, lens_derivative
from ..checks import CalibrationError, as_choice, undetermined_if_singular
from .image_map import COLUMNS, ImageMap, image_grid
from .result import Calibration
from .uncertainty import as_length, unit_rays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera

MIDDLE = 1 / 3
"""The motion is fitted in a circle with this fraction of the image's shorter side as its radius, unless another is
stated: nearly every calibration has corners there, and beyond its corners a lens with many coefficients may be wrong by
more pixels than all the rest, and would rule the fit."""

FIT_STEPS = 50
SETTLED = 1e-8
"""px: the fit of the motion ends after a step that moves no point of the region by more."""

ROUNDING = 1e-6
"""px: a difference is compared with no smaller sigma, since the last digits of two fits differ by about this."""


@dataclass(frozen=True, eq=False)
class CalibrationDifference:
    """The difference of two calibrations over the image (`difference`).

    Attributes
    ----------
    image_points : (n, 2) ndarray
        px, a grid over the image of the first camera, row by row.
    differences : (n, 2) ndarray
        Projection by the second camera minus `image_points`, px, with the motion removed.
    b_from_a : RigidTransform
        The fitted motion between the camera frames; its translation, mm, is 0 at infinite distance.
    fitted_points : (m, 2) ndarray
        The points from which it was fitted, px.
    covariances : (n, 2, 2) ndarray or None
        Of `differences`, px^2, if the two calibrations state the same camera with independent noise; None if one of
        them has no covariance.
    grid : (x, y)
        The axes of the grid, px.

    Examples
    --------
    >>> from pegpose_lab import difference, paper
    >>> camera = paper.paper_camera()
    >>> found = difference(camera, camera.with_parameters(kappa1=1.01 * camera.kappa1))
    >>> round(found.rms, 2), found.map().values.shape
    (0.05, (19, 25))
    """

    image_points: NDArray[np.float64]
    differences: NDArray[np.float64]
    b_from_a: RigidTransform
    fitted_points: NDArray[np.float64]
    covariances: NDArray[np.float64] | None
    grid: tuple[NDArray[np.float64], NDArray[np.float64]]

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Lengths of `differences`, px, (n,)."""
        return np.hypot(*self.differences.T)

    @property
    def rms(self) -> float:
        """Root of the mean squared length over the whole image, px."""
        return float(np.sqrt(np.mean(self.lengths**2)))

    @property
    def sigmas(self) -> NDArray[np.float64]:
        """Rms lengths that the covariances let expect, px, (n,).

        Raises
        ------
        ValueError
            If a calibration has no covariance.
        """
        if self.covariances is None:
            raise ValueError("a and b do not both have a covariance; compare calibrations that have one")
        return np.sqrt(np.maximum(np.trace(self.covariances, axis1=1, axis2=2), 0))

    @property
    def z(self) -> NDArray[np.float64]:
        """`lengths` over `sigmas`, (n,): their rms is about 1 if the two agree; ValueError as for `sigmas`."""
        return self.lengths / np.maximum(self.sigmas, ROUNDING)

    def map(self, quantity: str = "px") -> ImageMap:
        """The lengths of the differences over the image, in px or in sigmas.

        Parameters
        ----------
        quantity : {"px", "z"}

        Returns
        -------
        ImageMap

        Raises
        ------
        ValueError
            If z is asked for and there is no covariance.
        """
        if as_choice(quantity, "quantity", ("px", "z")) == "px":
            return ImageMap.of_points(*self.grid, self.lengths, "difference (px)")
        return ImageMap.of_points(*self.grid, self.z, "difference (sigmas)")


@undetermined_if_singular()
def difference(
    a: Calibration | TsaiCamera | OpenCVCamera | FisheyeCamera,
    b: Calibration | TsaiCamera | OpenCVCamera | FisheyeCamera,
    distance: float = np.inf,
    *,
    radius: float | None = None,
    columns: int = COLUMNS,
) -> CalibrationDifference:
    r"""Return the difference of two calibrations of one camera in px over the image, with their motion removed.

    With the derivatives :math:`J` of the image points by the lens parameters, and P by the motion, the fit leaves
    :math:`M J`, :math:`M = I - P (P_r^T P_r)^+ P_r^T`, where :math:`P_r` has the rows of the region.  So the difference
    has the covariance

    .. math:: M \left( J_a \Sigma_a J_a^T + J_b \Sigma_b J_b^T \right) M^T.

    Parameters
    ----------
    a, b : Calibration or camera
        Of one camera, in any lens models.  A camera alone counts as exact.
    distance : float
        mm along the rays of the points that are compared; at a finite distance a shift of the camera is fitted, too,
        which takes up most of a difference of f.
    radius : float, optional
        The motion is fitted in a circle of this radius round the middle of the image, px: None for a third of the
        image's shorter side, infinite for the whole image.
    columns : int
        Of the grid.

    Returns
    -------
    CalibrationDifference
        Its `z` are valid if a and b were made from different pictures.

    Raises
    ------
    ValueError
        If the image sizes differ or are not known, the radius is not positive, or one lens has no image of what the
        other one sees.
    CalibrationError
        If the fit of the motion finds no minimum, or a lens has no image within the uncertainty of its parameters.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from pegpose_lab import difference, paper
    >>> camera = paper.paper_camera()
    >>> shifted = replace(camera, principal_point=(809.5, 599.5))  # nearly a turn of the camera by 10 px
    >>> found = difference(camera, shifted)
    >>> round(float(np.degrees(found.b_from_a.rotation.magnitude())), 2), round(found.rms, 2)
    (0.43, 1.79)

    References
    ----------
    D. Kogan, "mrcal: differencing", https://mrcal.secretsauce.net/differencing.html
    """
    distance = as_length(distance, "distance")
    first, second = (item.camera if isinstance(item, Calibration) else item for item in (a, b))
    if tuple(first.image_size) != tuple(second.image_size):
        raise ValueError(f"a has the image size {first.image_size} and b {second.image_size}; expected the same")
    x, y, grid = image_grid(first.image_size, columns)
    fitted = _region(first.image_size, radius)
    points = np.vstack([fitted, grid])
    region = np.arange(len(points)) < len(fitted)
    rays = unit_rays(first, points)
    motion = _fit_motion(second, fitted, rays[region], distance)
    moved = _moved(motion, rays, distance)
    differences = (second.from_normalized(moved[:, :2] / moved[:, 2:]) - points)[~region]
    covariances = _covariances(((a, rays), (b, moved)), second, region, distance)
    return CalibrationDifference(grid, differences, motion, fitted, covariances, (x, y))


def _region(image_size, radius):
    """The points (m, 2) that the motion is fitted to: a grid over a circle, as far as it lies in the image."""
    radius = MIDDLE * min(image_size) if radius is None else as_length(radius, "radius")
    half = np.subtract(image_size, 1) / 2
    reach = np.minimum(radius, half)
    x, y = (np.linspace(-end, end, COLUMNS) for end in reach)
    arms = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return half + arms[np.hypot(*arms.T) <= radius]


def _moved(motion, rays, distance):
    """The points (n, 3) of unit rays at a distance after a motion, in units of the distance."""
    return motion.rotation.apply(rays) + motion.translation / distance


def _by_motion(camera, places, distance):
    """Derivatives (n, 2, 3 or 6) of image points by a turn, and at a finite distance by a shift in units of it."""
    by_ray = by_direction(camera, places)
    turn = by_turn(by_ray, places)
    return turn if np.isinf(distance) else np.concatenate([turn, by_ray], axis=2)


def _fit_motion(camera, points, rays, distance):
    """The motion after which the camera projects the rays nearest to the points, by Gauss-Newton steps."""
    motion = RigidTransform.identity()
    for _ in range(FIT_STEPS):
        moved = _moved(motion, rays, distance)
        error = camera.from_normalized(moved[:, :2] / moved[:, 2:]) - points
        columns = _by_motion(camera, moved, distance).reshape(2 * len(points), -1)
        step = -np.linalg.lstsq(columns, error.ravel(), rcond=None)[0]
        shift = distance * step[3:] if len(step) > 3 else np.zeros(3)
        motion = RigidTransform.from_components(shift, Rotation.from_rotvec(step[:3])) * motion
        if np.abs(columns @ step).max() <= SETTLED:
            return motion
    raise CalibrationError(
        f"the motion between a and b was not found in {FIT_STEPS} steps: are they calibrations of one camera?"
    )


def _covariances(sides, camera, region, distance):
    """Covariances (n, 2, 2) of the differences outside of the region; None if a calibration has none."""
    by_motion = _by_motion(camera, sides[1][1], distance)
    total = np.zeros((np.count_nonzero(~region), 2, 2))
    for item, rays in sides:
        if not isinstance(item, Calibration):
            continue
        if item.covariance is None:
            return None
        own = lens_covariance(item.camera, item.covariance)
        by_lens = lens_derivative(item.camera, own, rays[:, :2] / rays[:, 2:])
        rows = 2 * np.count_nonzero(region)
        taken = np.linalg.lstsq(by_motion[region].reshape(rows, -1), by_lens[region].reshape(rows, -1), rcond=None)[0]
        left = (by_lens - by_motion @ taken)[~region]
        total += left @ own.to_numpy() @ left.transpose(0, 2, 1)
    return total
