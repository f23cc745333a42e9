"""Even ground beyond the rings, which helps to know the levels."""

import cv2
import numpy as np

from .fit import _after_last_step, _rows
from .ring import RING

GROUND = 24.0  # px on either side of the edge up to which even ground helps to know the levels
GROUND_WIDTHS = 4.0  # edge widths s from the edge to where the ground begins: RING is at least that far
LEAST_GROUND = 30  # pixels of a side
GROUND_SIGMAS = 3.0  # departure from the ring's levels or noise, in standard deviations, that bars ground


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
    there = n >= LEAST_GROUND
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
