"""The paper's two stages for one view: Tsai's linear solution, then a genetic algorithm on (f, T_z).

Stage 1 is `calibrate_tsai` (the algebra is in `tsai`), stage 2 `calibrate_genetic` (the algorithm is in
`genetic`); between them lies `TwoStageObjective`, Eqs. 6 and 7 for many chromosomes at once.
"""

from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from scipy.spatial.transform import RigidTransform

from ...camera import demand_tsai, distort_radius, max_undistorted_radius
from ...checks import CalibrationError, as_matched_points, as_number, undetermined_if_singular
from ..joint.judge import profile_focal_length
from ..joint.starts import demand_views
from ..planes import is_planar
from ..result import MINIMUM_POINTS, Calibration
from .genetic import repeat_genetic
from .tsai import solve_coplanar, solve_noncoplanar

BOX = 0.25
"""Half-width of stage 2's box, as a fraction of the linear f and T_z (Eq. 5)."""

EDGE = 1e-3
"""A solution within this fraction of the box's width of its edge is said to sit on the edge."""

OVERSHOOT = 1e3
"""Added to the objective, px, per fraction of the box's width by which a chromosome's f leaves it."""

PENALTY = 1e6
"""Objective, px, of a chromosome for which a point lies behind the camera or has no image."""


SIDE_BY_SIDE = 8
"""Runs of the genetic algorithm that are evaluated together: their arrays still fit into a processor's cache."""


@undetermined_if_singular()
def calibrate_tsai(object_points, image_points, camera):
    """Stage 1: Tsai's linear calibration of one view, without distortion (Table 1, "linear").

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm.  Of one plane (a board, also as measured, in any frame; n >= 5): `solve_coplanar`; else (n >= 7)
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
    demand_tsai(camera)
    demand_views([object_points], [image_points], camera.image_size)
    solve = solve_coplanar if is_planar(object_points) else solve_noncoplanar
    solution = solve(object_points, camera.to_sensor(image_points))
    camera = replace(
        camera, focal_length=solution.focal_length, kappa1=0.0, scale_x=camera.scale_x * solution.scale_x
    )
    pose = RigidTransform.from_components(solution.translation, solution.rotation)
    residuals = camera.project(object_points, pose) - image_points
    return Calibration(camera, [pose], [residuals], solution.flags)


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
    return np.sum(c1 * (y_u - c4), axis=-1, keepdims=True) / np.sum(c1**2, axis=-1, keepdims=True)


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
        self.pixels_per_mm = np.array(linear.camera.pixels_per_mm)
        self.sensor_points = linear.camera.to_sensor(image_points)
        self.squared_radius = np.sum(self.sensor_points**2, axis=1)
        self.x_c = x_turned + pose.translation[0]
        self.c3 = y_turned + pose.translation[1]
        self.c4 = self.sensor_points[:, 1]
        self.c1 = self.c4 * self.squared_radius
        self.lateral = np.hypot(self.x_c, self.c3)

    @classmethod
    def stack(cls, objectives):
        """Several objectives of equally many points as one: chromosomes (r, m, 2), the r-th for the r-th of them."""
        both = object.__new__(cls)
        both.form = objectives[0].form
        for name in ("pixels_per_mm", "sensor_points", "squared_radius", "x_c", "c1", "c2", "c3", "c4", "lateral"):
            setattr(both, name, np.stack([getattr(objective, name) for objective in objectives])[:, None])
        return both

    def __call__(self, chromosomes):
        """Eq. 7, px, of chromosomes (m, 2); `PENALTY` where a point lies behind the camera or has no image."""
        residual_x, residual_y, valid = self._residuals(chromosomes)
        distances = np.sqrt(residual_x**2 + residual_y**2)
        return np.where(valid, np.minimum(distances.mean(axis=-1), PENALTY), PENALTY)

    def residuals(self, chromosomes):
        """Projected minus measured, px, (m, n, 2), of chromosomes (m, 2) that see all points."""
        return np.stack(self._residuals(chromosomes)[:2], axis=-1)

    def kappa1(self, chromosomes):
        """kappa1, mm^-2, of chromosomes (m, 2): shape (m, 1) if shared, (m, n) if per point."""
        return self._kappa1(*self._in_front(chromosomes)[:2])

    def _in_front(self, chromosomes):
        """Columns f and T_z (m, 1), and whether all points lie in front (m,); where not, some other T_z."""
        focal_length, t_z = np.moveaxis(np.asarray(chromosomes, np.float64), -1, 0)[..., None]
        nearest = self.c2.min(axis=-1, keepdims=True)
        front = nearest + t_z > 0
        return focal_length, np.where(front, t_z, 1 - nearest), front[..., 0]

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
            undistorted = magnification * self.lateral
            valid = valid & np.all(undistorted <= max_undistorted_radius(kappa1), axis=-1)
            factor = distort_radius(undistorted, kappa1) / np.where(self.lateral > 0, self.lateral, 1.0)
        x_d, y_d = np.moveaxis(self.sensor_points, -1, 0)
        scale_x, scale_y = np.moveaxis(self.pixels_per_mm, -1, 0)[..., None]
        return (factor * self.x_c - x_d) * scale_x, (factor * self.c3 - y_d) * scale_y, valid


class _Genes:
    """Between the chromosomes (f, T_z) in the box of Eq. 5 and the genes that the algorithm moves.

    ``"printed"`` genes are (f, T_z) themselves.  ``"magnification"`` genes are (m, T_z) with
    m = f / (T_z + mean c_2), the magnification at the centroid of the points: f and T_z lie in a valley
    as narrow as m is certain and as long as T_z is not, and these genes are its axes.  The box is the
    same: m has the range that the box allows; f outside is clipped, and what was clipped is penalised
    (clipping alone would make the corners of the box attractive, as many m would mean the same f there).
    An optimum on the edge in f then lies on an oblique ridge that these genes climb slowly: of 25 seeds on each of
    11 such simulated views 225 of 275 end within 1e-4 px of it, the worst 0.045 px above.
    """

    def __init__(self, form, linear, c2, box):
        if form not in ("magnification", "printed"):
            raise ValueError(f"genes is {form!r}; expected 'magnification' or 'printed'")
        centre = np.array([linear.camera.focal_length, linear.cam_from_object[0].translation[2]])
        half = box * np.abs(centre)
        self.form, self.lower, self.upper = form, centre - half, centre + half
        self.mean_c2 = c2.mean()
        self.smallest_depth = 0.1 * (centre[1] + self.mean_c2)  # where the box reaches behind the camera
        self.initial = centre if form == "printed" else np.array([centre[0] / self.depth(centre[1]), centre[1]])

    @classmethod
    def stack(cls, codings):
        """The genes of several runs as one, which takes genes (r, m, 2)."""
        both = object.__new__(cls)
        both.form = codings[0].form
        for name in ("lower", "upper", "mean_c2", "smallest_depth"):
            setattr(both, name, np.stack([getattr(coding, name) for coding in codings])[:, None])
        return both

    def depth(self, t_z):
        """Depth of the points' centroid, mm."""
        return np.maximum(t_z + self.mean_c2, self.smallest_depth)

    @property
    def bounds(self):
        """(2, 2) bounds of the genes."""
        if self.form == "printed":
            return np.column_stack([self.lower, self.upper])
        smallest = self.lower[0] / self.depth(self.upper[1])
        largest = self.upper[0] / self.depth(self.lower[1])
        return np.array([[smallest, largest], [self.lower[1], self.upper[1]]])

    def decode(self, genes):
        """Genes (..., 2) to chromosomes (f, T_z)."""
        if self.form == "printed":
            return genes
        focal_length = np.clip(self._focal_length(genes), self.lower[..., 0], self.upper[..., 0])
        return np.stack([focal_length, genes[..., 1]], axis=-1)

    def penalty(self, genes):
        """What is added to the objective of genes (..., 2) whose f was clipped, px."""
        if self.form == "printed":
            return np.zeros(genes.shape[:-1])
        focal_length, lower, upper = self._focal_length(genes), self.lower[..., 0], self.upper[..., 0]
        outside = np.maximum(lower - focal_length, focal_length - upper)
        return OVERSHOOT * np.maximum(outside, 0) / (upper - lower)

    def _focal_length(self, genes):
        return genes[..., 0] * self.depth(genes[..., 1])

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


def _edge_flags(coding, chromosome, allowed_f):
    """A sentence if the chromosome sits on the edge of the box, with what the view knows of f without a box.

    A wrong principal point moves f by more than the interval with it held says, so both intervals are told:
    `allowed_f` maps "fixed" and "free" to their words.
    """
    flags = coding.flags(chromosome)
    if not flags:
        return ()
    held, free = map(allowed_f, ("fixed", "free"))
    return (
        f"{flags[0]} Least squares of all parameters of this view (95 %, profile likelihood, this lens model): f is "
        f"{held} with this principal point, and {free} with the principal point free.",
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


@undetermined_if_singular()
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
    return repeat_calibration(
        object_points, [image_points], camera, [rng], box=box, kappa1=kappa1, genes=genes, **options
    )[0]


def repeat_calibration(
    object_points, image_points, camera, rngs, *, box=BOX, kappa1="shared", genes="magnification", **options
):
    """`calibrate_genetic` for many runs side by side, which takes a fraction of the time of one after the other.

    Parameters
    ----------
    object_points, camera
        As for `calibrate_genetic`, of all runs.
    image_points : (n, 2) or (r, n, 2) array_like
        px, of all runs or of each.
    rngs : sequence
        The source of randomness of each run, None, int or Generator.
    box, kappa1, genes, **options
        As for `calibrate_genetic`.

    Returns
    -------
    list of Calibration
        A run's result is that of `calibrate_genetic`, but for the last digits.

    Raises
    ------
    ValueError, CalibrationError
        As `calibrate_genetic`, if one run does; `ValueError` also if there are not as many images as runs.
    """
    box = as_number(box, "box", 0, 1, exclusive=True)
    shared = np.ndim(image_points) == 2
    images = [image_points] if shared else list(image_points)
    if not shared and len(images) != len(rngs):
        raise ValueError(f"image_points has {len(images)} images for {len(rngs)} rngs; expected one for each, or (n, 2)")
    starts = [_Start(object_points, image, camera, box, kappa1, genes) for image in images]
    starts = starts * len(rngs) if shared else starts
    groups = [slice(first, first + SIDE_BY_SIDE) for first in range(0, len(rngs), SIDE_BY_SIDE)]
    return [run for group in groups for run in _run_group(starts[group], rngs[group], options)]


def _run_group(starts, rngs, options):
    """The calibrations of some runs, one from each start."""
    objective = TwoStageObjective.stack([start.objective for start in starts])
    coding = _Genes.stack([start.coding for start in starts])
    found = repeat_genetic(
        lambda population: objective(coding.decode(population)) + coding.penalty(population),
        np.array([start.coding.bounds for start in starts]),
        rngs,
        keep_populations=True,
        **{"initial": np.array([start.coding.initial for start in starts])} | options,
    )
    return [start.result(run) for start, run in zip(starts, found, strict=True)]


class _Start:
    """One view, with what stage 2 starts from: stage 1, Eq. 7 and the genes."""

    def __init__(self, object_points, image_points, camera, box, kappa1, genes):
        self.view, self.intervals = (object_points, image_points, camera), {}
        self.linear = calibrate_tsai(*self.view)
        self.objective = TwoStageObjective(object_points, image_points, self.linear, kappa1=kappa1)
        self.coding = _Genes(genes, self.linear, self.objective.c2, box)

    @cached_property
    def common(self):
        """Eq. 7 with one kappa1 for all points."""
        return TwoStageObjective(*self.view[:2], self.linear)

    def allowed_f(self, principal_point):
        """The interval of f in words; found once, for it is the same for all runs."""
        if principal_point not in self.intervals:
            self.intervals[principal_point] = _allowed_f(*self.view, principal_point)
        return self.intervals[principal_point]

    def result(self, found):
        """The calibration that a run of the algorithm found."""
        if found.fun >= PENALTY:
            raise CalibrationError("no chromosome in the box sees all points; check the points and stage 1")
        populations = self.coding.decode(found.populations)
        best = populations[:, 0]
        kappa1 = np.ravel(self.common.kappa1(best))
        history = found.history.assign(focal_length=best[:, 0], T_z=best[:, 1], kappa1=kappa1)
        flags = self.linear.flags + _edge_flags(self.coding, best[-1], self.allowed_f)
        if self.objective.form == "per-point":
            flags += ("With one kappa1 per point Eq. 7 is the same for all (f, T_z): these were drawn, not found.",)
        pose = self.linear.cam_from_object[0]
        return Calibration(
            replace(self.linear.camera, focal_length=best[-1, 0], kappa1=kappa1[-1]),
            [RigidTransform.from_components([*pose.translation[:2], best[-1, 1]], pose.rotation)],
            [self.common.residuals(best[-1:])[0]],
            flags,
            history=history,
            populations=populations,
        )


# --- the oracle ----------------------------------------------------------------------------------------


SCANNED, SCANNED_F = 401, 41
"""Values of T_z across the box that `optimum_in_box` starts from, and of f for each of them."""

STARTS = 3
NARROWED = 9
"""Points of each later, narrower scan: it is a quarter as wide as the one before."""

COARSE, FINE = 8, 25
"""Narrower scans that find the valleys, to 1e-6 of the box, and that end at the last digits."""


@undetermined_if_singular()
def optimum_in_box(object_points, image_points, camera, *, box=BOX):
    r"""The best that stage 2 can find: the smallest Eq. 7 in the box of Eq. 5, without chance.  Judge the GA by it.

    The search has two unknowns, so it can be done in one: over T_z, of

    .. math:: g(T_z) = \min_{f_{low} \le f \le f_{high}} E(f, T_z),

    a valley's floor, however oblique and narrow the valley, and the edge of the box where the valley leaves it.  For a
    given T_z the undistorted problem is linear in f and kappa1, and E has one minimum, between the neighbours of the
    best of `SCANNED_F` values; ever narrower scans find it.  g is scanned at `SCANNED` values of T_z and its `STARTS`
    deepest valleys are narrowed alike, to the last digits.

    Parameters
    ----------
    object_points, image_points, camera, box
        As for `calibrate_genetic`.

    Returns
    -------
    Calibration
        With flags if the optimum sits on the edge of its box.

    Raises
    ------
    ValueError, CalibrationError
        As `calibrate_genetic`.
    """
    box = as_number(box, "box", 0, 1, exclusive=True)
    linear = calibrate_tsai(object_points, image_points, camera)
    objective = TwoStageObjective(object_points, image_points, linear)
    coding = _Genes("printed", linear, objective.c2, box)
    f_range = coding.lower[0], coding.upper[0]
    t_z = np.linspace(coding.lower[1], coding.upper[1], SCANNED)
    values = _valley_floor(objective, t_z, f_range, COARSE)[1]
    if values.min() >= PENALTY:
        raise CalibrationError("no chromosome in the box sees all points; check the points and stage 1")
    padded = np.pad(values, 1, constant_values=np.inf)
    valleys = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    starts = valleys[np.argsort(values[valleys])][:STARTS]
    low, high = t_z[np.maximum(starts - 1, 0)], t_z[np.minimum(starts + 1, SCANNED - 1)]
    found, values = _narrow(lambda t: _valley_floor(objective, t, f_range, FINE)[1], low, high, NARROWED, FINE)
    t_z = found[values.argmin()]
    best = np.array([_valley_floor(objective, t_z, f_range, FINE)[0], t_z])
    kappa1, stage_1 = objective.kappa1(best[None]).item(), linear.cam_from_object[0]
    return Calibration(
        replace(linear.camera, focal_length=best[0], kappa1=kappa1),
        [RigidTransform.from_components([*stage_1.translation[:2], best[1]], stage_1.rotation)],
        [objective.residuals(best[None])[0]],
        linear.flags + _edge_flags(coding, best, partial(_allowed_f, object_points, image_points, camera)),
    )


def _valley_floor(objective, t_z, f_range, scans):
    """The f within its range, ends included, with the smallest Eq. 7 for each T_z (any shape), and that value, px."""
    shape, t_z = np.shape(t_z), np.ravel(t_z)

    def at(f):
        chromosomes = np.stack([f, np.broadcast_to(t_z[:, None], f.shape)], axis=-1)
        return objective(chromosomes.reshape(-1, 2)).reshape(f.shape)

    f, values = _narrow(at, *(np.full(len(t_z), end) for end in f_range), SCANNED_F, scans)
    return f.reshape(shape), values.reshape(shape)


def _narrow(function, low, high, points, scans):
    """Where a function of (n, k) is smallest between low (n,) and high (n,), both included, and its value there."""
    for count in (points, *[NARROWED] * scans):
        places = np.linspace(low, high, count, axis=1)
        values = function(places)
        best = values.argmin(axis=1)[:, None]
        low, high = (np.take_along_axis(places, np.clip(best + k, 0, count - 1), 1)[:, 0] for k in (-1, 1))
    return np.take_along_axis(places, best, 1)[:, 0], np.take_along_axis(values, best, 1)[:, 0]
