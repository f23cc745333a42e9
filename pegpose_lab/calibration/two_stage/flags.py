"""What to report about a solution on the edge of its box."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...camera import Sensor, TsaiCamera
from ...checks import CalibrationError
from ..joint.profile import profile_focal_length


def edge_intervals(object_points: ArrayLike, image_points: ArrayLike, camera: Sensor | TsaiCamera) -> str:
    """Say in words what one view tells about f without a box; useful if a solution lies on the edge of its box.

    A wrong principal point can move f out of the interval for a fixed principal point, so both intervals are given.

    Parameters
    ----------
    object_points, image_points, camera
        As for `calibrate_genetic`.

    Returns
    -------
    str
        A sentence with both 95 % intervals of f by its profile likelihood (`profile_focal_length`).

    Raises
    ------
    ValueError
        If the input is unusable.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, edge_intervals
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard(4, 3, 60.0).object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> image = image + 0.1 * np.random.default_rng(0).standard_normal(image.shape)
    >>> words = edge_intervals(board, image, sensor)
    >>> low, high = words.split("f is ")[1].split(" mm")[0].split(" to ")
    >>> round(float(low), 1), round(float(high), 1)
    (7.9, 8.1)
    """
    held, free = (_allowed_f(object_points, image_points, camera, mode) for mode in ("fixed", "free"))
    return (
        "Least squares of all parameters of this view (95 %, profile likelihood, this lens model): f is "
        f"{held} with this principal point, and {free} with the principal point free."
    )


def _allowed_f(object_points, image_points, camera, principal_point):
    """The interval of f by its profile likelihood, in words."""
    try:
        low, high = profile_focal_length([object_points], [image_points], camera, principal_point=principal_point)
    except CalibrationError:
        return "not determined"
    if low == 0 or np.isinf(high):
        ends = [f"above {low:.5g} mm"] * (low > 0) + [f"below {high:.5g} mm"] * bool(np.isfinite(high))
        return ", ".join(["not determined", *ends])
    return f"{low:.5g} to {high:.5g} mm"
