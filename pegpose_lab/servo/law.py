"""What is left of the way to the goal, and the motion that makes it smaller (position-based visual servoing)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..checks import as_count, as_number, as_pose

if TYPE_CHECKING:
    from numpy.typing import NDArray


def remaining(cam_from_part: RigidTransform, goal: RigidTransform, symmetry: int = 1) -> NDArray[np.float64]:
    r"""Return the motion that is left: from the part's pose to the goal, the paper's C_T_P against C_T*_P (Sect. 2).

    .. math:: e = (t^* - t,\; \log(R^* R^T))

    Parameters
    ----------
    cam_from_part, goal : RigidTransform
    symmetry : int
        The part looks the same after each n-th of a turn about its z axis: the nearest of these goals counts.

    Returns
    -------
    (6,) ndarray
        Shift of the part's origin, mm, and rotation vector about it, rad, in the axes of the camera.

    Raises
    ------
    ValueError
        If an argument is unusable.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> part = RigidTransform.from_components([1.0, 2.0, 400.0], Rotation.from_rotvec([0, 0, 3.0]))
    >>> goal = RigidTransform.from_translation([0.0, 0.0, 400.0])
    >>> remaining(part, goal, symmetry=2).round(4).tolist()
    [-1.0, -2.0, 0.0, 0.0, 0.0, 0.1416]
    """
    n = as_count(symmetry, "symmetry", 1)
    part, goal = as_pose(cam_from_part, "cam_from_part"), as_pose(goal, "goal")
    turns = [goal.rotation * Rotation.from_rotvec([0, 0, 2 * np.pi * k / n]) * part.rotation.inv() for k in range(n)]
    nearest = min(turns, key=lambda turn: turn.magnitude())
    return np.append(goal.translation - part.translation, nearest.as_rotvec())


def correction(cam_from_part: RigidTransform, error: NDArray[np.float64], gain: float) -> RigidTransform:
    r"""Return the motion, in the camera's frame, that takes the part a share of what remains.

    .. math:: M = \begin{pmatrix} \exp(\lambda\omega) & t + \lambda\tau - \exp(\lambda\omega)\, t \\ 0 & 1 \end{pmatrix}

    for the rest :math:`e = (\tau, \omega)` of `remaining`: the part is turned about its own origin t and shifted.  With an
    exact robot :math:`e` becomes :math:`(1 - \lambda) e`.  A robot whose hand-eye rotation is off by an angle
    :math:`\beta` moves the part along turned axes: the rest shrinks by :math:`|1 - \lambda e^{i\beta}|` a step, which is
    less than 1 for :math:`\lambda < 2 \cos\beta`.

    Parameters
    ----------
    cam_from_part : RigidTransform
    error : (6,) ndarray
    gain : float
        lambda, above 0 and at most 1.

    Returns
    -------
    RigidTransform
        ``motion * cam_from_part`` is the pose after it.

    Raises
    ------
    ValueError
        If an argument is unusable.

    References
    ----------
    F. Chaumette and S. Hutchinson, "Visual servo control part I: basic approaches", IEEE Robotics & Automation Magazine 13,
    2006 (the paper's reference 2; position-based control with uncoupled shift and rotation).

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform
    >>> part, goal = (RigidTransform.from_translation([x, 0.0, 400.0]) for x in (8.0, 0.0))
    >>> (correction(part, remaining(part, goal), 0.75) * part).translation.tolist()
    [2.0, 0.0, 400.0]
    """
    gain = as_number(gain, "gain", 0, 1)
    if gain == 0:
        raise ValueError("gain is 0; expected more than 0")
    part, error = as_pose(cam_from_part, "cam_from_part").translation, np.asarray(error, float)
    turn = Rotation.from_rotvec(gain * error[3:])
    return RigidTransform.from_components(part + gain * error[:3] - turn.apply(part), turn)
