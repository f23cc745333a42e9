"""Zhang's calibration from several views of a plane, by OpenCV: the paper compares with it (Sect. 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import OpenCVCamera, Sensor, TsaiCamera
from ..checks import CalibrationError, as_views, undetermined_if_singular
from .joint.fitting import fit_at
from .joint.judge import judge_independence
from .joint.misfit import judge_misfit, refused
from .joint.models import COEFFICIENTS, lens_model
from .joint.starts import demand_views
from .joint.views import State, Views, evaluate
from .planes import FLAT, is_planar, plane_frame, relief
from .result import MINIMUM_POINTS, Calibration, judge_focal_length, judge_image_size

RADIAL = ((), ("k1",), ("k1", "k2"), ("k1", "k2", "k3"))
"""Sets of radial coefficients that `cv2.calibrateCamera` can estimate together."""


@undetermined_if_singular()
def calibrate_zhang(
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    camera: Sensor | TsaiCamera | OpenCVCamera | tuple[int, int],
    *,
    coefficients: Sequence[str] = ("k1", "k2"),
) -> Calibration:
    r"""Zhang's calibration from several views of a plane, by `cv2.calibrateCamera`.

    It estimates f_x, f_y, c_x, c_y and `coefficients`.  Zhang (2000) estimates two radial coefficients and no
    tangential ones.  ``("k1",)`` is the paper's model except that it distorts where the paper's model undistorts;
    ``("k1", "k2", "p1", "p2")`` is the model of the MATLAB toolbox.  OpenCV's own default also estimates k3, which an
    ordinary lens does not determine: it grows to compensate k2.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry per view.  Each is a plane in any position, flat to `planes.FLAT` (a measured board is).
    image_points : sequence of (n, 2) array_like
        px.
    camera : Sensor, TsaiCamera, OpenCVCamera or (int, int)
        Only the image size (width, height in px) is used.  Everything else is estimated from the views.
    coefficients : sequence of str
        Some of `COEFFICIENTS`, as for `calibrate_joint`: radial ones from k1 on without a gap, p1 and p2 both or
        neither.

    Returns
    -------
    Calibration
        With `OpenCVCamera` and `covariance`, stated as by `calibrate_joint`; `flags` tell when the residuals contradict
        independent noise, or the lens model (`misfit`).

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If there are fewer than two views, or their tilts do not differ enough.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_zhang
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0)
    >>> board = Checkerboard(8, 6, 29.0).object_points
    >>> turns = Rotation.from_rotvec(0.5 * np.eye(3))
    >>> poses = [RigidTransform.from_components([-90, -70, 500], turn) for turn in turns]
    >>> found = calibrate_zhang([board] * 3, [camera.project(board, pose) for pose in poses], camera.sensor)
    >>> round(found.camera.parameters["f_x"], 2), found.n_parameters
    (800.0, 24)

    References
    ----------
    Z. Zhang, "A flexible new technique for camera calibration", IEEE Transactions on Pattern Analysis and Machine
    Intelligence 22(11), 1330-1334, 2000.
    """
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    plain = Sensor((1.0, 1.0), (0.0, 0.0), getattr(camera, "image_size", camera))
    plain = replace(plain, principal_point=tuple((np.array(plain.image_size) - 1) / 2))  # for a start only
    size, model = plain.image_size, lens_model(plain, True, True, _as_coefficients(coefficients))
    for view, points in enumerate(object_points):
        if not is_planar(points):
            raise ValueError(
                f"object_points[{view}] leave the plane through them by {100 * relief(points):.2g} % of their width; "
                f"expected a plane, to {100 * FLAT:g} % (calibrate_joint takes any object)"
            )
    if len(object_points) < 2:
        raise CalibrationError("one view of a plane gives two constraints on f_x, f_y, c_x, c_y; add tilted views")
    demand_views(object_points, image_points, size)
    fit = None
    try:
        found, poses = _opencv_calibration(object_points, image_points, size, model.coefficient_names)
        fit = _fit_of(model, found, poses, object_points, image_points)
        flags = judge_focal_length(fit.covariance, "f_x", found.camera_matrix[0, 0], "px", fit.sigma_freedom)
    except (CalibrationError, np.linalg.LinAlgError) as error:
        raise refused(error, model, object_points, image_points, fit) from error
    flags += judge_independence(fit) + judge_image_size(found, image_points)
    flags += judge_misfit(fit, object_points, image_points)
    residuals = [
        found.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    return Calibration(found, poses, residuals, flags, **fit.stated())


def _as_coefficients(coefficients):
    """The checked coefficients in OpenCV's order; ValueError if `cv2.calibrateCamera` cannot estimate this set."""
    given = set(map(str, coefficients)) if np.iterable(coefficients) else {coefficients}
    radial = tuple(name for name in ("k1", "k2", "k3") if name in given)
    known = given <= set(COEFFICIENTS) and len(given) == np.size(coefficients)
    if not known or radial not in RADIAL or len(given & {"p1", "p2"}) == 1:
        raise ValueError(
            f"coefficients is {coefficients!r}; expected each once: radial ones of k1, k2, k3 without a gap, and p1 "
            "and p2 both or neither (calibrate_joint takes any)"
        )
    return tuple(name for name in COEFFICIENTS if name in given)


def _opencv_calibration(object_points, image_points, size, coefficients):
    """The result of `cv2.calibrateCamera` as an `OpenCVCamera` and poses.

    `cv2.calibrateCamera` takes other points than planes z = 0 only with a camera to start from.  So it first solves the
    same boards made flat, and starts from that camera.
    """
    frames = [plane_frame(points) for points in object_points]
    own = [frame.apply(points) for frame, points in zip(frames, object_points, strict=True)]
    flags = 0 if "p1" in coefficients else cv2.CALIB_ZERO_TANGENT_DIST
    for name, fixed in (("k1", cv2.CALIB_FIX_K1), ("k2", cv2.CALIB_FIX_K2), ("k3", cv2.CALIB_FIX_K3)):
        flags |= 0 if name in coefficients else fixed
    images = [points.astype(np.float32) for points in image_points]

    def solve(boards, matrix, coefficients, flags):
        boards = [points.astype(np.float32) for points in boards]
        return cv2.calibrateCamera(boards, images, size, matrix, coefficients, flags=flags)[1:]

    try:
        found = solve([points * [1, 1, 0] for points in own], None, None, flags)
        if any(np.any(points[:, 2]) for points in own):
            found = solve(own, *found[:2], flags | cv2.CALIB_USE_INTRINSIC_GUESS)
        matrix, coefficients, rotations, translations = found
        camera = OpenCVCamera(matrix, np.ravel(coefficients)[:5], size)
    except (cv2.error, ValueError) as error:
        raise CalibrationError(f"OpenCV finds no camera; add views of other tilts ({error})") from error
    poses = [
        RigidTransform.from_components(np.ravel(translation), Rotation.from_rotvec(np.ravel(rotation))) * frame
        for rotation, translation, frame in zip(rotations, translations, frames, strict=True)
    ]
    return camera, poses


def _fit_of(model, camera, poses, object_points, image_points):
    """OpenCV's solution as a `Fit`: its parameters and their covariance."""
    shared = [camera.parameters[name] for name in model.names]
    views = Views.stack(object_points, image_points)
    rotations = np.array([pose.rotation.as_matrix() for pose in poses])
    positions = np.array([pose.apply(centroid) for pose, centroid in zip(poses, views.centroids, strict=True)])
    state = State(np.array(shared), rotations, positions)
    if evaluate(model, views, state) is None:
        raise CalibrationError("OpenCV's camera has points behind it; check the order of the points, add tilted views")
    return fit_at(model, views, state)
