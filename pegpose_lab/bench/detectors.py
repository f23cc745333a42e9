"""Circle detectors side by side, ours and those that people use: a picture and a range of radii in, circles out.

The peers' settings are documented in `METHODS` and are the same for every picture.  `tuning` chose them, from grids
and by a rule that stand there, on frames that the benchmark does not use.  scikit-image and opencv-contrib are not needed
by anything else: the command ``bench`` installs them.  opencv-contrib cannot live in one environment with OpenCV, so it has a folder and a process of
its own, which measures its own time.
"""

import atexit
import functools
import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import metadata

import cv2
import numpy as np

from ..circles import find_circles
from ..discs import fit_discs
from ..lab import environment


@dataclass(frozen=True)
class Found:
    """What a detector reports: centers (n, 2) and radii (n,) px; sigmas (n, 3) of x, y and radius, or None."""

    centers: np.ndarray
    radii: np.ndarray
    sigmas: np.ndarray | None = None

    def __len__(self):
        return len(self.radii)


@dataclass(frozen=True)
class Method:
    """A detector, `find(image, (r_min, r_max), **options) -> Found`.

    `text` says what its settings are, with {names} where the options stand; `share` is the part of the frames that it
    gets (slow ones get fewer), `module` what has to be importable, `package` the distribution whose version counts.
    """

    name: str
    find: Callable
    text: str
    share: float = 1.0
    module: str = "cv2"
    package: str = "opencv-python-headless"
    options: dict = field(default_factory=dict)

    @property
    def settings(self):
        """Its settings, in words and numbers."""
        return self.text.format(**self.options)


def _rows(rows, radius_range):
    """`Found` from rows x, y, radius; those outside the range do not count."""
    rows = np.asarray(rows, float).reshape(-1, 3)
    rows = rows[(rows[:, 2] >= radius_range[0]) & (rows[:, 2] <= radius_range[1])]
    return Found(rows[:, :2], rows[:, 2])


# ---- ours ----


def _find_and_fit(image, radius_range):
    """Find circles in the whole picture and measure them; discs that are accepted and within the range."""
    discs = fit_discs(image, find_circles(image, radius_range))
    keep = discs.accepted & (discs.radii >= radius_range[0]) & (discs.radii <= radius_range[1])
    sigmas = np.column_stack([discs.sigmas[:, :2], radius_sigmas(discs)])
    return Found(discs.centers[keep], discs.radii[keep], sigmas[keep])


def radius_sigmas(discs):
    """Standard deviations (n,) px of `Discs.radii`, sqrt(a b): first order in the semi-axes' covariance."""
    gradient = discs.radii[:, None] / (2 * discs.semi_axes)
    block = np.where(np.isfinite(discs.covariance[:, 2:4, 2:4]), discs.covariance[:, 2:4, 2:4], np.inf)
    fitted = np.isfinite(block).all(axis=(1, 2))
    variance = np.full(len(discs), np.inf)
    variance[fitted] = np.einsum("ni,nij,nj->n", gradient[fitted], block[fitted], gradient[fitted])
    return np.sqrt(variance)


def _hough(image, radius_range, method):
    circles = find_circles(image, radius_range, method=method)
    return Found(circles.centers, circles.radii)


# ---- OpenCV ----


def _smooth(image, sigma):
    """The picture after a Gaussian of `sigma` px; 0 leaves it as it is."""
    return cv2.GaussianBlur(image, (0, 0), sigma) if sigma > 0 else image


def _opencv_hough(image, radius_range, *, method, dp, edge, votes, smoothing=0):
    """cv2.HoughCircles, the least distance of two centres being the least radius."""
    low, high = int(np.floor(radius_range[0])), int(np.ceil(radius_range[1]))
    limits = {"param1": edge, "param2": votes, "minRadius": low, "maxRadius": high}
    found = cv2.HoughCircles(_smooth(image, smoothing), method, dp, low, **limits)
    return _rows([] if found is None else found.reshape(-1, found.shape[-1])[:, :3], radius_range)


def _blobs(image, radius_range, *, smoothing, levels, circularity):
    """cv2.SimpleBlobDetector; `levels` are its least and largest threshold and their step; a blob's size is twice its
    radius."""
    settings = cv2.SimpleBlobDetector_Params()
    settings.blobColor = 255
    settings.minThreshold, settings.maxThreshold, settings.thresholdStep = levels
    settings.minArea, settings.maxArea = np.pi * radius_range[0] ** 2, np.pi * radius_range[1] ** 2
    settings.filterByCircularity, settings.minCircularity = True, circularity
    settings.filterByConvexity = False
    settings.filterByInertia, settings.minInertiaRatio = True, 0.6
    settings.minDistBetweenBlobs = radius_range[0]
    blobs = cv2.SimpleBlobDetector_create(settings).detect(_smooth(image, smoothing))
    return _rows([(*blob.pt, blob.size / 2) for blob in blobs], radius_range)


def _contour_ellipses(image, radius_range, *, smoothing, threshold, ratio):
    """A threshold (a grey value, or "Otsu"), outlines of at least half the least perimeter, cv2.fitEllipse; axes' ratio
    above `ratio`."""
    otsu = threshold == "Otsu"
    kind = cv2.THRESH_OTSU if otsu else cv2.THRESH_BINARY
    _, mask = cv2.threshold(_smooth(image, smoothing), 0 if otsu else threshold, 255, kind)
    outlines = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    rows = []
    for outline in outlines:
        if len(outline) >= max(np.pi * radius_range[0], 5):
            (x, y), (first, second), _ = cv2.fitEllipse(outline.reshape(-1, 2))
            if min(first, second) > ratio * max(first, second):
                rows.append((x, y, np.sqrt(first * second) / 2))
    return _rows(rows, radius_range)


# ---- scikit-image ----


def _skimage_hough(image, radius_range, *, sigma, threshold):
    """Canny, one plane of votes for each whole radius, peaks with the least radius between them."""
    from skimage.feature import canny
    from skimage.transform import hough_circle, hough_circle_peaks

    radii = np.arange(np.ceil(radius_range[0]), np.floor(radius_range[1]) + 1).astype(int)
    apart = int(radius_range[0])
    votes = hough_circle(canny(image, sigma=sigma), radii)
    _, x, y, r = hough_circle_peaks(votes, radii, min_xdistance=apart, min_ydistance=apart, threshold=threshold)
    return _rows(np.column_stack([x, y, r]), radius_range)


# ---- opencv-contrib, in its own process ----


def _edge_drawing(image, radius_range, *, operator, gradient, sigma):
    """Edge Drawing with its ellipses; runs where cv2 is opencv-contrib's."""
    detector = cv2.ximgproc.createEdgeDrawing()
    settings = cv2.ximgproc.EdgeDrawing.Params()
    settings.EdgeDetectionOperator = getattr(cv2.ximgproc, f"EdgeDrawing_{operator}")
    settings.GradientThresholdValue, settings.Sigma = gradient, sigma
    detector.setParams(settings)
    detector.detectEdges(image)
    found = detector.detectEllipses()
    rows = np.empty((0, 6)) if found is None else found.reshape(-1, 6)
    radii = np.where(rows[:, 2] > 0, rows[:, 2], np.sqrt(np.maximum(rows[:, 3] * rows[:, 4], 0)))
    return _rows(np.column_stack([rows[:, :2], radii]), radius_range)


class _Server:
    """A process with opencv-contrib: pictures in, circles and the seconds they took out."""

    def __init__(self):
        self.process = subprocess.Popen(
            [sys.executable, "-c", "from pegpose_lab.bench import detectors; detectors.serve()"],
            env=contrib_variables(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        atexit.register(self.close)

    def close(self):
        """End the process: its pipe is closed."""
        self.process.communicate()

    def ask(self, image, radius_range, options):
        """Return `Found` and seconds of processor time."""
        header = json.dumps([image.shape, [float(radius) for radius in radius_range], options])
        self.process.stdin.write(header.encode() + b"\n" + image.tobytes())
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the process with opencv-contrib ended with code {self.process.wait()}")
        rows, seconds = json.loads(answer)
        return _rows(rows, radius_range), seconds


_server = functools.cache(_Server)  # one for each process; it ends when its pipe does


def contrib_variables():
    """The variables of a process in which cv2 is opencv-contrib's."""
    path = os.pathsep.join([str(environment.contrib_folder()), str(environment.CHECKOUT)])
    return {**os.environ, "PYTHONPATH": path}


def serve():
    """Answer the requests of a `_Server` until its pipe is closed."""
    cv2.setNumThreads(1)
    for header in iter(sys.stdin.buffer.readline, b""):
        (height, width), radius_range, options = json.loads(header)
        image = np.frombuffer(sys.stdin.buffer.read(height * width), np.uint8).reshape(height, width)
        found, seconds = _timed(_edge_drawing, image, radius_range, options)
        print(json.dumps([np.column_stack([found.centers, found.radii]).tolist(), seconds]), flush=True)


# ---- all of them ----


def _timed(find, image, radius_range, options):
    start = time.process_time()
    found = find(image, radius_range, **options)
    return found, time.process_time() - start


def run(method, image, radius_range):
    """Run a detector on a picture.

    Returns
    -------
    Found, float
        Circles, and the seconds of processor time that they took.
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
METHODS = {
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


def missing(method):
    """Why a detector cannot run here; empty where it can."""
    if method.module == CONTRIB_MODULE:
        return "" if (environment.contrib_folder() / "cv2").is_dir() else f"{method.package} is not installed"
    return "" if importlib.util.find_spec(method.module) else f"{method.package} is not installed"


def version(method):
    """The version of a detector's package; empty where it is missing."""
    if method.module == "pegpose_lab":
        from .. import __version__

        return __version__
    where = {"path": [str(environment.contrib_folder())]} if method.module == CONTRIB_MODULE else {}
    found = next(iter(metadata.distributions(name=method.package, **where)), None)
    return found.version if found else ""
