"""Circle detectors side by side, ours and those that people use: a picture and a range of radii in, circles out.

The peers' settings are documented in `METHODS` and are the same for every picture.  They were chosen on frames of
their own (other poses than the benchmark's), first for the share of pegs found, then for few false circles, then
for the centre's error.  scikit-image and opencv-contrib are not needed by anything else: the command ``bench``
installs them.  opencv-contrib cannot live in one environment with OpenCV, so it has a folder and a process of
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
from dataclasses import dataclass
from importlib import metadata

import cv2
import numpy as np

from . import environment
from .circles import find_circles
from .edges import fit_discs


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
    """A detector, `find(image, (r_min, r_max)) -> Found`.

    `share` is the part of the frames that it gets (slow ones get fewer), `module` what has to be importable,
    `package` the distribution whose version counts.
    """

    name: str
    find: Callable
    settings: str
    share: float = 1.0
    module: str = "cv2"
    package: str = "opencv-python-headless"


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
    return cv2.GaussianBlur(image, (0, 0), sigma)


def _hough_gradient(image, radius_range, dp=1.5, votes=40, edge=200):
    return _opencv_hough(image, radius_range, cv2.HOUGH_GRADIENT, dp, edge, votes)


def _hough_gradient_smoothed(image, radius_range):
    return _hough_gradient(_smooth(image, 1.5), radius_range, dp=1, votes=30, edge=150)


def _hough_gradient_alt(image, radius_range):
    return _opencv_hough(_smooth(image, 1.5), radius_range, cv2.HOUGH_GRADIENT_ALT, 1.5, 300, 0.9)


def _opencv_hough(image, radius_range, method, dp, edge, votes):
    """cv2.HoughCircles, the least distance of two centres being the least radius."""
    low, high = int(np.floor(radius_range[0])), int(np.ceil(radius_range[1]))
    found = cv2.HoughCircles(image, method, dp, low, param1=edge, param2=votes, minRadius=low, maxRadius=high)
    return _rows([] if found is None else found.reshape(-1, found.shape[-1])[:, :3], radius_range)


def _blobs(image, radius_range):
    """cv2.SimpleBlobDetector with its own levels; a blob's size is twice its radius."""
    settings = cv2.SimpleBlobDetector_Params()
    settings.blobColor = 255
    settings.minArea, settings.maxArea = np.pi * radius_range[0] ** 2, np.pi * radius_range[1] ** 2
    settings.filterByCircularity, settings.minCircularity = True, 0.4
    settings.filterByConvexity = False
    settings.filterByInertia, settings.minInertiaRatio = True, 0.6
    settings.minDistBetweenBlobs = radius_range[0]
    blobs = cv2.SimpleBlobDetector_create(settings).detect(image)
    return _rows([(*blob.pt, blob.size / 2) for blob in blobs], radius_range)


def _contour_ellipses(image, radius_range):
    """Otsu's threshold, outlines of at least half the least perimeter, cv2.fitEllipse; axes' ratio above 0.8."""
    _, mask = cv2.threshold(_smooth(image, 1.0), 0, 255, cv2.THRESH_OTSU)
    outlines = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    rows = []
    for outline in outlines:
        if len(outline) >= max(np.pi * radius_range[0], 5):
            (x, y), (first, second), _ = cv2.fitEllipse(outline.reshape(-1, 2))
            if min(first, second) > 0.8 * max(first, second):
                rows.append((x, y, np.sqrt(first * second) / 2))
    return _rows(rows, radius_range)


# ---- scikit-image ----


def _skimage_hough(image, radius_range):
    """Canny, one plane of votes for each whole radius, peaks with the least radius between them."""
    from skimage.feature import canny
    from skimage.transform import hough_circle, hough_circle_peaks

    radii = np.arange(np.ceil(radius_range[0]), np.floor(radius_range[1]) + 1).astype(int)
    apart = int(radius_range[0])
    votes = hough_circle(canny(image, sigma=3), radii)
    _, x, y, r = hough_circle_peaks(votes, radii, min_xdistance=apart, min_ydistance=apart, threshold=0.3)
    return _rows(np.column_stack([x, y, r]), radius_range)


# ---- opencv-contrib, in its own process ----


def _edge_drawing(image, radius_range):
    """Edge Drawing with its ellipses; runs where cv2 is opencv-contrib's."""
    detector = cv2.ximgproc.createEdgeDrawing()
    settings = cv2.ximgproc.EdgeDrawing.Params()
    settings.GradientThresholdValue = 40
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
            [sys.executable, "-c", "from pegpose_lab import peers; peers.serve()"],
            env=contrib_variables(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        atexit.register(self.close)

    def close(self):
        """End the process: its pipe is closed."""
        self.process.communicate()

    def ask(self, image, radius_range):
        """Return `Found` and seconds of processor time."""
        header = json.dumps([image.shape, [float(radius) for radius in radius_range]])
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
        (height, width), radius_range = json.loads(header)
        image = np.frombuffer(sys.stdin.buffer.read(height * width), np.uint8).reshape(height, width)
        found, seconds = _timed(_edge_drawing, image, radius_range)
        print(json.dumps([np.column_stack([found.centers, found.radii]).tolist(), seconds]), flush=True)


# ---- all of them ----


def _timed(find, image, radius_range):
    start = time.process_time()
    found = find(image, radius_range)
    return found, time.process_time() - start


def run(method, image, radius_range):
    """Run a detector on a picture.

    Returns
    -------
    Found, float
        Circles, and the seconds of processor time that they took.
    """
    if method.module == CONTRIB_MODULE and not hasattr(cv2, "ximgproc"):
        return _server().ask(image, radius_range)
    return _timed(method.find, image, radius_range)


OURS, REFERENCE, CONTRIB_MODULE = "ours", "HoughCircles GRADIENT", "cv2.ximgproc"
_OUR_PACKAGE = {"module": "pegpose_lab", "package": "pegpose_lab"}
_TWO_STAGE, _PHASE_CODE, _ACCUMULATOR = (
    functools.partial(_hough, method=method) for method in ("two-stage", "phase-code", "accumulator")
)
METHODS = {
    method.name: method
    for method in (
        Method(OURS, _find_and_fit, "find_circles in the whole picture, fit_discs; defaults", **_OUR_PACKAGE),
        Method("find_circles two-stage", _TWO_STAGE, "whole picture; defaults", 0.1, **_OUR_PACKAGE),
        Method("find_circles phase-code", _PHASE_CODE, "whole picture; defaults", 0.1, **_OUR_PACKAGE),
        Method("find_circles accumulator", _ACCUMULATOR, "whole picture; defaults", 0.04, **_OUR_PACKAGE),
        Method(REFERENCE, _hough_gradient, "dp 1.5, param1 200, param2 40, minDist r_min"),
        Method(
            "HoughCircles GRADIENT, smoothed",
            _hough_gradient_smoothed,
            "Gaussian 1.5 px, dp 1, param1 150, param2 30, minDist r_min",
        ),
        Method(
            "HoughCircles GRADIENT_ALT",
            _hough_gradient_alt,
            "Gaussian 1.5 px, dp 1.5, param1 300, param2 0.9, minDist r_min",
        ),
        Method(
            "skimage hough_circle",
            _skimage_hough,
            "canny sigma 3, whole radii, peaks above 0.3, r_min apart",
            0.04,
            "skimage",
            "scikit-image",
        ),
        Method(
            "SimpleBlobDetector",
            _blobs,
            "default levels, area of the radius range, circularity > 0.4, inertia > 0.6, r_min apart",
        ),
        Method(
            "contours + fitEllipse",
            _contour_ellipses,
            "Gaussian 1 px, Otsu, outline > pi r_min, axes' ratio > 0.8",
        ),
        Method(
            "EdgeDrawing",
            _edge_drawing,
            "gradient threshold 40, else defaults",
            1.0,
            CONTRIB_MODULE,
            "opencv-contrib-python-headless",
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
        from . import __version__

        return __version__
    where = {"path": [str(environment.contrib_folder())]} if method.module == CONTRIB_MODULE else {}
    found = next(iter(metadata.distributions(name=method.package, **where)), None)
    return found.version if found else ""
