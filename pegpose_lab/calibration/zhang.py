"""Zhang's calibration from several views of a plane, by OpenCV: the paper's rival (Sect. 5)."""

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import OpenCVCamera, Sensor
from ..checks import CalibrationError, as_choice, as_count, as_views, undetermined_if_singular
from .joint.fitting import fit_at
from .joint.misfit import judge_misfit
from .joint.models import lens_model
from .joint.starts import demand_views
from .joint.views import State, Views, evaluate
from .planes import FLAT, is_planar, plane_frame, relief
from .result import MINIMUM_POINTS, Calibration, judge_focal_length, judge_image_size


@undetermined_if_singular()
def calibrate_zhang(object_points, image_points, image_size, *, radial=2, tangential=False):
    r"""Zhang's calibration from several views of a plane, by `cv2.calibrateCamera`.

    Free are f_x, f_y, c_x, c_y and `radial` coefficients k1, k2, ...  Two radial ones and no tangential ones
    are what Zhang (2000) estimates and publishes.  ``radial=1`` is the paper's model but for its direction;
    ``tangential=True`` adds p1, p2 as the MATLAB toolbox does.  OpenCV's own default frees k3 as well, which
    an ordinary lens does not determine: it grows to compensate k2.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry a view, each of a plane (to `planes.FLAT`: a board as it is measured), anywhere.
    image_points : sequence of (n, 2) array_like
        px.
    image_size : (int, int)
        Width and height, px.
    radial : int
        Number of radial coefficients, 0 to 3.
    tangential : bool
        Free the two tangential coefficients, too.

    Returns
    -------
    Calibration
        With `OpenCVCamera` and `covariance`.  Its sigmas hold if the lens is of this model and the noise is alike and
        independent at all points; `flags` say it when the residuals speak against it (`misfit`).

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If there are fewer than two views, or they do not differ enough in their tilt.
    """
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    radial, tangential = as_count(radial, "radial", 0, 3), bool(as_choice(tangential, "tangential", (False, True)))
    size = Sensor((1.0, 1.0), (0.0, 0.0), image_size).image_size
    for view, points in enumerate(object_points):
        if not is_planar(points):
            raise ValueError(
                f"object_points[{view}] leave the plane through them by {100 * relief(points):.2g} % of their width; "
                f"expected a plane, to {100 * FLAT:g} % (calibrate_joint takes any object)"
            )
    if len(object_points) < 2:
        raise CalibrationError("one view of a plane gives two constraints on f_x, f_y, c_x, c_y; add tilted views")
    demand_views(object_points, image_points, size)
    camera, poses = _opencv_calibration(object_points, image_points, size, radial, tangential)
    fit = _fit_of(camera, poses, object_points, image_points, radial, tangential)
    flags = judge_focal_length(fit.covariance, "f_x", camera.camera_matrix[0, 0], "px", fit.freedom)
    flags += judge_image_size(camera, image_points) + judge_misfit(fit, object_points, image_points)
    residuals = [
        camera.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    return Calibration(camera, poses, residuals, flags, covariance=fit.covariance)


def _opencv_calibration(object_points, image_points, size, radial, tangential):
    """`cv2.calibrateCamera` as an `OpenCVCamera` and poses.

    It takes planes z = 0 only, and others if it is given a camera to start from: that of the same boards made flat.
    """
    frames = [plane_frame(points) for points in object_points]
    own = [frame.apply(points) for frame, points in zip(frames, object_points, strict=True)]
    flags = 0 if tangential else cv2.CALIB_ZERO_TANGENT_DIST
    for fixed in (cv2.CALIB_FIX_K1, cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K3)[radial:]:
        flags |= fixed
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


def _fit_of(camera, poses, object_points, image_points, radial, tangential):
    """OpenCV's solution as a `Fit`: its parameters and their covariance."""
    names = ["k1", "k2"][:radial] + ["p1", "p2"] * tangential + ["k3"] * (radial == 3)
    model = lens_model(Sensor((1.0, 1.0), (0.0, 0.0), camera.image_size), True, True, names)
    coefficients = dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.dist_coeffs, strict=True))
    shared = [*np.diag(camera.camera_matrix)[:2], *camera.camera_matrix[:2, 2], *(coefficients[name] for name in names)]
    views = Views.stack(object_points, image_points)
    rotations = np.array([pose.rotation.as_matrix() for pose in poses])
    positions = np.array([pose.apply(centroid) for pose, centroid in zip(poses, views.centroids, strict=True)])
    state = State(np.array(shared), rotations, positions)
    if evaluate(model, views, state) is None:
        raise CalibrationError("OpenCV's camera has points behind it; check the order of the points, add tilted views")
    return fit_at(model, views, state)
