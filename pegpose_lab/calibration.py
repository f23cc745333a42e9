r"""Calibration of the camera: what every method returns, and the methods.

=====================  ==========  ====================================================================
`calibrate_tsai`       one view    stage 1, linear, without distortion (Table 1, first row)
`calibrate_genetic`    one view    stage 2: genetic algorithm on (f, T_z), kappa1 by Eq. 6 (second row)
`calibrate_zhang`      many views  Zhang's method as OpenCV has it, the paper's rival (Sect. 5)
`calibrate_joint`      many views  least squares of everything at once, with the paper's camera model
=====================  ==========  ====================================================================
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pandas as pd
from scipy.linalg import block_diag
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from .camera import OpenCVCamera, TsaiCamera, distort_radius, max_undistorted_radius
from .checks import CalibrationError, as_matched_points, as_number, as_points
from .genetic import minimize_genetic
from .results import replacing
from .tsai import CONFIDENCE, LOOSE_INTERVAL, is_planar, solve_coplanar, solve_noncoplanar

BOX = 0.25
"""Half-width of stage 2's box, as a fraction of the linear f and T_z (Eq. 5)."""

EDGE = 1e-3
"""A solution within this fraction of the box's width of its edge is said to sit on the edge."""

OVERSHOOT = 1e3
"""Added to the objective, px, per fraction of the box's width by which a chromosome's f leaves it."""

PENALTY = 1e6
"""Objective, px, of a chromosome for which a point lies behind the camera or has no image."""

SMALLEST_SINGULAR = 1e-10
"""Smallest singular value of a Jacobian with columns of one length, relative to the largest."""

FILE_FORMAT = "pegpose_lab calibration 1"

MINIMUM_POINTS = 5
"""Points of a view: a plane's five ratios (Tsai)."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated camera, and how well it explains the points it was made from.

    Attributes
    ----------
    camera : TsaiCamera or OpenCVCamera
    cam_from_object : list of RigidTransform
        Pose of the object in each view.
    residuals : list of (n, 2) ndarray
        Projected minus measured, px, one array a view.
    flags : tuple of str
        What the reader must know before using the numbers, in sentences.
    history : DataFrame or None
        Of the genetic algorithm, a row a generation (see `GeneticResult`) with the best chromosome's
        ``focal_length``, ``T_z`` and ``kappa1``.
    covariance : DataFrame or None
        Covariance matrix of the parameters; rows and columns bear their names, views count from 0.
        Rotations are ``rx_0, ry_0, rz_0``: radians about the camera's axes, applied after the estimate.
    populations : (generations + 1, n, 2) ndarray or None
        (f, T_z) of every chromosome of every generation of the genetic algorithm, best first; not saved.
    """

    camera: TsaiCamera | OpenCVCamera
    cam_from_object: list
    residuals: list
    flags: tuple = ()
    history: pd.DataFrame | None = None
    covariance: pd.DataFrame | None = None
    populations: np.ndarray | None = None

    @property
    def mean_distance(self):
        r"""Eq. 7, px: :math:`E = \frac{1}{n} \sum \sqrt{(x_f - x_i)^2 + (y_f - y_i)^2}`, a mean, not an rms."""
        return float(np.hypot(*np.concatenate(self.residuals).T).mean())

    @property
    def rms(self):
        """Root of the mean squared distance, px: what OpenCV's calibrateCamera returns."""
        return float(np.sqrt(np.mean(np.sum(np.concatenate(self.residuals) ** 2, axis=1))))

    @property
    def axis_std(self):
        """Standard deviation in x and in y, px, (2,): the MATLAB toolbox's "pixel error" (divisor n - 1)."""
        return np.concatenate(self.residuals).std(axis=0, ddof=1)

    def sigma(self, name):
        """Standard deviation of a parameter of `covariance`; ValueError if there is none of that name."""
        if self.covariance is None or name not in self.covariance.index:
            known = "no covariance" if self.covariance is None else ", ".join(self.covariance.index)
            raise ValueError(f"name is {name!r}; this calibration has {known}")
        return float(np.sqrt(self.covariance.loc[name, name]))

    def save(self, path):
        """Write the calibration as an OpenCV FileStorage YAML file, whole or not at all.

        ``camera_matrix``, ``distortion_coefficients``, ``image_width``, ``image_height`` and
        ``extrinsic_parameters`` (rotation vector and translation, a row a view) are named as in OpenCV's
        own calibration files, so its tools can read them; `load` reads the rest, too.
        """
        storage = cv2.FileStorage(".yml", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
        for name, value in _as_nodes(self).items():
            storage.write(name, value)
        with replacing(path) as temporary:
            temporary.write_text(storage.releaseAndGetString(), encoding="utf-8")

    @classmethod
    def load(cls, path):
        """Read what `save` wrote.  Only numbers and text are read; nothing in the file is executed.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If it is not a calibration.
        """
        with open(path, encoding="utf-8", errors="replace") as file:
            text = file.read()
        try:
            return _from_nodes(_Nodes(text))
        except (cv2.error, SystemError, KeyError) as error:
            raise ValueError(f"{path} is not a calibration that Calibration.save wrote: {error}") from error


# --- stage 1 -------------------------------------------------------------------------------------------


def calibrate_tsai(object_points, image_points, camera):
    """Stage 1: Tsai's linear calibration of one view, without distortion (Table 1, "linear").

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm.  One z for all (a board in its own frame, n >= 5): `solve_coplanar`; else (n >= 7)
        `solve_noncoplanar`, which also corrects scale_x.
    image_points : (n, 2) array_like
        px.
    camera : TsaiCamera
        Gives pixel pitch, principal point, image size and scale_x; its f and kappa1 are not used.

    Returns
    -------
    Calibration
        With kappa1 = 0, and flags if the view hardly determines f.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If the view does not determine f, for instance a plane seen from straight ahead.
    """
    object_points, image_points = as_matched_points(object_points, image_points, MINIMUM_POINTS)
    _demand_tsai(camera)
    solve = solve_coplanar if is_planar(object_points) else solve_noncoplanar
    solution = solve(object_points, camera.to_sensor(image_points))
    camera = replace(
        camera, focal_length=solution.focal_length, kappa1=0.0, scale_x=camera.scale_x * solution.scale_x
    )
    pose = RigidTransform.from_components(solution.translation, solution.rotation)
    residuals = camera.project(object_points, pose) - image_points
    return Calibration(camera, [pose], [residuals], solution.flags)


# --- stage 2 -------------------------------------------------------------------------------------------


def kappa1_per_point(focal_length, t_z, c1, c2, c3, c4):
    r"""Eq. 6 as printed: the kappa1, mm^-2, that makes each point's y equation exact.

    .. math:: \kappa_1 = \frac{c_3 f}{c_1 (c_2 + T_z)} - \frac{c_4}{c_1}

    with :math:`c_1 = d_y y_i r^2`, :math:`c_2 = r_7 x_w + r_8 y_w`, :math:`c_3 = r_4 x_w + r_5 y_w + T_y`,
    :math:`c_4 = d_y' y_i` of each point (n,), in mm on the sensor and in the world (`TwoStageObjective`
    has them).  `focal_length` and `t_z` broadcast against them.  A point on the camera's x axis, c1 = 0,
    says nothing of distortion and gets 0.
    """
    on_axis = c1 == 0
    safe = np.where(on_axis, 1.0, c1)
    return np.where(on_axis, 0.0, c3 * focal_length / (safe * (c2 + t_z)) - c4 / safe)


def kappa1_shared(focal_length, t_z, c1, c2, c3, c4):
    r"""One kappa1, mm^-2, for all points: least squares of Eq. 6's y equation; arguments as `kappa1_per_point`.

    .. math:: \kappa_1 = \frac{\sum c_1 \, (c_3 f / (c_2 + T_z) - c_4)}{\sum c_1^2}

    The sums run over the last axis, which stays with length 1.
    """
    y_u = c3 * focal_length / (c2 + t_z)
    return np.sum(c1 * (y_u - c4), axis=-1, keepdims=True) / np.sum(c1**2)


class TwoStageObjective:
    r"""Eq. 7 for many chromosomes (f, T_z) at once, with R, T_x and T_y held at stage 1.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm.
    image_points : (n, 2) array_like
        Measured, px.
    linear : Calibration
        Stage 1 of the same view (`calibrate_tsai`).
    kappa1 : {"shared", "per-point"}
        One coefficient per chromosome (`kappa1_shared`), or one per point, exactly as Eq. 6 is printed.
        Then each y residual is zero, and with the measured radius in Eq. 3 each x residual depends on
        neither f nor T_z: Eq. 7 is the same for all chromosomes.

    Attributes
    ----------
    c1, c2, c3, c4 : (n,) ndarray
        The constants of Eq. 6.
    """

    def __init__(self, object_points, image_points, linear, *, kappa1="shared"):
        object_points, image_points = as_matched_points(object_points, image_points, MINIMUM_POINTS)
        if kappa1 not in ("shared", "per-point"):
            raise ValueError(f"kappa1 is {kappa1!r}; expected 'shared' or 'per-point'")
        pose = linear.cam_from_object[0]
        x_turned, y_turned, self.c2 = pose.rotation.apply(object_points).T
        self.form = kappa1
        self.pixels_per_mm = linear.camera.pixels_per_mm
        self.sensor_points = linear.camera.to_sensor(image_points)
        self.squared_radius = np.sum(self.sensor_points**2, axis=1)
        self.x_c = x_turned + pose.translation[0]
        self.c3 = y_turned + pose.translation[1]
        self.c4 = self.sensor_points[:, 1]
        self.c1 = self.c4 * self.squared_radius

    def __call__(self, chromosomes):
        """Eq. 7, px, of chromosomes (m, 2); `PENALTY` where a point lies behind the camera or has no image."""
        residual_x, residual_y, valid = self._residuals(chromosomes)
        return np.where(valid, np.minimum(np.hypot(residual_x, residual_y).mean(axis=-1), PENALTY), PENALTY)

    def residuals(self, chromosomes):
        """Projected minus measured, px, (m, n, 2), of chromosomes (m, 2) that see all points."""
        return np.stack(self._residuals(chromosomes)[:2], axis=-1)

    def kappa1(self, chromosomes):
        """kappa1, mm^-2, of chromosomes (m, 2): shape (m, 1) if shared, (m, n) if per point."""
        return self._kappa1(*self._in_front(chromosomes)[:2])

    def _in_front(self, chromosomes):
        """Columns f and T_z (m, 1), and whether all points lie in front (m,); where not, some other T_z."""
        focal_length, t_z = np.asarray(chromosomes, np.float64).T[..., None]
        nearest = self.c2.min()
        front = nearest + t_z > 0
        return focal_length, np.where(front, t_z, 1 - nearest), front[:, 0]

    def _kappa1(self, focal_length, t_z):
        equation_6 = kappa1_per_point if self.form == "per-point" else kappa1_shared
        return equation_6(focal_length, t_z, self.c1, self.c2, self.c3, self.c4)

    def _residuals(self, chromosomes):
        """Residuals in x and in y (m, n), and whether a chromosome sees all points (m,)."""
        focal_length, t_z, valid = self._in_front(chromosomes)
        magnification = focal_length / (self.c2 + t_z)
        kappa1 = self._kappa1(focal_length, t_z)
        if self.form == "per-point":
            stretch = 1 + kappa1 * self.squared_radius  # Eq. 3 with the measured radius, as printed
            valid = valid & np.all(stretch != 0, axis=-1)
            factor = magnification / np.where(stretch == 0, 1.0, stretch)
        else:
            lateral = np.hypot(self.x_c, self.c3)
            undistorted = magnification * lateral
            valid = valid & np.all(undistorted <= max_undistorted_radius(kappa1), axis=-1)
            factor = distort_radius(undistorted, kappa1) / np.where(lateral > 0, lateral, 1.0)
        x_d, y_d = self.sensor_points.T
        scale_x, scale_y = self.pixels_per_mm
        return (factor * self.x_c - x_d) * scale_x, (factor * self.c3 - y_d) * scale_y, valid


class _Genes:
    """Between the chromosomes (f, T_z) in the box of Eq. 5 and the genes that the algorithm moves.

    ``"printed"`` genes are (f, T_z) themselves.  ``"magnification"`` genes are (m, T_z) with
    m = f / (T_z + mean c_2), the magnification at the centroid of the points: f and T_z lie in a valley
    as narrow as m is certain and as long as T_z is not, and these genes are its axes.  The box is the
    same: m has the range that the box allows; f outside is clipped, and what was clipped is penalised
    (clipping alone would make the corners of the box attractive, as many m would mean the same f there).
    """

    def __init__(self, form, linear, c2, box):
        if form not in ("magnification", "printed"):
            raise ValueError(f"genes is {form!r}; expected 'magnification' or 'printed'")
        centre = np.array([linear.camera.focal_length, linear.cam_from_object[0].translation[2]])
        half = box * np.abs(centre)
        self.form, self.lower, self.upper = form, centre - half, centre + half
        self.mean_c2 = c2.mean()
        self.smallest_depth = 0.1 * (centre[1] + self.mean_c2)  # where the box reaches behind the camera
        self.initial = centre if form == "printed" else np.array([centre[0] / self._depth(centre[1]), centre[1]])

    def _depth(self, t_z):
        return np.maximum(t_z + self.mean_c2, self.smallest_depth)

    @property
    def bounds(self):
        """(2, 2) bounds of the genes."""
        if self.form == "printed":
            return np.column_stack([self.lower, self.upper])
        smallest = self.lower[0] / self._depth(self.upper[1])
        largest = self.upper[0] / self._depth(self.lower[1])
        return np.array([[smallest, largest], [self.lower[1], self.upper[1]]])

    def decode(self, genes):
        """Genes (..., 2) to chromosomes (f, T_z)."""
        if self.form == "printed":
            return genes
        return np.stack([np.clip(self._focal_length(genes), self.lower[0], self.upper[0]), genes[..., 1]], axis=-1)

    def penalty(self, genes):
        """What is added to the objective of genes (m, 2) whose f was clipped, px."""
        if self.form == "printed":
            return np.zeros(len(genes))
        focal_length = self._focal_length(genes)
        outside = np.maximum(self.lower[0] - focal_length, focal_length - self.upper[0])
        return OVERSHOOT * np.maximum(outside, 0) / (self.upper[0] - self.lower[0])

    def _focal_length(self, genes):
        return genes[..., 0] * self._depth(genes[..., 1])

    def flags(self, chromosome):
        """A sentence if the chromosome sits on the edge of the box."""
        gap = np.minimum(chromosome - self.lower, self.upper - chromosome) / (self.upper - self.lower)
        names = [name for name, value in zip(("f", "T_z"), gap, strict=True) if value < EDGE]
        if not names:
            return ()
        box = ", ".join(
            f"{name} {low:.5g} to {high:.5g} mm"
            for name, low, high in zip(("f", "T_z"), self.lower, self.upper, strict=True)
        )
        return (
            f"The solution sits on the edge of its box in {' and '.join(names)} (box: {box}): the best f may lie "
            "outside; widen the box, tilt the board more, or calibrate several views jointly.",
        )


def calibrate_genetic(
    object_points, image_points, camera, *, rng=None, box=BOX, kappa1="shared", genes="magnification", **options
):
    r"""Both stages of the paper for one view: Tsai's linear solution, then the genetic algorithm.

    Stage 2 searches (f, T_z) within +-`box` of the linear values (Eq. 5) for the smallest mean distance
    (Eqs. 7, 8), with kappa1 of every chromosome by Eq. 6; R, T_x and T_y stay as stage 1 found them.

    Parameters
    ----------
    object_points, image_points, camera
        As for `calibrate_tsai`.
    rng : None, int or Generator
        Source of the algorithm's randomness.
    box : float
        Half-width of the box as a fraction, between 0 and 1 (Eq. 5: 0.25).  It is a fraction of T_z, which
        depends on where the world's origin is: with the origin near the camera's own plane it is narrow.
    kappa1 : {"shared", "per-point"}
        How Eq. 6 is read, see `TwoStageObjective`.
    genes : {"magnification", "printed"}
        What the algorithm moves: (m, T_z) with m = f / (T_z + mean(r_7 x + r_8 y)), the magnification at the
        centroid of the points, or the paper's (f, T_z).  The box is the same.
    **options
        Of `minimize_genetic`: population_size, generations, initialisation, crossover, alpha, mutation,
        mutation_index, mutation_rate.

    Returns
    -------
    Calibration
        With `history`, and flags if the solution sits on the edge of its box.

    Raises
    ------
    ValueError, CalibrationError
        As `calibrate_tsai`; `CalibrationError` also if nothing in the box sees all points.
    """
    box = as_number(box, "box", 0, 1, exclusive=True)
    linear = calibrate_tsai(object_points, image_points, camera)
    objective = TwoStageObjective(object_points, image_points, linear, kappa1=kappa1)
    coding = _Genes(genes, linear, objective.c2, box)
    found = minimize_genetic(
        lambda population: objective(coding.decode(population)) + coding.penalty(population),
        coding.bounds,
        initial=coding.initial,
        keep_populations=True,
        rng=rng,
        **options,
    )
    if found.fun >= PENALTY:
        raise CalibrationError("no chromosome in the box sees all points; check the points and stage 1")
    shared = TwoStageObjective(object_points, image_points, linear)
    populations = coding.decode(found.populations)
    best = populations[:, 0]
    history = found.history.assign(
        focal_length=best[:, 0], T_z=best[:, 1], kappa1=np.ravel(shared.kappa1(best))
    )
    flags = linear.flags + coding.flags(best[-1])
    if kappa1 == "per-point":
        flags += ("With one kappa1 per point Eq. 7 is the same for all (f, T_z): these were drawn, not found.",)
    last, stage_1 = history.iloc[-1], linear.cam_from_object[0]
    return Calibration(
        replace(linear.camera, focal_length=last["focal_length"], kappa1=last["kappa1"]),
        [RigidTransform.from_components([*stage_1.translation[:2], last["T_z"]], stage_1.rotation)],
        [shared.residuals(best[-1:])[0]],
        flags,
        history=history,
        populations=populations,
    )


# --- many views ----------------------------------------------------------------------------------------


def calibrate_zhang(object_points, image_points, image_size, *, radial=2, tangential=False):
    r"""Zhang's calibration from several views of a plane, by `cv2.calibrateCamera`.

    Free are f_x, f_y, c_x, c_y and `radial` coefficients k1, k2, ...  Two radial ones and no tangential ones
    are what Zhang (2000) estimates and publishes.  ``radial=1`` is the paper's model but for its direction;
    ``tangential=True`` adds p1, p2 as the MATLAB toolbox does.  OpenCV's own default frees k3 as well, which
    an ordinary lens does not determine: it grows to compensate k2.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry a view, each in a plane z = 0.
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
        With `OpenCVCamera` and `covariance`.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If there are fewer than two views, or they do not differ enough in their tilt.
    """
    object_points, image_points = _as_views(object_points, image_points)
    if any(np.any(points[:, 2] != 0) for points in object_points):
        raise ValueError("object_points has z other than 0; expected each board in its own frame, z = 0")
    if as_number(radial, "radial", 0, 3) != int(radial):
        raise ValueError(f"radial is {radial}; expected 0, 1, 2 or 3")
    if len(object_points) < 2:
        raise CalibrationError("one view of a plane gives two constraints on f_x, f_y, c_x, c_y; add tilted views")
    camera, poses = _opencv_calibration(object_points, image_points, image_size, int(radial), tangential)
    residuals = [
        camera.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    free = ["f_x", "f_y", "c_x", "c_y", *("k1", "k2")[: int(radial)], *("p1", "p2") * bool(tangential)]
    free += ["k3"] * (radial == 3)
    views = zip(object_points, poses, strict=True)
    jacobian = _assemble([_opencv_jacobian(camera, points, pose, free) for points, pose in views])
    squared_sum = sum(np.sum(view**2) for view in residuals)
    covariance = _covariance(jacobian, squared_sum, free + _pose_names(len(poses)))
    flags = _judge_focal_length(covariance, "f_x", camera.camera_matrix[0, 0], "px")
    return Calibration(camera, poses, residuals, flags, covariance=covariance)


def _opencv_calibration(object_points, image_points, image_size, radial, tangential):
    """`cv2.calibrateCamera` as an `OpenCVCamera` and poses."""
    flags = 0 if tangential else cv2.CALIB_ZERO_TANGENT_DIST
    for fixed in (cv2.CALIB_FIX_K1, cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K3)[radial:]:
        flags |= fixed
    size = OpenCVCamera(np.eye(3), np.zeros(5), image_size).image_size
    try:
        _, matrix, coefficients, rotations, translations = cv2.calibrateCamera(
            [points.astype(np.float32) for points in object_points],
            [points.astype(np.float32) for points in image_points],
            size,
            None,
            None,
            flags=flags,
        )
        camera = OpenCVCamera(matrix, np.ravel(coefficients)[:5], size)
    except (cv2.error, ValueError) as error:
        raise CalibrationError(f"OpenCV finds no camera; add views of other tilts ({error})") from error
    poses = [
        RigidTransform.from_components(np.ravel(translation), Rotation.from_rotvec(np.ravel(rotation)))
        for rotation, translation in zip(rotations, translations, strict=True)
    ]
    return camera, poses


def _opencv_jacobian(camera, object_points, pose, free):
    """Derivatives (2n, k) and (2n, 6) of the projection by the free intrinsics and by the pose (see `_turn`)."""
    rotation_vector = pose.rotation.as_rotvec()
    jacobian = cv2.projectPoints(
        object_points, rotation_vector, pose.translation, camera.camera_matrix, camera.dist_coeffs
    )[1]
    columns = ["f_x", "f_y", "c_x", "c_y", "k1", "k2", "p1", "p2", "k3"]
    by_rotation = jacobian[:, :3] @ np.linalg.inv(_left_jacobian(rotation_vector))
    intrinsics = jacobian[:, 6:][:, [columns.index(name) for name in free]]
    return intrinsics, np.hstack([by_rotation, jacobian[:, 3:6]])


def calibrate_joint(object_points, image_points, camera, *, principal_point="free"):
    r"""Least squares of all views at once with the paper's camera model (Eq. 3).

    Minimises the sum of the squared signed x and y residuals (not of Eq. 7's distances, whose derivative
    jumps at zero) over f, kappa1, the principal point and the pose of each view, by
    `scipy.optimize.least_squares` with exact derivatives.  It starts at the view whose linear solution has
    the smallest relative sigma of f.

    Parameters
    ----------
    object_points : sequence of (n, 3) array_like
        mm, one entry a view.
    image_points : sequence of (n, 2) array_like
        px.
    camera : TsaiCamera
        Gives pixel pitch, image size, scale_x and the principal point to start from (or to keep).
    principal_point : {"free", "fixed"}
        Whether it is estimated.

    Returns
    -------
    Calibration
        With `covariance` of all parameters: ``focal_length``, ``kappa1``, ``c_x``, ``c_y`` if free, and for
        view v ``rx_v, ry_v, rz_v, tx_v, ty_v, tz_v``.

    Raises
    ------
    ValueError
        If the input is unusable.
    CalibrationError
        If no view determines f, as when all are fronto-parallel, or all of them together do not.
    """
    object_points, image_points = _as_views(object_points, image_points)
    _demand_tsai(camera)
    if principal_point not in ("free", "fixed"):
        raise ValueError(f"principal_point is {principal_point!r}; expected 'free' or 'fixed'")
    problem = _JointProblem(object_points, image_points, camera, principal_point == "free")
    fitted = least_squares(
        problem.residuals, problem.start(), problem.jacobian, x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12
    )
    camera, poses = problem.unpack(fitted.x)
    covariance = problem.covariance(camera, poses, 2 * fitted.cost)
    residuals = [
        camera.project(points, pose) - measured
        for points, measured, pose in zip(object_points, image_points, poses, strict=True)
    ]
    flags = _judge_focal_length(covariance, "focal_length", camera.focal_length, "mm")
    return Calibration(camera, poses, residuals, flags, covariance=covariance)


class _JointProblem:
    """Residuals and their derivatives for `calibrate_joint`.

    Parameters: f, kappa1, (c_x, c_y), then for each view a rotation vector about the camera's axes, applied
    after the starting rotation, and the position of the points' centroid, which the data determine far
    better than that of a distant origin.
    """

    def __init__(self, object_points, image_points, camera, free_principal_point):
        self.object_points, self.image_points, self.camera = object_points, image_points, camera
        self.names = ["focal_length", "kappa1", *("c_x", "c_y") * free_principal_point]
        self.centroids = [points.mean(axis=0) for points in object_points]
        self.start_rotations = None

    def start(self):
        """Starting parameters, kappa1 = 0; sets the rotations that the parameters turn."""
        focal_length = _linear_focal_length(self.object_points, self.image_points, self.camera)
        matrix = np.diag([*(focal_length * self.camera.pixels_per_mm), 1.0])
        matrix[:2, 2] = self.camera.principal_point
        views = zip(self.object_points, self.image_points, self.centroids, strict=True)
        poses = [_pnp(points - centroid, measured, matrix) for points, measured, centroid in views]
        self.start_rotations = [pose.rotation for pose in poses]
        intrinsics = [focal_length, 0.0, *self.camera.principal_point][: len(self.names)]
        return np.concatenate([intrinsics, *([0, 0, 0, *pose.translation] for pose in poses)])

    def residuals(self, parameters):
        """Signed residuals x, y, x, y, ... of all views, px; infinite where a point has no image."""
        intrinsics, blocks = self._split(parameters)
        projected = [
            _project(intrinsics, Rotation.from_rotvec(block[:3]).apply(start.apply(points - centroid)), block[3:])
            for points, centroid, start, block in self._views(blocks)
        ]
        return (np.concatenate(projected) - np.concatenate(self.image_points)).ravel()

    def jacobian(self, parameters):
        """Derivatives of `residuals` by all parameters."""
        intrinsics, blocks = self._split(parameters)
        pairs = []
        for points, centroid, start, block in self._views(blocks):
            turned = Rotation.from_rotvec(block[:3]).apply(start.apply(points - centroid))
            by_intrinsics, by_pose = _project_jacobian(intrinsics, turned, block[3:])
            by_pose[:, :3] = by_pose[:, :3] @ _left_jacobian(block[:3])
            pairs.append((by_intrinsics[:, : len(self.names)], by_pose))
        return _assemble(pairs)

    def unpack(self, parameters):
        """Parameters as a camera and poses of the objects' own origins."""
        intrinsics, blocks = self._split(parameters)
        poses = []
        for _, centroid, start, block in self._views(blocks):
            rotation = Rotation.from_rotvec(block[:3]) * start
            poses.append(RigidTransform.from_components(block[3:] - rotation.apply(centroid), rotation))
        return intrinsics, poses

    def covariance(self, camera, poses, squared_sum):
        """Covariance of the parameters, translations being those of the objects' own origins."""
        pairs = [
            _project_jacobian(camera, pose.rotation.apply(points), pose.translation)
            for points, pose in zip(self.object_points, poses, strict=True)
        ]
        jacobian = _assemble([(by_intrinsics[:, : len(self.names)], by_pose) for by_intrinsics, by_pose in pairs])
        return _covariance(jacobian, squared_sum, self.names + _pose_names(len(poses)))

    def _split(self, parameters):
        """The camera and the (views, 6) pose blocks; a trial step to f <= 0 gets the smallest f there is."""
        count = len(self.names)
        focal_length, kappa1 = max(parameters[0], np.finfo(float).tiny), parameters[1]
        center = tuple(parameters[2:4]) if count == 4 else self.camera.principal_point
        camera = replace(self.camera, focal_length=focal_length, kappa1=kappa1, principal_point=center)
        return camera, parameters[count:].reshape(-1, 6)

    def _views(self, blocks):
        return zip(self.object_points, self.centroids, self.start_rotations, blocks, strict=True)


def _linear_focal_length(object_points, image_points, camera):
    """f, mm, of the view whose stage 1 has the smallest relative sigma of f."""
    found, reasons = [], []
    for points, measured in zip(object_points, image_points, strict=True):
        solve = solve_coplanar if is_planar(points) else solve_noncoplanar
        try:
            solution = solve(points, camera.to_sensor(measured))
            found.append((solution.focal_length_sigma / solution.focal_length, solution.focal_length))
        except CalibrationError as error:
            reasons.append(str(error))
    if not found:
        raise CalibrationError(f"none of {len(object_points)} views determines f; of the first: {reasons[0]}")
    return min(found)[1]


def _pnp(object_points, image_points, camera_matrix):
    """Pose of one view through an undistorted camera, by OpenCV."""
    found, rotation, translation = cv2.solvePnP(
        object_points, image_points, camera_matrix, None, flags=cv2.SOLVEPNP_SQPNP
    )
    if not found or not np.isfinite([rotation, translation]).all():
        raise CalibrationError("OpenCV finds no pose for a view; check the order of its points")
    return RigidTransform.from_components(translation.ravel(), Rotation.from_rotvec(rotation.ravel()))


def _project(camera, turned, translation):
    """Image points (n, 2) of points R p (n, 3) at a translation; infinite where there is no image."""
    points = turned + translation
    front = points[:, 2:] > 0
    undistorted = camera.focal_length * points[:, :2] / np.where(front, points[:, 2:], 1.0)
    radius = np.hypot(*undistorted.T)[:, None]
    distorted = distort_radius(radius, camera.kappa1)
    projected = camera.to_image(undistorted / (1 + camera.kappa1 * distorted**2))
    return np.where(front & (radius <= max_undistorted_radius(camera.kappa1)), projected, np.inf)


def _project_jacobian(camera, turned, translation):
    r"""Derivatives (2n, 4) by f, kappa1, c_x, c_y and (2n, 6) by a turn about the camera's axes and a shift.

    With :math:`h = 1 / (1 + \kappa_1 r_d^2)` and :math:`s = 1 + 3 \kappa_1 r_d^2`, Eq. 3 solved for
    :math:`x_d = h x_u` has :math:`dx_d/dx_u = h I - (2 \kappa_1 h^3 / s) x_u x_u^T` and
    :math:`dx_d/d\kappa_1 = -(h r_d^2 / s) x_u`.
    """
    points = turned + translation
    x_u = camera.focal_length * points[:, :2] / points[:, 2:]
    squared = distort_radius(np.hypot(*x_u.T), camera.kappa1)[:, None] ** 2
    h, s = 1 / (1 + camera.kappa1 * squared), 1 + 3 * camera.kappa1 * squared
    outer = x_u[:, :, None] * x_u[:, None, :]
    by_x_u = h[..., None] * np.eye(2) - (2 * camera.kappa1 * h**3 / s)[..., None] * outer
    by_x_u = camera.pixels_per_mm[:, None] * by_x_u
    by_focal_length = by_x_u @ x_u[:, :, None] / camera.focal_length
    by_kappa1 = (camera.pixels_per_mm * (-h * squared / s) * x_u)[:, :, None]
    by_center = np.broadcast_to(np.eye(2), (len(points), 2, 2))
    x_u_by_point = np.concatenate(
        [np.broadcast_to(camera.focal_length * np.eye(2), (len(points), 2, 2)), -x_u[:, :, None]], axis=2
    ) / points[:, 2, None, None]
    by_shift = by_x_u @ x_u_by_point
    by_turn = np.cross(turned[:, None, :], by_shift)
    by_intrinsics = np.concatenate([by_focal_length, by_kappa1, by_center], axis=2)
    return by_intrinsics.reshape(-1, 4), np.concatenate([by_turn, by_shift], axis=2).reshape(-1, 6)


def _left_jacobian(rotation_vector):
    """J with exp(v + dv) = exp(J dv) exp(v) for rotation vectors v."""
    angle = np.linalg.norm(rotation_vector)
    cross = np.cross(np.eye(3), rotation_vector)  # [v]_x, antisymmetric
    if angle < 1e-4:
        return np.eye(3) + cross / 2 + cross @ cross / 6
    return (
        np.eye(3)
        + (1 - np.cos(angle)) / angle**2 * cross
        + (angle - np.sin(angle)) / angle**3 * cross @ cross
    )


def _assemble(pairs):
    """One Jacobian from each view's derivatives by the shared parameters and by its own pose."""
    shared, own = zip(*pairs, strict=True)
    return np.hstack([np.concatenate(shared), block_diag(*own)])


def _pose_names(count):
    return [f"{name}_{view}" for view in range(count) for name in ("rx", "ry", "rz", "tx", "ty", "tz")]


def _covariance(jacobian, squared_sum, names):
    """sigma^2 (J^T J)^-1 with sigma^2 = squared_sum / (rows - columns), as a labelled table."""
    rows, columns = jacobian.shape
    if rows <= columns:
        raise CalibrationError(f"{rows} coordinates cannot determine {columns} parameters; add points or views")
    scale = np.linalg.norm(jacobian, axis=0)
    _, singular, right = np.linalg.svd(jacobian / np.where(scale > 0, scale, 1), full_matrices=False)
    if scale.min() == 0 or singular[-1] < SMALLEST_SINGULAR * singular[0]:
        raise CalibrationError(
            f"the views do not determine all of {', '.join(names[:-6 * (len(names) // 6)])}: some can change "
            "together without moving a point; add views of other tilts (about 30 deg)"
        )
    root = right.T / singular / scale[:, None]
    return pd.DataFrame(squared_sum / (rows - columns) * root @ root.T, names, names)


def _judge_focal_length(covariance, name, value, unit):
    """Flags by the 95 % interval of f; `CalibrationError` if it reaches zero."""
    half = CONFIDENCE * np.sqrt(covariance.loc[name, name])
    interval = f"95 % interval {value - half:.4g} to {value + half:.4g} {unit}"
    if half >= value:
        raise CalibrationError(f"the views do not determine f ({interval}); add views tilted by about 30 deg")
    if half > LOOSE_INTERVAL * value:
        return (f"The views hardly determine f ({interval}): it trades off with T_z; add tilted views.",)
    return ()


# --- input and files -----------------------------------------------------------------------------------


def _demand_tsai(camera):
    if not isinstance(camera, TsaiCamera):
        raise ValueError(f"camera is {type(camera).__name__}; expected a TsaiCamera")


def _as_views(object_points, image_points):
    """Two lists of checked arrays, one entry a view."""
    for views, name in ((object_points, "object_points"), (image_points, "image_points")):
        if not hasattr(views, "__len__") or isinstance(views, str) or len(views) == 0 or np.ndim(views[0]) != 2:
            raise ValueError(f"{name} is not a sequence of arrays, one for each view")
    if len(object_points) != len(image_points):
        raise ValueError(
            f"object_points has {len(object_points)} views and image_points {len(image_points)}; expected as many"
        )
    pairs = [as_matched_points(*view, MINIMUM_POINTS) for view in zip(object_points, image_points, strict=True)]
    for points, measured in pairs:
        for array, name in ((points, "object_points"), (measured, "image_points")):
            singular = np.linalg.svd(array - array.mean(axis=0), compute_uv=False)
            if singular[1] <= 1e-6 * singular[0]:
                raise ValueError(f"{name} of shape {array.shape} lie on one line; expected a spread of points")
    return [[np.ascontiguousarray(view) for view in views] for views in zip(*pairs, strict=True)]  # for OpenCV


def _as_nodes(calibration):
    """What `Calibration.save` writes: names and values, in order."""
    camera, poses = calibration.camera, calibration.cam_from_object
    nodes = {"format": FILE_FORMAT, "camera_model": type(camera).__name__}
    nodes |= dict(zip(("image_width", "image_height"), camera.image_size, strict=True))
    if isinstance(camera, TsaiCamera):
        for name in ("focal_length", "kappa1", "scale_x"):
            nodes[name] = getattr(camera, name)
        for name in ("pixel_pitch", "principal_point"):
            nodes[name] = np.array([getattr(camera, name)])
        try:
            camera = camera.to_opencv()
        except ValueError:  # a distortion that no OpenCV camera describes
            camera = None
    if camera is not None:
        nodes |= {"camera_matrix": camera.camera_matrix, "distortion_coefficients": camera.dist_coeffs[None]}
    vectors = [np.concatenate([pose.rotation.as_rotvec(), pose.translation]) for pose in poses]
    nodes |= {"extrinsic_parameters": np.array(vectors), "avg_reprojection_error": calibration.rms}
    nodes["points_per_view"] = np.array([[float(len(residuals)) for residuals in calibration.residuals]])
    nodes["residuals"] = np.concatenate(calibration.residuals)
    nodes["flags"] = list(calibration.flags)
    for name in ("history", "covariance"):
        table = getattr(calibration, name)
        if table is not None:
            nodes |= {f"{name}_columns": list(table.columns), name: table.to_numpy(np.float64)}
    return nodes


class _Nodes:
    """Numbers, matrices and texts of a FileStorage text by name; KeyError where one is missing or not such."""

    def __init__(self, text):
        self.storage = cv2.FileStorage(text, cv2.FileStorage_READ | cv2.FileStorage_MEMORY)

    def __contains__(self, name):
        return not self.storage.getNode(name).empty()

    def _get(self, name, wanted):
        node = self.storage.getNode(name)
        if node.empty() or not wanted(node):
            raise KeyError(f"{name} is missing or of another kind")
        return node

    def number(self, name):
        return self._get(name, lambda node: node.isInt() or node.isReal()).real()

    def text(self, name):
        return self._get(name, lambda node: node.isString()).string()

    def texts(self, name):
        node = self.storage.getNode(name)
        return tuple(node.at(index).string() for index in range(node.size()))

    def matrix(self, name, columns):
        array = self._get(name, lambda node: node.isMap()).mat()
        return as_points(array, array.shape[-1] if columns is None else columns, name)

    def table(self, name):
        if name not in self:
            return None
        columns = self.texts(f"{name}_columns")
        return pd.DataFrame(self.matrix(name, len(columns)), columns=list(columns))


def _from_nodes(nodes):
    """The `Calibration` of a file."""
    if nodes.text("format") != FILE_FORMAT:
        raise ValueError(f"format is {nodes.text('format')!r}; expected {FILE_FORMAT!r}")
    size = nodes.number("image_width"), nodes.number("image_height")
    model = nodes.text("camera_model")
    if model not in (TsaiCamera.__name__, OpenCVCamera.__name__):
        raise KeyError(f"camera_model is {model!r}")
    if model == TsaiCamera.__name__:
        numbers = {name: nodes.number(name) for name in ("focal_length", "kappa1", "scale_x")}
        pairs = {name: tuple(nodes.matrix(name, 2)[0]) for name in ("pixel_pitch", "principal_point")}
        camera = TsaiCamera(image_size=size, **numbers, **pairs)
    else:
        coefficients = nodes.matrix("distortion_coefficients", None)[0]
        camera = OpenCVCamera(nodes.matrix("camera_matrix", 3), coefficients, size)
    poses = [
        RigidTransform.from_components(row[3:], Rotation.from_rotvec(row[:3]))
        for row in nodes.matrix("extrinsic_parameters", 6)
    ]
    ends = np.cumsum(nodes.matrix("points_per_view", len(poses))[0]).astype(int)
    residuals = np.split(nodes.matrix("residuals", 2), ends[:-1])
    history, covariance = nodes.table("history"), nodes.table("covariance")
    if history is not None:
        history = history.astype({"generation": int, "evaluations": int})
    if covariance is not None:
        covariance.index = covariance.columns
    return Calibration(camera, poses, residuals, nodes.texts("flags"), history, covariance)
