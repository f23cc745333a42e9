r"""Stage 1 (Sect. 3.1, Table 1 "linear"): Tsai's radial alignment method, in sensor coordinates.

Radial distortion moves an image point along the line to the principal point, so it does not change the
direction (x_d, y_d), and

.. math:: x_d\,(r_4 x + r_5 y + r_6 z + T_y) = y_d\,(r_1 x + r_2 y + r_3 z + T_x)

holds with and without distortion.  Divided by T_y, this equation is linear in seven ratios, or in five for a plane
z = 0 (every plane has z = 0 in its own frame, see `planes`).  The ratios give R, T_x and T_y.  Then the projection of
y without distortion gives f and T_z, again linearly:

.. math:: f\,(r_4 x + r_5 y + r_6 z + T_y) - y_d\,T_z = y_d\,(r_7 x + r_8 y + r_9 z)

Source: R. Y. Tsai, IEEE J. Robotics and Automation 3(4), 323-344, 1987 (the paper's ref. 15).  The functions document
the numerically stable T_y^2, the sign conventions and the checks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from ...checks import CalibrationError, as_matched_points, undetermined_if_singular
from ...flags import Flag
from ..planes import FLAT, is_planar, plane_frame, relief
from .estimate import _column_norms, _design, _estimate, _propagate, _solve_ratios, _squared_sine

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SMALLEST_SPREAD = 1e-6
"""Points lie on a line (or in a plane) if they deviate from it by at most this fraction of their extent."""

RELIEF_ROUNDS = 4
"""Rounds that correct the image for the relief of a plane; each round leaves about `FLAT` of its effect."""

SMALLEST_TY = 0.05
"""The world origin is moved if its |y_c| is below this fraction of the points' largest |y_c|."""

SMALLEST_TILT = 0.05
"""Degrees; with less tilt between the optical axis and a plane's normal, f is never determined."""

TILT_SIGNIFICANCE = 4.0
"""sin^2(tilt) must exceed zero by this many standard deviations; otherwise the plane may be fronto-parallel."""

SMALL_TILT = 10.0
"""Degrees; with less board tilt, f is flagged."""

LOOSE_INTERVAL = 0.25
"""f is flagged if the half-width of its 95 % interval is more than this fraction of f."""

CONFIDENCE = 1.96
"""Half-width of a 95 % interval, in standard deviations."""


@dataclass(frozen=True, eq=False)
class TsaiSolution:
    """The linear solution of one view.

    Attributes
    ----------
    rotation : Rotation
        From the object's frame to the camera's.
    translation : (3,) ndarray
        T_x, T_y, T_z, mm.
    focal_length : float
        f, mm.
    scale_x : float
        Horizontal scale that remains in the sensor points; 1 for a plane, which does not determine it.
    tilt : float
        Angle between the optical axis and the plane's normal (for points that are not coplanar, the object's z axis),
        degrees, 0 to 90.
    focal_length_sigma : float
        Standard deviation of f, mm, due to noise; it does not include the bias due to neglected distortion.
    flags : tuple of Flag
        What a user must know.
    """

    rotation: Rotation
    translation: np.ndarray
    focal_length: float
    scale_x: float
    tilt: float
    focal_length_sigma: float
    flags: tuple = ()


@undetermined_if_singular()
def solve_coplanar(object_points: ArrayLike, sensor_points: ArrayLike) -> TsaiSolution:
    r"""Tsai's method for points of one plane, in any position in the object's frame.

    The five ratios :math:`U = (r_1, r_2, T_x, r_4, r_5) / T_y` solve

    .. math:: [y_d x,\; y_d y,\; y_d,\; -x_d x,\; -x_d y]\, U = x_d

    by least squares with scaled columns.  With :math:`S = U_1^2 + U_2^2 + U_4^2 + U_5^2` and
    :math:`D = U_1 U_5 - U_2 U_4`, :math:`T_y^2 = 2 / (S + \sqrt{S^2 - 4 D^2})`.  This equals the textbook's
    :math:`(S - \sqrt{S^2 - 4 D^2}) / (2 D^2)`, but without its cancellation near D = 0.

    The system is solved at the given origin.  If the origin is imaged near the camera's x axis (its |y_c| is below
    5 % of the points' largest |y_c|), T_y is near 0 and a division by it is inaccurate.  The origin is then moved to
    the point imaged farthest from that axis, and moved back at the end.

    A measured board is flat to micrometres only.  x and y are taken in the plane through the points
    (`plane_frame`), and the effect of the distances from it on the image is subtracted, by the solution so far.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 5, on a plane within `FLAT`; for other points see `solve_noncoplanar`.
    sensor_points : (n, 2) array_like
        Distorted sensor coordinates from the principal point, mm (`TsaiCamera.to_sensor`).

    Returns
    -------
    TsaiSolution

    Raises
    ------
    ValueError
        If the input is unusable: fewer than five points, points on a line, or points not on one plane.
    CalibrationError
        If the plane is fronto-parallel within the noise, or f is undetermined for another reason.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, TsaiCamera
    >>> from pegpose_lab.calibration import solve_coplanar
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera, board = TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> found = solve_coplanar(board, camera.to_sensor(camera.project(board, pose)))
    >>> round(found.focal_length, 3), found.translation.round(1).tolist()
    (8.0, [-90.0, -70.0, 500.0])
    """
    object_points, sensor_points = as_matched_points(object_points, sensor_points, 5)
    if not is_planar(object_points):
        raise ValueError(
            f"object_points leave the plane through them by {100 * relief(object_points):.2g} % of their width; "
            f"expected a plane, to {100 * FLAT:g} % (for points that are not a plane use solve_noncoplanar)"
        )
    plane_from_object = plane_frame(object_points)
    points = plane_from_object.apply(object_points)
    _demand_spread(points[:, :2], "object_points", "line")
    _demand_spread(sensor_points, "image_points", "line")
    shift = np.zeros(3)
    if _origin_near_x_axis(points[:, :2], sensor_points):
        shift = _point_off_x_axis(points, sensor_points) * [1, 1, 0]
    solution = _solve((points - shift)[:, :2], sensor_points, shift)
    for _ in range(RELIEF_ROUNDS if np.any(points[:, 2]) else 0):
        solution = _solve((points - shift)[:, :2], sensor_points - _relief_in_image(points, solution), shift)
    translation = solution.translation + solution.rotation.apply(plane_from_object.translation)
    return replace(solution, rotation=solution.rotation * plane_from_object.rotation, translation=translation)


def _relief_in_image(points, solution):
    """The shift (n, 2) in the sensor, mm, that the z of points near the plane z = 0 causes."""
    seen, feet = (solution.rotation.apply(p) + solution.translation for p in (points, points * [1, 1, 0]))
    if min(seen[:, 2].min(), feet[:, 2].min()) <= 0:
        raise CalibrationError("the linear solution has points behind the camera; check the order of the points")
    return solution.focal_length * (seen[:, :2] / seen[:, 2:] - feet[:, :2] / feet[:, 2:])


@undetermined_if_singular()
def solve_noncoplanar(object_points: ArrayLike, sensor_points: ArrayLike) -> TsaiSolution:
    r"""Tsai's method for points that are not coplanar; it also gives the horizontal scale s_x.

    The seven ratios :math:`U = (s_x r_1, s_x r_2, s_x r_3, s_x T_x, r_4, r_5, r_6) / T_y` solve the radial
    alignment equations by least squares with scaled columns;
    :math:`|T_y| = (U_5^2 + U_6^2 + U_7^2)^{-1/2}`, :math:`s_x = |T_y| (U_1^2 + U_2^2 + U_3^2)^{1/2}`.
    The cross product of the two rows gives the third, and the matrix is projected on SO(3).  The origin is moved
    as in `solve_coplanar`.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm, n >= 7, not all on one plane.
    sensor_points : (n, 2) array_like
        Distorted sensor coordinates from the principal point, mm.

    Returns
    -------
    TsaiSolution

    Raises
    ------
    ValueError
        If the input is unusable: fewer than seven points, or points on one plane.
    CalibrationError
        If the view does not determine f.
    """
    object_points, sensor_points = as_matched_points(object_points, sensor_points, 7)
    _demand_spread(object_points, "object_points", "plane")
    _demand_spread(sensor_points, "image_points", "line")
    shift = np.zeros(3)
    if _origin_near_x_axis(object_points, sensor_points):
        shift = _point_off_x_axis(object_points, sensor_points)
    return _solve(object_points - shift, sensor_points, shift)


def _demand_spread(points, name, degenerate):
    """Refuse points that lie on a line (2-D) or in a plane (3-D)."""
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if singular[-1] <= SMALLEST_SPREAD * singular[0]:
        raise ValueError(f"{name} of shape {points.shape} lie on one {degenerate}; expected a spread of points")


def _origin_near_x_axis(points, sensor_points):
    """Whether T_y is too small to divide by, according to the homogeneous system, which needs no division."""
    d = points.shape[1]
    design = np.hstack([_design(points, sensor_points), -sensor_points[:, :1]])
    scale = _column_norms(design)
    null = np.linalg.svd(design / scale, full_matrices=False)[2][-1] / scale
    y_c = points @ null[d + 1 : -1] + null[-1]
    return abs(null[-1]) < SMALLEST_TY * np.abs(y_c).max()


def _point_off_x_axis(object_points, sensor_points):
    """The point imaged farthest from the camera's x axis."""
    return object_points[np.argmax(np.abs(sensor_points[:, 1]))]


def _solve(points, sensor_points, shift):
    """Solve for points of a plane, (n, 2), or of a body, (n, 3), with the origin at `shift`, and judge the result."""
    ratios = _solve_ratios(points, sensor_points)
    rotation, translation, focal_length, scale_x = _estimate(points, sensor_points, ratios)
    tilt = float(np.degrees(np.arcsin(min(np.sqrt(_squared_sine(rotation)), 1.0))))
    planar = points.shape[1] == 2
    if planar and tilt < SMALLEST_TILT:
        raise _fronto_parallel(tilt)
    sigma, sine_sigma = _propagate(points, sensor_points, ratios, rotation, translation)
    if planar and _squared_sine(rotation) < TILT_SIGNIFICANCE * sine_sigma:
        raise _fronto_parallel(tilt)
    _demand_view(points, rotation, translation, focal_length)
    flags = _judge(focal_length, sigma, tilt if planar else None)
    translation = translation - rotation.apply(shift)
    return TsaiSolution(rotation, translation, float(focal_length), float(scale_x), tilt, float(sigma), flags)


def _fronto_parallel(tilt):
    return CalibrationError(
        f"the plane is seen from straight ahead (tilt {tilt:.2g} deg, not distinguishable from 0): f and T_z "
        "trade off and are not determined; tilt the board by about 30 deg"
    )


def _demand_view(points, rotation, translation, focal_length):
    """Refuse a solution with f <= 0 or with a point behind the camera."""
    nearest = (points @ rotation.as_matrix()[2, : points.shape[1]]).min() + translation[2]
    if not (focal_length > 0 and nearest > 0):
        raise CalibrationError(
            f"the linear solution has f = {focal_length:.4g} mm and its nearest point at depth {nearest:.4g} mm, "
            "which is impossible; check the order of the points and that their axes are right-handed, and tilt more"
        )


def _judge(focal_length, sigma, tilt):
    """Flags of a solution; `CalibrationError` if the 95 % interval of f reaches zero."""
    refusal = "the view does not determine f ({}); tilt the board by about 30 deg, bring it nearer or use more points"
    kind = "95 % interval of f, by noise alone:"
    interval, loose = judge_interval(focal_length, CONFIDENCE * sigma, f"{kind} {{}} mm", refusal)
    if tilt is not None and tilt < SMALL_TILT:
        text = f"The plane is tilted by only {tilt:.1f} deg, so f and T_z trade off ({interval}); tilt it more."
        return (Flag("little-tilt", text),)
    if loose:
        text = f"The view hardly determines f ({interval}); tilt the board more or use more points."
        return (Flag("loose-focal-length", text),)
    return ()


def judge_interval(value: float, half: float, words: str, refusal: str) -> tuple[str, bool]:
    """Judge the interval of f, value +- half.

    Returns
    -------
    str, bool
        The interval in `words`, and whether it is longer than `LOOSE_INTERVAL` allows.

    Raises
    ------
    CalibrationError
        With the text of `refusal`, if the interval reaches zero.
    """
    interval = words.format(f"{value - half:.4g} to {value + half:.4g}")
    if half >= value:
        raise CalibrationError(refusal.format(interval))
    return interval, bool(half > LOOSE_INTERVAL * value)
