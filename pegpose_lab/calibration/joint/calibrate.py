"""Joint calibration: bundle adjustment of all views, with the uncertainty of the result (`bundle` has the equations).

It also judges how noise affects S.  A view tells about f through its board tilt.  If the tilt is no larger than its own
noise, the information is made by the noise, more with every view, and f is wrong by many of its stated sigmas.
"""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from ...camera import Sensor, TsaiCamera, as_sensor
from ...checks import CalibrationError, as_choice, as_views, undetermined_if_singular
from ..result import MINIMUM_POINTS, Calibration, judge_image_size
from .fitting import fit_views
from .judge import _judge, judge_independence
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
    r"""Bundle adjustment of all views, with the paper's camera model (Eq. 3) or OpenCV's.

    It minimises the sum of the squared signed x and y residuals over the camera's parameters and the pose of each
    view, by the Levenberg-Marquardt method with exact derivatives.  (The derivative of Eq. 7's distances jumps at
    zero.)  It starts from the f of the views' homographies, or from the view whose linear solution (stage 1) has the
    smallest relative sigma of f.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry per view.
    image_points : sequence of (n, 2) array_like
        px.
    camera : Sensor or TsaiCamera
        Gives the pixel pitch, image size, scale_x and the principal point to start from (or to keep); f and kappa1 of
        a camera are not used.
    principal_point : {"free", "fixed"}
        Whether it is estimated.
    focal : {"one", "two"}
        One f, or two: f_x and f_y in px.  In the paper's model the second is scale_x, Tsai's uncertainty factor.
    coefficients : sequence of str, optional
        None: the paper's model, with kappa1.  Otherwise OpenCV's model, which distorts, with these of `COEFFICIENTS`
        estimated and the others zero; an empty list gives a camera without distortion.  The result is then an
        `OpenCVCamera`.
    loss : {"linear", "huber", "cauchy"}
        The loss of a point's distance.  The two robust losses bend at `HUBER` and `CAUCHY` standard deviations
        (estimated from the median distance), so that a few wrong corners have little influence.

    Returns
    -------
    Calibration
        With `covariance` of all parameters.  They are ``focal_length`` (mm), ``scale_x``, ``kappa1``, ``c_x`` and
        ``c_y`` as far as they are free, or ``f_x``, ``f_y`` (or ``f_x`` for both), ``c_x``, ``c_y`` and the
        coefficients; and for view v ``rx_v, ry_v, rz_v, tx_v, ty_v, tz_v``.  With a robust loss it is the covariance
        of the M-estimate (`_robust_variance`).  `classical_covariance` is valid if the lens follows the model and
        the noise is independent and equal at all points.  Where the residuals contradict independent noise,
        `covariance` is larger, by the scatter between the views (`clustered`), and a flag gives the factor for f; that
        takes `LEAST_VIEWS` views, and with fewer a flag says that the sigmas are too small.  `flags` also tell when
        the residuals favour a richer model or contradict a view (`misfit`), when the board tilt is below
        `SMALL_TILT`, and when f or the principal point is poorly known.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If the views do not determine f (for example if all boards are fronto-parallel within the noise), if they do
        not determine all parameters together, or if no minimum is found.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_joint
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001)
    >>> board, turns = Checkerboard().object_points, Rotation.from_rotvec(0.5 * np.eye(3))
    >>> poses = [RigidTransform.from_components([-90, -70, 500], turn) for turn in turns]
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
    flags += judge_independence(fit) + judge_image_size(found, image_points)
    flags += judge_misfit(fit, object_points, image_points, loss)
    residuals = [
        found.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    return Calibration(found, poses, residuals, flags, **fit.stated())
