"""Cross-validation by halves: a calibration is worth what two of it, from different views, agree on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..camera import lens_covariance
from ..checks import CalibrationError, as_choice, as_count, as_views
from .differencing import ROUNDING, difference
from .image_map import COLUMNS, ImageMap, image_grid
from .result import MINIMUM_POINTS
from .uncertainty import as_length

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas as pd
    from numpy.typing import ArrayLike, NDArray

    from .result import Calibration

FEWEST_VIEWS = 4
INSIDE = 1.96
"""Sigmas of the normal distribution's 95 % interval."""


@dataclass(frozen=True, eq=False)
class Halves:
    """What calibrations of random halves of the views say of each other (`split_halves`).

    Attributes
    ----------
    table : DataFrame
        A row for each repeat: ``z`` of each parameter of the lens, the difference of the two halves over its stated
        sigma; ``difference`` and ``expected``, px: the rms difference over the image with the motion removed, and the
        one that the covariances let expect.
    lengths, sigmas : (repeats, n) ndarray
        px, the lengths of the differences over the grid, and their expected rms.
    grid : (x, y)
        The axes of the grid over the image, px.
    refused : tuple of str
        Why halves could not be calibrated or compared, a text for each repeat that is missing.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from pegpose_lab.calibration import Halves
    >>> lengths = np.array([[3.0, 4.0], [5.0, 5.0]])
    >>> halves = Halves(pd.DataFrame({"z f_x": [-1.0, 7.0]}), lengths, np.ones((2, 2)), ([0, 639], [0]), ())
    >>> halves.summary.loc["f_x"].tolist(), halves.map().values.round(2).tolist()
    ([5.0, 50.0], [[4.12, 4.53]])
    """

    table: pd.DataFrame
    lengths: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    grid: tuple[NDArray[np.float64], NDArray[np.float64]]
    refused: tuple[str, ...]

    @property
    def summary(self) -> pd.DataFrame:
        """For each parameter, and for the projection over the image: rms z, and the share of |z| <= 1.96, %.

        Both are 1 and 95 where the stated sigmas are right.  The projection's z is the difference's length over its
        expected rms.
        """
        import pandas as pd

        z = {name[2:]: self.table[name].to_numpy() for name in self.table if name.startswith("z ")}
        z["projection"] = self._in_sigmas().ravel()
        rows = [
            (name, np.sqrt(np.mean(values**2)), 100 * np.mean(np.abs(values) <= INSIDE)) for name, values in z.items()
        ]
        return pd.DataFrame(rows, columns=["parameter", "rms_z", "within"]).set_index("parameter")

    def _in_sigmas(self):
        return self.lengths / np.maximum(self.sigmas, ROUNDING)

    def map(self, quantity: str = "px") -> ImageMap:
        """The rms difference over the repeats, at each point of the image, in px or over what is expected.

        Parameters
        ----------
        quantity : {"px", "z"}

        Returns
        -------
        ImageMap
        """
        if as_choice(quantity, "quantity", ("px", "z")) == "px":
            values, label = self.lengths, "difference of halves (px)"
        else:
            values, label = self._in_sigmas(), "difference of halves (sigmas)"
        return ImageMap.of_points(*self.grid, np.sqrt(np.mean(values**2, axis=0)), label)


def split_halves(
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    calibrate: Callable[..., Calibration],
    *,
    repeats: int = 20,
    distance: float = np.inf,
    radius: float | None = None,
    columns: int = COLUMNS,
    rng: int | Sequence[int] | np.random.Generator | None = None,
) -> Halves:
    """Calibrate two random halves of the views, again and again, and compare the two with their stated sigmas.

    An rms z well above 1 says that the sigmas are too small: the lens does not follow the model, the board is bent, or
    the noise is not independent.  The repeats share the views, so they are not as many independent trials; one split
    alone tells about each parameter with one number.

    Parameters
    ----------
    object_points, image_points : sequences of (n, 3) and (n, 2) array_like
        mm and px, an entry for each view; at least four.
    calibrate : callable
        Maps lists of object points and of image points to a `Calibration` with a covariance.
    repeats : int
        Random splits.
    distance, radius : float
        mm and px, as for `difference`.
    columns : int
        Of the grid over the image.
    rng : int, sequence of int, Generator or None
        For `numpy.random.default_rng`.

    Returns
    -------
    Halves

    Raises
    ------
    ValueError
        If the views are unusable or fewer than four, or the calibrations have no covariance.
    CalibrationError
        If no split can be calibrated, and compared over the whole image.

    Examples
    --------
    >>> from pegpose_lab import calibrate_joint, paper, split_halves, study
    >>> rng, camera, board = np.random.default_rng(1), paper.paper_camera(), paper.paper_experiment().board
    >>> poses = study.trial_poses(board, 30.0, 8, rng)
    >>> images = [camera.project(board.object_points, pose) + 0.1 * rng.normal(size=(48, 2)) for pose in poses]
    >>> halves = split_halves(
    ...     [board.object_points] * 8, images, lambda *views: calibrate_joint(*views, camera), repeats=3, rng=0
    ... )
    >>> halves.summary.index.tolist()
    ['focal_length', 'kappa1', 'c_x', 'c_y', 'projection']
    """
    import pandas as pd

    object_points, image_points = as_views(object_points, image_points, MINIMUM_POINTS)
    repeats, rng = as_count(repeats, "repeats", 1), np.random.default_rng(rng)
    count = len(object_points)
    if count < FEWEST_VIEWS:
        raise ValueError(f"object_points has {count} views; expected at least {FEWEST_VIEWS}, two in each half")
    rows, lengths, sigmas, refused = [], [], [], []
    for _ in range(repeats):
        order = rng.permutation(count)
        try:
            pair = [
                calibrate([object_points[k] for k in half], [image_points[k] for k in half])
                for half in (np.sort(order[: count // 2]), np.sort(order[count // 2 :]))
            ]
            found = _compared(pair, distance, radius, columns)
        except CalibrationError as error:
            refused.append(str(error))
            continue
        expected = float(np.sqrt(np.mean(found.sigmas**2)))
        rows.append(_z(*pair) | {"difference": found.rms, "expected": expected})
        lengths.append(found.lengths)
        sigmas.append(found.sigmas)
    if not rows:
        raise CalibrationError(
            f"none of {repeats} splits of {count} views can be calibrated and compared; of the last: {refused[-1]}"
        )
    return Halves(pd.DataFrame(rows), np.array(lengths), np.array(sigmas), found.grid, tuple(refused))


def _compared(pair, distance, radius, columns):
    """The difference of two halves; CalibrationError where one lens has no image of what the other one sees.

    Half of the views may determine a lens so poorly that its distortion folds inside the image.
    """
    image_grid(pair[0].camera.image_size, columns)  # unusable arguments are a ValueError, whatever the views
    as_length(distance, "distance")
    as_length(np.inf if radius is None else radius, "radius")
    try:
        return difference(*pair, distance, radius=radius, columns=columns)
    except ValueError as error:
        raise CalibrationError(f"two halves cannot be compared over the whole image ({error})") from error


def _z(first, second):
    """The differences of the lens parameters of two calibrations over their stated sigmas."""
    tables = [lens_covariance(found.camera, found.covariance) for found in (first, second)]
    common = [name for name in tables[0].index if name in tables[1].index]
    z = {}
    for name in common:
        moved = second.camera.parameters[name] - first.camera.parameters[name]
        sigma = np.sqrt(sum(table.loc[name, name] for table in tables))
        z[f"z {name}"] = float(moved / sigma) if sigma > 0 else 0.0
    return z
