"""Rotation, translation and f from the radial alignment equations, with standard deviations."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...checks import CalibrationError
from .ratios import solve_ratios


def _design(points, sensor_points):
    """Rows [y_d p, y_d, -x_d p] of the radial alignment equations; their right-hand side is x_d."""
    x_d, y_d = sensor_points[:, :1], sensor_points[:, 1:]
    return np.hstack([y_d * points, y_d, -x_d * points])


def _column_norms(matrix):
    norms = np.linalg.norm(matrix, axis=0)
    return np.where(norms > 0, norms, 1.0)


def _solve_ratios(points, sensor_points):
    """The ratios U by least squares; CalibrationError if the equations are rank deficient."""
    design = _design(points, sensor_points)
    scale = _column_norms(design)
    solution, _, rank, _ = np.linalg.lstsq(design / scale, sensor_points[:, 0], rcond=1e-12)
    if rank < design.shape[1]:
        raise CalibrationError(
            f"the radial alignment equations have rank {rank} of {design.shape[1]}: the points do not determine "
            "the pose (too many of them on a line or a conic); use points spread over the image"
        )
    return solution / scale


def _estimate(points, sensor_points, ratios):
    """Rotation, translation, f and s_x from the ratios."""
    first, second, ty, scale_x = _rows_of_plane(ratios) if len(ratios) == 5 else _rows_of_body(ratios)
    sign = _sign_of_ty(points, sensor_points, ratios)
    rows = np.array([sign * first, sign * second, np.cross(first, second)])
    rotation = Rotation.from_matrix(rows)  # projects on SO(3)
    tx, ty = sign * ratios[points.shape[1]] * ty / scale_x, sign * ty
    side = sensor_points[:, 1] * (points @ rotation.as_matrix()[2, : points.shape[1]])
    focal_length, depth = _depth_inverse(points, sensor_points, rotation, ty) @ side
    if focal_length < 0 and len(ratios) == 5:  # the other signs of r3, r6, and so of r7, r8, are correct
        rotation = Rotation.from_matrix(rotation.as_matrix() * [[1, 1, -1], [1, 1, -1], [-1, -1, 1]])
        focal_length, depth = -focal_length, -depth
    return rotation, np.array([tx, ty, depth]), focal_length, scale_x


def _rows_of_plane(ratios):
    """The first two rows of R with one of the two sign choices of (r3, r6), T_y > 0, and s_x = 1."""
    u1, u2, _, u4, u5 = ratios
    s, d = u1**2 + u2**2 + u4**2 + u5**2, u1 * u5 - u2 * u4
    ty = np.sqrt(2 / (s + np.sqrt(max(s**2 - 4 * d**2, 0.0))))
    r1, r2, r4, r5 = u1 * ty, u2 * ty, u4 * ty, u5 * ty
    product = -(r1 * r4 + r2 * r5)  # equals r3 r6, because the rows are orthogonal
    larger = np.sqrt(max(1 - r1**2 - r2**2, 1 - r4**2 - r5**2, 0.0))
    smaller = product / larger if larger > 0 else 0.0  # a square root would lose half the digits near 0
    r3, r6 = (larger, smaller) if r1**2 + r2**2 < r4**2 + r5**2 else (smaller, larger)
    return np.array([r1, r2, r3]), np.array([r4, r5, r6]), ty, 1.0


def _rows_of_body(ratios):
    """The first two rows of R (orthogonal except for noise), T_y > 0, and s_x."""
    ty = 1 / np.linalg.norm(ratios[4:])
    scale_x = ty * np.linalg.norm(ratios[:3])
    return ratios[:3] * ty / scale_x, ratios[4:] * ty, ty, scale_x


def _sign_of_ty(points, sensor_points, ratios):
    """The sign of T_y for which more coordinates have the sign of the measured ones."""
    x_c, y_c = _scaled_coordinates(points, ratios)
    votes = np.sign(x_c * sensor_points[:, 0]) + np.sign(y_c * sensor_points[:, 1])
    return 1.0 if votes.sum() >= 0 else -1.0


def _scaled_coordinates(points, ratios):
    """The points' s_x x_c / T_y and y_c / T_y."""
    d = points.shape[1]
    return points @ ratios[:d] + ratios[d], points @ ratios[d + 1 :] + 1


def _depth_inverse(points, sensor_points, rotation, ty):
    """Pseudo-inverse (2, n) of the system f y_c - y_d T_z = y_d (r7 x + r8 y + r9 z) for (f, T_z)."""
    y_c = points @ rotation.as_matrix()[1, : points.shape[1]] + ty
    design = np.column_stack([y_c, -sensor_points[:, 1]])
    scale = _column_norms(design)
    return np.linalg.pinv(design / scale) / scale[:, None]


def _squared_sine(rotation):
    """sin^2 of the angle between the optical axis and the object's z axis."""
    return np.sum(rotation.as_matrix()[2, :2] ** 2)


def _propagate(points, sensor_points, ratios, rotation, translation):
    """Standard deviations of f and of sin^2(tilt), from the residuals of the radial alignment equations.

    Rotation and translation are those of `_estimate`.

    Distortion moves a point along its radius, so it does not count as noise.  To first order, the noise
    changes the ratios, and so R, T_y and f; it also changes the y_d from which f is solved.
    """
    x_c, y_c = _scaled_coordinates(points, ratios)  # the equations' derivatives are (-y_c, x_c)
    design = _design(points, sensor_points)
    residuals = (design @ ratios - sensor_points[:, 0]) / np.maximum(np.hypot(x_c, y_c), 1e-300)
    noise = np.sqrt(np.sum(residuals**2) / max(len(points) - len(ratios), 1))
    scale = _column_norms(design)
    inverse = np.linalg.pinv(design / scale) / scale[:, None]
    by_residual = -_gradient(points, sensor_points, ratios, scale) @ inverse
    depth = points @ rotation.as_matrix()[2, : points.shape[1]] + translation[2]
    direct = _depth_inverse(points, sensor_points, rotation, translation[1])[0] * depth
    by_y = by_residual * x_c + np.array([direct, np.zeros(len(points))])
    return noise * np.sqrt(np.sum((by_residual * y_c) ** 2 + by_y**2, axis=1))


def _gradient(points, sensor_points, ratios, scale):
    """Derivatives (2, len(ratios)) of f and sin^2(tilt) by the ratios, by central differences."""
    steps = np.diag(1e-6 * np.linalg.norm(ratios * scale) / scale)
    outcomes = _outcomes(points, sensor_points, np.concatenate([ratios + steps, ratios - steps]))
    above, below = np.split(outcomes, 2)
    return ((above - below) / (2 * steps.sum(axis=1, keepdims=True))).T


def _outcomes(points, sensor_points, moved):
    """f and sin^2(tilt), (k, 2), for several sets of ratios (k, 5 or 7)."""
    if moved.shape[1] == 5:
        focal_length, _, _, third = solve_ratios(points, sensor_points, moved)
        return np.column_stack([focal_length, np.sum(third[:, :2] ** 2, axis=1)])
    found = (_estimate(points, sensor_points, ratios) for ratios in moved)
    return np.array([[focal_length, _squared_sine(rotation)] for rotation, _, focal_length, _ in found])
