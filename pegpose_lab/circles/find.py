"""Hough transforms for circles: two-stage, phase coding, the classic accumulator, and one for all scales.

The paper finds its circles in the segmented image with MATLAB's two-stage method (Sect. 3.1, ref. 11) and
describes the classic transform: "a circle is drawn for each edge point with a radius r".  All three
are here, and a fourth that finds circles of any size, tilted, blurred or unevenly lit, in a fraction of their
time.  They find circles; `pegpose_lab.discs` measures them with an ellipse fit:

    discs = fit_discs(image, find_circles(image, (r_min, r_max)))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_count
from .request import DETECTION_METHODS, _as_grey, _as_request, _windows
from .select import _as_circles

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .select import Circles


def find_circles(
    image: ArrayLike,
    radius_range: tuple[float, float],
    *,
    method: str = "multiscale",
    polarity: str = "bright",
    sensitivity: float = 0.85,
    edge_threshold: float | None = None,
    max_circles: int | None = None,
    regions: ArrayLike | None = None,
) -> Circles:
    """Find circles (bright or dark discs) in an image by a Hough transform.

    Parameters
    ----------
    image : (height, width) uint8 or bool
        A grey image, or a mask (the paper looks for circles in the segmented image).
    radius_range : (r_min, r_max) px
        0 < r_min <= r_max.  Radii never lie outside, and a circle whose own radius, by its edge, lies outside by more
        than its error (3 %, at least 0.5 px) is not returned, even if all of it is seen.  One nearer to the range is
        returned with a radius at the range's end.  Keep r_max below 3 r_min for "two-stage" and "phase-code".
    method : {"multiscale", "two-stage", "phase-code", "accumulator"}
        "multiscale" searches each octave of radii on an image that is reduced (by 1, 2, 4 ...) until the radii are 5
        to 10 px (radii below 10 px on the image itself).  Edge points are thinned as in Canny's detector, need a
        gradient of at least four standard deviations of the noise, whatever the contrast above 6 grey values (below,
        the steps that rounding makes of slow shading look the same), and vote along the gradient as in "two-stage".
        Around each peak of the votes, the radii at which edge points lie all around (24 sectors) are tried,
        and an ellipse is fitted to those points.  The score is the part of the sectors with an edge point within 10 %
        of the radius of that ellipse, at least 1.55 - sensitivity; where a circle runs along better ones, that part
        does not count.  Accurate to a few per cent of the radius.

        For the others see `circle_accumulator`.  The two-dimensional accumulators are smoothed (Gaussian,
        sigma 2 px); centres are the weighted centroids of the 8-connected regional maxima left after
        the h-maxima transform with h = 1 - sensitivity, and the score is the peak's value, at least h.
        "two-stage" then takes the whole-pixel radius of largest mean gradient around the centre, "phase-code"
        reads the radius from the phase of the peak; both give one radius per centre, so they cannot separate
        concentric circles.  "accumulator" takes maxima over 3 x 3 x 3 neighbours, refined
        by a parabola along each axis; the score is the fraction of the circle's perimeter that got
        votes, at least 1 - sensitivity/2, and the gradient along the perimeter must have the right polarity.
        In ranges narrower than 16 px "two-stage" and "phase-code" also let radii beyond the range vote: a blurred
        edge is wider than such a range.
    polarity : {"bright", "dark"}
        Discs brighter or darker than what surrounds them.
    sensitivity : float in [0, 1]
        Larger values find more circles, and more false ones.
    edge_threshold : float in [0, 1], optional
        Edges are pixels whose gradient is above this fraction of the largest one; by default Otsu's threshold
        ("multiscale": a threshold from the noise).
    max_circles : int, optional
        Keep only the best ones.
    regions : (k, 4) boxes x, y, width, height, px, optional
        Search only these boxes, for example `Segmentation.boxes`: each box is grown by a margin of
        r_max / 4 + 4 px and searched by itself, with its own edge threshold.  Boxes smaller
        than r_min in both directions cannot hold a circle and are skipped.

    Returns
    -------
    Circles
        Sorted by score, descending, ties by y and then x.  Centres lie inside the image.  Of two circles that are nowhere
        further apart than max(3 px, 15 % of the smaller radius), the better one is kept.  Empty where nothing
        is found.

    Raises
    ------
    ValueError
        If an argument is unusable.

    References
    ----------
    H. K. Yuen, J. Princen, J. Illingworth and J. Kittler, "Comparative study of Hough transform methods for circle
    finding", Image and Vision Computing 8(1), 1990 (two-stage).
    E. R. Davies, "A modified Hough scheme for general circle location", Pattern Recognition Letters 7(1), 1988.
    T. J. Atherton and D. J. Kerbyson, "Size invariant circle detection", Image and Vision Computing 17(11), 1999
    (phase-code).

    Examples
    --------
    >>> import cv2
    >>> import numpy as np
    >>> import pegpose_lab as pl
    >>> image = np.full((100, 120), 60, np.uint8)
    >>> image = cv2.GaussianBlur(cv2.circle(image, (70, 40), 20, 200, -1), (0, 0), 1.0)
    >>> image += np.random.default_rng(0).integers(0, 5, image.shape, np.uint8)
    >>> circles = find_circles(image, (15, 30))
    >>> circles.centers.round().tolist(), circles.radii.round().tolist()
    ([[70.0, 40.0]], [20.0])
    >>> len(find_circles(image, (15, 30), polarity="dark"))
    0
    """
    image = _as_grey(image)
    request = _as_request(radius_range, method, polarity, sensitivity, edge_threshold)
    if max_circles is not None:
        max_circles = as_count(max_circles, "max_circles", 1)
    find = importlib.import_module(f"{__package__}.{DETECTION_METHODS[request.method]}").find
    rows = [np.empty((0, 4))]
    for x0, y0, x1, y1 in _windows(image.shape, regions, request):
        found = find(image[y0:y1, x0:x1], request)
        rows.append(found + [x0, y0, 0, 0])
    return _as_circles(np.concatenate(rows), image.shape, request, max_circles)
