"""Hough transforms for circles: two-stage, phase coding, the classic accumulator, and one for all scales.

The paper finds its circles in the segmented image with MATLAB's two-stage method (Sect. 3.1, ref. 11) and
describes the classic transform: "a circle is drawn for each edge point with a radius r".  All three
are here, and a fourth that finds circles of any size, tilted, blurred or unevenly lit, in a fraction of their
time.  They serve to find circles, `pegpose_lab.edges` to measure them:

    discs = fit_discs(image, find_circles(image, (r_min, r_max)))
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..checks import as_choice, as_count, as_image, as_number, as_points
from .own_radius import end_tolerance, own_radius

METHODS = ("two-stage", "phase-code", "accumulator", "multiscale")
POLARITIES = ("bright", "dark")
OCTAVE = 5.0  # px, smallest radius that is searched on a reduced picture; the largest is twice that, or 2.4 times
NOISE_FACTOR, LEAST_GRADIENT = 4.0, 16.0  # least Sobel gradient of an edge: in sigmas of the noise, and at all (rounding's is 4)
LEAST_VOTES, LEAST_QUALITY = 0.25, 1.0  # of a candidate
ALIGNED = 0.8  # cosine of the largest angle between an edge's gradient and the direction of the centre
BAND = 0.2  # part of the radius by which an ellipse's edge may depart from a circle
SECTORS = 24
RADIUS_STEP = 0.5  # px between the radii of the votes along the gradient
SMOOTHING = 2.0  # px, sigma of the Gaussian over the 2-D accumulator
LEAST_WIDTH = 16.0  # px, of the range in which votes are cast, whatever range was asked for
CHUNK = 500_000  # votes held in memory at a time


@dataclass(frozen=True)
class Circles:
    """Circles, the best first: centers (n, 2) px, radii (n,) px, scores (n,); the polarity that was looked for."""

    centers: np.ndarray
    radii: np.ndarray
    scores: np.ndarray
    polarity: str = ""

    def __len__(self):
        return len(self.radii)


@dataclass(frozen=True)
class _Request:
    """The checked arguments of a search."""

    r_min: float
    r_max: float
    method: str
    sign: float
    sensitivity: float
    edge_threshold: float | None


def find_circles(
    image,
    radius_range,
    *,
    method="multiscale",
    polarity="bright",
    sensitivity=0.85,
    edge_threshold=None,
    max_circles=None,
    regions=None,
):
    """Find circles by a Hough transform.

    Parameters
    ----------
    image : (height, width) uint8 or bool
        A grey picture, or a mask (the paper looks for circles in the segmented image).
    radius_range : (r_min, r_max) px
        0 < r_min <= r_max.  Radii never lie outside, and a circle whose own radius, by its edge, lies outside by more
        than its error (3 %, at least 0.5 px) is not returned, even if all of it is seen.  One nearer to the range is
        returned with a radius at the range's end.  Keep r_max below 3 r_min for "two-stage" and "phase-code".
    method : {"multiscale", "two-stage", "phase-code", "accumulator"}
        "multiscale" searches each octave of radii on a picture reduced so far (by 1, 2, 4 ...) that they are 5
        to 10 px there (those below 10 px on the picture itself).  Edge points, thinned as Canny does, count from a
        gradient of four standard deviations of the noise on, whatever the contrast above 6 grey values (below, steps
        that rounding makes of slow shading look the same), and vote along the gradient as in "two-stage".  Around each peak of the votes the radii are tried at which edge points lie all around
        (24 sectors), and an ellipse is fitted to those points.  The score is the part of the sectors with an edge
        point within 10 % of the radius of that ellipse, at least 1.55 - sensitivity; where a circle runs along
        better ones, that part does not count.  Accurate to a few per cent of the radius.

        For the others see `circle_accumulator`.  The two-dimensional accumulators are smoothed (Gaussian,
        sigma 2 px); centres are the weighted centroids of the 8-connected regional maxima left after
        the h-maxima transform with h = 1 - sensitivity, and the score is the peak's value, at least h.
        "two-stage" then takes the whole-pixel radius of largest mean gradient around the centre, "phase-code"
        reads the radius from the phase of the peak; both give one radius for a centre, so they cannot tell
        concentric circles.  "accumulator" takes maxima over 3 x 3 x 3 neighbours, refined
        by a parabola along each axis; the score is the share of the circle's perimeter that was
        voted for, at least 1 - sensitivity/2, and the gradient along the perimeter must have the right polarity.
        In ranges narrower than 16 px "two-stage" and "phase-code" let radii beyond the range vote, too: a blurred
        edge is wider than such a range.
    polarity : {"bright", "dark"}
        Discs brighter or darker than what surrounds them.
    sensitivity : float in [0, 1]
        Larger finds more, and more false, circles.
    edge_threshold : float in [0, 1], optional
        Edges are pixels whose gradient is above this part of the largest one; by default Otsu's threshold
        ("multiscale": the noise's).
    max_circles : int, optional
        Keep the best ones only.
    regions : (k, 4) boxes x, y, width, height, px, optional
        Look only there, for example in `Segmentation.boxes`: each box is grown by a margin of
        r_max / 4 + 4 px and searched by itself, with edge threshold of its own.  Boxes smaller
        than r_min in both directions cannot hold a circle and are skipped.

    Returns
    -------
    Circles
        Sorted by score, descending, ties by y and then x.  Centres lie inside the image.  Of two circles nowhere
        further apart than max(3 px, 15 % of the smaller radius) the better one is kept.  Empty where nothing
        is found.

    Raises
    ------
    ValueError
        If an argument is unusable.
    """
    image = _as_grey(image)
    request = _as_request(radius_range, method, polarity, sensitivity, edge_threshold)
    if max_circles is not None:
        max_circles = as_count(max_circles, "max_circles", 1)
    rows = [np.empty((0, 4))]
    for x0, y0, x1, y1 in _windows(image.shape, regions, request):
        found = _find(image[y0:y1, x0:x1], request)
        rows.append(found + [x0, y0, 0, 0])
    return _as_circles(np.concatenate(rows), image.shape, request, max_circles)


def circle_accumulator(image, radius_range, *, method="two-stage", polarity="bright", edge_threshold=None):
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
    """
    image = _as_grey(image)
    if method == "multiscale":
        raise ValueError("method is 'multiscale', which has no one accumulator; expected one of the others")
    request = _as_request(radius_range, method, polarity, 0.85, edge_threshold)
    if method == "accumulator":
        radii = np.arange(int(np.ceil(request.r_min)), int(np.floor(request.r_max)) + 1)
        if len(radii) == 0:
            raise ValueError(f"radius_range is {radius_range}; expected a whole radius in it for 'accumulator'")
        edges = _thin_edges(_Gradient(image), request)
        return np.stack([_draw_circles(edges, int(r)) for r in radii])
    return _vote(_Gradient(image), request)


# ---------------------------------------------------------------------------------------------------- input


def _as_grey(image):
    """The picture as uint8; a mask becomes 0 and 255."""
    if isinstance(image, np.ndarray) and image.dtype == bool:
        image = image.astype(np.uint8) * 255
    return as_image(image)


def _as_request(radius_range, method, polarity, sensitivity, edge_threshold):
    """Check everything but the picture and the regions."""
    try:
        r_min, r_max = radius_range
    except (TypeError, ValueError) as error:
        raise ValueError(f"radius_range is {radius_range!r}; expected a pair (r_min, r_max) in px") from error
    r_min = as_number(r_min, "radius_range[0]", 0.0, 1e5, exclusive=True)
    r_max = as_number(r_max, "radius_range[1]", r_min, 1e5)
    method, polarity = as_choice(method, "method", METHODS), as_choice(polarity, "polarity", POLARITIES)
    sensitivity = as_number(sensitivity, "sensitivity", 0.0, 1.0)
    if edge_threshold is not None:
        edge_threshold = as_number(edge_threshold, "edge_threshold", 0.0, 1.0)
    return _Request(r_min, r_max, method, 1.0 if polarity == "bright" else -1.0, sensitivity, edge_threshold)


def _windows(shape, regions, request):
    """The parts of the picture to search, as x0, y0, x1, y1."""
    height, width = shape
    if regions is None:
        return [(0, 0, width, height)]
    boxes = as_points(np.reshape(regions, (0, 4)) if np.size(regions) == 0 else regions, 4, "regions", 0)
    boxes = boxes[boxes[:, 2:].max(axis=1, initial=0) >= request.r_min]
    margin = request.r_max / 4 + 4
    low = np.clip(np.floor(boxes[:, :2] - margin), 0, [width, height])
    high = np.clip(np.ceil(boxes[:, :2] + boxes[:, 2:] + margin), 0, [width, height])
    windows = np.unique(np.hstack([low, high]).astype(int), axis=0)
    return [tuple(window) for window in windows if (window[2:] > window[:2]).all()]


# ---------------------------------------------------------------------------------------------------- edges


class _Gradient:
    """Sobel gradient of a picture, border replicated."""

    def __init__(self, image):
        self.dx = cv2.Sobel(image, cv2.CV_16S, 1, 0, borderType=cv2.BORDER_REPLICATE)
        self.dy = cv2.Sobel(image, cv2.CV_16S, 0, 1, borderType=cv2.BORDER_REPLICATE)
        # not cv2.magnitude, whose last bit depends on where in memory its input lies; the sum of squares is exact
        self.magnitude = np.sqrt(np.square(self.dx, dtype=np.float32) + np.square(self.dy, dtype=np.float32))

    def threshold(self, request):
        """The gradient above which a pixel is an edge."""
        largest = float(self.magnitude.max())
        if request.edge_threshold is not None:
            return request.edge_threshold * largest
        scaled = cv2.convertScaleAbs(self.magnitude, alpha=255 / max(largest, 1.0))
        return cv2.threshold(scaled, 0, 255, cv2.THRESH_OTSU)[0] / 255 * largest


def _thin_edges(gradient, request):
    """Edge points of one pixel's width: Canny's non-maximum suppression above the threshold, as bool."""
    threshold = gradient.threshold(request)
    edges = cv2.Canny(gradient.dx, gradient.dy, threshold, threshold, L2gradient=True)
    return (edges > 0) & (gradient.magnitude > threshold)


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


# ---------------------------------------------------------------------------------------------------- peaks


def _find(window, request):
    """Rows x, y, r, score of the circles in one window."""
    if request.method == "multiscale":
        return _find_multiscale(window, request)
    gradient = _Gradient(window)
    if not gradient.magnitude.any():
        return np.empty((0, 4))
    if request.method == "accumulator":
        return _find_in_volume(gradient, request)
    wide = _widened(request)
    votes = _vote(gradient, wide)
    smooth = cv2.GaussianBlur(np.abs(votes), (0, 0), SMOOTHING, borderType=cv2.BORDER_CONSTANT)
    peaks = _regional_peaks(smooth, max(1 - request.sensitivity, 1e-6))
    radius = _radius_by_phase if request.method == "phase-code" else _radius_by_histogram
    # rounded, so that no processor's last digit decides the order of equally good circles
    rows = [(x, y, radius(votes, gradient, x, y, wide), round(score, 6)) for x, y, score in peaks]
    return _of_own_radius(gradient, np.array(rows).reshape(-1, 4), request, wide)


def _widened(request):
    """The request with a range of at least LEAST_WIDTH px, so that all of a blurred edge can vote."""
    more = max(0.5 * (LEAST_WIDTH - (request.r_max - request.r_min)), 0)
    return replace(request, r_min=max(request.r_min - more, 0.5 * request.r_min), r_max=request.r_max + more)


def _of_own_radius(gradient, rows, request, wide):
    """The circles, rows x, y, r, score, whose radius lies in the range by what their edge itself tells.

    A circle of which too little edge is seen for that is judged by the radius that the method gives it.  That
    of "phase-code" is ambiguous at the ends of the range: there the edge tells which one it is.
    """
    if len(rows) == 0:
        return rows
    y, x = np.nonzero(gradient.magnitude > gradient.threshold(request))
    inwards = request.sign * np.stack([gradient.dx[y, x], gradient.dy[y, x]], axis=1).astype(float)
    points, reach = np.stack([x, y], axis=1).astype(float), 3 * wide.r_max
    own = np.array([own_radius(points, inwards, row[:3], reach) for row in rows])
    known, ratio = np.isfinite(own), wide.r_max / wide.r_min
    if request.method == "phase-code":
        others = rows[:, 2, None] * ratio ** np.array([0.0, -1.0, 1.0])
        nearest = np.abs(others - np.where(known, own, rows[:, 2])[:, None]).argmin(axis=1)
        rows[:, 2] = others[np.arange(len(rows)), nearest]
    radii = np.where(known, own, rows[:, 2])
    return rows[_in_range(radii, request)]


def _in_range(radii, request):
    """Which radii lie in the range, or nearer to it than the error that they may have."""
    tolerance = end_tolerance(radii)
    return (radii >= request.r_min - tolerance) & (radii <= request.r_max + tolerance)


def _regional_peaks(surface, h):
    """Centroid x, y and peak value of each regional maximum of the h-maxima transform, if the peak is >= h.

    A maximum of value v survives the transform when the 8-connected part of {surface >= v - h} around it
    has no higher point; that part is then its region.  Going down from the highest, everything flooded so far
    belongs to higher points, so touching it is the whole test.
    """
    surface = np.ascontiguousarray(surface, np.float32)
    is_maximum = (surface >= h) & (surface == cv2.dilate(surface, np.ones((3, 3), np.uint8)))
    rows, columns = np.nonzero(is_maximum)
    order = np.lexsort((columns, rows, -surface[rows, columns]))
    flooded = np.zeros((surface.shape[0] + 2, surface.shape[1] + 2), np.uint8)
    peaks = []
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if not flooded[row + 1, column + 1]:
            region = _flood(surface, flooded, row, column, h)
            if region is not None:
                peaks.append((*region, float(surface[row, column])))
    return peaks


_FLOODED = 3  # mark in the mask; floodFill itself writes 1 along the mask's border


def _flood(surface, flooded, row, column, h):
    """Flood the region around a maximum; its weighted centroid x, y, or None where it touches a higher one."""
    flags = 8 | (2 << 8) | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY
    depth = min(h, float(surface[row, column]) * (1 - 1e-6))
    *_, (x, y, width, height) = cv2.floodFill(surface, flooded, (column, row), 0, depth, 1e9, flags)
    around = flooded[y : y + height + 2, x : x + width + 2]
    new = (around == 2).astype(np.uint8)
    touches = (cv2.dilate(new, np.ones((3, 3), np.uint8)) & (around == _FLOODED)).any()
    around[new > 0] = _FLOODED
    if touches:
        return None
    weights = surface[y : y + height, x : x + width] * new[1:-1, 1:-1]
    total = weights.sum(dtype=float)
    cx = weights.sum(axis=0, dtype=float) @ np.arange(x, x + width) / total
    cy = weights.sum(axis=1, dtype=float) @ np.arange(y, y + height) / total
    return cx, cy


def _radius_by_phase(votes, _gradient, x, y, request):
    """Radius from the phase of the votes around a centre (weighted by the smoothing's Gaussian)."""
    reach = int(3 * SMOOTHING)
    row, column = int(round(y)), int(round(x))
    rows = np.arange(max(row - reach, 0), min(row + reach + 1, votes.shape[0]))
    columns = np.arange(max(column - reach, 0), min(column + reach + 1, votes.shape[1]))
    down = np.exp(-0.5 * ((rows - y) / SMOOTHING) ** 2)
    across = np.exp(-0.5 * ((columns - x) / SMOOTHING) ** 2)
    peak = down @ votes[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] @ across
    phase = np.angle(peak) % (2 * np.pi)
    return request.r_min * (request.r_max / request.r_min) ** (phase / (2 * np.pi))


def _radius_by_histogram(_votes, gradient, x, y, request):
    """The whole radius at which the mean gradient in a ring of one pixel's width is largest."""
    reach = int(np.ceil(request.r_max)) + 1
    row, column = int(round(y)), int(round(x))
    rows = np.arange(max(row - reach, 0), min(row + reach + 1, gradient.magnitude.shape[0]))
    columns = np.arange(max(column - reach, 0), min(column + reach + 1, gradient.magnitude.shape[1]))
    patch = gradient.magnitude[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    bins = np.rint(np.hypot(columns - x, (rows - y)[:, None])).astype(int).ravel()
    total, count = np.bincount(bins, patch.ravel()), np.bincount(bins)
    low, high = int(np.ceil(request.r_min)), int(np.floor(request.r_max))
    mean = total[low : high + 1] / np.maximum(count[low : high + 1], 1)
    return float(low + mean.argmax()) if len(mean) else 0.5 * (request.r_min + request.r_max)


# ----------------------------------------------------------------------------------------------- multiscale


def _find_multiscale(image, request):
    """Rows x, y, r, score: each octave of radii is searched on a picture of its own (see `find_circles`)."""
    reduction, rows = 1, [np.empty((0, 4))]
    largest = min(request.r_max, min(image.shape))  # larger circles show less than half of their edge
    while True:
        low, high = request.r_min / reduction, largest / reduction
        last = high <= 2.4 * OCTAVE
        if low < 2 * OCTAVE or last:
            low = max(low, OCTAVE if reduction > 1 else 0)
            found = _find_octave(image, (low, high if last else 2 * OCTAVE), request) if low <= high else rows[0]
            found = found * [reduction, reduction, reduction, 1] + 0.5 * (reduction - 1) * _IS_PLACE
            rows.append(found[_in_range(found[:, 2], request)])
        if last:
            return np.concatenate(rows)
        image, reduction = _halved(image), 2 * reduction


_IS_PLACE = np.array([1, 1, 0, 0])


def _halved(image):
    """The picture at half the size, each pixel the mean of four."""
    height, width = image.shape[0] // 2, image.shape[1] // 2
    return cv2.resize(image[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA)


def _find_octave(image, radii, request):
    """Rows x, y, r, score of the circles with `radii` (smallest, largest), at most an octave."""
    edges = _EdgePoints.of(image, request)
    if len(edges.x) == 0:
        return np.empty((0, 4))
    more = max(0.5 * (1 - (radii[1] - radii[0])), 0)  # an edge is no narrower than that
    radii = max(radii[0] - more, 0.5 * radii[0]), radii[1] + more
    peaks = _octave_peaks(edges, radii, image.shape)
    if len(peaks) == 0:
        return np.empty((0, 4))
    near = _edges_near(edges, peaks, radii[1] * (1 + BAND) + 2)
    return _fit_outlines(near, *_best_radii(near, radii), request)


@dataclass(frozen=True)
class _EdgePoints:
    """Thin edge points: x, y (n,) px, and unit vectors (n,) towards the inside of a disc."""

    mask: np.ndarray
    x: np.ndarray
    y: np.ndarray
    ux: np.ndarray
    uy: np.ndarray

    @classmethod
    def of(cls, image, request):
        """Canny's edge points, above a threshold that noise does not reach."""
        dx = cv2.Sobel(image, cv2.CV_16S, 1, 0, borderType=cv2.BORDER_REPLICATE)
        dy = cv2.Sobel(image, cv2.CV_16S, 0, 1, borderType=cv2.BORDER_REPLICATE)
        threshold = _noise_threshold(dx, dy, request)
        mask = cv2.Canny(dx, dy, threshold, threshold, L2gradient=True)
        points = cv2.findNonZero(mask)
        x, y = np.empty((2, 0), np.intp) if points is None else points.reshape(-1, 2).T.astype(np.intp)
        ux, uy = dx[y, x].astype(np.float32), dy[y, x].astype(np.float32)
        length = np.float32(request.sign) * np.maximum(np.sqrt(ux * ux + uy * uy), 1)
        return cls(mask, x, y, ux / length, uy / length)


def _noise_threshold(dx, dy, request):
    """Least gradient of an edge: NOISE_FACTOR times the noise's, told by quartiles (slopes do not count)."""
    if request.edge_threshold is not None:
        return request.edge_threshold * float(np.hypot(dx.astype(np.float32), dy).max())
    some = (dx[::4].clip(-127, 127) + 128).astype(np.uint8)
    below = np.cumsum(cv2.calcHist([some], [0], None, [256], [0, 256]).ravel())
    quartiles = np.searchsorted(below, [0.25 * below[-1], 0.75 * below[-1]])
    return max(NOISE_FACTOR / 1.349 * (float(quartiles[1] - quartiles[0]) + 1), LEAST_GRADIENT)


def _octave_peaks(edges, radii, shape):
    """Cells of 2 x 2 px where votes along the gradient meet: their centres (n, 2), px."""
    height, width = shape[0] // 2 + 1, shape[1] // 2 + 1
    distances = np.arange(radii[0], radii[1] + 0.49, 0.5, dtype=np.float32)[:, None]
    columns = ((edges.x + 0.5 + distances * edges.ux) * 0.5).astype(np.int32)
    rows = ((edges.y + 0.5 + distances * edges.uy) * 0.5).astype(np.int32)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    weights = np.broadcast_to(1 / (2 * np.pi * distances), inside.shape)
    votes = np.bincount((rows * width + columns)[inside], weights[inside], height * width)
    votes = cv2.GaussianBlur(votes.reshape(height, width).astype(np.float32), (3, 3), 0)
    highest = cv2.dilate(votes, np.ones((3, 3), np.uint8))
    peaks = cv2.findNonZero(cv2.compare(votes, highest, cv2.CMP_EQ) & cv2.compare(votes, LEAST_VOTES, cv2.CMP_GT))
    if peaks is None:
        return np.empty((0, 2))
    peaks = peaks.reshape(-1, 2)
    around = cv2.copyMakeBorder(votes, 1, 1, 1, 1, cv2.BORDER_CONSTANT)
    around = around[peaks[:, 1, None] + _ROWS, peaks[:, 0, None] + _COLUMNS]
    total = around.sum(axis=1)
    shift = np.stack([around @ (_COLUMNS - 1), around @ (_ROWS - 1)], axis=1) / total[:, None]
    return np.clip(2 * (peaks + shift) + 0.5, 0, [shape[1] - 1, shape[0] - 1])


_ROWS, _COLUMNS = np.indices((3, 3)).reshape(2, 9)


@dataclass(frozen=True)
class _Near:
    """Edge points around peaks: index of the peak, place relative to it, distance; peaks (n, 2)."""

    peaks: np.ndarray
    index: np.ndarray
    x: np.ndarray
    y: np.ndarray
    distance: np.ndarray


def _edges_near(edges, peaks, reach):
    """The edge points within `reach` of each peak whose gradient points to it within ALIGNED."""
    size = int(reach) + 2
    number = np.full((edges.mask.shape[0] + 2 * size, edges.mask.shape[1] + 2 * size), -1, np.int32)
    number[edges.y + size, edges.x + size] = np.arange(len(edges.x))
    corners = np.rint(peaks).astype(int)
    patches = np.lib.stride_tricks.sliding_window_view(number, (2 * size + 1, 2 * size + 1))
    patches = patches[corners[:, 1], corners[:, 0]].reshape(len(peaks), -1)
    index, place = np.nonzero(patches >= 0)
    point = patches[index, place]
    x, y = edges.x[point] - peaks[index, 0], edges.y[point] - peaks[index, 1]
    distance = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    keep = (x * edges.ux[point] + y * edges.uy[point] < -ALIGNED * distance) & (distance <= reach)
    return _Near(peaks, index[keep], x[keep], y[keep], distance[keep])


def _best_radii(near, radii):
    """Peaks and radii at which the edge around a peak is most complete: two arrays (m,)."""
    n_bins = int(2 * radii[1] * (1 + BAND)) + 6
    sector = _sector(near.x, near.y)
    cells = (near.index * n_bins + (2 * near.distance + 0.5).astype(int).clip(0, n_bins - 1)) * SECTORS + sector
    counts = np.bincount(cells, minlength=len(near.peaks) * n_bins * SECTORS)
    below = np.zeros((len(near.peaks), n_bins + 1, SECTORS), int)
    np.cumsum(counts.reshape(-1, n_bins, SECTORS), axis=1, out=below[:, 1:])
    tried = np.arange(max(int(2 * radii[0]), 1), int(np.ceil(2 * radii[1])) + 1)
    quality = np.zeros((len(near.peaks), len(tried)), np.float32)
    for band in (0, 0.5 * BAND, BAND):
        half = np.maximum(np.rint(band * tried).astype(int), 1)
        low, high = np.maximum(tried - half, 0), np.minimum(tried + half + 1, n_bins)
        quality += ((below[:, high] - below[:, low]) > 0).mean(axis=2, dtype=np.float32)
    highest = cv2.dilate(quality, np.ones((1, 5), np.uint8)) if quality.size else quality
    peak, radius = np.nonzero((quality == highest) & (quality > LEAST_QUALITY))
    return peak, tried[radius] / 2


def _sector(x, y):
    """Number of the angular sector of points around the origin."""
    return ((np.arctan2(y, x) / (2 * np.pi) + 0.5) * SECTORS).astype(int).clip(0, SECTORS - 1)


def _fit_outlines(near, peak, radius, request):
    """Rows x, y, r, score of ellipses through the edge points around each candidate.

    To first order an ellipse is distance(t) = r + x cos t + y sin t + p cos 2t + q sin 2t.  The score is the part
    of the sectors that have an edge point within 10 % of the radius (at least 1 px) of it.
    """
    if len(peak) == 0:
        return np.empty((0, 4))
    point, used = _points_of(near, peak)
    distance, wanted = np.where(used, near.distance[point], np.inf), radius[:, None]
    cos, sin = near.x[point] / near.distance[point], near.y[point] / near.distance[point]
    design = np.stack([np.ones_like(cos), cos, sin, cos * cos - sin * sin, 2 * cos * sin], axis=2)
    solution = np.zeros((len(peak), 5, 1))
    solution[:, 0, 0] = radius
    for tolerance in (BAND, 0.6 * BAND, 0.4 * BAND):
        residual = distance - (design @ solution)[:, :, 0]
        inside = np.abs(residual) <= np.maximum(tolerance * wanted, 1)
        weighted = (design * inside[:, :, None]).transpose(0, 2, 1)
        residual = np.where(inside, residual, 0)[:, :, None]
        solution += np.linalg.solve(weighted @ design + _HOLD, weighted @ residual)
    residual = np.abs(distance - (design @ solution)[:, :, 0])
    candidate, place = np.nonzero(residual <= np.maximum(0.1 * wanted, 1))
    sectors = candidate * SECTORS + _sector(cos[candidate, place], sin[candidate, place])
    score = (np.bincount(sectors, minlength=len(peak) * SECTORS).reshape(-1, SECTORS) > 0).sum(axis=1) / SECTORS
    r, x, y, p, q = solution[:, :, 0].T
    good = (np.hypot(x, y) < 0.5 * radius + 2) & (np.hypot(p, q) < 0.3 * radius)
    good &= (np.abs(r - radius) < BAND * radius + 1) & (score >= _least_score(request))
    return np.stack([near.peaks[peak, 0] + x, near.peaks[peak, 1] + y, r, score], axis=1)[good]


_HOLD = np.diag([1e-3, 0.5, 0.5, 1.0, 1.0])  # holds centre and shape where there are few points


def _least_score(request):
    """The least part of a circle's edge that must be seen."""
    return 1.55 - request.sensitivity


def _points_of(near, peak):
    """For each candidate the indices of the edge points around its peak, in rows (n, m), and which count."""
    starts = np.searchsorted(near.index, np.arange(len(near.peaks) + 1))
    counts = np.diff(starts)[peak]
    place = np.arange(counts.max())
    used = place < counts[:, None]
    return np.where(used, starts[peak][:, None] + place, 0), used


# ---------------------------------------------------------------------------------------------------- volume


def _find_in_volume(gradient, request):
    """Rows x, y, r, score: maxima of the 3-D accumulator, held three planes at a time."""
    edges, least = _thin_edges(gradient, request), 1 - request.sensitivity / 2
    empty = np.zeros(edges.shape, np.float32)
    first, last = max(int(np.floor(request.r_min)) - 1, 1), int(np.ceil(request.r_max)) + 1
    below = _draw_circles(edges, first - 1) if first > 1 else empty
    here, rows = _draw_circles(edges, first), []
    for radius in range(first, last + 1):  # planes beyond the range tell which circles belong there
        above = _draw_circles(edges, radius + 1)
        rows.extend(_plane_maxima(below, here, above, radius, least))
        below, here = here, above
    rows = [row for row in rows if _has_polarity(gradient, row, request.sign)]
    rows = np.array(rows, float).reshape(-1, 4)
    return rows[_in_range(rows[:, 2], request)]


def _plane_maxima(below, here, above, radius, least):
    """Maxima of the middle plane over 3 x 3 x 3 neighbours, refined by a parabola along each axis."""
    cube = np.ones((3, 3), np.uint8)
    highest = cv2.dilate(cv2.max(cv2.max(below, above), here), cube)
    for y, x in np.argwhere((here >= least) & (here == highest)).tolist():
        dx = _parabola(*_neighbours(here, x, y, 1, 0))
        dy = _parabola(*_neighbours(here, x, y, 0, 1))
        dr = _parabola(below[y, x], here[y, x], above[y, x])
        yield x + dx, y + dy, radius + dr, here[y, x]


def _neighbours(plane, x, y, dx, dy):
    """A value between its two neighbours; outside the picture the value itself is repeated."""
    height, width = plane.shape
    before = plane[max(y - dy, 0), max(x - dx, 0)]
    return before, plane[y, x], plane[min(y + dy, height - 1), min(x + dx, width - 1)]


def _parabola(before, here, after):
    """Place of the vertex through three equally spaced values, the middle one not the smallest: |x| <= 0.5."""
    bend = float(before) - 2 * float(here) + float(after)
    return 0.5 * (float(before) - float(after)) / bend if bend < 0 else 0.0


def _has_polarity(gradient, row, sign):
    """Whether the gradient along a circle points, on the whole, to its centre (sign 1) or away (-1)."""
    x, y, radius, _ = row
    t = np.arange(0, 2 * np.pi, 1 / radius)
    columns = np.rint(x + radius * np.cos(t)).astype(int)
    rows = np.rint(y + radius * np.sin(t)).astype(int)
    height, width = gradient.magnitude.shape
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    dx, dy = gradient.dx[rows[inside], columns[inside]], gradient.dy[rows[inside], columns[inside]]
    return sign * (dx @ np.cos(t[inside]) + dy @ np.sin(t[inside])) < 0


# ---------------------------------------------------------------------------------------------------- result


def _as_circles(rows, shape, request, max_circles):
    """Sorted circles without duplicates, inside the image and the radius range."""
    centers = np.clip(rows[:, :2], 0, [shape[1] - 1, shape[0] - 1])
    radii = np.clip(rows[:, 2], request.r_min, request.r_max)
    order = np.lexsort((centers[:, 0], centers[:, 1], -rows[:, 3]))
    places, kept = np.column_stack([centers, radii]).tolist(), []
    for i in order.tolist():
        if max_circles is not None and len(kept) == max_circles:
            break
        near = [k for k in kept if _may_touch(places[i], places[k])]
        if not near or not _is_known(places[i], [places[k] for k in near], rows[i, 3], request):
            kept.append(i)
    polarity = "bright" if request.sign > 0 else "dark"
    return Circles(centers[kept], radii[kept], rows[kept, 3], polarity)


def _may_touch(first, second):
    """Whether two circles x, y, r are nearer than the widest tolerance below."""
    apart = math.hypot(first[0] - second[0], first[1] - second[1])
    tolerance = 3.0 + BAND * min(first[2], second[2])
    return abs(first[2] - second[2]) - tolerance < apart < first[2] + second[2] + tolerance


def _is_known(circle, others, score, request):
    """Whether a circle is nowhere far from a better one, or (multiscale) too little of its edge is its own."""
    x, y, r = np.array(others).T
    smaller = np.minimum(r, circle[2])
    if (np.hypot(x - circle[0], y - circle[1]) + np.abs(r - circle[2]) < np.maximum(3.0, 0.15 * smaller)).any():
        return True
    if request.method != "multiscale":
        return False
    along, across = circle[0] + circle[2] * _COS[:, None] - x, circle[1] + circle[2] * _SIN[:, None] - y
    shared = np.abs(np.hypot(along, across) - r) < np.maximum(2.0, BAND * smaller)
    shared &= along * _COS[:, None] + across * _SIN[:, None] > 0  # where discs touch, each has the edge of its own
    return score - shared.any(axis=1).mean() < _least_score(request)


_COS, _SIN = (function((np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS)) for function in (np.cos, np.sin))
