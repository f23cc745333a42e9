"""Least squares of all views at once, and what it leaves uncertain (`bundle` has the equations).

What the residuals' noise does to S is judged too.  A view's tilt makes its information about f; where the tilt is no
larger than its own noise, the noise makes it, more so with every view, and f is wrong by many of its stated sigmas.
"""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from ...camera import Sensor, TsaiCamera, as_sensor
from ...checks import CalibrationError, as_choice, as_views, undetermined_if_singular
from ..result import MINIMUM_POINTS, Calibration, judge_image_size
from .fitting import fit_views
from .judge import _judge
from .misfit import judge_misfit, views_in_doubt
from .models import lens_model
from .starts import demand_views


@undetermined_if_singular()
def calibrate_joint(
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    camera: Sensor | TsaiCamera,
    *,
    principal_point: str = "free",
    focal: str = "one",
    coefficients: Sequence[str] | None = None,
    loss: str = "linear",
) -> Calibration:
    r"""Least squares of all views at once, with the paper's camera model (Eq. 3) or OpenCV's.

    Minimises the sum of the squared signed x and y residuals (not of Eq. 7's distances, whose derivative
    jumps at zero) over the camera's parameters and the pose of each view, by Levenberg and Marquardt's method
    with exact derivatives.  It starts at the f of the views' homographies, or at the view whose linear solution
    (stage 1) has the smallest relative sigma of f.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry a view.
    image_points : sequence of (n, 2) array_like
        px.
    camera : Sensor or TsaiCamera
        Gives pixel pitch, image size, scale_x and the principal point to start from (or to keep); f and kappa1 of a
        camera are not used.
    principal_point : {"free", "fixed"}
        Whether it is estimated.
    focal : {"one", "two"}
        One f; or two, f_x and f_y in px.  With the paper's model the second is scale_x, Tsai's uncertainty factor.
    coefficients : sequence of str, optional
        None: the paper's model, with kappa1.  Else OpenCV's distorting model with these of `COEFFICIENTS` free and
        the others zero, none of them for a camera without distortion; the result is an `OpenCVCamera`.
    loss : {"linear", "huber", "cauchy"}
        What a point's distance costs.  The two robust losses bend at `HUBER` and `CAUCHY` standard deviations (by
        the median of the distances), so that single wrong corners hardly count.

    Returns
    -------
    Calibration
        With `covariance` of all parameters: ``focal_length`` (mm), ``scale_x``, ``kappa1``, ``c_x``, ``c_y`` as far as
        they are free, or ``f_x``, ``f_y`` (or ``f_x`` for both), ``c_x``, ``c_y`` and the coefficients; and for
        view v ``rx_v, ry_v, rz_v, tx_v, ty_v, tz_v``.  A robust loss's is that of M-estimation (`_robust_variance`).
        Its sigmas, and intervals made of them, hold on two conditions: the lens is of the fitted model, and the
        noise is independent and alike at all points.  `flags` say it when the residuals speak for a richer model or
        against a view (`misfit`; correlated noise and bent boards are not seen), when planes are tilted by less than
        `SMALL_TILT`, or f or the principal point is hardly known.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If the views do not determine f, as when all are fronto-parallel as far as the noise can tell, or not all
        parameters together, or no minimum is found.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_joint
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001), Checkerboard().object_points
    >>> poses = [RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec(turn)) for turn in 0.5 * np.eye(3)]
    >>> images = [camera.project(board, pose) for pose in poses]
    >>> found = calibrate_joint([board] * 3, images, camera.sensor)
    >>> round(found.camera.focal_length, 3), round(found.camera.kappa1, 5), round(found.rms, 3)
    (8.0, 0.001, 0.0)
    """
    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    sensor = as_sensor(camera)
    as_choice(principal_point, "principal_point", ("free", "fixed"))
    as_choice(focal, "focal", ("one", "two"))
    as_choice(loss, "loss", ("linear", "huber", "cauchy"))
    model = lens_model(sensor, principal_point == "free", focal == "two", coefficients)
    demand_views(object_points, image_points, sensor.image_size)
    fit = fit_views(model, object_points, image_points, loss)
    try:
        flags = _judge(fit, object_points)
    except CalibrationError as error:
        doubt = views_in_doubt(fit, object_points, image_points, loss)
        raise CalibrationError(f"{doubt} With all views: {error}" if doubt else str(error)) from error
    found, poses = model.camera(fit.state.shared), fit.state.poses(fit.views)
    flags += judge_image_size(found, image_points) + judge_misfit(fit, object_points, image_points, loss)
    residuals = [
        found.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    return Calibration(found, poses, residuals, flags, covariance=fit.covariance, n_parameters=len(fit.covariance))
