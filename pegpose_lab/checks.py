"""What every public function requires of its input, and the errors and flags of the package."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy.spatial.transform import RigidTransform

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

T = TypeVar("T")
REMAP_LIMIT = 32_766  # px, longest side of what cv2.remap takes
ASYMMETRY = 1e-6  # of a covariance in its own units: more than rounding, less than a mistake


class DetectionError(RuntimeError):
    """The image does not show what was looked for; the message says what was seen and what to change.

    Examples
    --------
    >>> import contextlib, numpy as np, pegpose_lab as pl
    >>> with contextlib.suppress(pl.DetectionError):  # go on with the next image
    ...     pl.find_corners(np.zeros((300, 400), np.uint8), pl.Checkerboard(8, 6, 29.0))
    """


class CalibrationError(RuntimeError):
    """The measurements do not determine the camera; the message says why and what to measure instead.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> board = pl.Checkerboard(8, 6, 29.0).object_points
    >>> try:
    ...     pl.calibrate_zhang([board], [board[:, :2] + 100], (640, 480))
    ... except pl.CalibrationError as error:
    ...     print(error)
    one view of a plane gives two constraints on f_x, f_y, c_x, c_y; add tilted views
    """


@contextmanager
def undetermined_if_singular() -> Iterator[None]:
    """Decorator: raise `CalibrationError` where numpy raises LinAlgError because rounding made a matrix singular."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise CalibrationError(
            f"the points do not determine what is asked, to the last digits ({error}); check that every point has an image "
            "in front of the camera, and add views of other tilts (about 30 deg)"
        ) from error


def as_image(image: ArrayLike | None, name: str = "image") -> NDArray[np.uint8]:
    """Return `image` as a C-contiguous (height, width) uint8 array.

    Raises
    ------
    ValueError
        If it is not a two-dimensional, non-empty array of 8-bit grey values.
    """
    if image is None:
        raise ValueError(
            f"{name} is None, which cv2.imread returns for a file that it cannot read; expected a (height, width) array "
            "of type uint8: check the path"
        )
    array = np.asarray(image)
    if array.ndim != 2 or array.size == 0 or array.dtype != np.uint8:
        raise ValueError(
            f"{name} has shape {array.shape} and type {array.dtype}; expected a non-empty (height, width) "
            "image of type uint8 (convert colour with cv2.cvtColor, 16 bits by scaling to 0..255)"
        )
    return np.ascontiguousarray(array)


def as_points(points: ArrayLike | None, dimension: int, name: str, minimum: int = 1) -> NDArray[np.float64]:
    """Return `points` as an (n, dimension) float64 array with n >= minimum and finite values only.

    Raises
    ------
    ValueError
        If the shape, the number of points or a value is unusable.
    """
    if points is None:
        raise ValueError(f"{name} is None; expected an array of shape (n, {dimension})")
    try:
        array = np.array(points, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} is not an array of numbers; expected shape (n, {dimension})") from error
    if array.shape[1:] == (1, dimension):
        raise ValueError(
            f"{name} has shape {array.shape}, as OpenCV returns points; expected (n, {dimension}): .reshape(-1, {dimension})"
        )
    if array.ndim != 2 or array.shape[1] != dimension or len(array) < minimum:
        raise ValueError(f"{name} has shape {array.shape}; expected (n, {dimension}) with n >= {minimum}")
    if not np.isfinite(array).all():
        first = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ValueError(
            f"{name} of shape {array.shape} has NaN or infinite values, first in row {first}; expected finite numbers"
        )
    return array


def as_matched_points(
    object_points: ArrayLike, image_points: ArrayLike, minimum: int = 1, view: str = ""
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (n, 3) object points and (n, 2) image points of one view, checked to have equal lengths.

    `view` is appended to both names in messages, for example "[3]".

    Raises
    ------
    ValueError
        If either is unusable (see `as_points`) or their lengths differ.
    """
    object_points = as_points(object_points, 3, f"object_points{view}", minimum)
    image_points = as_points(image_points, 2, f"image_points{view}", minimum)
    if len(object_points) != len(image_points):
        raise ValueError(
            f"object_points{view} has {len(object_points)} rows and image_points{view} {len(image_points)}; "
            "expected one image point for each object point"
        )
    return object_points, image_points


def as_number(
    value: Any, name: str, minimum: float = -np.inf, maximum: float = np.inf, *, exclusive: bool = False
) -> float:
    """Return `value` as a finite float within [minimum, maximum] (without the ends if `exclusive`).

    Raises
    ------
    ValueError
        If it is not such a number.
    """
    if np.ndim(value) != 0 or isinstance(value, (str, bytes, bool, np.bool_)):
        raise ValueError(f"{name} is {value!r}; expected a number")
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} is {value!r}; expected a number") from error
    inside = minimum < number < maximum if exclusive else minimum <= number <= maximum
    if not (np.isfinite(number) and inside):
        raise ValueError(f"{name} is {number:g}; expected a finite number between {minimum:g} and {maximum:g}")
    return number


def as_count(value: Any, name: str, minimum: float = 0, maximum: float = np.inf) -> int:
    """Return `value` as an int within [minimum, maximum]; a float counts if it is a whole number (8.0).

    Raises
    ------
    ValueError
        If it is not such a number; strings and booleans are refused.
    """
    number = as_number(value, name)
    if number != int(number) or not minimum <= number <= maximum:
        bounds = f"of at least {minimum}" if maximum == np.inf else f"between {minimum} and {maximum}"
        raise ValueError(f"{name} is {value!r}; expected a whole number {bounds}")
    return int(value)


def as_choice(value: Any, name: str, choices: Iterable[T]) -> T:
    """Return the one of `choices` (strings or numbers) that equals `value`.

    Raises
    ------
    ValueError
        If none of them equals it; the message lists the choices.
    """
    for choice in choices:
        if isinstance(value, str) == isinstance(choice, str) and np.ndim(value) == 0 and value == choice:
            return choice
    raise ValueError(f"{name} is {value!r}; expected one of {', '.join(map(repr, choices))}")


def as_pose(pose: RigidTransform, name: str) -> RigidTransform:
    """Return `pose`; ValueError if it is not one `RigidTransform`."""
    if not isinstance(pose, RigidTransform) or not pose.single:
        raise ValueError(f"{name} is {type(pose).__name__}; expected one scipy RigidTransform")
    return pose


def as_covariance(covariance: ArrayLike, name: str, *, infinite: bool = True) -> NDArray[np.float64]:
    """Return the covariance (6, 6) of a pose; it may be infinite on its diagonal if `infinite`.

    Raises
    ------
    ValueError
        If it is none: of another shape, not symmetric, or with a negative variance.
    """
    array = np.array(covariance, np.float64)
    if array.shape != (6, 6) or np.isnan(array).any() or not (infinite or np.isfinite(array).all()):
        kind = "" if infinite else "finite "
        raise ValueError(f"{name} has shape {array.shape}; expected a {kind}covariance (6, 6) without NaN")
    if np.isfinite(array).all():
        units = np.sqrt(np.maximum(np.diag(array), 0.0))  # mm and rad are not compared with one another
        scaled = array / np.where(units > 0, units, 1.0) / np.where(units > 0, units, 1.0)[:, None]
        low = np.linalg.eigvalsh((scaled + scaled.T) / 2)[0]
        if np.abs(scaled - scaled.T).max() > ASYMMETRY or low < -ASYMMETRY or (np.diag(array) < 0).any():
            raise ValueError(
                f"{name} is no covariance; expected a symmetric matrix (6, 6) without negative eigenvalues"
            )
    return array


def as_views(
    object_points: Sequence[ArrayLike], image_points: Sequence[ArrayLike], minimum: int
) -> list[list[NDArray[np.float64]]]:
    """Return the points of several views as two lists of checked arrays, (n, 3) and (n, 2), one array per view.

    Raises
    ------
    ValueError
        If they are not such lists, a view has fewer than `minimum` points, or the points of a view lie on a line;
        the message names the view, counted from 0.
    """
    for views, name in ((object_points, "object_points"), (image_points, "image_points")):
        _demand_sequence(views, name)
    if len(object_points) != len(image_points):
        raise ValueError(
            f"object_points has {len(object_points)} views and image_points {len(image_points)}; expected as many"
        )
    pairs = []
    for view, (points, measured) in enumerate(zip(object_points, image_points, strict=True)):
        pairs.append(as_matched_points(points, measured, minimum, f"[{view}]"))
        for array, name in zip(pairs[-1], ("object_points", "image_points"), strict=True):
            singular = np.linalg.svd(array - array.mean(axis=0), compute_uv=False)
            if singular[1] <= 1e-6 * singular[0]:
                raise ValueError(f"{name}[{view}] of shape {array.shape} lie on one line; expected a spread of points")
    return [[np.ascontiguousarray(view) for view in views] for views in zip(*pairs, strict=True)]  # for OpenCV


def _demand_sequence(views, name):
    """Raise if `views` is not a sequence with at least one array."""
    if isinstance(views, np.ndarray) and views.ndim < 3 and views.dtype != object:
        raise ValueError(
            f"{name} has shape {views.shape}; expected a sequence of arrays, one for each view (of one view: [array])"
        )
    if not hasattr(views, "__len__") or isinstance(views, (str, bytes, dict)):
        raise ValueError(f"{name} is {type(views).__name__}; expected a sequence of arrays, one for each view")
    if len(views) == 0:
        raise ValueError(f"{name} is empty: there is no view; expected a sequence of arrays, one for each view")


def outside(image_points: NDArray[np.float64], image_size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which image points (n, 2), px, lie more than a pixel outside of an image of (width, height) px: (n,) bool."""
    return np.any((image_points < -1.5) | (image_points > np.array(image_size) + 0.5), axis=1)
