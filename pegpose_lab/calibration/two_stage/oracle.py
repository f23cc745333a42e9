"""The optimum in the box of Eq. 5, which is the best that stage 2 can find, by ever narrower scans."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from ...camera import Sensor, TsaiCamera
from ...checks import CalibrationError, as_number, undetermined_if_singular
from ..result import Calibration
from .genes import BOX, _Genes
from .objective import PENALTY, TwoStageObjective
from .stages import calibrate_tsai, calibration_at
from .valley import lowest

SCANNED = 401
"""Number of T_z values across the box with which `optimum_in_box` starts."""

COARSE, FINE = 8, 25
"""Numbers of narrower scans: to find the valleys to 1e-6 of the box, and to end at the last digits."""


@undetermined_if_singular()
def optimum_in_box(
    object_points: ArrayLike, image_points: ArrayLike, camera: Sensor | TsaiCamera, *, box: float = BOX
) -> Calibration:
    r"""The smallest Eq. 7 in the box of Eq. 5, found without randomness.  The genetic algorithm is judged by it.

    The search has two unknowns, but it can be reduced to a search over T_z alone, of

    .. math:: g(T_z) = \min_{f_{low} \le f \le f_{high}} E(f, T_z),

    which follows the floor of a valley, however oblique and narrow it is, and the edge of the box where the valley
    leaves the box.  For a given T_z the undistorted problem is linear in f and kappa1, and E has one minimum.  It lies
    between the neighbours of the best of `valley.SCANNED_F` values, and ever narrower scans find it.  g is scanned at
    `SCANNED` values of T_z, and its `valley.STARTS` deepest valleys are narrowed in the same way, to the last digits.

    Parameters
    ----------
    object_points, image_points, camera, box
        As for `calibrate_genetic`.

    Returns
    -------
    Calibration
        With flags if the optimum lies on the edge of its box.

    Raises
    ------
    ValueError, CalibrationError
        As for `calibrate_genetic`.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, optimum_in_box
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard(4, 3, 60.0).object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> found = optimum_in_box(board, image, sensor)
    >>> round(found.camera.focal_length, 2), round(found.mean_distance, 3)
    (8.0, 0.0)
    """
    box = as_number(box, "box", 0, 1, exclusive=True)
    linear = calibrate_tsai(object_points, image_points, camera)
    objective = TwoStageObjective(object_points, image_points, linear)
    coding = _Genes("printed", linear, objective.c2, box)
    best, value = lowest(objective, coding.lower, coding.upper, SCANNED, COARSE, FINE)
    if value >= PENALTY:
        raise CalibrationError("no chromosome in the box sees all points; check the points and stage 1")
    kappa1 = objective.kappa1(best[None]).item()
    optimum = calibration_at(linear, best, kappa1, objective.residuals(best[None])[0])
    return replace(optimum, flags=linear.flags + coding.flags(best))
