"""What to report about one view: what is wrong with its points, and a solution on the edge of its box."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import RigidTransform

from ...camera import Sensor, TsaiCamera
from ...checks import CalibrationError
from ...flags import Flag
from ..joint.copies import judge_sides
from ..joint.corners import judge_corners, wrong_corners
from ..joint.fitting import fit_views
from ..joint.models import TsaiModel
from ..joint.noise import LEAST_POINTS, homography_misses
from ..joint.orders import far_corners, far_sentence
from ..joint.profile import profile_focal_length
from ..joint.views import State
from ..planes import is_planar
from ..result import judge_image_size

SUSPECT = 6.0
"""A view is searched for wrong corners if a point is off its homography by this many standard deviations, by the median
distance.  Distortion alone leaves 4 at most."""


def judge_view(
    object_points: NDArray[np.float64], image_points: NDArray[np.float64], camera: TsaiCamera, pose: RigidTransform
) -> tuple[Flag, ...]:
    """Flags about the points (n, 3), (n, 2) of one view: outside the image, mirrored order, wrong corners.

    Camera and pose are those of stage 1.
    """
    flags = judge_image_size(camera, [image_points])
    centroid = object_points.mean(axis=0)
    state = State(np.zeros(0), pose.rotation.as_matrix()[None], pose.apply(centroid)[None])
    flags += judge_sides([object_points], state)
    if not is_planar(object_points) or len(object_points) < LEAST_POINTS:
        return flags
    distances = np.linalg.norm(homography_misses(object_points, image_points), axis=1)
    if distances.max() <= SUSPECT * np.median(distances) / np.sqrt(2 * np.log(2)):
        return flags
    try:
        fit = fit_views(TsaiModel(camera.sensor, False, False), [object_points], [image_points])
    except (CalibrationError, np.linalg.LinAlgError):
        return flags
    wrong, rest = wrong_corners(fit, [object_points], [image_points], "linear")
    return flags + ((judge_corners(fit, wrong, rest),) if wrong else ())


def view_refused(
    error: CalibrationError, object_points: NDArray[np.float64], image_points: NDArray[np.float64]
) -> CalibrationError:
    """The error of stage 1, led by the wrong corners of the view if there are any."""
    corners = far_corners(object_points, image_points) if is_planar(object_points) else {}
    if not corners:
        return error
    words = far_sentence({0: corners}, True)
    return CalibrationError(f"{words[0].upper()}{words[1:]}; leave them out. With all corners: {error}")


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
