"""Equal circles in one plane, fitted together to the edges of a picture: a homography and one radius."""

from dataclasses import dataclass, replace

import numpy as np

from .edges import N_RAYS, RAYS, _Outlines, _Rims, _rims

PERSPECTIVE = 0.2  # standard deviation of the vanishing line's coefficients, per pitch radius: few cameras are nearer
PROPORTION_SIGMA = 0.15  # of the logarithm of the radius: what patterns are off, and competing edges
REACHES = (0.5, 0.35, 0.2, 0.12, 0.08)  # of the radius: edges farther away do not count, step by step
LAST_REACH = 2.5  # px, at least
RADII = np.exp(np.linspace(np.log(0.6), np.log(1.6), 21))  # times the pattern's radius, tried for the first fit
TUKEY = 3.0  # of the residuals' scale
LAST_SCALE = (
    0.3  # px, of the residuals at least; before the last step half the reach, so that no disc is given up early
)
ELLIPSE_SCALE = 0.1  # of the radius: the same for ellipses of the places' own


def _images(homographies, spots):
    """Images (..., n, 2) of points (..., n, 2) of a plane and their derivatives (..., n, 2, 2), by one homography (3, 3), or
    by m of them (m, 3, 3)."""
    full = spots @ np.swapaxes(homographies[..., :2], -1, -2) + homographies[..., None, :, 2]
    points, rows = full[..., :2] / full[..., 2:], homographies[..., None, :, :2]
    jacobians = rows[..., :2, :] - points[..., None] * rows[..., 2:, :]
    return points, jacobians / full[..., 2, None, None]


@dataclass(frozen=True, eq=False)
class _Plane:
    """The image of a ring: homography (3, 3) from the pattern (middle at 0, size 1), radius of the discs there."""

    homography: np.ndarray
    radius: float

    def outlines(self, places, radii=None):
        """Outlines of discs at `places` (n, 2) in the plane; a unit of offset is their radius."""
        radii = np.full(len(places), self.radius) if radii is None else np.asarray(radii)
        spots = places[:, None] + radii[:, None, None] * RAYS
        points, jacobian = _images(self.homography, spots)
        along = np.einsum("kmij,kmj->kmi", jacobian, radii[:, None, None] * RAYS)
        tangents = np.einsum("kmij,mj->kmi", jacobian, RAYS[:, ::-1] * [-1, 1])
        normals = tangents[:, :, ::-1] * [1, -1]
        return _Outlines(points, along, normals / np.linalg.norm(normals, axis=2, keepdims=True))

    def ellipses(self, places, radii=None):
        """Centres (n, 2) and shapes (n, 2, 2) of the images of discs: exact, the image of a circle is an ellipse."""
        radii = np.full(len(places), self.radius) if radii is None else np.asarray(radii)
        frames = np.zeros((len(places), 3, 3))
        frames[:, 0, 0] = frames[:, 1, 1] = radii
        frames[:, :2, 2], frames[:, 2, 2] = places, 1
        images = self.homography @ frames
        duals = images * (1.0, 1.0, -1.0) @ images.transpose(0, 2, 1)
        duals /= -duals[:, 2:, 2:]
        centers = -duals[:, :2, 2]
        values, vectors = np.linalg.eigh(duals[:, :2, :2] + centers[:, :, None] * centers[:, None])
        return centers, vectors * np.sqrt(np.maximum(values, 1e-12))[:, None] @ vectors.transpose(0, 2, 1)

    @property
    def tilt(self):
        """Ratio of the axes of a small circle's image in the middle."""
        singular = np.linalg.svd(_images(self.homography, np.zeros((1, 2)))[1][0], compute_uv=False)
        return float(singular[0] / max(singular[1], 1e-12))


def _starts(field, plane, places, signs):
    """The planes with those radii at which the most edges lie all around: at most three."""
    radii = np.repeat(plane.radius * RADII, len(places))
    outlines = plane.outlines(np.tile(places, (len(RADII), 1)), radii)
    rims, _ = _rims(field, outlines, np.tile(signs, len(RADII)), 0.15, steps=3)
    evidence = rims.weights.reshape(len(RADII), -1).mean(axis=1)
    evidence = evidence * np.exp(-0.5 * (np.log(RADII) / (3 * PROPORTION_SIGMA)) ** 2)
    padded = np.pad(evidence.round(4), 1)
    peaks = np.flatnonzero((padded[1:-1] > padded[:-2]) & (padded[1:-1] >= padded[2:]))
    best = peaks[np.argsort(-evidence[peaks], kind="stable")][:3]
    return [replace(plane, radius=plane.radius * RADII[k]) for k in best]


def _fit_plane(field, plane, places, signs, radius, reaches=REACHES, used=None):
    """The plane drawn to the edges within shrinking reaches; `radius` is the pattern's own, `used` (n,) the places that
    count.

    Returns the plane, its rims, residuals (n, N_RAYS) px, and the polarity (n,) of each place.
    """
    for reach in reaches:
        outlines = plane.outlines(places)
        if not _is_sane(plane, outlines):
            return None
        widest = max(reach * outlines.px.mean(), LAST_REACH)
        rims, _ = _rims(field, outlines, signs, widest / outlines.px.mean())
        if used is not None:
            rims = _Rims(rims.offsets, rims.weights * used[:, None])
        last = reach == reaches[-1]
        plane = _step(plane, places, rims, outlines.px, radius, LAST_SCALE if last else widest / 2)
    outlines = plane.outlines(places)
    if not _is_sane(plane, outlines):
        return None
    rims, found = _rims(field, outlines, signs, max(reaches[-1], LAST_REACH / outlines.px.mean()))
    return plane, rims, rims.offsets * outlines.px, found


def _fit_to_ellipses(plane, places, centers, shapes, weights, radius):
    """The plane drawn to ellipses (n, 2), (n, 2, 2) near its discs: for rims that are no circles of one plane."""
    for _ in range(3):
        outlines = plane.outlines(places)
        if not _is_sane(plane, outlines):
            return None
        own_centers, own_shapes = plane.ellipses(places)
        inverse = np.linalg.inv(own_shapes)
        shift = (inverse @ (centers - own_centers)[:, :, None])[:, :, 0]
        spots = np.linalg.solve(shapes, outlines.points.transpose(0, 2, 1) - centers[:, :, None])
        beyond = 1 / np.linalg.norm(spots, axis=1) - 1  # along the ray from the ellipse's own centre
        offsets = np.where(np.abs(beyond) < 0.5, beyond, (shift @ RAYS.T))
        rims = _Rims(offsets, np.repeat(weights[:, None], N_RAYS, axis=1))
        plane = _step(plane, places, rims, outlines.px, radius, ELLIPSE_SCALE * outlines.px.mean())
    return plane if _is_sane(plane, plane.outlines(places)) else None


def _step(plane, places, rims, px, radius, least_scale):
    """One robust step: H <- H (I + D), log radius; the residuals are linear in the eight of D and the radius.

    An edge at offset t along the ray e of a disc asks for e . (D q) + dr = t r, q being the outline's point: D moves q
    by A q + b - q (c . q).
    """
    weight = (rims.weights * px / plane.radius).ravel()
    q = (places[:, None] + plane.radius * RAYS).reshape(-1, 2)
    e = np.tile(RAYS, (len(places), 1))
    inner = (e * q).sum(axis=1)
    design = np.column_stack(
        [e[:, 0] * q[:, 0], e[:, 0] * q[:, 1], e[:, 1] * q[:, 0], e[:, 1] * q[:, 1], e, -inner[:, None] * q]
    )
    design = np.column_stack([design, np.full(len(q), plane.radius)])
    goal = rims.offsets.ravel() * plane.radius
    prior, pull = _prior(plane, radius)
    solution, residuals, robust = np.zeros(9), goal * px.ravel() / plane.radius, np.ones(len(goal))
    used = rims.weights.ravel() > 0
    for _ in range(6):
        rows = design * (weight * robust)[:, None]
        right = goal * weight * robust
        solution = np.linalg.solve(rows.T @ rows + prior, rows.T @ right + pull)
        residuals = (goal - design @ solution) * px.ravel() / plane.radius
        scale = max(1.4826 * float(np.median(np.abs(residuals[used]))) if used.any() else 1.0, least_scale)
        robust = np.maximum(1 - (residuals / (TUKEY * scale)) ** 2, 0)
    return _moved(plane, solution)


def _prior(plane, radius):
    """Weights (9, 9) and pulls (9,) of what is known before: little perspective, about the pattern's radius."""
    line = plane.homography[2, :2] / plane.homography[2, 2]
    weights = np.full(9, 1e-3)
    weights[6:8] = 1 / PERSPECTIVE**2
    weights[8] = 1 / PROPORTION_SIGMA**2
    pull = np.zeros(9)
    pull[6:8] = -weights[6:8] * line
    pull[8] = -weights[8] * np.log(plane.radius / radius)
    return np.diag(weights), pull


def _moved(plane, solution):
    """The plane after a step (9,), limited so that one bad set of edges does not throw it away."""
    solution = solution * min(1.0, 0.4 / max(np.abs(solution).max(), 1e-12))
    change = np.eye(3)
    change[:2, :2] += solution[:4].reshape(2, 2)
    change[:2, 2] += solution[4:6]
    change[2, :2] += solution[6:8]
    homography = plane.homography @ change
    return _Plane(homography / homography[2, 2], plane.radius * float(np.exp(solution[8])))


def _is_sane(plane, outlines):
    """Whether the plane is seen from its front, not too flat, and the discs have a size."""
    singular = np.linalg.svd(plane.homography)[1]
    spread = np.abs(outlines.points - outlines.points.mean(axis=(0, 1))).max()
    return bool(
        np.linalg.det(plane.homography) > 0
        and singular[-1] > 1e-9
        and np.isfinite(outlines.points).all()
        and spread < 1e5
        and plane.tilt < 3.2
        and outlines.px.min() > 0.5
        and outlines.px.max() < 8 * outlines.px.mean()
    )
