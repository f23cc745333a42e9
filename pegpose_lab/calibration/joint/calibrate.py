"""Joint calibration: bundle adjustment of all views, with the uncertainty of the result (`bundle` has the equations).

It also judges how noise affects S.  A view tells about f through its board tilt.  If the tilt is no larger than its own
noise, the information is made by the noise, more with every view, and f is wrong by many of its stated sigmas.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...camera import Sensor, TsaiCamera, as_sensor
from ...checks import CalibrationError, as_choice, as_views, undetermined_if_singular
from ..board import FIRST_NOISE, BoardShape, board_unknowns
from ..result import MINIMUM_POINTS, Calibration, judge_image_size
from .fitting import fit_views
from .judge import _judge, judge_independence
from .misfit import judge_misfit, refused
from .models import lens_model
from .richer import f_tail
from .starts import demand_views

PRIOR_ROUNDS = 3
"""Fits with priors: the noise of the residuals, which weights them, is then settled to a percent."""


@undetermined_if_singular()
def calibrate_joint(
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    camera: Sensor | TsaiCamera,
    *,
    principal_point: str = "free",
    focal: str = "one",
    lens: str = "perspective",
    coefficients: Sequence[str] | None = None,
    board: Sequence[str] | Mapping[str, float] = (),
    loss: str = "linear",
) -> Calibration:
    r"""Bundle adjustment of all views, with the paper's camera model (Eq. 3), OpenCV's, or a fisheye lens.

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
    lens : {"perspective", "equidistant"}
        A lens without distortion has a point at the angle t to the axis at f tan(t), or at f t (a fisheye lens).
    coefficients : sequence of str, optional
        None: the paper's model, with kappa1; of an equidistant lens, k1 to k4.  Otherwise OpenCV's model, which distorts,
        with these of `RATIONAL` estimated and the others zero; an empty list gives a camera without distortion.  The
        result is then an `OpenCVCamera`, or of an equidistant lens a `FisheyeCamera`.  k1, k2, (k3,) p1 and p2 are the
        common polynomial; k4, k5 and k6 besides make a ratio, for wide lenses.
    board : sequence of str, or dict
        What of the board is estimated too: "warp" (a bow along x and y, mm: ``warp_x``, ``warp_y``), "bend" (its twist
        and S-shaped bends: ``twist``, ``bend_x``, ``bend_y``), "aspect" (a factor of y, about 1).  All views must show the
        same flat or nearly flat board.  A dictionary gives priors, as sigmas about the exact board, for example
        ``{"warp": 0.2, "aspect": 1e-4}``.  "scale" needs one, the relative sigma of the board's size: no view tells it, and
        it widens the covariance of the positions.
    loss : {"linear", "huber", "cauchy"}
        The loss of a point's distance.  The two robust losses bend at `HUBER` and `CAUCHY` standard deviations
        (estimated from the median distance), so that a few wrong corners have little influence.

    Returns
    -------
    Calibration
        With `board`, if its shape was estimated, and `covariance` of all parameters.  They are ``focal_length`` (mm),
        ``scale_x``, ``kappa1``, ``c_x`` and ``c_y`` as far as they are free, or ``f_x``, ``f_y`` (or ``f_x`` for both),
        ``c_x``, ``c_y`` and the coefficients; those of the board; and for view v ``rx_v, ry_v, rz_v, tx_v, ty_v, tz_v``.
        With a robust loss it is the covariance of the M-estimate (`_robust_variance`).  `classical_covariance` is valid
        if lens and board follow the model and the noise is independent and equal at all points.  Where the residuals
        contradict independent noise, `covariance` is larger, by the scatter between the views (`clustered`), and a flag
        gives the factor for f; that takes `LEAST_VIEWS` views, and with fewer a flag says that the sigmas are too small.
        `flags` also tell when the residuals favour a richer model of the lens or of the board, or contradict a view or
        a corner (`misfit`), when the board tilt is below `SMALL_TILT`, and when f or the principal point is poorly known.

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
    model = lens_model(sensor, principal_point == "free", focal == "two", coefficients, lens)
    unknowns, scale_sigma = board_unknowns(object_points, board)
    demand_views(object_points, image_points, sensor.image_size)
    model, fit = model.on(unknowns), None
    try:
        fit = _fit_with_priors(model, object_points, image_points, loss)
        flags = _judge(fit, object_points)
    except (CalibrationError, np.linalg.LinAlgError) as error:
        raise refused(error, model, object_points, image_points, fit, loss) from error
    found, poses = fit.model.camera(fit.state.shared), fit.state.poses(fit.views)
    flags += judge_independence(fit) + judge_image_size(found, image_points)
    flags += judge_misfit(fit, object_points, image_points, loss)
    shape = _board_shape(fit)
    residuals = [
        found.project(shape.apply(points) if shape else points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    stated = fit.stated()
    if scale_sigma:
        for name in ("covariance", "classical_covariance"):
            stated[name] = _with_scale(fit, stated[name], poses, scale_sigma)
    return Calibration(found, poses, residuals, flags, **stated, board=shape)


def _fit_with_priors(model, object_points, image_points, loss):
    """The fit; with priors it is repeated until they are weighted by the noise of the residuals."""
    fit = fit_views(model, object_points, image_points, loss)
    for _ in range(PRIOR_ROUNDS if model.board and model.board.has_prior else 0):
        model = model.on(replace(model.board, variance=fit.variance))
        fit = fit_views(model, object_points, image_points, loss, fit.state)
    return fit


def _board_shape(fit):
    """The estimated shape of the board, with the test whether it is exact; None if it was not estimated."""
    board, first = fit.model.board, len(fit.model.lens_names)
    if board is None:
        return None
    values, number = fit.state.shared[first:], len(board.names)
    off, covariance = values - board.start, fit.covariance.loc[board.names, board.names].to_numpy()
    freedom = max(fit.sigma_freedom - number + 1, 1) if fit.clustered else fit.freedom  # Hotelling's, of a scatter
    statistic = float(off @ np.linalg.solve(covariance, off)) / number
    if fit.clustered:
        statistic *= freedom / fit.sigma_freedom
    probability = float(f_tail(statistic, number, freedom))
    exact = replace(board, sigmas=np.full(number, np.inf), variance=FIRST_NOISE**2)  # without what only the fit needs
    return BoardShape(exact, dict(zip(board.names, values.tolist(), strict=True)), statistic, probability)


def _with_scale(fit, covariance, poses, sigma):
    """The covariance with the board's scale, which the views do not tell: all positions grow with it, and a bend does."""
    import pandas as pd

    rest = list(covariance.index)
    named = dict.fromkeys(rest, 0.0)
    for view, pose in enumerate(poses):
        named |= dict(zip((f"tx_{view}", f"ty_{view}", f"tz_{view}"), pose.translation, strict=True))
    if fit.model.board is not None:
        values = dict(zip(fit.model.names, fit.state.shared, strict=True))
        named |= {name: values[name] for name in fit.model.board.names if name != "aspect"}
    by_scale = np.array(list(named.values()))
    names = [*fit.model.names, "scale", *rest[len(fit.model.names) :]]
    found = pd.DataFrame(0.0, names, names)
    found.loc[rest, rest] = covariance.to_numpy() + sigma**2 * np.outer(by_scale, by_scale)
    found.loc["scale", rest] = found.loc[rest, "scale"] = sigma**2 * by_scale
    found.loc["scale", "scale"] = sigma**2
    return found
