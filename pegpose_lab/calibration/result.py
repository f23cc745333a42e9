"""What every calibration returns: the camera, the poses, the residuals and the uncertainty.

=====================  ==============  ==========  ===========================================================
`calibrate_tsai`       `two_stage`     one view    stage 1, linear, without distortion (Table 1, first row)
`calibrate_genetic`    `two_stage`     one view    stage 2: genetic algorithm on (f, T_z), kappa1 by Eq. 6
                                                   (Table 1, second row)
`calibrate_zhang`      `zhang`         many views  Zhang's method by OpenCV, which the paper compares with (Sect. 5)
`calibrate_joint`      `joint`         many views  bundle adjustment with the paper's camera
=====================  ==============  ==========  ===========================================================
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from ..camera import UNKNOWN_SIZE
from ..checks import as_number, outside
from ..flags import Flag
from .files import read_calibration, write_calibration
from .two_stage.tsai import judge_interval

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    import pandas as pd
    from numpy.typing import NDArray

    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from .board import BoardShape

LEAST_VIEWS = 5
"""Fewest views whose scatter can give the sigmas: of five views it has four degrees of freedom, and an interval is 2.8
sigmas on either side; of four or three, 3.2 and 4.3."""

MINIMUM_POINTS = 5
"""Fewest points of a view: Tsai's method solves for five ratios of a plane."""

SWAPPED = 0.25
"""Width and height are taken to be swapped if the principal point is closer than this to the centre of the swapped
image, as a fraction of the distance between the two centres."""

LOOSE_CENTER = 0.05
"""The principal point is flagged if its 95 % interval is longer than this fraction of the image's size."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated camera, its poses and its residuals.

    Attributes
    ----------
    camera : TsaiCamera, OpenCVCamera or FisheyeCamera
    cam_from_object : list of RigidTransform
        Pose of the object in each view.
    residuals : list of (n, 2) ndarray
        Projected minus measured, px, one array per view.
    flags : tuple of Flag
        What a user must know before using the numbers: sentences, each with a code (see `Flag`).
    history : DataFrame or None
        The genetic algorithm's history, one row per generation (see `GeneticResult`), with the best chromosome's
        ``focal_length``, ``T_z`` and ``kappa1``.
    covariance : DataFrame or None
        Covariance matrix of the parameters; rows and columns are named after them, and views count from 0.
        Rotations are ``rx_0, ry_0, rz_0``: radians about the camera's axes, applied after the estimate.  From
        `LEAST_VIEWS` views on it allows for errors that are not independent within a view (`sigmas_from`).
    classical_covariance : DataFrame or None
        The same for independent errors that are equal at all points.
    freedom : int or None
        Degrees of freedom of the sigmas of `covariance`, as `interval` takes them.
    populations : (generations + 1, n, 2) ndarray or None
        (f, T_z) of every chromosome of every generation of the genetic algorithm, best first; not saved.
    n_parameters : int or None
        Number of fitted parameters, including those of the poses; None if it is not known.  n points have
        2 n - n_parameters degrees of freedom.
    board : BoardShape or None
        The estimated shape of the board (`calibrate_joint`, option ``board``); its ``apply`` gives the measured board.

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
    >>> round(found.camera.focal_length, 3), round(found.rms, 3), len(found.cam_from_object)
    (8.0, 0.0, 3)
    """

    camera: TsaiCamera | OpenCVCamera | FisheyeCamera
    cam_from_object: list
    residuals: list
    flags: tuple[Flag, ...] = ()
    history: pd.DataFrame | None = None
    covariance: pd.DataFrame | None = None
    populations: np.ndarray | None = None
    n_parameters: int | None = None
    classical_covariance: pd.DataFrame | None = None
    freedom: int | None = None
    board: BoardShape | None = None

    @property
    def mean_distance(self) -> float:
        r"""Eq. 7, px: :math:`E = \frac{1}{n} \sum \sqrt{(x_f - x_i)^2 + (y_f - y_i)^2}` (a mean, not an rms)."""
        return float(np.hypot(*self._all_residuals().T).mean())

    @property
    def rms(self) -> float:
        """Rms reprojection error, px: root of the mean squared distance, as OpenCV's calibrateCamera returns it."""
        return float(np.sqrt(np.mean(np.sum(self._all_residuals() ** 2, axis=1))))

    @property
    def axis_std(self) -> NDArray[np.float64]:
        """Standard deviation in x and in y, px, (2,): the MATLAB toolbox's "pixel error" (divisor n - 1)."""
        return self._all_residuals().std(axis=0, ddof=1)

    def _all_residuals(self):
        if not self.residuals:
            raise ValueError("this calibration has no residuals; it was read from a file that keeps the camera only")
        return np.concatenate(self.residuals)

    def sigma(self, name: str) -> float:
        """Standard deviation of a parameter of `covariance`; ValueError if there is no parameter of that name."""
        if self.covariance is None or name not in self.covariance.index:
            known = "no covariance" if self.covariance is None else ", ".join(self.covariance.index)
            raise ValueError(f"name is {name!r}; this calibration has {known}")
        return float(np.sqrt(self.covariance.loc[name, name]))

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the interval (low, high) of a camera's parameter that holds it with this probability.

        Raises
        ------
        ValueError
            If the camera has no such parameter, it has no sigma, or the level is not between 0 and 1.

        Examples
        --------
        >>> import numpy as np
        >>> from pegpose_lab import paper, calibrate_joint
        >>> truth = paper.paper_experiment()
        >>> board, rng = truth.board.object_points, np.random.default_rng(0)
        >>> seen = [truth.camera.project(board, pose) for pose in truth.cam_from_boards]
        >>> seen = [points + 0.1 * rng.standard_normal(points.shape) for points in seen]
        >>> low, high = calibrate_joint([board] * 5, seen, truth.camera.sensor).interval("focal_length")
        >>> round(low, 2), round(high, 2), low < truth.camera.focal_length < high
        (47.87, 47.97, True)
        """
        if name not in self.camera.parameters or self.freedom is None:
            raise ValueError(
                f"name is {name!r}; expected one of {', '.join(self.camera.parameters)}, with a covariance"
            )
        value, sigma = self.camera.parameters[name], self.sigma(name)
        half = float(stdtrit(self.freedom, (1 + as_number(level, "level", 0, 1, exclusive=True)) / 2)) * sigma
        return float(value - half), float(value + half)

    def classical_sigma(self, name: str) -> float:
        """As `sigma`, of `classical_covariance`."""
        return replace(self, covariance=self.classical_covariance).sigma(name)

    @property
    def sigmas_from(self) -> str:
        """What the stated sigmas come from, in words: ``"independent errors"``, ``"scatter between views"``, or
        ``"independent errors, not checked: 3 views, at least 5 are needed"``."""
        if self.covariance is None:
            return "no covariance"
        if self.classical_covariance is not None and not self.covariance.equals(self.classical_covariance):
            return "scatter between views"
        views = len(self.cam_from_object)
        few = f", not checked: {views} view{'s' * (views > 1)}, at least {LEAST_VIEWS} are needed"
        return "independent errors" + few * (views < LEAST_VIEWS)

    def correlation(self, first: str, second: str) -> float:
        """Correlation of two parameters of `covariance`, -1 to 1; raises ValueError like `sigma`."""
        product = self.sigma(first) * self.sigma(second)
        return float(self.covariance.loc[first, second] / product)

    def save(self, path: str | PathLike[str], form: str = "opencv") -> None:
        """Write the calibration as a YAML file; a failed write leaves no partial file.

        Parameters
        ----------
        path : path
        form : {"opencv", "ros"}
            OpenCV's FileStorage holds everything except `populations`.  ``camera_matrix``,
            ``distortion_coefficients``, ``image_width``, ``image_height`` and ``extrinsic_parameters`` (rotation vector
            and translation, one row per view) have the names of OpenCV's own calibration files, so its tools can read
            them.  A `TsaiCamera` that no OpenCV camera describes (`TsaiCamera.to_opencv`) is written without the first
            two.  ROS's camera_info holds the camera only, in OpenCV's model (``plumb_bob``, ``rational_polynomial``) or a
            fisheye camera's (``equidistant``).

        Raises
        ------
        OSError
            If the file cannot be written.
        ValueError
            If the form is unknown, ROS has no name for the camera's distortion, or no OpenCV camera describes it.
        """
        write_calibration(path, self, form)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Calibration:
        """Read a file that `save` wrote, or another tool; its content tells which form it has.  Nothing in it is executed.

        A ROS file or one of OpenCV's own calibration files (YAML, XML or JSON) gives the camera only: there are no poses,
        and no residuals for `rms`, `mean_distance` and `axis_std`.  So does a file with a camera matrix and distortion
        coefficients alone (``K`` and ``D``, for instance); without the image's size that of the camera is `UNKNOWN_SIZE`.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If it is not a calibration.
        """
        return cls(**read_calibration(path))


def pose_names(count: int) -> list[str]:
    return [f"{name}_{view}" for view in range(count) for name in ("rx", "ry", "rz", "tx", "ty", "tz")]


def judge_focal_length(covariance: pd.DataFrame, name: str, value: float, unit: str, freedom: int) -> tuple[Flag, ...]:
    """Flags from the 95 % interval of f (Student's t, `freedom` degrees); CalibrationError if it reaches 0."""
    half = _half_interval(covariance, name, freedom)
    refusal = "the views do not determine f ({}); add views tilted by about 30 deg"
    interval, loose = judge_interval(value, half, f"95 % interval {{}} {unit}", refusal)
    if loose:
        text = f"The views hardly determine f ({interval}): it trades off with T_z; add tilted views."
        return (Flag("loose-focal-length", text),)
    return ()


def judge_principal_point(covariance: pd.DataFrame, image_size: tuple[int, int], freedom: int) -> tuple[Flag, ...]:
    """A flag if a 95 % interval of the principal point is longer than `LOOSE_CENTER` of the image."""
    free = [name for name in ("c_x", "c_y") if name in covariance.index]
    halves = [_half_interval(covariance, name, freedom) for name in free]
    if all(2 * half <= LOOSE_CENTER * size for half, size in zip(halves, image_size, strict=False)):
        return ()
    found = " and ".join(f"{name} to +-{half:.3g} px" for name, half in zip(free, halves, strict=True))
    text = f"The views hardly determine the principal point (95 %: {found}): add tilted views, or keep it fixed."
    return (Flag("loose-principal-point", text),)


def judge_image_size(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera, image_points: Sequence[NDArray[np.float64]]
) -> tuple[Flag, ...]:
    """Flags if points lie outside the image, or if the principal point lies at the centre of the image with width and
    height swapped."""
    if camera.image_size == UNKNOWN_SIZE:
        return ()
    width, height = camera.image_size
    views = [str(view) for view, points in enumerate(image_points) if outside(points, camera.image_size).any()]
    center = np.asarray(camera.principal_point)
    middle, swapped = (np.subtract(size, 1) / 2 for size in (camera.image_size, camera.image_size[::-1]))
    turned = any(outside(points, (height, width)).any() for points in image_points)  # no image of swapped size has them
    nearer = 0 < np.linalg.norm(center - middle) < np.linalg.norm(center - swapped)  # 0 if it is held there
    if views and (turned or nearer or width == height):
        text = (
            f"Points of view{'s' * (len(views) > 1)} {', '.join(views)} (counted from 0) lie outside the image of "
            f"{width} x {height} px: is image_size (width, height) correct?"
        )
        return (Flag("points-outside", text),)
    if views:
        text = (
            f"Points of view{'s' * (len(views) > 1)} {', '.join(views)} (counted from 0) lie outside the image of "
            f"{width} x {height} px, and all points inside one of {height} x {width} px: is image_size (width, height) "
            "swapped?"
        )
        return (Flag("size-swapped", text),)
    if turned or np.linalg.norm(center - swapped) >= SWAPPED * np.linalg.norm(swapped - middle):
        return ()
    text = (
        f"The principal point ({center[0]:.0f}, {center[1]:.0f}) px is that of an image of {height} x {width} px: "
        "is image_size (width, height) swapped?"
    )
    return (Flag("size-swapped", text),)


def _half_interval(covariance, name, freedom):
    return stdtrit(freedom, 0.975) * np.sqrt(covariance.loc[name, name])
