"""Sub-pixel corners by OpenCV's gradient method, for comparison with those of this project."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)  # steps, px


def sub_pixel_corners(image: NDArray[np.uint8], start: ArrayLike, half: int = 5) -> NDArray[np.float64]:
    """Return corners by `cv2.cornerSubPix` (Foerstner's gradient method, which the MATLAB toolbox uses, too).

    Parameters
    ----------
    image : (height, width) uint8 array
    start : (n, 2) array_like
        Where the corners are, roughly, px.
    half : int
        Half the width of the window, which is 2 half + 1 px wide.

    Returns
    -------
    (n, 2) ndarray
        px.

    Examples
    --------
    >>> image = np.kron([[0, 255], [255, 0]], np.ones((20, 20))).astype(np.uint8)
    >>> sub_pixel_corners(image, [[20, 18]]).round(2).tolist()
    [[19.5, 19.5]]
    """
    start = np.array(start, np.float32).reshape(-1, 1, 2)  # a copy: OpenCV writes into it
    return cv2.cornerSubPix(image, start, (half, half), (-1, -1), STOP).reshape(-1, 2).astype(float)
