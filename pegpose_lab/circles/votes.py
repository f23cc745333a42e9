"""The accumulators of the classic, two-stage and phase-coding Hough transforms."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..checks import as_choice
from .edges import _Gradient, _thin_edges
from .request import _as_grey, _as_request

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

ACCUMULATORS = ("two-stage", "phase-code", "accumulator")
RADIUS_STEP = 0.5  # px between the radii of the votes along the gradient
CHUNK = 500_000  # votes held in memory at a time


def circle_accumulator(
    image: ArrayLike,
    radius_range: tuple[float, float],
    *,
    method: str = "two-stage",
    polarity: str = "bright",
    edge_threshold: float | None = None,
) -> NDArray[Any]:
    """The votes of a Hough transform, before smoothing.

    Parameters
    ----------
    image, radius_range, method, polarity, edge_threshold
        As for `find_circles`.

    Returns
    -------
    "two-stage" : (height, width) float64
        Each edge pixel votes along its gradient (against it for dark discs) at the distances r_min, r_min + 0.5,
        ... up to r_max, each vote with weight 1/(2 pi r), in the pixel next to it; votes outside are dropped.
    "phase-code" : (height, width) complex128
        The same with weight exp(i phi)/(2 pi r), phi = 2 pi ln(r / r_min) / ln(r_max / r_min).
    "accumulator" : (n_radii, height, width) float32
        For each whole radius in the range, one circle drawn around each edge point, divided by its
        perimeter 2 pi r.  A drawn circle is all pixels whose distance from the centre rounds to r; edge
        points are thinned by Canny's non-maximum suppression.  n_radii * height * width * 4 bytes are needed
        (`find_circles` itself keeps three radii at a time); `polarity` plays no part.

    Raises
    ------
    ValueError
        If an argument is unusable.

    Examples
    --------
    >>> import cv2
    >>> import numpy as np
    >>> image = cv2.circle(np.zeros((100, 120), np.uint8), (70, 40), 20, 255, -1)
    >>> votes = circle_accumulator(image, (18, 22))
    >>> y, x = np.unravel_index(votes.argmax(), votes.shape)
    >>> votes.shape, bool(abs(x - 70) <= 1 and abs(y - 40) <= 1)
    ((100, 120), True)
    """
    image = _as_grey(image)
    if method == "multiscale":
        raise ValueError("method is 'multiscale', which has no one accumulator; expected one of the others")
    method = as_choice(method, "method", ACCUMULATORS)
    request = _as_request(radius_range, method, polarity, 0.85, edge_threshold)
    if method == "accumulator":
        radii = np.arange(int(np.ceil(request.r_min)), int(np.floor(request.r_max)) + 1)
        if len(radii) == 0:
            raise ValueError(f"radius_range is {radius_range}; expected a whole radius in it for 'accumulator'")
        edges = _thin_edges(_Gradient(image), request)
        return np.stack([_draw_circles(edges, int(r)) for r in radii])
    return _vote(_Gradient(image), request)


# ---------------------------------------------------------------------------------------------------- votes


def _vote(gradient, request):
    """The 2-D accumulator, real or complex (see `circle_accumulator`)."""
    height, width = gradient.magnitude.shape
    y, x = np.nonzero(gradient.magnitude > gradient.threshold(request))
    magnitude = gradient.magnitude[y, x]
    ux = np.float32(request.sign) * gradient.dx[y, x] / magnitude
    uy = np.float32(request.sign) * gradient.dy[y, x] / magnitude
    farthest = min(request.r_max, max(math.hypot(height, width), request.r_min))  # votes from further fall outside
    radii = request.r_min + RADIUS_STEP * np.arange(int((farthest - request.r_min) / RADIUS_STEP + 1e-9) + 1)
    weights = _weights(radii, request)
    votes = np.zeros(height * width, weights.dtype)
    per_chunk = max(1, CHUNK // max(len(x), 1))
    x, y, distances = x.astype(np.float32), y.astype(np.float32), radii.astype(np.float32)
    for first in range(0, len(radii), per_chunk):
        chunk = slice(first, first + per_chunk)
        _add_votes(votes, (x, y, ux, uy), distances[chunk], weights[chunk], (height, width))
    return votes.reshape(height, width)


def _weights(radii, request):
    """Weight of a vote at each radius."""
    weights = 1 / (2 * np.pi * radii)
    if request.method == "two-stage":
        return weights
    turns = np.log(radii / request.r_min) / max(np.log(request.r_max / request.r_min), 1e-12)
    return weights * np.exp(2j * np.pi * turns)


def _add_votes(votes, edges, radii, weights, shape):
    """Add the votes of all edge pixels at some radii to the flat accumulator."""
    x, y, ux, uy = edges
    columns = np.rint(x + radii[:, None] * ux).astype(np.int32)
    rows = np.rint(y + radii[:, None] * uy).astype(np.int32)
    inside = (columns >= 0) & (columns < shape[1]) & (rows >= 0) & (rows < shape[0])
    cells, size = (rows * shape[1] + columns)[inside], shape[0] * shape[1]

    for total, part in ((votes.real, weights.real), (votes.imag, weights.imag)):
        if part.any():
            total += np.bincount(cells, np.broadcast_to(part[:, None], inside.shape)[inside], size)


def _draw_circles(edges, radius):
    """One plane of the 3-D accumulator: correlation of the edge points with a drawn circle."""
    offsets = np.arange(-radius - 1, radius + 2)
    ring = (np.rint(np.hypot(offsets, offsets[:, None])) == radius).astype(np.float32)
    votes = cv2.filter2D(edges.astype(np.float32), cv2.CV_32F, ring, borderType=cv2.BORDER_CONSTANT)
    return np.rint(votes) / np.float32(2 * np.pi * radius)
