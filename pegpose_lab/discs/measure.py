"""From circles to discs: the fits of a picture, and what is returned of them."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial import cKDTree
from scipy.special import ndtr

from ..checks import as_choice, as_image, as_number, as_points

RING = 6.0  # px on either side of the edge that take part in the fit
GROUND = 24.0  # px on either side of the edge up to which even ground helps to know the levels
GROUND_WIDTHS = 4.0  # edge widths s from the edge to where the ground begins: RING is at least that far
GROUND_SIGMAS = 3.0  # departure from the ring's levels or noise, in standard deviations, that bars ground
QUANTISATION = 1 / 12  # variance of rounding to whole grey values
N_RAYS, RAY_POINTS = 64, 49
REMAP_LIMIT = 32_766  # px, longest side of what cv2.remap takes
CHUNK = 256  # pixels that are summed in float32: no sum depends on how far a disc's row is filled up
SAME = 1.0  # px, distance of centres and radii below which two fits are of one disc
GROUP = 250  # sum of the radii (px) of the discs that are fitted together: their arrays stay in the cache
N_SECTORS = np.array([24, 36, 48, 60, 78, 96])  # sectors of a refit, multiples of BLOCK
SECTOR_ROW, LONGER_ROW = 72, 12  # pixels to which the rows of sectors are filled up, and further where there are more
PART = 4  # every so-many-th pixel is enough for the first steps, if there are LEAST_PIXELS
LEAST_PIXELS, LEAST_RING = 600, 30
MAX_STEPS, ROUGH_STEPS = 12, 6
STEP_TOLERANCE = 1e-3  # squared length, in sigmas, of a step that is not worth taking
ROUGH_STEP, SMALL_STEP = 0.3, 0.05  # px, a step after which none is needed: on a part of the pixels, on all
MAX_RINGS = 2
REFIT_SIGMAS = 5.0  # excess of the simple model's chi2, in standard deviations, that calls for a refit by sectors
NEAR, NEAR_CHI2 = 0.7, 5.0  # a refit starts from the simple fit if that is so near (px) and so good
SECTOR_LENGTH = 5.0  # px along the edge, about
SECTOR_SIGMAS, OWN_EXCESS = 4.0, 14.0  # when a sector gets levels of its own, see `_refit`
OWN_WEIGHT = 0.3  # of such a sector
OWN_VISIBLE = 0.6  # what it counts as visible edge
ALONE, FREEZE = 2, 8  # steps in which all sectors have levels of their own; after which none changes sides
LAST_STEP = 0.1  # squared length, in sigmas, of a refit's step after which none is needed
UNEVEN = 0.1  # part of the contrast by which the common levels are expected to vary around the disc
TOLERATED = 0.01  # part of the contrast by which any sector may depart from the model
MIN_VISIBLE = 0.4  # least part of the edge that has to fit
BLOCK = 3  # neighbouring sectors that err together


@dataclass(frozen=True)
class Discs:
    """Discs measured in a picture, one row for each circle that was given, in the same order.

    Attributes
    ----------
    centers : (n, 2) px
    semi_axes : (n, 2) px
        Major first.
    angles : (n,) rad
        Direction of the major axis from x towards y, in (-pi/2, pi/2].
    sigmas : (n, 5)
        Standard deviations of x, y, major, minor (px) and angle (rad); infinite where no fit was possible.
    covariance : (n, 5, 5)
        Covariance in the same order.
    chi2 : (n,)
        Mean squared residual over the noise variance of the picture in the disc's own ring.
    contrasts, blurs, noises : (n,)
        A (positive for bright discs; grey values), s (px), standard deviation of the noise (grey values).
    accepted : (n,) bool
    reasons : (n,) str
        Empty where accepted.
    """

    centers: np.ndarray
    semi_axes: np.ndarray
    angles: np.ndarray
    sigmas: np.ndarray
    covariance: np.ndarray
    chi2: np.ndarray
    contrasts: np.ndarray
    blurs: np.ndarray
    noises: np.ndarray
    accepted: np.ndarray
    reasons: np.ndarray

    @property
    def radii(self):
        """Radius of the circle of equal area, sqrt(a b), px."""
        return np.sqrt(self.semi_axes.prod(axis=1))

    def __len__(self):
        return len(self.centers)


@dataclass
class _Ellipse:
    """Centre, radius of equal area, shape m, angle of the major axis: numbers, or arrays (n,) for n ellipses."""

    x: np.ndarray
    y: np.ndarray
    r: np.ndarray
    m: np.ndarray = 0.0
    angle: np.ndarray = 0.0

    @property
    def axes(self):
        return self.r * np.exp(self.m), self.r * np.exp(-self.m)

    @property
    def half_size(self):
        """Half width and half height of the upright box around the ellipse."""
        (a, b), cos, sin = self.axes, np.cos(self.angle), np.sin(self.angle)
        return np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)

    def moved(self, dx, dy, dr, dp, dq):
        """The ellipse after a step; (dp, dq) is the change of shape in the ellipse's own axes.

        The shape's matrix S^T S, S = diag(e^-m, e^m) R^T, becomes S^T exp(-2 [dp dq; dq -dp]) S.
        """
        size = np.hypot(dp, dq)
        even, odd = np.cosh(2 * size), np.where(size > 0, np.sinh(2 * size) / np.where(size > 0, size, 1), 2)
        shrink, grow = np.exp(-2 * self.m), np.exp(2 * self.m)
        along, across, mixed = shrink * (even - odd * dp), grow * (even + odd * dp), -odd * dq
        cos, sin = np.cos(2 * self.angle), np.sin(2 * self.angle)
        split = 0.5 * (across - along)  # of the form's eigenvalues, in the old axes
        c, s = split * cos + mixed * sin, split * sin - mixed * cos
        return _Ellipse(
            self.x + dx, self.y + dy, self.r + dr, 0.5 * np.arcsinh(np.hypot(c, s)), 0.5 * np.arctan2(s, c)
        )

    def __getitem__(self, i):
        return _Ellipse(self.x[i], self.y[i], self.r[i], self.m[i], self.angle[i])

    def __setitem__(self, i, other):
        for name in ("x", "y", "r", "m", "angle"):
            getattr(self, name)[i] = getattr(other, name)


def fit_discs(image, circles, *, max_chi2=1.5, max_misfit=0.05):
    """Fit a blurred ellipse to the picture around each circle.

    Parameters
    ----------
    image : (height, width) uint8
    circles : object with .centers (n, 2) and .radii (n,) in px
        Bright or dark discs, for example from `find_circles`; starting values are refined along rays,
        so they may be off by some 20 % of the radius.  With a .polarity, "bright" or "dark", only discs
        of that kind are accepted; without it each is what its strongest edge says.
    max_chi2, max_misfit : float
        A fit is rejected when its chi2 exceeds `max_chi2` *and* the part of the residual that noise
        does not explain exceeds `max_misfit` of the contrast.  The second condition is there because in
        a picture without noise any departure from the model is significant, however small.

    Returns
    -------
    Discs
        A row for each circle.  Rows that are not accepted have a reason: "leaves the image",
        "radius too small", "no edge", "does not converge", "edge hidden" (less than 40 % of it fits;
        parts that need grey levels of their own count less),
        "contrast below noise", "other polarity", "chi2", "same disc" (as an earlier row's).  All values
        are finite, except for sigmas, covariance and chi2 (infinite) where there is no fit at all; centre
        and radius are then the circle's own.

    Raises
    ------
    ValueError
        If the image or the circles are unusable.

    Notes
    -----
    The noise that chi2 is judged by comes from the differences of neighbouring residuals in the ring, edges that
    the model does not describe left out; its variance is never below that of rounding, 1/12.  Their ratio tells
    structure from noise to 1/sqrt(number of pixels): above 1 + 5/sqrt(n), or where the ground farther out is not
    even, the disc is fitted again by sectors
    (see `_refit`), so that highlights, walls, swarf or hidden parts spoil their own sectors only.  The sigmas
    are scaled by the residual of the fit itself.  They hold for white noise and for levels that change slowly around the
    disc: where the ground changes within some pixels of the edge (a narrow side wall), where values are
    clipped at 0 or 255, or where the picture was smoothed, compressed or sharpened, errors are larger than stated.  For a circle the angle is undetermined; its sigma is then that
    of a uniform distribution over half a turn, pi/sqrt(12).
    """
    image = as_image(image)
    limits = as_number(max_chi2, "max_chi2", 0.0), as_number(max_misfit, "max_misfit", 0.0)
    rows = _as_circles(circles)
    sign = _SIGNS[as_choice(getattr(circles, "polarity", ""), "circles.polarity", _SIGNS)]
    circles = _Ellipse(*rows.T.copy(), np.zeros(len(rows)), np.zeros(len(rows)))
    fits = [None] * len(rows)
    usable = (rows[:, 2] >= 2) & _inside(circles, image.shape)
    for i in np.flatnonzero(~usable):
        fits[i] = _Fit(circles[i], "radius too small" if rows[i, 2] < 2 else "leaves the image")
    if len(rows) == 0:
        return _collect([])
    starts, started = _start(image, circles, sign)
    for i in np.flatnonzero(usable & ~started):
        fits[i] = _Fit(circles[i], "no edge")
    for group in _groups(np.flatnonzero(usable & started), rows[:, 2]):
        for i, fit in zip(group, _fit_group(image, circles[group], starts[group], sign, *limits), strict=True):
            fits[i] = fit
    return _collect(_without_repetitions(fits))


_SIGNS = {"bright": 1, "dark": -1, "": 0}


def _as_circles(circles):
    """The circles as (n, 3) rows x, y, r."""
    if not (hasattr(circles, "centers") and hasattr(circles, "radii")):
        raise ValueError(f"circles is a {type(circles).__name__}; expected an object with .centers and .radii")
    centers = as_points(circles.centers, 2, "circles.centers", 0)
    radii = as_points(np.reshape(circles.radii, (-1, 1)), 1, "circles.radii", 0)
    if len(centers) != len(radii) or (radii <= 0).any():
        raise ValueError(
            f"circles has {len(centers)} centers and {len(radii)} radii; expected one radius > 0 each"
        )
    return np.hstack([centers, radii])


def _without_repetitions(fits):
    """The fits, but of two accepted ones that are nowhere SAME px apart only the first is accepted."""
    accepted = [i for i, fit in enumerate(fits) if not fit.reason]
    places = [(fits[i].ellipse.x, fits[i].ellipse.y, fits[i].ellipse.r) for i in accepted]
    for first, second in sorted(cKDTree(places).query_pairs(SAME)) if places else ():
        if not fits[accepted[first]].reason:
            fits[accepted[second]] = replace(fits[accepted[second]], reason="same disc")
    return fits


@dataclass(frozen=True)
class _Fit:
    """What is known of one disc; the defaults are what is returned where there is no fit."""

    ellipse: _Ellipse
    reason: str
    covariance: np.ndarray = None
    chi2: float = np.inf
    contrast: float = 0.0
    blur: float = 0.0
    noise: float = np.sqrt(QUANTISATION)


def _groups(indices, radii):
    """Arrays of indices of discs that are fitted together: of about one size, and some thousand pixels in all.

    That saves time only: no disc's result depends on the others in its group.
    """
    indices = indices[np.argsort(radii[indices], kind="stable")]
    groups, first = [], 0
    for i in range(1, len(indices) + 1):
        smallest = radii[indices[first]]
        if i == len(indices) or radii[indices[i]] > 1.2 * smallest + 2 or (i - first) * smallest > GROUP:
            groups.append(indices[first:i])
            first = i
    return groups if len(indices) else []


def _inside(ellipse, shape):
    """Whether the whole ellipse lies on the picture."""
    width, height = ellipse.half_size
    return (
        (width <= ellipse.x)
        & (ellipse.x <= shape[1] - 1 - width)
        & (height <= ellipse.y)
        & (ellipse.y <= shape[0] - 1 - height)
    )


def _start(image, circles, sign):
    """Ellipses through the strongest steps along rays from the centres, outliers weighed down, and which are good.

    The directed step is looked for within 25 % of the radius (at least 4 px).  To first order in the
    departure from the circle, radius(t) = r + x cos t + y sin t + r p cos 2t + r q sin 2t.
    """
    n, reach = len(circles.r), np.maximum(4.0, 0.25 * circles.r)
    low = np.maximum(circles.r - reach, 0.5)
    rho = low[:, None] + (circles.r + reach - low)[:, None] * np.linspace(0, 1, RAY_POINTS)
    x = (circles.x[:, None, None] + _RAYS[:, 1, None] * rho[:, None]).reshape(-1, RAY_POINTS)
    y = (circles.y[:, None, None] + _RAYS[:, 2, None] * rho[:, None]).reshape(-1, RAY_POINTS)
    steps = cv2.sepFilter2D(_interpolated(image, x, y), cv2.CV_32F, _STEP, np.ones(1, np.float32), borderType=cv2.BORDER_REPLICATE)
    steps = steps.reshape(n, len(_RAYS), RAY_POINTS)
    profile = steps.mean(axis=1)
    steps *= sign or np.sign(np.take_along_axis(profile, np.abs(profile).argmax(axis=1)[:, None], axis=1))[:, None]
    best = steps.argmax(axis=2)
    weights = np.maximum(np.take_along_axis(steps, best[:, :, None], axis=2)[:, :, 0], 0).astype(float)
    r, dx, dy, p, q = _robust_solve(_RAYS, np.take_along_axis(rho, best, axis=1), weights).T
    good = (r > 1) & (np.hypot(p, q) <= 0.5 * r) & (np.hypot(dx, dy) <= 2 * reach)
    safe = np.where(good, r, circles.r)
    shape = [np.where(good, step, 0) for step in (dx, dy, p / safe, q / safe)]
    return _Ellipse(circles.x, circles.y, safe, circles.m, circles.angle).moved(*shape[:2], 0, *shape[2:]), good


def _interpolated(image, x, y):
    """Grey values (m, k) at the places x, y (m, k), px; `cv2.remap` in parts that it takes.

    Of a picture that is too large only the part around each disc is looked at, and of a disc that is too large every
    so-many-th pixel.
    """
    rows, values = N_RAYS if max(image.shape) > REMAP_LIMIT else REMAP_LIMIT, []
    for first in range(0, len(x), rows):
        part_x, part_y, part = x[first : first + rows], y[first : first + rows], image
        if max(image.shape) > REMAP_LIMIT:
            left, right = np.clip([part_x.min(), part_x.max() + 2], 0, image.shape[1]).astype(int)
            top, bottom = np.clip([part_y.min(), part_y.max() + 2], 0, image.shape[0]).astype(int)
            step = max(right - left, bottom - top) // REMAP_LIMIT + 1
            part = np.ascontiguousarray(image[top:bottom:step, left:right:step])
            part_x, part_y = (part_x - left) / step, (part_y - top) / step
        places = part_x.astype(np.float32), part_y.astype(np.float32)
        values.append(cv2.remap(part, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
    return np.concatenate(values)


_STEP = np.array([1, 1, 1, 0, -1, -1, -1], np.float32)  # inside minus outside
_TURN = np.arange(N_RAYS) * (2 * np.pi / N_RAYS)
_RAYS = np.stack([np.ones(N_RAYS), np.cos(_TURN), np.sin(_TURN), np.cos(2 * _TURN), np.sin(2 * _TURN)], axis=1)


def _robust_solve(design, values, weights):
    """Least squares of n rows with Cauchy weights that start from the median; the scale follows the residuals."""
    residuals = values - _median(values)
    weights = weights + 1e-6
    for _ in range(4):
        scale = np.maximum(2 * _median(np.abs(residuals)), 0.25)
        w = (weights / (1 + (residuals / scale) ** 2))[:, None] * design.T
        solution = np.linalg.solve(w @ design, w @ values[:, :, None])[:, :, 0]
        residuals = values - (design @ solution[:, :, None])[:, :, 0]
    return solution


def _median(rows):
    """The upper median of each row (n, 1)."""
    middle = rows.shape[1] // 2
    return np.partition(rows, middle, axis=1)[:, middle : middle + 1]


@dataclass
class _Solution:
    """Fits of the simple model, levels B and A, a row each; `normal` is for x, y, r, p, q, log s, B, A."""

    ellipse: _Ellipse
    log_s: np.ndarray
    levels: np.ndarray
    normal: np.ndarray
    squares: np.ndarray
    count: np.ndarray
    noise: np.ndarray
    converged: np.ndarray

    def update(self, rows, other):
        """Take over other solutions in some rows."""
        for name in self.__dataclass_fields__:
            getattr(self, name)[rows] = getattr(other, name)


def _settle(image, ellipses):
    """Fit, and fit again on a new ring where the ellipse moved by more than a pixel.

    Returns a `_Solution` with a row for each, and the reasons why there is none.
    """
    n = len(ellipses.r)
    ellipse, log_s, reasons = ellipses[np.arange(n)], np.full(n, np.log(1.2)), np.full(n, "", object)
    reasons[~_inside(ellipse, image.shape)] = "leaves the image"
    solution = _Solution(ellipse, log_s, np.zeros((n, 2)), np.zeros((n, 8, 8)), *np.zeros((4, n)))
    todo = np.flatnonzero(reasons == "")
    for _ in range(MAX_RINGS if len(todo) else 0):
        ring = _ring_pixels(image, ellipse[todo])
        few = ring.used.sum(axis=1) < LEAST_RING
        if few.any():
            reasons[todo[few]], todo = "no edge", todo[~few]
            if len(todo) == 0:
                return solution, reasons
            ring = _ring_pixels(image, ellipse[todo])
        found, singular = _least_squares(ring, ellipse[todo], log_s[todo])
        moved = _distance(ellipse[todo], found.ellipse)
        solution.update(todo, found)
        reasons[todo[singular]] = "no edge"
        reasons[todo[~singular & ~_inside(found.ellipse, image.shape)]] = "leaves the image"
        todo = todo[(moved >= 1) & (reasons[todo] == "")]
        if len(todo) == 0:
            return solution, reasons
    solution.converged[todo] = False
    return solution, reasons


def _distance(first, second):
    """An upper bound, px, of how far the edge moved between two ellipses."""
    change = np.abs(np.subtract(first.half_size, second.half_size)).max(axis=0)
    return np.hypot(first.x - second.x, first.y - second.y) + change + np.abs(first.r - second.r)


@dataclass
class _Pixels:
    """The pixels of n rings in rows, filled up to a multiple of `chunk` where `used` is 0, float32.

    Places x, y are told from `origin` (n, 2), grey values from `level` (n,), both whole numbers.
    """

    origin: np.ndarray
    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    used: np.ndarray
    level: np.ndarray
    chunk: int = CHUNK

    def some(self, rows, step=1):
        """The pixels, or a part of them, of some rows."""
        parts = (a[rows, ::step] for a in (self.x, self.y, self.values, self.used))
        return _Pixels(self.origin[rows], *parts, self.level[rows], self.chunk // step)


def _ring_pixels(image, ellipses):
    """The pixels within about RING px of the ellipses."""
    rings = [_ring_indices(ellipses[i], image.shape) for i in range(len(ellipses.r))]
    origin, level = np.rint(np.stack([ellipses.x, ellipses.y], axis=1)), np.zeros(len(rings))
    longest = max(max(len(ring[0]) for ring in rings), 1)
    x, y, values, used = np.zeros((4, len(rings), -(-longest // CHUNK) * CHUNK), np.float32)
    for i, (columns, rows) in enumerate(rings):
        m = len(columns)
        x[i, :m], y[i, :m], x[i, m:], used[i, :m] = columns, rows, origin[i, 0] + ellipses.r[i], 1
        grey = image.ravel().take(rows * image.shape[1] + columns)
        level[i] = np.rint(grey.mean()) if m else 0
        values[i, :m] = grey - np.float32(level[i])
    x -= origin[:, :1].astype(np.float32)
    y -= origin[:, 1:].astype(np.float32)
    return _Pixels(origin, x, y, values, used, level)


def _ring_indices(ellipse, shape):
    """Columns and rows of the pixels between the ellipses with semi-axes longer and shorter by RING px."""
    (a, b), cos, sin = ellipse.axes, np.cos(ellipse.angle), np.sin(ellipse.angle)
    half = np.hypot((a + RING) * sin, (b + RING) * cos)
    rows = np.arange(max(int(np.ceil(ellipse.y - half)), 0), min(int(ellipse.y + half), shape[0] - 1) + 1)
    outer, inner = ((max(a + d, 0.1), max(b + d, 0.1)) for d in (RING, -RING))
    middle, reach = _spans(rows - ellipse.y, *outer, cos, sin)
    first = np.maximum(np.ceil(ellipse.x + middle - reach), 0)
    end = np.minimum(np.floor(ellipse.x + middle + reach) + 1, shape[1])
    middle, reach = _spans(rows - ellipse.y, *inner, cos, sin)
    left = np.where(reach > 0, np.ceil(ellipse.x + middle - reach), end).clip(first, end)
    right = np.where(reach > 0, np.floor(ellipse.x + middle + reach) + 1, end).clip(left, end)
    first, counts = np.array([first, right]).ravel(), np.array([left - first, end - right]).ravel()
    counts = np.maximum(counts, 0).astype(np.intp)
    shift = first.astype(np.intp) - np.cumsum(counts) + counts
    return np.arange(counts.sum()) + np.repeat(shift, counts), np.repeat(np.concatenate([rows, rows]), counts)


def _spans(dy, a, b, cos, sin):
    """Middle and half width of an ellipse in the rows at dy from its centre; half width 0 where they miss it."""
    form = (cos / a) ** 2 + (sin / b) ** 2
    middle = dy * (-cos * sin * (1 / a**2 - 1 / b**2) / form)
    return middle, np.sqrt(np.maximum(form - (dy / (a * b)) ** 2, 0)) / form


def _ingredients(pixels, ellipse, log_s, extra=0):
    """Rows (n, 9, m): Phi's derivatives by x, y, r, p, q, log s, then 1, Phi and the grey values.

    With w = S (X - c), S = diag(e^-m, e^m) R^T, the ellipse is |w| = r; the distance is
    (r - |w|) / |S^T w / |w||, exact for circles and in error by (d^2/r) O(m^2) for ellipses.  Two more rows, if
    `extra` is 2: the distance, and the distance times Phi.  All in float32; Phi and its derivative from
    tables, which every processor reads alike.
    """
    column = np.stack(
        [
            ellipse.x - pixels.origin[:, 0],
            ellipse.y - pixels.origin[:, 1],
            np.exp(-ellipse.m) * np.cos(ellipse.angle),
            np.exp(-ellipse.m) * np.sin(ellipse.angle),
            np.exp(ellipse.m) * np.cos(ellipse.angle),
            np.exp(ellipse.m) * np.sin(ellipse.angle),
            ellipse.r,
            np.exp(-log_s),
            0.5 * np.exp(log_s) / ellipse.r,
        ]
    ).astype(np.float32)[:, :, None]
    cx, cy, ux, uy, vy, vx, r, per_s, bend = column
    rows = np.empty((len(ellipse.r), 9 + extra, pixels.x.shape[1]))
    dx, dy = pixels.x - cx, pixels.y - cy
    u, v = dx * ux + dy * uy, dy * vy - dx * vx
    uu, vv = u * u, v * v
    norm = np.maximum(uu + vv, np.float32(1e-6))
    inverse_norm = 1 / np.sqrt(norm)
    norm = norm * inverse_norm
    # the gradient of |w| is (gx, gy) / |w|; dx and dy are no longer needed
    gx, gy = u * ux - v * vx, u * uy + v * vy
    inverse = 1 / np.sqrt(np.maximum(gx * gx + gy * gy, np.float32(0.01) * norm * norm))
    steep = inverse * norm  # 1 / |gradient of |w||
    z = (r - norm) * (steep * per_s) - bend * steep * steep * steep
    cell = _cells(z)
    density = _DENSITY.take(cell, mode="clip")
    density *= per_s
    density *= pixels.used
    flat = density * inverse
    np.multiply(gx, flat, out=rows[:, 0])
    np.multiply(gy, flat, out=rows[:, 1])
    np.multiply(density, steep, out=rows[:, 2])
    np.multiply(uu - vv, flat, out=rows[:, 3])
    np.multiply(u * v, 2 * flat, out=rows[:, 4])
    np.multiply(-density / per_s, z + (2 * bend) * (steep * steep * steep), out=rows[:, 5])
    rows[:, 6] = pixels.used
    np.multiply(_CDF.take(cell, mode="clip"), pixels.used, out=rows[:, 7])
    rows[:, 8] = pixels.values
    if extra:
        np.multiply(r - norm, steep * pixels.used, out=rows[:, 9])
        np.multiply(rows[:, 9], rows[:, 7], out=rows[:, 10])
    return rows


def _cells(z):
    """Where the tables below hold float32 values."""
    return (z * np.float32(1024) + np.float32(8 * 1024 + 0.5)).astype(np.int32)


_TABULATED = np.arange(-8 * 1024, 8 * 1024 + 1) / 1024
_CDF = ndtr(_TABULATED).astype(np.float32)
_DENSITY = (np.exp(-0.5 * _TABULATED**2) / np.sqrt(2 * np.pi)).astype(np.float32)


def _least_squares(pixels, ellipse, log_s):
    """Gauss-Newton over ellipse, log s and the levels: on a part of the pixels, then on all.

    Returns a `_Solution` and where the equations are singular.
    """
    many = pixels.used.sum(axis=1) > LEAST_PIXELS
    if many.any():
        part, *_ = _gauss_newton(
            pixels.some(many, PART), ellipse[many], log_s[many], ROUGH_STEP, ROUGH_STEPS, residuals=None
        )
        ellipse, log_s = ellipse[np.arange(len(many))], log_s.copy()
        ellipse[many], log_s[many] = part.ellipse, part.log_s
    residuals = np.empty(pixels.x.shape, np.float32)
    solution, singular = _gauss_newton(pixels, ellipse, log_s, SMALL_STEP, MAX_STEPS, residuals)
    solution.levels[:, 0] += pixels.level
    for i, m in enumerate(solution.count.astype(int)):
        solution.squares[i], solution.noise[i] = _sum_of_squares(residuals[i, :m]), _residual_noise(residuals[i, :m])
    return solution, singular


def _gauss_newton(pixels, ellipse, log_s, small, most, residuals):
    """Gauss-Newton with halved steps, n discs at once; B and A are solved for in every step.

    A disc is done when its step's squared length in its own sigmas is below STEP_TOLERANCE, when a step that
    moves nothing by more than `small` is taken (the rest of the way is of second order: no more than that
    squared), or when a small one fails to improve the fit.  Fills in the residuals of the pixels, unless None.
    """
    n, count = len(log_s), pixels.used.sum(axis=1, dtype=float)
    best, step, fraction, gain = None, np.zeros((n, 6)), np.ones(n), np.zeros(n)
    done, singular = np.zeros((2, n), bool)
    for _ in range(most):
        trial = ellipse.moved(*(fraction[:, None] * step[:, :5]).T)
        trial_s = np.clip(log_s + fraction * step[:, 5], -1.5, 2.0)
        rows = _ingredients(pixels, trial, trial_s)
        parts = rows.reshape(n, 9, -1, pixels.chunk).swapaxes(1, 2)
        found, combination, scale, new_step, new_gain, bad = _solve_rows(parts, trial, trial_s, count)
        if best is None:
            best, better = found, np.ones(n, bool)
        else:
            better = (found.squares <= best.squares) & ~done
            done |= ~better & (gain <= 10 * STEP_TOLERANCE * np.maximum(best.squares / count, QUANTISATION))
            best.update(better, _rows(found, better))
        step[better], gain[better], singular[better & bad] = new_step[better, :6], new_gain[better], True
        fraction = np.where(better, np.minimum(1.0, 2 * fraction), 0.5 * fraction)
        ellipse, log_s = best.ellipse, best.log_s
        decrement = gain / np.maximum(best.squares / count, QUANTISATION)
        last = better & ((decrement <= STEP_TOLERANCE) | (_movement(step, ellipse) < small))
        if last.any():
            best.update(last, _after_last_step(_rows(best, last), new_step[last], gain[last]))
        combination[last, :8] -= new_step[last] * scale[last]
        if residuals is not None:
            rest = combination[better, None, None] @ (parts if better.all() else parts[better])
            residuals[better] = rest.reshape(-1, residuals.shape[1])
        done |= last | singular
        if done.all():
            break
        step = _limited(step, ellipse)
    best.converged[:] = done
    return best, singular


def _rows(solution, rows):
    """Some rows of a `_Solution`."""
    return _Solution(*(getattr(solution, name)[rows] for name in solution.__dataclass_fields__))


def _movement(step, ellipse):
    """An upper bound, px, of how far steps (..., 6) move any part of the edge, or s."""
    shape = np.abs(step[..., 3:5]).max(axis=-1) * ellipse.r
    return np.maximum(np.maximum(np.abs(step[..., :3]).max(axis=-1), np.abs(step[..., 5])), shape)


def _after_last_step(solution, step, gain):
    """Solutions after a step (n, 8) so small that the linear model says what it changes."""
    step = np.hstack([_limited(step[:, :6], solution.ellipse), step[:, 6:]])
    return _Solution(
        solution.ellipse.moved(*step[:, :5].T),
        np.clip(solution.log_s + step[:, 5], -1.5, 2.0),
        solution.levels + step[:, 6:],
        solution.normal,
        np.maximum(solution.squares - gain, 0),
        solution.count,
        solution.noise,
        solution.converged,
    )


def _solve_rows(parts, ellipse, log_s, count):
    """From `_ingredients` in chunks (n, c, 9, chunk): the solution; the residual as a linear combination (n, 9) of
    the ingredients; the next step (n, 8), how much it gains, and where it is undefined.
    """
    moments = (parts @ parts.swapaxes(2, 3)).sum(axis=1)
    ones, mean, phi = moments[:, 6, 6], moments[:, 6, 7], moments[:, 7, 7]
    contrast = moments[:, 7, 8] - mean * moments[:, 6, 8] / ones
    contrast /= np.maximum(phi - mean**2 / ones, 1e-12)
    level = (moments[:, 6, 8] - contrast * mean) / ones
    combination = np.zeros((len(count), 9))
    combination[:, 6], combination[:, 7], combination[:, 8] = -level, -contrast, 1
    against = (moments @ combination[:, :, None])[:, :, 0]
    squares = np.maximum((combination * against).sum(axis=1), 0)
    scale = np.where(np.arange(8) < 6, contrast[:, None], 1.0)
    normal, gradient = moments[:, :8, :8] * (scale[:, :, None] * scale[:, None, :]), against[:, :8] * scale
    step, bad = _solve_scaled(normal, gradient)
    levels, unknown = np.stack([level, contrast], axis=1), np.zeros(len(count))
    solution = _Solution(ellipse, log_s, levels, normal, squares, count, unknown, unknown.copy())
    return solution, combination, scale, step, (step * gradient).sum(axis=1), bad


def _use_ground(image, solution, rows):
    """Let the even ground beyond the rings of some discs improve their levels, and with these radius and s.

    Level, radius and s of a narrow ring are correlated.  Farther out Phi is 0 or 1, so that a side's pixels enter
    the normal equations by their number, mean and variance alone; one more step then solves them.  A side is
    not even if its mean or variance departs by more than GROUND_SIGMAS from the ring's, or its level changes across
    the disc by more than that.  Returns the discs that have ground which is not even; they are left as they are.
    """
    rows = rows[GROUND_WIDTHS * np.exp(solution.log_s[rows]) <= RING]
    if len(rows) == 0:
        return rows
    sides, noise = np.array([_ground(image, solution.ellipse[i]) for i in rows]), solution.noise[rows, None]
    n, mean, variance, slopes = sides[..., 0], sides[..., 1], sides[..., 2], sides[..., 3:]
    known = np.linalg.inv(solution.normal[rows])[:, 6:, 6:]
    excess = mean - (solution.levels[rows, None] @ _BY_LEVELS)[:, 0]
    there = n >= LEAST_RING
    n = np.where(there, n, 1)
    bound = noise * np.sqrt(1 / n + np.diagonal(_BY_LEVELS.T @ known @ _BY_LEVELS, axis1=1, axis2=2))
    even = (np.abs(excess) <= GROUND_SIGMAS * bound) & (np.abs(slopes) <= GROUND_SIGMAS * noise[..., None]).all(axis=2)
    of_differences = 3 / np.maximum(solution.count[rows, None], 1)  # relative variance of `_residual_noise` squared
    even &= np.abs(variance / noise**2 - 1) <= GROUND_SIGMAS * np.sqrt(2 / n + of_differences)
    usable = (even | ~there).all(axis=1)
    uneven, rows = rows[~usable], rows[usable]
    if len(rows) == 0:
        return uneven
    n, excess, variance = (array[usable] for array in (n * there, excess, variance))
    gradient = np.zeros((len(rows), 8))
    gradient[:, 6:] = (_BY_LEVELS @ (n * excess)[:, :, None])[:, :, 0]
    solution.normal[rows, 6:, 6:] += np.einsum("ns,is,js->nij", n, _BY_LEVELS, _BY_LEVELS)
    solution.squares[rows] += (n * (variance + excess**2)).sum(axis=1)
    solution.count[rows] += n.sum(axis=1)
    step = np.linalg.solve(solution.normal[rows], gradient[:, :, None])[:, :, 0]
    solution.update(rows, _after_last_step(_rows(solution, rows), step, (step * gradient).sum(axis=1)))
    return uneven


_BY_LEVELS = np.array([[1.0, 1.0], [0.0, 1.0]])  # derivatives by B and A of the level outside and inside


def _ground(image, ellipse):
    """Of the pixels RING to GROUND px outside the ellipse, and of those inside it: number, mean, variance, and how much
    the level changes along x and y, in units in which noise alone has its own sigma."""
    width, height = (size + GROUND + 2 for size in ellipse.half_size)
    top, left = max(int(ellipse.y - height), 0), max(int(ellipse.x - width), 0)
    part = image[top : int(ellipse.y + height) + 2, left : int(ellipse.x + width) + 2]
    mask = np.zeros(part.shape, np.uint8)
    center = round(16 * (ellipse.x - left)), round(16 * (ellipse.y - top))  # sixteenths of a pixel, as shift = 4
    for longer, value in ((GROUND, 1), (RING, 0), (-RING - 1, 2), (-GROUND, 0)):
        axes = [round(16 * (axis + longer)) for axis in ellipse.axes]
        if min(axes) > 0:
            cv2.ellipse(mask, center, axes, np.degrees(ellipse.angle), 0, 360, value, cv2.FILLED, shift=4)
    offsets = np.arange(part.shape[1]) + left - ellipse.x, np.arange(part.shape[0]) + top - ellipse.y
    return [_side(part, cv2.compare(mask, value, cv2.CMP_EQ), offsets) for value in (1, 2)]


def _side(part, side, offsets):
    """One side's numbers for `_ground`."""
    n, slopes = cv2.countNonZero(side), []
    mean, deviation = (float(value[0, 0]) for value in cv2.meanStdDev(part, mask=side))
    for along, offset in enumerate(offsets):
        values, number = (cv2.reduce(a, along, cv2.REDUCE_SUM, dtype=cv2.CV_32S).ravel() for a in (part & side, side))
        moment = number @ offset / 255
        spread = number @ offset**2 / 255 - moment**2 / max(n, 1)
        slopes.append((values @ offset - mean * moment) / np.sqrt(max(spread, 1.0)))
    return n, mean, deviation**2, *slopes


def _sum_of_squares(residuals):
    return float(np.square(residuals, dtype=float).sum())


def _residual_noise(residuals):
    """Standard deviation of the noise, from the differences of neighbouring residuals (m,) of one disc.

    Differences larger than 3.5 standard deviations (first by their median) are left out: edges that the model
    does not describe.
    """
    difference = np.abs(np.diff(residuals))
    middle = len(residuals) // 2
    limit = 3.5 * max(1.4826 * float(np.partition(difference, middle)[middle]), 0.7)
    difference = difference[difference < limit]
    return np.sqrt(max(_sum_of_squares(difference) / max(2 * len(difference), 1), QUANTISATION))


def _limited(step, ellipse):
    """Steps (..., 6) shortened so that no part of the edge moves by more than 2 px and s by more than half."""
    size = np.abs(step[..., :3]).max(axis=-1) / 2, np.abs(step[..., 3:5]).max(axis=-1) * ellipse.r / 2
    return step / np.maximum(np.maximum(*size), np.maximum(np.abs(step[..., 5]) / 0.7, 1.0))[..., None]


def _fit_group(image, circles, starts, sign, max_chi2, max_misfit):
    """Fit some discs: the simple model, a refit by sectors where it fails, and the judgement; a list of `_Fit`."""
    solution, reasons = _settle(image, starts)
    fitted, contrast, noise = reasons == "", solution.levels[:, 1], np.maximum(solution.noise, 1e-3)
    fails = _variance(solution) > (1 + REFIT_SIGMAS / np.sqrt(np.maximum(solution.count, 1))) * noise**2
    simple = fitted & solution.converged.astype(bool) & ~(fails & (np.abs(contrast) > noise))
    simple[_use_ground(image, solution, np.flatnonzero(simple & ~fails))] = False
    again = np.flatnonzero(fitted & ~simple)
    ellipse, contrast, s = solution.ellipse, solution.levels[:, 1], np.exp(solution.log_s)
    variance = _variance(solution)
    covariance = np.zeros((len(s), 5, 5))
    covariance[fitted] = np.linalg.inv(solution.normal[fitted])[:, :5, :5] * variance[fitted, None, None]
    if len(again):
        near = solution.converged[again].astype(bool) & (variance[again] < NEAR_CHI2 * noise[again] ** 2)
        near &= _distance(ellipse[again], starts[again]) < NEAR
        for part, sectors in _sectors(image, _choose(near, ellipse[again], starts[again])):
            rows = again[part]
            refit = _refit(image.shape, sectors, contrast[rows], noise[rows])
            reasons[rows], done = refit.reasons, refit.reasons == ""
            ellipse[rows[done]], covariance[rows[done]] = refit.ellipse[done], refit.covariance[done]
            variance[rows[done]], s[rows[done]] = refit.variance[done], np.exp(refit.log_s[done])
    vanished = fitted & ~(ellipse.r > 1)
    reasons[vanished], fitted = "does not converge", fitted & ~vanished
    misfit = np.sqrt(np.maximum(variance - noise**2, 0))
    reasons[(reasons == "") & (np.abs(contrast) <= noise)] = "contrast below noise"
    reasons[(reasons == "") & (contrast * sign < 0)] = "other polarity"
    reasons[(reasons == "") & (variance > max_chi2 * noise**2) & (misfit > max_misfit * np.abs(contrast))] = "chi2"
    fits = [_Fit(circles[i], reasons[i]) for i in range(len(s))]
    for i in np.flatnonzero(fitted):
        chi2, values = float(variance[i] / noise[i] ** 2), (float(contrast[i]), float(s[i]), float(noise[i]))
        fits[i] = _Fit(ellipse[i], reasons[i], _to_axes(ellipse[i], covariance[i]), chi2, *values)
    return fits


def _variance(solution):
    """Residual variance (n,) of the simple model with its 8 unknowns."""
    return np.maximum(solution.squares / np.maximum(solution.count - 8, 1), QUANTISATION)


def _choose(where, first, second):
    """The first ellipses where that is said, else the second."""
    return _Ellipse(
        *(np.where(where, getattr(first, name), getattr(second, name)) for name in ("x", "y", "r", "m", "angle"))
    )


# -------------------------------------------------------------------------------------------------- sectors


@dataclass
class _Sectors:
    """The pixels of n rings in k angular sectors each, a row for a sector, and the ellipses they lie around."""

    ellipse: _Ellipse
    pixels: _Pixels
    k: int


def _sectors(image, ellipses):
    """Indices of the ellipses, and the `_Sectors` of their rings, of those that can be fitted together.

    The number of sectors and the length of their rows follow from the disc itself, and those of one number and
    length are fitted together: so no result depends on other discs.
    """
    rings = [_ring_by_sectors(image, ellipses[i]) for i in range(len(ellipses.r))]
    kinds = {}
    for i, (counts, _) in enumerate(rings):
        length = max(-(-int(counts.max()) // LONGER_ROW) * LONGER_ROW, SECTOR_ROW)
        kinds.setdefault((len(counts), length), []).append(i)
    for (k, length), part in kinds.items():
        filled = np.zeros((4, len(part) * k, length), np.float32)
        filled[0] = np.repeat(ellipses.r[part], k)[:, None]
        used = np.arange(length) < np.concatenate([rings[i][0] for i in part])[:, None]
        filled[:3, used] = np.concatenate([rings[i][1] for i in part], axis=1)
        filled[3] = used
        origin = np.repeat(np.stack([ellipses.x[part], ellipses.y[part]], axis=1), k, axis=0)
        yield np.array(part), _Sectors(ellipses[part], _Pixels(origin, *filled, np.zeros(len(origin))), k)


def _ring_by_sectors(image, ellipse):
    """The number of pixels (k,) in each angular sector of a ring; x, y, value (3, m) of the pixels, sector by sector.

    Places are told from the ellipse's centre, values from their mean.  A sector is about SECTOR_LENGTH px long.
    """
    number = int(N_SECTORS[np.abs(np.log(N_SECTORS * SECTOR_LENGTH / (2 * np.pi * ellipse.r))).argmin()])
    columns, rows = _ring_indices(ellipse, image.shape)
    x, y = columns - ellipse.x, rows - ellipse.y
    sector = np.minimum(((np.arctan2(y, x) / (2 * np.pi) + 0.5) * number).astype(np.int16), number - 1)
    values = image.ravel().take(rows * image.shape[1] + columns).astype(float)
    order = np.argsort(sector, kind="stable")
    pixels = np.stack([x, y, values - values.mean()])[:, order]
    return np.bincount(sector, minlength=number), pixels.astype(np.float32)


@dataclass
class _Refit:
    """Ellipses, log s, covariance of x, y, r, p, q, variance, and the reasons why there is no fit."""

    ellipse: _Ellipse
    log_s: np.ndarray
    covariance: np.ndarray
    variance: np.ndarray
    reasons: np.ndarray


def _refit(shape, sectors, contrast, noise):
    """Fit again, with levels and slopes of their own, inside and outside, in those sectors that need them.

    Side walls, highlights and clutter change the levels around a disc.  The common levels may change with the
    direction (see `_common_normal`).  A sector gets a level and a slope of its
    own on either side if they lower its sum of squares by more than OWN_EXCESS noise variances (with
    four more unknowns, 4 are expected), or its chi2 with the common levels is more than SECTOR_SIGMAS standard
    deviations above 1.  The own levels are eliminated from the normal equations.  Such a sector has the weight
    OWN_WEIGHT, because what changes the levels is seldom straight; (limit / chi2)^2 times that where its chi2 is
    high even so, and none if it has less than a quarter of the contrast.  In the first ALONE steps all sectors
    have levels of their own.
    """
    start, pixels, k = sectors.ellipse, sectors.pixels, sectors.k
    n, count = len(noise), pixels.used.sum(axis=1, dtype=float).reshape(-1, k)
    limit = 1 + SECTOR_SIGMAS * np.sqrt(2 / np.maximum(count - 4, 1))
    result = _Refit(start[np.arange(n)], np.full(n, np.log(1.2)), np.zeros((n, 5, 5)), np.zeros(n), None)
    result.reasons = np.full(n, "", object)
    noise, tolerated = np.hypot(noise, TOLERATED * contrast), noise**2 / (noise**2 + (TOLERATED * contrast) ** 2)
    around, held = _directions(k), (noise / (UNEVEN * np.maximum(np.abs(contrast), 1e-3)))[:, None] ** 2 * _HELD
    levels, own, active = np.zeros((n, 6)), np.ones((n, k), bool), np.ones(n, bool)
    for number in range(MAX_STEPS):
        if active.all():
            moments = _sector_moments(pixels, result.ellipse, result.log_s, k)
        else:  # what is done keeps its moments
            moments[active] = _sector_moments(
                pixels.some(np.repeat(active, k)), result.ellipse[active], result.log_s[active], k
            )
        free = _own_levels(moments, count, noise)
        if number <= ALONE:
            levels[:, 0], levels[:, 3] = np.median(free.level, axis=1), np.median(free.contrast, axis=1)
        shared = _same_chi2(moments, levels, around, count, noise)
        if ALONE <= number < FREEZE:
            own = (shared * count - free.chi2 * (count - 4) > OWN_EXCESS) | (shared > limit)
        fits = _share_that_fits(free, limit, contrast)
        visible = np.where(own, fits * (OWN_VISIBLE if number > ALONE else 1), 1).mean(axis=1)
        hidden = active & (visible < MIN_VISIBLE)
        weights = np.where(hidden[:, None] | ~own, 1, OWN_WEIGHT * fits)
        normal, gradient, scores = _sector_equations(moments, levels, around, held, free, own, weights)
        step, bad = _solve_scaled(normal, gradient)
        result.reasons[active & bad], result.reasons[hidden] = "no edge", "edge hidden"
        last = active & (np.einsum("ni,nij,nj->n", step, normal, step) <= LAST_STEP * noise**2) & (number > ALONE)
        step[:, :6] = _limited(step[:, :6], result.ellipse)
        step[~active | bad | hidden] = 0
        result.ellipse = result.ellipse.moved(*step[:, :5].T)
        result.log_s, levels = np.clip(result.log_s + step[:, 5], -1.5, 2.0), levels + step[:, 6:]
        result.reasons[active & (_distance(result.ellipse, start) > RING)] = "does not converge"
        if last.any():
            chi2 = np.where(own, free.chi2, shared)
            known = np.where(own, 0, np.maximum(chi2, tolerated[:, None]))
            middle = _common_normal(moments, levels, around, known)[:, :12, :12] + held[:, :, None] * np.eye(12)
            _state(result, last, normal, middle, scores, noise)
            usual = np.average(chi2, axis=1, weights=np.maximum(weights * count, 1e-9))
            result.variance[last] = (noise**2 * usual)[last]
        active &= ~last & (result.reasons == "")
        if not active.any():
            break
    result.reasons[active] = "does not converge"
    result.reasons[(result.reasons == "") & ~_inside(result.ellipse, shape)] = "leaves the image"
    return result


def _state(result, rows, normal, middle, scores, noise):
    """Set the covariance in some rows.

    Sectors with the common levels contribute what noise explains, those with their own (`scores`) what they show:
    what the model does not describe counts once for BLOCK neighbours, not for each pixel.
    """
    k = scores.shape[1]
    blocks = scores[rows, : k // BLOCK * BLOCK].reshape(-1, k // BLOCK, BLOCK, 6).sum(axis=2)
    middle = middle[rows] * noise[rows, None, None] ** 2
    middle[:, :6, :6] += blocks.swapaxes(1, 2) @ blocks * ((k / BLOCK) / (k / BLOCK - 6))
    bread = np.linalg.inv(normal[rows])
    result.covariance[rows] = (bread @ middle @ bread)[:, :5, :5]


def _share_that_fits(free, limit, contrast):
    """1 for sectors that fit with levels of their own, less for those that do not, 0 where there is no edge."""
    usual = np.maximum(limit, np.median(free.chi2, axis=1, keepdims=True))
    return np.minimum(1, (usual / free.chi2) ** 2) * (free.contrast / contrast[:, None] > 0.25)


def _sector_equations(moments, levels, around, held, free, own, weights):
    """Normal equations of x, y, r, p, q, log s and the six levels: matrices (n, 12, 12), gradients (n, 12), and the
    part (n, k, 6) of these that each sector with levels of its own contributes."""
    alone = np.where(own, weights, 0)
    scores = (alone * free.contrast)[:, :, None] * free.left[:, :, :6, 6]
    normal = _common_normal(moments, levels, around, np.where(own, 0, 1.0)) + 1e-9 * np.eye(13)
    normal[:, range(12), range(12)] += held
    normal[:, 6:12, 12] -= held[:, 6:] * levels
    normal[:, :6, :6] += _weighted_sum(alone * free.contrast**2, free.left)[:, :6, :6]
    normal[:, :6, 12] += scores.sum(axis=1)
    return normal[:, :12, :12], normal[:, :12, 12], scores


@dataclass
class _SectorFit:
    """Sectors (n, k) with levels of their own: chi2, contrast, level outside, and what is `left` (n, k, 7, 7) of
    the sums of products of Phi's derivatives and of the grey values when these are eliminated."""

    chi2: np.ndarray
    contrast: np.ndarray
    level: np.ndarray
    left: np.ndarray


def _weighted_sum(weights, matrices):
    """Sums over the sectors of matrices (n, k, i, j) with weights (n, k)."""
    n, k, *shape = matrices.shape
    return (weights[:, None] @ matrices.reshape(n, k, -1))[:, 0].reshape(n, *shape)


def _directions(k):
    """1, cos t and sin t (3, k) of the directions t in which k sectors lie."""
    t = (np.arange(k) + 0.5) * (2 * np.pi / k) - np.pi
    return np.stack([np.ones(k), np.cos(t), np.sin(t)])


_HELD = np.array([0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 1, 1])  # the levels' changes with the direction are held near 0


def _common_normal(moments, levels, around, weights):
    """Sums (n, 13, 13) of products of the derivatives and the residual, with common levels.

    Levels (n, 6) are B and A, each as a + b cos t + c sin t in the direction t: the ground is seldom the same on
    both sides of a disc, and a difference of 1 % of the contrast between them would move the centre by 0.01 px.
    """
    pairs = (around[:, None] * around).reshape(9, -1)
    sums = (weights[:, None] * pairs) @ moments.reshape(*moments.shape[:2], -1)
    sums = sums.reshape(-1, 3, 3, 11, 11)[..., :9, :9].swapaxes(2, 3).reshape(-1, 27, 27)
    change, harmonics = np.zeros((len(levels), 13, 3, 9)), np.arange(3)
    for derivative in range(6):
        change[:, derivative, :, derivative] = levels[:, 3:]
    change[:, 6 + harmonics, harmonics, 6] = change[:, 9 + harmonics, harmonics, 7] = change[:, 12, 0, 8] = 1
    change[:, 12, :, 6], change[:, 12, :, 7] = -levels[:, :3], -levels[:, 3:]
    change = change.reshape(-1, 13, 27)
    return change @ sums @ change.swapaxes(1, 2)


def _sector_moments(pixels, ellipse, log_s, k):
    """Sums of products (n, k, 11, 11) of the rows of `_ingredients`, the distance and the distance times Phi."""
    many = _Ellipse(*(np.repeat(getattr(ellipse, name), k) for name in ("x", "y", "r", "m", "angle")))
    rows = _ingredients(pixels, many, np.repeat(log_s, k), extra=2)
    return (rows @ rows.transpose(0, 2, 1)).reshape(-1, k, 11, 11)


def _own_levels(moments, count, noise):
    """Each sector with a level and a slope of its own on either side."""
    inner = moments[:, :, _OWN[:, None], _OWN] + np.diag([1e-6, 1e-6, 1e-3, 1e-3])
    mixed = moments[:, :, _OWN[:, None], _REST]
    solved = np.linalg.solve(inner, mixed)
    left = moments[:, :, _REST[:, None], _REST] - mixed.swapaxes(2, 3) @ solved
    chi2 = np.maximum(left[:, :, 6, 6] / np.maximum(count - 4, 1), QUANTISATION) / noise[:, None] ** 2
    return _SectorFit(chi2, solved[:, :, 1, 6], solved[:, :, 0, 6], left)


_OWN, _REST = np.array([6, 7, 9, 10]), np.array([0, 1, 2, 3, 4, 5, 8])


def _same_chi2(moments, levels, around, count, noise):
    """Chi2 (n, k) of sectors with their disc's common levels."""
    level, contrast = ((part[:, None] @ around)[:, 0] for part in (levels[:, :3], levels[:, 3:]))
    combination = np.stack([-level, -contrast, np.ones_like(level)], axis=2)
    squares = ((moments[:, :, 6:9, 6:9] @ combination[..., None])[..., 0] * combination).sum(axis=2)
    return np.maximum(squares / np.maximum(count, 1), QUANTISATION) / noise[:, None] ** 2


def _solve_scaled(normal, gradient):
    """Solve n normal equations, scaled to a unit diagonal; the steps, 0 where singular, and where that is."""
    scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-18))
    unit = normal / (scale[:, :, None] * scale[:, None, :])
    bad = (scale < 1e-6).any(axis=1) | ~(np.linalg.det(unit) > 1e-14)
    unit[bad] = np.eye(normal.shape[1])
    step = np.linalg.solve(unit, (gradient / scale)[:, :, None])[:, :, 0] / scale
    step[bad] = 0
    return step, bad


def _to_axes(ellipse, covariance):
    """Covariance of x, y, r, p, q turned to x, y, major, minor, angle.

    With the shape's change (p, q) in the ellipse's own axes: dm = p, d angle = q / sinh 2m, da = a (dr/r + p),
    db = b (dr/r - p).  The divisor is kept large enough for the angle's sigma to be at most pi/sqrt(12).
    """
    (a, b), r = ellipse.axes, ellipse.r
    jacobian = np.zeros((5, 5))
    jacobian[0, 0] = jacobian[1, 1] = 1
    jacobian[2, 2:4] = a / r, a
    jacobian[3, 2:4] = b / r, -b
    jacobian[4, 4] = 1 / max(np.sinh(2 * ellipse.m), np.sqrt(12 * covariance[4, 4]) / np.pi)
    return jacobian @ covariance @ jacobian.T


def _collect(fits):
    """One `Discs` from the single fits."""
    n = len(fits)
    unknown = np.diag(np.full(5, np.inf))
    covariance = [unknown if fit.covariance is None else fit.covariance for fit in fits]
    covariance = np.array(covariance).reshape(n, 5, 5)
    reasons = np.array([fit.reason for fit in fits], dtype=np.str_)
    return Discs(
        centers=np.array([(fit.ellipse.x, fit.ellipse.y) for fit in fits], float).reshape(n, 2),
        semi_axes=np.array([fit.ellipse.axes for fit in fits], float).reshape(n, 2),
        angles=np.array([fit.ellipse.angle for fit in fits], float),
        sigmas=np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)),
        covariance=covariance,
        chi2=np.array([fit.chi2 for fit in fits], float),
        contrasts=np.array([fit.contrast for fit in fits], float),
        blurs=np.array([fit.blur for fit in fits], float),
        noises=np.array([fit.noise for fit in fits], float),
        accepted=reasons == "",
        reasons=reasons,
    )
