"""The registry of circle detectors, and the function that runs one of them."""

from __future__ import annotations

import functools
import importlib.util
from importlib import metadata
from typing import TYPE_CHECKING

import cv2

from ..lab import environment
from .contrib import _edge_drawing, _server, _timed
from .detectors import Method, _blobs, _contour_ellipses, _find_and_fit, _hough, _opencv_hough, _skimage_hough

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .detectors import Found


def run(method: Method, image: NDArray[np.uint8], radius_range: tuple[float, float]) -> tuple[Found, float]:
    """Run a detector on an image.

    Returns
    -------
    Found, float
        Circles, and the processor time in seconds.
    """
    if method.module == CONTRIB_MODULE and not hasattr(cv2, "ximgproc"):
        return _server().ask(image, radius_range, method.options)
    return _timed(method.find, image, radius_range, method.options)


OURS, REFERENCE, CONTRIB_MODULE = "ours", "HoughCircles GRADIENT", "cv2.ximgproc"
_OUR_PACKAGE = {"module": "pegpose_lab", "package": "pegpose_lab"}
_TWO_STAGE, _PHASE_CODE, _ACCUMULATOR = (
    functools.partial(_hough, method=method) for method in ("two-stage", "phase-code", "accumulator")
)
_GRADIENT, _GRADIENT_ALT = (
    functools.partial(_opencv_hough, method=method) for method in (cv2.HOUGH_GRADIENT, cv2.HOUGH_GRADIENT_ALT)
)
_HOUGH_TEXT = "dp {dp}, param1 {edge}, param2 {votes}, minDist r_min"
COMPARED = {
    method.name: method
    for method in (
        Method(OURS, _find_and_fit, "find_circles in the whole picture, fit_discs; defaults", **_OUR_PACKAGE),
        Method("find_circles two-stage", _TWO_STAGE, "whole picture; defaults", 0.1, **_OUR_PACKAGE),
        Method("find_circles phase-code", _PHASE_CODE, "whole picture; defaults", 0.1, **_OUR_PACKAGE),
        Method("find_circles accumulator", _ACCUMULATOR, "whole picture; defaults", 0.04, **_OUR_PACKAGE),
        Method(REFERENCE, _GRADIENT, _HOUGH_TEXT, options={"dp": 1, "edge": 300, "votes": 30}),
        Method(
            "HoughCircles GRADIENT, smoothed",
            _GRADIENT,
            "Gaussian {smoothing} px, " + _HOUGH_TEXT,
            options={"smoothing": 1, "dp": 1, "edge": 200, "votes": 40},
        ),
        Method(
            "HoughCircles GRADIENT_ALT",
            _GRADIENT_ALT,
            "Gaussian {smoothing} px, " + _HOUGH_TEXT,
            options={"smoothing": 0, "dp": 3, "edge": 600, "votes": 0.9},
        ),
        Method(
            "skimage hough_circle",
            _skimage_hough,
            "canny sigma {sigma}, whole radii, peaks above {threshold}, r_min apart",
            0.04,
            "skimage",
            "scikit-image",
            {"sigma": 3, "threshold": 0.4},
        ),
        Method(
            "SimpleBlobDetector",
            _blobs,
            "Gaussian {smoothing} px, levels {levels[0]} to {levels[1]} by {levels[2]}, area of the radius range, "
            "circularity > {circularity}, inertia > 0.6, r_min apart",
            options={"smoothing": 1, "levels": (70, 150, 10), "circularity": 0.1},
        ),
        Method(
            "contours + fitEllipse",
            _contour_ellipses,
            "Gaussian {smoothing} px, threshold {threshold}, outline > pi r_min, axes' ratio > {ratio}",
            options={"smoothing": 1, "threshold": 100, "ratio": 0.8},
        ),
        Method(
            "EdgeDrawing",
            _edge_drawing,
            "operator {operator}, gradient threshold {gradient}, sigma {sigma} px, else defaults",
            1.0,
            CONTRIB_MODULE,
            "opencv-contrib-python-headless",
            {"operator": "PREWITT", "gradient": 80, "sigma": 1.0},
        ),
    )
}


def missing(method: Method) -> str:
    """Return the reason why a detector cannot run here, or "" if it can."""
    if method.module == CONTRIB_MODULE:
        return "" if (environment.contrib_folder() / "cv2").is_dir() else f"{method.package} is not installed"
    return "" if importlib.util.find_spec(method.module) else f"{method.package} is not installed"


def version(method: Method) -> str:
    """Return the version of a detector's package, or "" if it is missing."""
    if method.module == "pegpose_lab":
        from .. import __version__

        return __version__
    where = {"path": [str(environment.contrib_folder())]} if method.module == CONTRIB_MODULE else {}
    found = next(iter(metadata.distributions(name=method.package, **where)), None)
    return found.version if found else ""
