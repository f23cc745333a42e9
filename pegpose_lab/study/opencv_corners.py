"""Corners by OpenCV's gradient method, beside which this project's own are judged."""

import cv2
import numpy as np

STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)  # steps, px


def sub_pixel_corners(image, start, half=5):
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
    """
    start = np.array(start, np.float32).reshape(-1, 1, 2)  # a copy: OpenCV writes into it
    return cv2.cornerSubPix(image, start, (half, half), (-1, -1), STOP).reshape(-1, 2).astype(float)
