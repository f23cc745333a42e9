"""Sub-pixel fit of checkerboard corners: crossings of two blurred or sharpened edges, as pixels see them.

Near a corner the image of two crossing edges is

    I = m + a S(d_1) S(d_2) + g_x x + g_y y,

where d_1 and d_2 are the signed distances to the edges and g is a gradient of the light, which would otherwise bias
the corner.
S is the profile of an edge, from -1 to 1.  A step, blurred by a Gaussian of s px and averaged over a pixel one px
wide, is

    F(d, s) = H(d + 1/2) - H(d - 1/2),   H(t) = t erf(t / (sqrt(2) s)) + sqrt(2 / pi) s exp(-t^2 / (2 s^2)).

Without the pixel's width the profile of a sharp, nearly vertical edge is wrong by up to 0.05 px.  Cameras also
sharpen, which no blur describes: with an unsharp mask of amount k and Gaussian u the profile becomes

    S(d) = (1 + k) F(d, s) - k F(d, sqrt(s^2 + u^2)).

One unknown v, the variance by which the edge is wider than a pixel, stands for both: v = s^2 - k u^2, with k = 0
down to the smallest blur and s^2 constant below it (a parabola joins the two).  Least squares over a round window
(maximum likelihood under white noise) gives the corner, the directions of both edges, v and the levels together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import erf

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHARPENING = 0.9  # px, the Gaussian of the unsharp mask that stands for a camera's sharpening
SMALLEST_VARIANCE, BLEND = 0.04, 0.15  # px^2, where blur gives way to sharpening, and how softly
LEAST_VARIANCE, LARGEST_VARIANCE = -1.5, 25.0  # px^2
_STEPS = 60
_GAUSS_NEWTON_STEPS = (
    10  # a rough fit has no others; later ones are Newton's, since Gauss-Newton is slow with large residuals
)
_TOLERANCE, _ROUGH_TOLERANCE = 3e-4, 3e-2  # of the corner's standard deviation: a step that moves nothing
_ROUNDING = 1e-7  # px: where the residual is only rounding
_STEP_LIMITS = np.array([1.0, 1.0, 0.2, 0.2, 0.3] + [np.inf] * 4)
_BLUR = 4  # its column
_REACH = 7.5  # times the blur: there the profile is flat to 1e-13


@dataclass(frozen=True)
class CornerFits:
    """Fits of n windows.

    Attributes
    ----------
    parameters : (n, 9) ndarray
        x, y (px from the window's middle), the normals' directions (rad), v (px^2), m, a, g_x, g_y.
    sigma : (n,) ndarray
        px, standard deviation of the corner along its worse axis, from the window's residuals.
    covariance : (n, 2, 2) ndarray
        px^2, of the corner's x and y, from the same residuals.
    misfit : (n,) ndarray
        Residuals (root mean square) over |a|.
    converged : (n,) bool ndarray
        Whether the last step was small.
    """

    parameters: np.ndarray
    sigma: np.ndarray
    covariance: np.ndarray
    misfit: np.ndarray
    converged: np.ndarray


def fit_corners(
    values: NDArray[np.float64],
    weights: NDArray[np.float64],
    lattice: NDArray[np.float64],
    start: NDArray[np.float64],
    rough: bool = False,
) -> CornerFits:
    """Fit the module's model to windows by Levenberg's and Marquardt's damped least squares, all at once.

    Parameters
    ----------
    values, weights : (n, k) ndarray
        Grey values, and 1 for the pixels that count, else 0.
    lattice : (2, k) ndarray
        px, x and y of the windows' pixels from the windows' middle.
    start : (n, 4) or (n, 9) ndarray
        The first four parameters or all.
    rough : bool
        Stop within a few hundredths of the corner's standard deviation, not a few ten-thousandths.

    Returns
    -------
    CornerFits

    Notes
    -----
    A step is taken only where it lowers the window's own sum of squares.  v stays within its limits; while
    it is at one of them and pushed beyond, it is held fixed.
    """
    parameters = start.copy() if start.shape[1] == 9 else _first_guess(values, weights, lattice, start)
    tolerance = _ROUGH_TOLERANCE if rough else _TOLERANCE
    damping, active = np.full(len(start), 1e-3), np.arange(len(start))
    current = _equations(parameters, values, weights, lattice)
    sigma, cost, converged = np.zeros(len(start)), current[2].copy(), np.zeros(len(start), bool)
    covariance = np.zeros((len(start), 2, 2))
    freedom = np.maximum(weights.sum(axis=1) - parameters.shape[1], 1)
    for count in range(_GAUSS_NEWTON_STEPS if rough else _STEPS):
        normal, right, _ = current
        if count >= _GAUSS_NEWTON_STEPS:
            normal = _second_derivatives(parameters[active], values[active], weights[active], lattice, normal)
        step, spread, scatter = _step(parameters[active], normal, right, damping[active])
        trial = parameters[active] + step
        trial[:, _BLUR] = np.clip(trial[:, _BLUR], LEAST_VARIANCE, LARGEST_VARIANCE)
        tried = _equations(trial, values[active], weights[active], lattice)
        better = tried[2] <= current[2]
        parameters[active[better]] = trial[better]
        for new, old in zip(tried, current, strict=True):
            old[better] = new[better]
        sigma[active] = spread * np.sqrt(current[2] / freedom[active])
        covariance[active] = scatter * (current[2] / freedom[active])[:, None, None]
        cost[active] = current[2]
        small = np.abs(step[:, :2]).max(axis=1) <= tolerance * sigma[active] + _ROUNDING
        converged[active] = small & (damping[active] <= 1.0)  # a strongly damped step is always small
        damping[active] = np.clip(damping[active] * np.where(better, 0.1, 10.0), 1e-9, 1e9)
        going = ~converged[active]
        active, current = active[going], [part[going] for part in current]
        if not active.size:
            break
    misfit = np.sqrt(cost / np.maximum(weights.sum(axis=1), 1)) / np.maximum(np.abs(parameters[:, 6]), 1e-9)
    return CornerFits(parameters, sigma, covariance, misfit, converged)


def _first_guess(values, weights, lattice, start):
    """`start` completed by a blur of 1 px, the mean and the amplitude that fit best with it, and even light."""
    parameters = np.hstack([start, np.zeros((len(start), 5))])
    parameters[:, _BLUR] = 1.0
    product = edge_crossing(parameters, lattice)[1][:, :, 6]
    total = np.maximum(weights.sum(axis=1), 1)
    parameters[:, 5] = np.sum(weights * values, axis=1) / total
    spread = np.maximum(np.sum(weights * product**2, axis=1), 1e-9)
    parameters[:, 6] = np.sum(weights * product * (values - parameters[:, 5:6]), axis=1) / spread
    return parameters


def _equations(parameters, values, weights, lattice):
    """Normal matrices (n, 9, 9), right-hand sides (n, 9) and sums of squares (n,)."""
    model, jacobian = edge_crossing(parameters, lattice)
    weighted = (jacobian * weights[:, :, None]).transpose(0, 2, 1)
    residuals = values - model
    return weighted @ jacobian, (weighted @ residuals[:, :, None])[:, :, 0], np.sum(weights * residuals**2, axis=1)


def _second_derivatives(parameters, values, weights, lattice, normal):
    """Half the sums' second derivatives (n, 9, 9), by differences; `normal` where they are not definite."""
    hessian = np.empty_like(normal)
    for k in range(parameters.shape[1]):
        step = np.zeros(parameters.shape[1])
        step[k] = 1e-4
        ahead, behind = (_equations(parameters + sign * step, values, weights, lattice)[1] for sign in (1, -1))
        hessian[:, k] = (behind - ahead) / 2e-4
    hessian = (hessian + hessian.transpose(0, 2, 1)) / 2
    convex = np.linalg.eigvalsh(hessian)[:, 0] > 0
    return np.where(convex[:, None, None], hessian, normal)


def _step(parameters, normal, right, damping):
    """Damped steps (n, 9), and the corners' standard deviation (n,) and covariance (n, 2, 2) for residuals of 1."""
    normal, right = normal.copy(), right.copy()
    variance, pull = parameters[:, _BLUR], right[:, _BLUR]
    pressed = (variance <= LEAST_VARIANCE) & (pull < 0) | (variance >= LARGEST_VARIANCE) & (pull > 0)
    normal[pressed, _BLUR, :] = normal[pressed, :, _BLUR] = right[pressed, _BLUR] = 0.0
    diagonal = np.einsum("nii->ni", normal)
    diagonal += 1e-9 * diagonal + 1e-9  # a window without an edge has no unique solution
    covariance = np.linalg.inv(normal)[:, :2, :2]
    diagonal += damping[:, None] * diagonal
    step = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
    worst = np.linalg.eigvalsh(covariance)[:, 1]
    limits = np.tile(_STEP_LIMITS, (len(step), 1))
    limits[:, _BLUR] += 0.5 * np.abs(variance)
    return np.clip(step, -limits, limits), np.sqrt(np.maximum(worst, 0.0)), covariance


def edge_crossing(
    parameters: NDArray[np.float64], lattice: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The model (n, k) of the module's text and its derivatives (n, k, 9)."""
    x, y, first, second, variance, mean, amplitude, slope_x, slope_y = parameters.T[:, :, None]
    dx, dy = lattice[0] - x, lattice[1] - y
    along, profile, slope, spreading = [], [], [], []
    for angle in (first, second):
        edge = _profile(np.cos(angle) * dx + np.sin(angle) * dy, variance)
        for part, kind in zip(edge, (profile, slope, spreading), strict=True):
            kind.append(part)
        along.append(np.cos(angle) * dy - np.sin(angle) * dx)
    product = profile[0] * profile[1]
    model = mean + amplitude * product + slope_x * lattice[0] + slope_y * lattice[1]
    pull = amplitude * slope[0] * profile[1], amplitude * slope[1] * profile[0]  # derivatives by the two distances
    columns = [
        -pull[0] * np.cos(first) - pull[1] * np.cos(second),
        -pull[0] * np.sin(first) - pull[1] * np.sin(second),
        pull[0] * along[0],
        pull[1] * along[1],
        amplitude * (spreading[0] * profile[1] + spreading[1] * profile[0]),
        np.ones_like(product),
        product,
        *np.broadcast_arrays(*lattice, product)[:2],
    ]
    return model, np.stack(columns, axis=2)


def _profile(distance, variance):
    """S of the module's text, and its derivatives by the distance and by the blur's variance."""
    excess = np.clip((variance - SMALLEST_VARIANCE) / BLEND, -1.0, None)
    blended = excess < 1
    narrow = np.where(blended, SMALLEST_VARIANCE + BLEND * (excess + 1) ** 2 / 4, variance)  # s^2
    share = np.where(blended, (excess + 1) / 2, 1.0)  # its derivative
    parts = _blurred_step(distance, narrow)
    sharpened = blended[:, 0]
    if sharpened.any():
        rows = distance[sharpened], narrow[sharpened] + SHARPENING**2
        amount = (narrow - variance)[sharpened] / SHARPENING**2
        sharp, wide = [part[sharpened] for part in parts], _blurred_step(*rows)
        parts[2][sharpened] *= share[sharpened]
        parts[2][sharpened] += (share[sharpened] - 1) / SHARPENING**2 * (sharp[0] - wide[0])
        parts[2][sharpened] += amount * share[sharpened] * (sharp[2] - wide[2])
        for part, narrower, wider in zip(parts[:2], sharp, wide, strict=False):
            part[sharpened] += amount * (narrower - wider)
    return parts


def _blurred_step(distance, variance):
    """F of the module's text, and its derivatives by the distance and by s^2."""
    values, slope, spreading = np.sign(distance), np.zeros_like(distance), np.zeros_like(distance)
    s = np.sqrt(variance)
    near = np.abs(distance) < 0.5 + _REACH * s
    distance, s = distance[near], np.broadcast_to(s, near.shape)[near]
    ahead, behind = (distance + 0.5) / s, (distance - 0.5) / s
    steps = erf(ahead / np.sqrt(2)), erf(behind / np.sqrt(2))
    bells = np.sqrt(2 / np.pi) * (np.exp(-0.5 * ahead**2) - np.exp(-0.5 * behind**2))
    slope[near] = steps[0] - steps[1]
    spreading[near] = bells / (2 * s)
    values[near] = distance * slope[near] + 0.5 * (steps[0] + steps[1]) + s * bells
    return values, slope, spreading
