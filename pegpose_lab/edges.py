"""Sub-pixel discs: the maximum-likelihood fit of a blurred ellipse edge, with a sigma for every number.

Around the edge of a blurred disc the picture is

    I = B + A Phi((d - s^2 kappa / 2) / s),

d the signed distance to the ellipse (positive inside), Phi the normal distribution function, s the
edge's standard deviation (optical blur and the pixel's own width, s^2 = blur^2 + 1/12) and kappa the
ellipse's curvature: blur moves the half-way point of a curved edge towards the inside by s^2 kappa / 2.
With white noise, least squares over the pixels of a ring around the edge is maximum likelihood: for
a disc of radius r, contrast A and noise sigma, no unbiased method can measure the centre better
than (sigma / A) sqrt(2 s / (sqrt(pi) r)) per axis.

The fit runs over the centre, the radius of the circle of equal area r, the shape, log s and the
levels.  The shape is a symmetric traceless matrix m (cos 2 angle, sin 2 angle; sin 2 angle, -cos 2 angle)
with semi-axes r exp(+-m): unlike axes and angle it is regular for a perfect circle.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import ndtr

from .checks import as_image, as_number, as_points

RING = 6.0  # px on either side of the edge that take part in the fit
QUANTISATION = 1 / 12  # variance of rounding to whole grey values
N_RAYS = 96
MAX_STEPS = 30
STEP_TOLERANCE = 1e-3
REFIT_CHI2 = 1.15  # residual chi2 of the simple model above which the levels are set free
MIN_VISIBLE = 0.4  # least part of the edge that has to fit
MAX_REFITS = 3


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
    """Centre, radius of equal area, and the shape as m and the angle of the major axis."""

    x: float
    y: float
    r: float
    m: float = 0.0
    angle: float = 0.0

    @property
    def axes(self):
        return self.r * np.exp(self.m), self.r * np.exp(-self.m)

    @property
    def half_size(self):
        """Half width and half height of the upright box around the ellipse."""
        (a, b), cos, sin = self.axes, np.cos(self.angle), np.sin(self.angle)
        return np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)

    def moved(self, dx, dy, dr, dp, dq):
        """The ellipse after a step; (dp, dq) is the change of shape in the ellipse's own axes."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        root = np.diag(np.exp([-self.m, self.m])) @ np.array([[cos, sin], [-sin, cos]])
        size = np.hypot(dp, dq)
        change = np.cosh(2 * size) * np.eye(2)
        if size > 0:
            change -= np.sinh(2 * size) / size * np.array([[dp, dq], [dq, -dp]])
        form = root.T @ change @ root
        split = np.hypot(form[1, 1] - form[0, 0], 2 * form[0, 1])
        angle = 0.5 * np.arctan2(-2 * form[0, 1], form[1, 1] - form[0, 0]) if split > 0 else 0.0
        return _Ellipse(self.x + dx, self.y + dy, self.r + dr, 0.5 * np.arcsinh(split / 2), angle)


def fit_discs(image, circles, *, max_chi2=1.5, max_misfit=0.05):
    """Fit a blurred ellipse to the picture around each circle.

    Parameters
    ----------
    image : (height, width) uint8
    circles : object with .centers (n, 2) and .radii (n,) in px
        Bright or dark discs, for example from `find_circles`; starting values are refined along rays,
        so they may be off by some 20 % of the radius.
    max_chi2, max_misfit : float
        A fit is rejected when its chi2 exceeds `max_chi2` *and* the part of the residual that noise
        does not explain exceeds `max_misfit` of the contrast.  The second condition is there because in
        a picture without noise any departure from the model is significant, however small.

    Returns
    -------
    Discs
        A row for each circle.  Rows that are not accepted have a reason: "leaves the image",
        "radius too small", "no edge", "does not converge", "edge hidden" (less than 40 % of it fits),
        "contrast below noise", "chi2".  All values
        are finite, except for sigmas, covariance and chi2 (infinite) where there is no fit at all; centre
        and radius are then the circle's own.

    Raises
    ------
    ValueError
        If the image or the circles are unusable.

    Notes
    -----
    The noise that chi2 is judged by comes from the picture: the mean absolute response of Immerkaer's
    mask (1 -2 1; -2 4 -2; 1 -2 1), blind to planes and edges along the axes, over the ring's pixels away
    from the edge, and never below the variance 1/12 of rounding.  The sigmas are scaled
    by the residual of the fit itself.  For a circle the angle is undetermined; its sigma is then that
    of a uniform distribution over half a turn, pi/sqrt(12).
    """
    image = as_image(image)
    limits = as_number(max_chi2, "max_chi2", 0.0), as_number(max_misfit, "max_misfit", 0.0)
    starts = _as_circles(circles)
    return _collect([_fit_one(image, start, *limits) for start in starts])


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


def _fit_one(image, start, max_chi2, max_misfit):
    """Fit one disc: start, least squares (the ring follows the ellipse), then the judgement."""
    circle = _Ellipse(*start)
    if start[2] < 2:
        return _Fit(circle, "radius too small")
    if not _inside(circle, image.shape):
        return _Fit(circle, "leaves the image")
    ellipse = _start(image, circle)
    if ellipse is None:
        return _Fit(circle, "no edge")
    solution = _settle(image, ellipse)
    if isinstance(solution, str):
        return _Fit(circle, solution)
    return _judge(image, solution, ellipse, max_chi2, max_misfit)


def _inside(ellipse, shape):
    """Whether the whole ellipse lies on the picture."""
    width, height = ellipse.half_size
    return width <= ellipse.x <= shape[1] - 1 - width and height <= ellipse.y <= shape[0] - 1 - height


def _start(image, circle):
    """An ellipse through the strongest steps along rays from the centre, outliers weighed down.

    The directed step is looked for within 25 % of the radius (at least 4 px).  To first order in the
    departure from the circle, radius(t) = r + x cos t + y sin t + r p cos 2t + r q sin 2t.
    """
    reach = max(4.0, 0.25 * circle.r)
    t = np.arange(N_RAYS) * (2 * np.pi / N_RAYS)
    rho = np.arange(max(circle.r - reach, 0.5), circle.r + reach, 0.5)
    x = (circle.x + np.cos(t)[:, None] * rho).astype(np.float32)
    y = (circle.y + np.sin(t)[:, None] * rho).astype(np.float32)
    rays = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float32)
    steps = cv2.sepFilter2D(rays, -1, _STEP, np.ones(1, np.float32), borderType=cv2.BORDER_REPLICATE)
    profile = steps.mean(axis=0)
    steps *= np.sign(profile[np.abs(profile).argmax()])
    found = rho[steps.argmax(axis=1)]
    design = np.stack([np.ones_like(t), np.cos(t), np.sin(t), np.cos(2 * t), np.sin(2 * t)], axis=1)
    r, dx, dy, p, q = _robust_solve(design, found, np.maximum(steps.max(axis=1), 0))
    if not r > 1 or np.hypot(p, q) > 0.5 * r or np.hypot(dx, dy) > 2 * reach:
        return None
    return _Ellipse(circle.x, circle.y, r).moved(dx, dy, 0, p / r, q / r)


_STEP = np.array([1, 1, 1, 0, -1, -1, -1], np.float32)  # inside minus outside, 1.5 px each


def _robust_solve(design, values, weights):
    """Least squares with Cauchy weights that start from the median, whose scale follows the residuals."""
    residuals = values - np.median(values)
    weights = weights + 1e-6
    for _ in range(8):
        scale = max(2 * np.median(np.abs(residuals)), 0.25)
        w = weights / (1 + (residuals / scale) ** 2)
        solution = np.linalg.solve(design.T @ (w[:, None] * design), design.T @ (w * values))
        residuals = values - design @ solution
    return solution


@dataclass(frozen=True)
class _Solution:
    """A fit of the simple model, levels B and A; `normal` is for x, y, r, p, q, log s, B, A."""

    ellipse: _Ellipse
    log_s: float
    levels: np.ndarray
    normal: np.ndarray
    squares: float
    count: int
    converged: bool = True


def _settle(image, ellipse):
    """Fit, and fit again on a new ring where the ellipse moved by more than a pixel."""
    log_s = np.log(1.2)
    for _ in range(MAX_REFITS):
        if not _inside(ellipse, image.shape):
            return "leaves the image"
        x, y, values = _ring_pixels(image, ellipse)
        solution = _least_squares(x, y, values, ellipse, log_s)
        if isinstance(solution, str):
            return solution
        moved = _distance(ellipse, solution.ellipse)
        ellipse, log_s = solution.ellipse, solution.log_s
        if moved < 1:
            break
    if not _inside(ellipse, image.shape):
        return "leaves the image"
    return solution if moved < 1 else replace(solution, converged=False)


def _distance(first, second):
    """An upper bound, px, of how far the edge moved between two ellipses."""
    change = np.abs(np.subtract(first.half_size, second.half_size)).max()
    return np.hypot(first.x - second.x, first.y - second.y) + change + abs(first.r - second.r)


def _ring(image, ellipse, margin):
    """The patch around an ellipse, its first column and row, and each pixel's distance (positive inside)."""
    half = np.array(ellipse.half_size) + margin + 1
    x0, y0 = np.maximum(np.floor([ellipse.x - half[0], ellipse.y - half[1]]), 0).astype(int)
    x1, y1 = np.ceil([ellipse.x + half[0], ellipse.y + half[1]]).astype(int) + 1
    patch = image[y0:y1, x0:x1]
    x = np.arange(x0, x0 + patch.shape[1]) - ellipse.x
    y = (np.arange(y0, y0 + patch.shape[0]) - ellipse.y)[:, None]
    (a, b), cos, sin = ellipse.axes, np.cos(ellipse.angle), np.sin(ellipse.angle)
    u, v = x * (cos / a) + y * (sin / a), y * (cos / b) - x * (sin / b)
    norm2 = u * u + v * v
    slope2 = (u / a) ** 2 + (v / b) ** 2
    return patch, (x0, y0), (np.sqrt(norm2) - norm2) / np.sqrt(np.maximum(slope2, 1e-12))


def _ring_pixels(image, ellipse):
    """x, y and grey values of the pixels within RING px of the ellipse."""
    patch, (x0, y0), distance = _ring(image, ellipse, RING)
    rows, columns = np.nonzero(np.abs(distance) <= RING)
    return columns + float(x0), rows + float(y0), patch[rows, columns].astype(float)


def _geometry(x, y, ellipse):
    """Signed distance (positive inside), its derivatives by x, y, r, p, q as rows, and the curvature.

    With w = S (X - c), S = diag(e^-m, e^m) R^T, the ellipse is |w| = r; the distance is
    (r - |w|) / |S^T w / |w||, exact for circles and in error by (d^2/r) O(m^2) for ellipses.
    """
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    grow, shrink = np.exp(ellipse.m), np.exp(-ellipse.m)
    dx, dy = x - ellipse.x, y - ellipse.y
    u, v = shrink * (dx * cos + dy * sin), grow * (dy * cos - dx * sin)
    norm = np.sqrt(u * u + v * v)
    centre = norm < 1e-6  # has no direction; any will do
    u[centre], norm[centre] = 1e-6, 1e-6
    u /= norm
    v /= norm
    along, across = shrink * u, grow * v
    inverse = 1 / np.sqrt(along * along + across * across)
    rows = np.empty((5, len(x)))
    rows[0] = (along * cos - across * sin) * inverse
    rows[1] = (along * sin + across * cos) * inverse
    rows[2] = inverse
    rows[3] = (u * u - v * v) * norm * inverse
    rows[4] = 2 * u * v * norm * inverse
    return (ellipse.r - norm) * inverse, rows, inverse**3 / ellipse.r


def _model(x, y, ellipse, log_s):
    """Phi and the derivatives of Phi by x, y, r, p, q, log s (rows)."""
    s = np.exp(log_s)
    distance, rows, curvature = _geometry(x, y, ellipse)
    shift = 0.5 * s * curvature
    z = distance / s - shift
    density = np.exp(-0.5 * z * z) * (1 / (np.sqrt(2 * np.pi) * s))
    derivatives = np.empty((6, len(x)))
    np.multiply(rows, density, out=derivatives[:5])
    derivatives[5] = -(z + 2 * shift) * density * s
    return ndtr(z), derivatives


def _least_squares(x, y, values, ellipse, log_s):
    """Gauss-Newton with halved steps over ellipse and log s; B and A are solved for in every step.

    Ends (converged) when a step is below some hundredths of the parameters' own sigmas (STEP_TOLERANCE is its
    squared length in sigmas), or fails to improve the fit although it is below a tenth of them.
    Returns a `_Solution` or the reason why there is none.
    """
    best, step, fraction, decrement = None, np.zeros(6), 1.0, np.inf
    for _ in range(MAX_STEPS):
        trial, trial_s = ellipse.moved(*fraction * step[:5]), float(np.clip(log_s + fraction * step[5], -1.5, 2.0))
        share, derivatives = _model(x, y, trial, trial_s)
        levels = _solve_levels(share, values)
        residuals = values - levels[0] - levels[1] * share
        squares = residuals @ residuals
        if best is not None and squares > best.squares:
            if decrement <= 10 * STEP_TOLERANCE:
                return best
            fraction *= 0.5
            continue
        ellipse, log_s, fraction = trial, trial_s, min(1.0, 2 * fraction)
        jacobian = np.vstack([levels[1] * derivatives, np.ones_like(share), share])
        normal, gradient = jacobian @ jacobian.T, jacobian @ residuals
        best = _Solution(ellipse, log_s, levels, normal, squares, len(x))
        step = _solve_scaled(normal, gradient)
        if step is None:
            return "no edge"
        decrement = step @ gradient / max(squares / len(x), QUANTISATION)
        if decrement <= STEP_TOLERANCE:
            return best
        step = _limited(step, ellipse)
    return replace(best, converged=False)


def _solve_levels(share, values):
    """B and A of B + A * share by least squares."""
    mean, level = share.mean(), values.mean()
    centred = share - mean
    contrast = (centred @ values) / max(centred @ centred, 1e-12)
    return np.array([level - contrast * mean, contrast])


def _solve_scaled(normal, gradient):
    """Solve the normal equations scaled to a unit diagonal; None where they are singular."""
    scale = np.sqrt(np.diag(normal))
    if not (scale > 1e-9).all():
        return None
    try:
        return cho_solve(cho_factor(normal / np.outer(scale, scale)), gradient / scale) / scale
    except np.linalg.LinAlgError:
        return None


def _limited(step, ellipse):
    """The step shortened so that no part of the edge moves by more than 2 px and s by more than half."""
    size = max(np.abs(step[:3]).max() / 2, np.abs(step[3:5]).max() * ellipse.r / 2, abs(step[5]) / 0.7, 1.0)
    return step / size


def _judge(image, solution, start, max_chi2, max_misfit):
    """Covariance, chi2 and the reason for a rejection; a refit by sectors from `start` where the model fails."""
    ellipse, contrast, s = solution.ellipse, float(solution.levels[1]), np.exp(solution.log_s)
    variance = max(solution.squares / max(solution.count - 8, 1), QUANTISATION)
    noise = _ring_noise(image, ellipse, s)
    covariance = variance * np.linalg.inv(solution.normal)[:5, :5]
    if not solution.converged or (variance > REFIT_CHI2 * noise**2 and abs(contrast) > noise):
        refit = _refit(image, start, contrast, noise)
        if isinstance(refit, str):
            return _Fit(ellipse, refit, _to_axes(ellipse, covariance), variance / noise**2, contrast, s, noise)
        ellipse, covariance, variance, s = refit
    misfit = np.sqrt(max(variance - noise**2, 0.0))
    reason = ""
    if abs(contrast) <= noise:
        reason = "contrast below noise"
    elif variance > max_chi2 * noise**2 and misfit > max_misfit * abs(contrast):
        reason = "chi2"
    return _Fit(ellipse, reason, _to_axes(ellipse, covariance), variance / noise**2, contrast, s, noise)


# -------------------------------------------------------------------------------------------------- sectors


@dataclass(frozen=True)
class _Sectors:
    """The ring's pixels in rows, one row for each angular sector; `used` is 0 on what fills the rows up."""

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    used: np.ndarray


def _sectors(image, ellipse):
    """Cut the ring into sectors of about 12 px along the edge (12 to 48 of them)."""
    x, y, values = _ring_pixels(image, ellipse)
    number = int(np.clip(round(2 * np.pi * ellipse.r / 12), 12, 48))
    angle = np.arctan2(y - ellipse.y, x - ellipse.x)
    sector = np.minimum(((angle / (2 * np.pi) + 0.5) * number).astype(int), number - 1)
    order = np.argsort(sector, kind="stable")
    counts = np.bincount(sector, minlength=number)
    place = np.arange(len(x)) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = np.zeros((4, number, counts.max()))
    for row, data in zip(rows, (x, y, values, np.ones(len(x))), strict=True):
        row[sector[order], place] = data[order]
    return _Sectors(*rows)


def _refit(image, start, contrast, noise):
    """Fit again with a level and a slope of its own, inside and outside, in each angular sector.

    Side walls, highlights and clutter change the levels around the disc; ellipse and s are common.  The
    linear unknowns of a sector are eliminated from the normal equations.  A sector whose chi2 is above a
    limit, 1.5 or the median over the sectors if that is larger, gets the weight (limit / chi2)^2, one with
    less than a quarter of the contrast none.  The covariance is
    the sandwich over sectors, sum of w^2 g g^T in the middle (g a sector's gradient), so that what
    the model does not describe counts once for a sector and not once for each pixel.

    Returns the ellipse, the covariance of x, y, r, p, q, the variance and s, or the reason why there is none.
    """
    sectors = _sectors(image, start)
    ellipse, log_s = start, np.log(1.2)
    for _ in range(MAX_STEPS):
        normals, gradients, squares, contrasts = _sector_equations(sectors, ellipse, log_s)
        freedom = np.maximum(sectors.used.sum(axis=1) - 4, 1)
        chi2 = np.maximum(squares / freedom, QUANTISATION) / noise**2
        weights = np.minimum(1, (max(1.5, np.median(chi2)) / chi2) ** 2) * (contrasts / contrast > 0.25)
        if weights.sum() < MIN_VISIBLE * len(weights):
            return "edge hidden"
        normal = np.tensordot(weights, normals, 1)
        step = _solve_scaled(normal, weights @ gradients)
        if step is None:
            return "no edge"
        if step @ normal @ step <= 10 * STEP_TOLERANCE * noise**2:
            break
        step = _limited(step, ellipse)
        ellipse, log_s = ellipse.moved(*step[:5]), float(np.clip(log_s + step[5], -1.5, 2.0))
        if _distance(ellipse, start) > RING:
            return "does not converge"
    else:
        return "does not converge"
    if not _inside(ellipse, image.shape):
        return "leaves the image"
    scores = weights[:, None] * gradients
    bread = np.linalg.inv(normal)
    middle = scores.T @ scores * (len(weights) / (len(weights) - 6))
    covariance = bread @ middle @ bread
    variance = noise**2 * (weights * freedom) @ chi2 / (weights @ freedom)
    return ellipse, covariance[:5, :5], variance, np.exp(log_s)


def _sector_equations(sectors, ellipse, log_s):
    """Normal matrices and gradients of (x, y, r, p, q, log s), residual squares and contrasts, by sector."""
    shape = sectors.x.shape
    x, y = sectors.x.ravel(), sectors.y.ravel()
    share, derivatives = (part.reshape(*part.shape[:-1], *shape) for part in _model(x, y, ellipse, log_s))
    distance = np.clip(_geometry(x, y, ellipse)[0].reshape(shape), -RING, RING) / RING
    basis = np.stack([1 - share, (1 - share) * distance, share, share * distance], axis=-1)
    basis *= sectors.used[..., None]
    moments = basis.transpose(0, 2, 1) @ basis + 1e-6 * np.eye(4)
    levels = np.linalg.solve(moments, basis.transpose(0, 2, 1) @ sectors.values[..., None])
    residuals = sectors.values - (basis @ levels)[..., 0]
    levels = levels[..., 0]
    step = (levels[:, 2] - levels[:, 0])[:, None] + (levels[:, 3] - levels[:, 1])[:, None] * distance
    jacobian = (derivatives * (step * sectors.used)).transpose(1, 2, 0)
    mixed = basis.transpose(0, 2, 1) @ jacobian
    jacobian -= basis @ np.linalg.solve(moments, mixed)
    turned = jacobian.transpose(0, 2, 1)
    gradients = (turned @ residuals[..., None])[..., 0]
    return turned @ jacobian, gradients, (residuals**2).sum(axis=1), levels[:, 2] - levels[:, 0]


# ---------------------------------------------------------------------------------------------------- noise


def _ring_noise(image, ellipse, s):
    """Standard deviation of the noise in the ring, by Immerkaer's mask away from the edge."""
    patch, _, distance = _ring(image, ellipse, RING)
    distance = np.abs(distance)
    flat = (distance <= RING) & (distance >= min(3 * s + 1.5, RING - 1))
    response = np.abs(cv2.filter2D(patch, cv2.CV_32F, _IMMERKAER, borderType=cv2.BORDER_REFLECT_101))[flat]
    variance = np.pi / 2 * response.mean() ** 2 / 36 if len(response) else 0.0
    return np.sqrt(max(float(variance), QUANTISATION))


_IMMERKAER = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)


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
