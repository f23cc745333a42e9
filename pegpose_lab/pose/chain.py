"""The paper's formulas (Table 2, Eq. 11) and the chain from the camera to the robot (Sect. 2, Eqs. 1 and 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_number, as_points, as_pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform


def scale_coordinates(image_points: ArrayLike, mm_per_pixel: float) -> NDArray[np.float64]:
    """Table 2's metric coordinates: pixels times one scale, from the corner of the image.

    No tilt, principal point or distortion enters; compare `back_project_discs`.

    Parameters
    ----------
    image_points : (n, 2) array_like
        px.
    mm_per_pixel : float
        0.207 in Table 2.

    Returns
    -------
    (n, 2) ndarray
        mm.

    Examples
    --------
    >>> scale_coordinates([[100.0, 200.0]], 0.2).tolist()
    [[20.0, 40.0]]
    """
    return as_points(image_points, 2, "image_points") * as_number(mm_per_pixel, "mm_per_pixel", 0, exclusive=True)


def line_angle(point: ArrayLike, center: ArrayLike) -> float:
    r"""Eq. 11 by the two-argument arctangent: direction of the line from the hub centre to peg 1.

    .. math:: \theta = \operatorname{atan2}(y - y_c, x - x_c)

    Parameters
    ----------
    point, center : (2,) array_like
        In any frame; with y down, positive angles turn clockwise on the screen.

    Returns
    -------
    float
        rad in (-pi, pi], also for vertical lines.

    Raises
    ------
    ValueError
        If the points coincide or are unusable.

    Examples
    --------
    >>> import math
    >>> round(math.degrees(line_angle((-1.0, 1.0), (0.0, 0.0))), 6)
    135.0
    """
    dx, dy = _line(point, center)
    return float(np.arctan2(dy, dx))


def line_angle_printed(point: ArrayLike, center: ArrayLike, m2: float = 0.0) -> float:
    r"""Eq. 11 as printed, from the slopes m_1 of the line from the hub centre to peg 1 and m_2 of the horizontal.

    .. math:: \tan \theta = \frac{m_1 - m_2}{1 + m_1 m_2}

    Kept to show its limits: opposite directions give the same angle, vertical lines give none.

    Parameters
    ----------
    point, center : (2,) array_like
    m2 : float
        Slope of the reference line.

    Returns
    -------
    float
        rad in (-pi/2, pi/2).

    Raises
    ------
    ValueError
        If a slope does not exist (vertical line), the lines are at right angles, or the points coincide.

    Examples
    --------
    >>> import math
    >>> round(math.degrees(line_angle_printed((-1.0, 1.0), (0.0, 0.0))), 6)  # the opposite direction
    -45.0
    """
    dx, dy = _line(point, center)
    m2 = as_number(m2, "m2")
    if dx == 0 or dx + m2 * dy == 0:
        raise ValueError("point and center: Eq. 11 as printed has no value for vertical or perpendicular lines")
    m1 = dy / dx
    return float(np.arctan((m1 - m2) / (1 + m1 * m2)))


def _line(point, center):
    difference = as_points([point], 2, "point")[0] - as_points([center], 2, "center")[0]
    if not difference.any():
        raise ValueError("point and center coincide; they do not determine a direction")
    return difference


def robot_from_end_effector(
    robot_from_cam: RigidTransform, cam_from_hub: RigidTransform, hub_from_end_effector: RigidTransform
) -> RigidTransform:
    r"""Eq. 1: pose of the end effector in the robot's base.

    .. math:: {}^R T_E = {}^R T_C \, {}^C T_P \, {}^P T_E

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> steps = [RigidTransform.from_translation([0.0, 0.0, z]) for z in (1.0, 2.0, 3.0)]
    >>> robot_from_end_effector(*steps).translation.tolist()
    [0.0, 0.0, 6.0]
    """
    robot_from_hub = as_pose(robot_from_cam, "robot_from_cam") * as_pose(cam_from_hub, "cam_from_hub")
    return robot_from_hub * as_pose(hub_from_end_effector, "hub_from_end_effector")


def hub_from_end_effector(cam_from_hub: RigidTransform, cam_from_end_effector: RigidTransform) -> RigidTransform:
    r"""Eq. 2: pose of the end effector in the hub's frame.

    .. math:: {}^P T_E = [{}^C T_P]^{-1} \, {}^C T_E

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> hub, tool = (RigidTransform.from_translation([0.0, 0.0, z]) for z in (400.0, 380.0))
    >>> hub_from_end_effector(hub, tool).translation.tolist()
    [0.0, 0.0, -20.0]
    """
    cam_from_hub = as_pose(cam_from_hub, "cam_from_hub")
    return cam_from_hub.inv() * as_pose(cam_from_end_effector, "cam_from_end_effector")


@dataclass(frozen=True)
class Misalignment:
    """How far a mating part is from its place for insertion.

    Attributes
    ----------
    lateral : float
        Distance of the part's origin from the hub's axis, mm.
    axial : float
        Its distance along the axis, mm, positive behind the plane of the peg tops.
    tilt : float
        Angle between the two axes, rad.
    twist : float
        Turn about the axis to the nearest place where holes meet pegs, rad in [-pi/n, pi/n].

    Examples
    --------
    >>> Misalignment(lateral=0.1, axial=-20.0, tilt=0.0, twist=0.01).axial
    -20.0
    """

    lateral: float
    axial: float
    tilt: float
    twist: float


def misalignment(cam_from_hub: RigidTransform, cam_from_part: RigidTransform, n_pegs: int) -> Misalignment:
    """Compare a mating part's frame with the hub's (Eq. 2).

    Parameters
    ----------
    cam_from_hub, cam_from_part : RigidTransform
        The part's frame is the one that has to coincide with the hub's.
    n_pegs : int
        The part fits again after each n-th of a turn.

    Returns
    -------
    Misalignment

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> hub, part = (RigidTransform.from_translation([x, 0.0, 400.0 - 200 * x]) for x in (0.0, 0.1))
    >>> found = misalignment(hub, part, 4)
    >>> round(found.lateral, 6), round(found.axial, 6)
    (0.1, -20.0)
    """
    hub_from_part = hub_from_end_effector(cam_from_hub, cam_from_part)
    x, y, z = hub_from_part.translation
    matrix = hub_from_part.rotation.as_matrix()
    qx, qy, qz, qw = hub_from_part.rotation.as_quat()
    step = 2 * np.pi / as_number(n_pegs, "n_pegs", 1)
    twist = 2 * np.arctan2(qz, qw)
    return Misalignment(
        lateral=float(np.hypot(x, y)),
        axial=float(z),
        tilt=float(np.arctan2(np.hypot(matrix[0, 2], matrix[1, 2]), matrix[2, 2])),
        twist=float(twist - step * np.rint(twist / step)),
    )
