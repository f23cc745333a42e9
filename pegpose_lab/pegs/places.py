"""What each place of a ring shows: a disc that is measured, part of one, nothing, or something else."""

from dataclasses import dataclass

import numpy as np

from ..circles import Circles
from ..discs import fit_discs
from .edges import N_RAYS, SERIES, _ellipses, _rims, _solve_series

WHOLE = 0.6  # visible share of a place's own rim that determines an ellipse without help
CUT_SIGMA = 0.5  # of the radius times the misfit of the shape: what is cut off moves the centre by about so much
PART = 0.4  # visible share of the ring's outline that is more than chance
OFF = 0.12  # of the radius: distance of a place's own centre from the ring's, of real parts
MISSHAPEN = 0.15  # how much a semi-axis may differ from that of a circle in the ring's plane
FIT_AGREES = 0.1  # of the radius (at least a pixel): between a place's own rim and the fit to the grey values
MODEL_HOLDS = 1.5  # chi2 of that fit: beyond, it depends on which sectors it leaves out, and jumps from frame to frame
BY_CHANCE = 9.0  # squared distance in sigmas between a place and the ring that does not widen its covariance
MOST_HOLD = 0.75  # of the measured places, for which it has to hold
LAGS = 6  # rays whose errors may go together


@dataclass(frozen=True, eq=False)
class _Places:
    """The discs of a ring: centres (n, 2), covariances (n, 2, 2), radii (n,) px, states and visible shares (n,), and which
    of the partial ones (n,) have a whole rim of their own of another shape, as discs that a hole cuts."""

    centers: np.ndarray
    covariances: np.ndarray
    radii: np.ndarray
    states: np.ndarray
    visible: np.ndarray
    cut: np.ndarray


def _measured_places(image, field, ring, design):
    """`_Places` of a ring."""
    centers, shapes = ring.plane.ellipses(design.places)
    own = ring.own.centers, ring.own.shapes
    rims = _own_rims(field, *own, ring.signs)
    off, misshapen = _departures(centers, shapes, *own)
    like = (off < OFF) & (misshapen < MISSHAPEN)
    visible = np.maximum(ring.shares, np.where(like, ring.own.shares, 0))
    whole = ring.own.shares >= WHOLE
    cut = whole & ~like & (off < OFF) & (ring.shares < PART)
    states = np.where(whole & like, "measured", "partial").astype(object)
    states[whole & (off >= OFF) & (ring.shares < PART)] = "contradicted"
    states[ring.empty] = "missing"
    cut &= states == "partial"
    found = _by_own_rim(own, rims, centers, off)
    found[1][cut] += ((CUT_SIGMA * misshapen[cut] * found[2][cut]) ** 2)[:, None, None] * np.eye(2)
    rows = np.flatnonzero((states == "partial") & ~cut)
    found = _by_shape_of_ring(found, rows, ring, design, centers, shapes)
    found = _by_grey_values(image, found, states, ring.signs)
    covariances = _widened(found, np.flatnonzero(states == "measured"), centers)
    covariances[states == "missing"] = np.diag([np.inf, np.inf])
    radii = np.where(states == "missing", np.sqrt(np.linalg.det(shapes)), found[2])
    places = np.where((states == "missing")[:, None], centers, found[0])
    return _Places(places, covariances, radii, states, visible, cut)


def _px(ring, design):
    return ring.plane.outlines(design.places).px


def _own_rims(field, centers, shapes, signs):
    """The edges next to ellipses: offsets from the fit, px, and their weights."""
    outlines = _ellipses(centers, shapes)
    rims, _ = _rims(field, outlines, signs, 2.5 / float(np.median(outlines.px)), steps=8)
    steps, residuals = _solve_series(rims, 1.0 / outlines.px.mean(axis=1, keepdims=True))
    return steps, residuals * outlines.px, rims.weights


def _departures(centers, shapes, own_centers, own_shapes):
    """How far own centres (n,) lie from the ring's, and how much own semi-axes (n,) differ, in parts of the radius."""
    steps = np.linalg.solve(shapes, (own_centers - centers)[:, :, None])[:, :, 0]
    ratios = np.linalg.svd(np.linalg.solve(shapes, own_shapes), compute_uv=False)
    return np.linalg.norm(steps, axis=1), np.abs(ratios - 1).max(axis=1)


def _by_own_rim(own, rims, centers, off):
    """Centres, covariances and radii of the places' own ellipses, drawn to their edges once more."""
    (steps, residuals, weights), (own_centers, shapes) = rims, own[:2]
    moved = own_centers + (shapes @ np.clip(steps[:, 1:3, None], -0.1, 0.1))[:, :, 0]
    covariances = np.empty((len(moved), 2, 2))
    for k in range(len(moved)):
        covariances[k] = shapes[k] @ _covariance_of_shift(residuals[k], weights[k], shapes[k], SERIES) @ shapes[k].T
    gap = moved - centers
    far = off >= OFF  # a disc that is not where the ring has it: the covariance covers both
    covariances[far] += (gap[:, :, None] * gap[:, None, :])[far]
    return [moved, covariances, np.sqrt(np.abs(np.linalg.det(shapes))) * (1 + np.clip(steps[:, 0], -0.1, 0.1))]


def _covariance_of_shift(residuals, weights, shape, design):
    """Covariance (2, 2) of the shift in parts of the shape, from residuals (N_RAYS,) px that go together.

    The sum of their autocorrelations over some rays tells how many rays say the same.
    """
    used = weights > 0
    if used.sum() < design.shape[1] + 3:
        return np.diag([1.0, 1.0])
    size = np.sqrt(abs(np.linalg.det(shape)))
    clipped = np.clip(residuals, -2, 2) * used
    power = float((clipped**2).sum()) / max(used.sum() - design.shape[1], 1)
    lags = [float((clipped * np.roll(clipped, lag)).sum()) / used.sum() for lag in range(1, LAGS)]
    together = 1 + 2 * max(sum(lags) / max(power, 1e-12), 0)
    normal = design[used].T @ design[used] + 1e-6 * np.eye(design.shape[1])
    return np.linalg.inv(normal)[1:3, 1:3] * (power + 0.05**2) * together / size**2


def _by_shape_of_ring(found, rows, ring, design, centers, shapes):
    """The same for partly visible places, whose shape is the ring's: only the shift is measured."""
    px, series = _px(ring, design), SERIES[:, :3]
    for k in rows:
        near = (ring.rims.weights[k] > 0) & (np.abs(ring.residuals[k]) < max(2.0, 0.1 * px[k].mean()))
        part = series[near][:, 1:3]
        offsets = ring.residuals[k][near] / px[k][near]
        shift = np.linalg.solve(part.T @ part + 0.5 * np.eye(2), part.T @ offsets)
        found[0][k] = centers[k] + shapes[k] @ shift
        left = np.zeros(N_RAYS)
        left[near] = (offsets - part @ shift) * px[k][near]
        covariance = shapes[k] @ _covariance_of_shift(left, near.astype(float), shapes[k], series) @ shapes[k].T
        step = shapes[k] @ shift
        found[1][k] = covariance + np.outer(step, step)
        found[2][k] = np.sqrt(np.linalg.det(shapes[k]))
    return found


def _by_grey_values(image, found, states, signs, most=MOST_HOLD):
    """The same with the fit to the grey values, if that finds the own rims of most places and its model holds there.

    Else no place has it: two measures of one ring differ by more than either scatters from frame to frame.
    """
    rows = np.flatnonzero(states == "measured")
    fits = []
    for sign, polarity in ((1, "bright"), (-1, "dark")):
        some = rows[signs[rows] == sign]
        if len(some) == 0:
            continue
        discs = fit_discs(image, Circles(found[0][some], found[2][some], np.ones(len(some)), polarity))
        near = np.maximum(1.0, FIT_AGREES * found[2][some])
        agrees = np.linalg.norm(discs.centers - found[0][some], axis=1) < near
        agrees &= np.abs(discs.radii - found[2][some]) < near
        fits.append((some, discs, discs.accepted & agrees & (discs.chi2 < MODEL_HOLDS)))
    if sum(int(good.sum()) for _, _, good in fits) >= most * max(len(rows), 1):
        for some, discs, good in fits:
            found[0][some[good]] = discs.centers[good]
            found[1][some[good]] = discs.covariance[good][:, :2, :2]
            found[2][some[good]] = discs.radii[good]
    return found


def _widened(found, rows, centers):
    """The covariances, wider where a place's centre departs from the ring's by more than chance: of competing edges, it
    may have another one than the others."""
    covariances = found[1]
    for k in rows:
        gap = found[0][k] - centers[k]
        square = float(gap @ np.linalg.solve(covariances[k], gap))
        if square > BY_CHANCE:
            covariances[k] += np.outer(gap, gap) * (1 - BY_CHANCE / square)
    return covariances


def _residual(ring, design, states):
    """Rms of the rims about the ring's outlines, px, and its ratio to what is left when each place has its own ellipse."""
    px = _px(ring, design)
    rows = np.flatnonzero(states == "measured")
    if len(rows) == 0:
        return np.inf, np.inf
    near = (ring.rims.weights > 0) & (np.abs(ring.residuals) < np.maximum(2.0, 0.1 * px))
    together = apart = 0.0
    for k in rows:
        use = near[k]
        fit = np.linalg.lstsq(SERIES[use] * px[k][use, None], ring.residuals[k][use], rcond=None)[0]
        together += float((ring.residuals[k][use] ** 2).sum())
        apart += float(((ring.residuals[k][use] - SERIES[use] * px[k][use, None] @ fit) ** 2).sum())
    count = int(near[rows].sum())
    mean = together / max(count - 9, 1)
    rest = apart / max(count - 5 * len(rows), 1)
    return float(np.sqrt(mean)), float(np.sqrt(mean / max(rest, 1e-4)))
