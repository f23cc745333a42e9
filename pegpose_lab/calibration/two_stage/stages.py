"""The paper's two stages for one view: Tsai's linear solution, then a genetic algorithm on (f, T_z).

Stage 1 is `calibrate_tsai` (its algebra is in `tsai`) and stage 2 is `calibrate_genetic` (its algorithm is in
`genetic`).  `TwoStageObjective` connects them: it has Eqs. 6 and 7 for many chromosomes at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform

from ...camera import Sensor, TsaiCamera, as_sensor
from ...checks import CalibrationError, as_matched_points, as_number, undetermined_if_singular
from ...flags import Flag
from ..joint.starts import demand_views
from ..planes import is_planar
from ..result import MINIMUM_POINTS, Calibration
from .flags import judge_view, view_refused
from .genes import BOX, _Genes
from .genetic import repeat_genetic
from .objective import PENALTY, TwoStageObjective
from .tsai import solve_coplanar, solve_noncoplanar
from .valley import Valley

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIDE_BY_SIDE = 8
"""Number of genetic algorithm runs evaluated together; their arrays still fit into a processor's cache."""


@undetermined_if_singular()
def calibrate_tsai(object_points: ArrayLike, image_points: ArrayLike, camera: Sensor | TsaiCamera) -> Calibration:
    """Stage 1: Tsai's linear calibration of one view, without distortion (Table 1, "linear").

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm.  Points of one plane (n >= 5; an ideal or measured board, in any frame) are solved by `solve_coplanar`,
        others (n >= 7) by `solve_noncoplanar`, which also corrects scale_x.
    image_points : (n, 2) array_like
        px.
    camera : Sensor or TsaiCamera
        Gives the pixel pitch, principal point, image size and scale_x; f and kappa1 of a camera are not used.

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

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_tsai
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0).project(board, pose)
    >>> round(calibrate_tsai(board, image, sensor).camera.focal_length, 3)
    8.0

    References
    ----------
    R. Y. Tsai, "A versatile camera calibration technique for high-accuracy 3D machine vision metrology using
    off-the-shelf TV cameras and lenses", IEEE Journal of Robotics and Automation 3(4), 323-344, 1987.
    """
    object_points, image_points = as_matched_points(object_points, image_points, MINIMUM_POINTS)
    sensor = as_sensor(camera)
    demand_views([object_points], [image_points], sensor.image_size)
    solve = solve_coplanar if is_planar(object_points) else solve_noncoplanar
    try:
        solution = solve(object_points, sensor.to_sensor(image_points))
    except CalibrationError as error:
        raise view_refused(error, object_points, image_points) from error
    camera = replace(sensor, scale_x=sensor.scale_x * solution.scale_x).camera(solution.focal_length)
    pose = RigidTransform.from_components(solution.translation, solution.rotation)
    residuals = camera.project(object_points, pose) - image_points
    unknowns = 7 if is_planar(object_points) else 8  # the pose and f, and scale_x of a body
    flags = solution.flags + judge_view(object_points, image_points, camera, pose)
    return Calibration(camera, [pose], [residuals], flags, n_parameters=unknowns)


@undetermined_if_singular()
def calibrate_genetic(
    object_points: ArrayLike,
    image_points: ArrayLike,
    camera: Sensor | TsaiCamera,
    *,
    rng: Any = None,
    box: float = BOX,
    kappa1: str = "shared",
    genes: str = "magnification",
    **options: Any,
) -> Calibration:
    r"""Both stages of the paper for one view: Tsai's linear solution, then the genetic algorithm.

    Stage 2 searches (f, T_z) within +-`box` of the linear values (Eq. 5) for the smallest mean distance
    (Eqs. 7, 8).  Eq. 6 gives kappa1 of each chromosome; R, T_x and T_y stay as stage 1 found them.

    Parameters
    ----------
    object_points, image_points, camera
        As for `calibrate_tsai`.
    rng : None, int or Generator
        Source of the algorithm's randomness.
    box : float
        Half-width of the box as a fraction, between 0 and 1 (Eq. 5: 0.25).  As it is a fraction of T_z, the box
        depends on the world's origin: it is narrow if the origin lies near the plane z = 0 of the camera.
    kappa1 : {"shared", "per-point"}
        The reading of Eq. 6, see `TwoStageObjective`.
    genes : {"magnification", "printed"}
        The variables of the search: (m, T_z) with m = f / (T_z + mean(r_7 x + r_8 y)), the magnification at the
        centroid of the points, or the paper's (f, T_z).  The box is the same.
    **options
        Of `minimize_genetic`: population_size, generations, initialisation, crossover, alpha, mutation,
        mutation_index, mutation_rate.

    Returns
    -------
    Calibration
        With `history`, and a flag if the solution lies on the edge of its box (`edge_intervals` then tells what the
        view says about f without the box) or if the box has a lower point than the run found (`valley.Valley`).
        On 159 simulated views of wide lenses (f 400 to 800 px, k1 down to -0.4, every fourth a fisheye), 5 seeds each,
    all 410 runs end within 1e-4 px of the optimum if that lies inside the box.  If it lies on the edge, 102 of 385
    runs end farther above it (7 by more than 0.01 px), and all of these are flagged.

    Raises
    ------
    ValueError, CalibrationError
        As for `calibrate_tsai`; `CalibrationError` also if no chromosome in the box has all points in view.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_genetic
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> found = calibrate_genetic(board, image, sensor, rng=0)
    >>> round(found.camera.focal_length, 1), found.mean_distance < 0.01
    (8.0, True)
    """
    return repeat_calibration(
        object_points, [image_points], camera, [rng], box=box, kappa1=kappa1, genes=genes, **options
    )[0]


def repeat_calibration(
    object_points: ArrayLike,
    image_points: ArrayLike,
    camera: Sensor | TsaiCamera,
    rngs: Sequence[Any],
    *,
    box: float = BOX,
    kappa1: str = "shared",
    genes: str = "magnification",
    **options: Any,
) -> list[Calibration]:
    """Run `calibrate_genetic` many times side by side, which takes a fraction of the time of separate runs.

    Parameters
    ----------
    object_points, camera
        As for `calibrate_genetic`, the same for all runs.
    image_points : (n, 2) or (r, n, 2) array_like
        px, for all runs or for each run.
    rngs : sequence
        The source of randomness of each run: None, int or Generator.
    box, kappa1, genes, **options
        As for `calibrate_genetic`.

    Returns
    -------
    list of Calibration
        Each run has the result of `calibrate_genetic`, except for the last digits.

    Raises
    ------
    ValueError, CalibrationError
        As for `calibrate_genetic`, if one run fails; `ValueError` also if the numbers of images and runs differ.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor
    >>> from pegpose_lab.calibration import repeat_calibration
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> image = sensor.camera(8.0, kappa1=0.001).project(board, pose)
    >>> runs = repeat_calibration(board, image, sensor, [0, 1], generations=60)
    >>> [round(run.camera.focal_length, 1) for run in runs]
    [8.0, 8.0]
    """
    box = as_number(box, "box", 0, 1, exclusive=True)
    shared = np.ndim(image_points) == 2
    images = [image_points] if shared else list(image_points)
    if not shared and len(images) != len(rngs):
        raise ValueError(
            f"image_points has {len(images)} images for {len(rngs)} rngs; expected one for each, or (n, 2)"
        )
    starts = [_Start(object_points, image, camera, box, kappa1, genes) for image in images]
    starts = starts * len(rngs) if shared else starts
    groups = [slice(first, first + SIDE_BY_SIDE) for first in range(0, len(rngs), SIDE_BY_SIDE)]
    return [run for group in groups for run in _run_group(starts[group], rngs[group], options)]


def _run_group(starts, rngs, options):
    """The calibrations of several runs, one from each start."""
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
    """One view with everything that stage 2 needs to start: the result of stage 1, Eq. 7 and the genes."""

    def __init__(self, object_points, image_points, camera, box, kappa1, genes):
        self.view = object_points, image_points, camera
        self.linear = calibrate_tsai(*self.view)
        self.objective = TwoStageObjective(object_points, image_points, self.linear, kappa1=kappa1)
        self.coding = _Genes(genes, self.linear, self.objective.c2, box)
        if kappa1 == "shared":
            self.valley = Valley(self.objective, self.coding.lower, self.coding.upper)
            self.coding.follow(*self.valley.floor)

    @cached_property
    def common(self):
        """Eq. 7 with one kappa1 for all points."""
        shared = self.objective.form == "shared"
        return self.objective if shared else TwoStageObjective(*self.view[:2], self.linear)

    def result(self, found):
        """The calibration from one run of the algorithm."""
        if found.fun >= PENALTY:
            raise CalibrationError("no chromosome in the box sees all points; check the points and stage 1")
        populations = self.coding.decode(found.populations)
        best = populations[:, 0]
        kappa1 = np.ravel(self.common.kappa1(best))
        history = found.history.assign(focal_length=best[:, 0], T_z=best[:, 1], kappa1=kappa1)
        edge = self.coding.flags(best[-1])
        if self.objective.form == "shared":
            flags = self.linear.flags + self.valley.judge(best[-1], found.fun) + edge
        else:
            text = "With one kappa1 per point Eq. 7 is the same for all (f, T_z): these were drawn, not found."
            flags = (*self.linear.flags, *edge, Flag("drawn-not-found", text))
        residuals = self.common.residuals(best[-1:])[0]
        found = calibration_at(self.linear, best[-1], kappa1[-1], residuals)
        return replace(found, flags=flags, history=history, populations=populations)


def calibration_at(
    linear: Calibration,
    chromosome: Sequence[float] | NDArray[np.float64],
    kappa1: float,
    residuals: NDArray[np.float64] | None = None,
) -> Calibration:
    """Return stage 1 with another (f, T_z), mm, and kappa1, mm^-2; it has no flags, and only the given residuals.

    Examples
    --------
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_tsai
    >>> from pegpose_lab.calibration import calibration_at
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> sensor, board = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)), Checkerboard().object_points
    >>> pose = RigidTransform.from_components([-90, -70, 500], Rotation.from_rotvec([0.5, 0.2, 0]))
    >>> linear = calibrate_tsai(board, sensor.camera(8.0).project(board, pose), sensor)
    >>> found = calibration_at(linear, (8.1, 505.0), 0.001)
    >>> found.camera.focal_length, found.camera.kappa1, found.n_parameters
    (8.1, 0.001, 8)
    """
    stage_1 = linear.cam_from_object[0]
    camera = replace(linear.camera, focal_length=chromosome[0], kappa1=kappa1)
    pose = RigidTransform.from_components([*stage_1.translation[:2], chromosome[1]], stage_1.rotation)
    return Calibration(camera, [pose], [] if residuals is None else [residuals], n_parameters=linear.n_parameters + 1)
