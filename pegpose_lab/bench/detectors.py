"""Circle detectors, ours and common alternatives: each takes an image and a range of radii and returns circles.

The peers' settings are listed in `peers.COMPARED` and are the same for every image.  They were chosen by `tuning`,
which has the grids and the rule, on frames that the benchmark does not use.  scikit-image and opencv-contrib are used
only here, so the command ``bench`` installs them.  opencv-contrib cannot share an environment with OpenCV, so it
has its own folder and its own process, which measures its own time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..circles import find_circles
from ..discs import fit_discs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..discs import Discs


@dataclass(frozen=True)
class Found:
    """The circles of a detector: centers (n, 2) and radii (n,) px; sigmas (n, 3) of x, y and radius, or None."""

    centers: np.ndarray
    radii: np.ndarray
    sigmas: np.ndarray | None = None

    def __len__(self):
        return len(self.radii)


@dataclass(frozen=True)
class Method:
    """A detector, `find(image, (r_min, r_max), **options) -> Found`.

    `text` describes its settings, with {names} in place of the options.  `share` is the fraction of the frames that it
    gets (slow ones get fewer).  `module` must be importable, and `package` is the distribution that has the version.
    """

    name: str
    find: Callable
    text: str
    share: float = 1.0
    module: str = "cv2"
    package: str = "opencv-python-headless"
    options: dict = field(default_factory=dict)

    @property
    def settings(self) -> str:
        """Its settings in words and numbers."""
        return self.text.format(**self.options)


def _rows(rows, radius_range):
    """`Found` from rows x, y, radius, without those outside the radius range."""
    rows = np.asarray(rows, float).reshape(-1, 3)
    rows = rows[(rows[:, 2] >= radius_range[0]) & (rows[:, 2] <= radius_range[1])]
    return Found(rows[:, :2], rows[:, 2])


# ---- ours ----


def _find_and_fit(image, radius_range):
    """Find and measure circles in the whole image; keeps discs that are accepted and within the radius range."""
    discs = fit_discs(image, find_circles(image, radius_range))
    keep = discs.accepted & (discs.radii >= radius_range[0]) & (discs.radii <= radius_range[1])
    sigmas = np.column_stack([discs.sigmas[:, :2], radius_sigmas(discs)])
    return Found(discs.centers[keep], discs.radii[keep], sigmas[keep])


def radius_sigmas(discs: Discs) -> NDArray[np.float64]:
    """Standard deviations (n,) px of `Discs.radii`, sqrt(a b), to first order from the semi-axes' covariance."""
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
    """The image smoothed by a Gaussian of `sigma` px; 0 leaves it unchanged."""
    return cv2.GaussianBlur(image, (0, 0), sigma) if sigma > 0 else image


def _opencv_hough(image, radius_range, *, method, dp, edge, votes, smoothing=0):
    """cv2.HoughCircles, with the smallest radius as the smallest distance between two centres."""
    low, high = int(np.floor(radius_range[0])), int(np.ceil(radius_range[1]))
    limits = {"param1": edge, "param2": votes, "minRadius": low, "maxRadius": high}
    found = cv2.HoughCircles(_smooth(image, smoothing), method, dp, low, **limits)
    return _rows([] if found is None else found.reshape(-1, found.shape[-1])[:, :3], radius_range)


def _blobs(image, radius_range, *, smoothing, levels, circularity):
    """cv2.SimpleBlobDetector; `levels` are its smallest and largest threshold and the step between thresholds.

    A blob's size is twice its radius.
    """
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
    """Threshold, outlines and cv2.fitEllipse.

    The threshold is a grey value or "Otsu".  Outlines need at least half the smallest perimeter, and ellipses an axis
    ratio above `ratio`.
    """
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
    """Canny edges, one accumulator plane for each whole radius, and peaks at least the smallest radius apart."""
    from skimage.feature import canny
    from skimage.transform import hough_circle, hough_circle_peaks

    radii = np.arange(np.ceil(radius_range[0]), np.floor(radius_range[1]) + 1).astype(int)
    apart = int(radius_range[0])
    votes = hough_circle(canny(image, sigma=sigma), radii)
    _, x, y, r = hough_circle_peaks(votes, radii, min_xdistance=apart, min_ydistance=apart, threshold=threshold)
    return _rows(np.column_stack([x, y, r]), radius_range)
