"""How the image of a fixed direction moves with the camera's parameters, for any lens model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import CalibrationError

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from .fisheye import FisheyeCamera
    from .opencv import OpenCVCamera
    from .tsai import TsaiCamera

STEP, SMALLEST_STEP = 1e-2, 1e-6
"""A parameter's step for the central difference: a hundredth of its sigma, over which the projection is straight, but
at least a millionth of its value, over which the projection moves by far more than its last digits."""


def lens_covariance(camera: TsaiCamera | OpenCVCamera | FisheyeCamera, covariance: pd.DataFrame) -> pd.DataFrame:
    """The rows and columns of the camera's own parameters.

    The others are poses, and what is estimated of the board, as its warp: these do not move the image of a fixed
    point in the camera frame.

    Examples
    --------
    >>> import pandas as pd
    >>> from pegpose_lab import TsaiCamera
    >>> camera = TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480))
    >>> names = ["focal_length", "rx_0"]
    >>> lens_covariance(camera, pd.DataFrame(np.eye(2), names, names)).index.tolist()
    ['focal_length']
    """
    names = [name for name in covariance.index if name in camera.parameters]
    return covariance.loc[names, names]


def lens_derivative(
    camera: TsaiCamera | OpenCVCamera | FisheyeCamera, own: pd.DataFrame, normalized: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Derivatives (n, 2, k) of image points, px, by the parameters of `own`, at fixed directions (x/z, y/z), (n, 2).

    `own` is the covariance of `lens_covariance`.  Where only f_x was estimated, f_y goes with it in proportion.

    Raises
    ------
    CalibrationError
        If the lens has no image of a direction, with parameters within their uncertainty.

    Examples
    --------
    >>> import pandas as pd
    >>> from pegpose_lab import TsaiCamera
    >>> camera = TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480))
    >>> own = pd.DataFrame([[1e-4]], ["focal_length"], ["focal_length"])
    >>> lens_derivative(camera, own, np.array([[0.1, 0.0]])).round(6).tolist()  # 0.1 / 0.01 px per mm
    [[[10.0], [0.0]]]
    """
    values, columns = camera.parameters, []
    for name, variance in zip(own.index, np.diagonal(own), strict=True):
        step = max(STEP * np.sqrt(variance), SMALLEST_STEP * abs(values[name]))
        tied = {"f_y": values["f_y"] / values["f_x"]} if name == "f_x" and "f_y" not in own.index else {}
        if step == 0:
            columns.append(np.zeros(normalized.shape))
            continue
        ends = []
        for sign in (1, -1):
            moved = {other: values[other] + sign * step * rate for other, rate in {name: 1.0, **tied}.items()}
            try:
                ends.append(camera.with_parameters(**moved).from_normalized(normalized))
            except ValueError as error:
                raise CalibrationError(
                    f"within the uncertainty of {name} the lens model gives some of the points no image ({error}); "
                    "ask for points nearer to the middle of the image"
                ) from error
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=-1) if columns else np.zeros((len(normalized), 2, 0))


def by_direction(camera: TsaiCamera | OpenCVCamera | FisheyeCamera, rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 2, 3) of image points, px, by the viewing directions (n, 3) themselves, of whatever length.

    Examples
    --------
    >>> from pegpose_lab import TsaiCamera
    >>> camera = TsaiCamera(8.0, (0.01, 0.01), (319.5, 239.5), (640, 480))
    >>> by_direction(camera, np.array([[0.0, 0.0, 2.0]])).round(6).tolist()
    [[[400.0, 0.0, 0.0], [0.0, 400.0, 0.0]]]
    """
    depth = rays[:, 2:]
    by_normalized = camera.image_and_derivative(rays[:, :2] / depth)[1]
    by_ray = np.zeros((len(rays), 2, 3))
    by_ray[:, 0, 0] = by_ray[:, 1, 1] = 1
    by_ray[:, :, 2] = -rays[:, :2] / depth
    return by_normalized @ by_ray / depth[:, :, None]


def by_turn(by_ray: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 2, 3) by a small rotation vector of the rays about the camera's axes.

    Examples
    --------
    >>> by_turn(np.array([[[400.0, 0, 0], [0, 400.0, 0]]]), np.array([[0.0, 0, 1]])).tolist()
    [[[0.0, 400.0, 0.0], [-400.0, 0.0, 0.0]]]
    """
    return np.cross(rays[:, None, :], by_ray)  # d . (w x r) = w . (r x d)
