"""Where the parts of the frame before are now: a disc is looked for near each place, and the places move together."""

import cv2
import numpy as np

REACH = 1.0  # of a disc's radius: how far a disc may move between two frames to be found without a search
SMALL = 6.0  # px: radius of the discs in the reduced picture in which they are looked for
RIM = 0.35  # of the radius: how much ground round a disc is compared with it
LEAST_MATCH = 0.5  # correlation with a disc on even ground: less is another thing, or an edge of one
TOGETHER = 0.15  # of the radius, at least LEAST_APART px: how far a disc may lie from where the others' motion takes it
LEAST_APART = 2.0
LARGEST_ZOOM = 1.15  # change of size between two frames


def _motion(image, centers, radii, signs):
    """The similarity (a, b), z -> a z + b for places x + i y, that takes discs of the frame before to this one.

    Each disc is looked for by correlation with a disc on even ground, up to REACH radii away.  None if one is not found,
    or if they do not move together.

    Parameters
    ----------
    image : (height, width) uint8
    centers, radii, signs : (n, 2), (n,), (n,)
        Of the frame before, px; +1 for a disc that is brighter than its ground, -1 for a darker one, 0 for either.
    """
    found = np.empty(len(centers), complex)
    for k, (center, radius, sign) in enumerate(zip(centers, radii, signs, strict=True)):
        place = _disc_near(image, center, radius, sign)
        if place is None:
            return None
        found[k] = place
    before = centers @ (1, 1j)
    middle, goal = before.mean(), found.mean()
    arms = before - middle
    a = (arms.conj() @ (found - goal)) / max(float((np.abs(arms) ** 2).sum()), 1e-12)
    apart = np.abs(a * arms + goal - found)
    if (
        abs(np.log(max(abs(a), 1e-9))) > np.log(LARGEST_ZOOM)
        or (apart > np.maximum(TOGETHER * radii, LEAST_APART)).any()
    ):
        return None
    return a, goal - a * middle


def _disc_near(image, center, radius, sign, reach=REACH):
    """The place x + i y of the disc of that radius within `reach` radii of a place, to a part of a reduced pixel.

    None if there is none.
    """
    step = max(radius / SMALL, 1.0)
    half = int(np.ceil((1 + RIM + reach) * radius / step)) + 1  # of the window, reduced px
    low = np.rint(center).astype(int) - int(np.ceil(half * step))
    size = 2 * half + 1
    left, top = np.maximum(low, 0)
    part = image[top : low[1] + int(size * step) + 1, left : low[0] + int(size * step) + 1]
    if min(part.shape) < 2 * radius:
        return None
    small = cv2.resize(part, [round(side / step) for side in part.shape[::-1]], interpolation=cv2.INTER_AREA)
    template = _template(round(radius / step, 1))
    if min(small.shape) < len(template):
        return None
    match = cv2.matchTemplate(small.astype(np.float32), template, cv2.TM_CCOEFF_NORMED)
    match = match * np.float32(sign) if sign else np.abs(match)
    _, best, _, (column, row) = cv2.minMaxLoc(match)
    if best < LEAST_MATCH:
        return None
    scale = np.array(part.shape[::-1]) / small.shape[::-1]
    spot = np.array([_vertex(match[row], column), _vertex(match[:, column], row)]) + len(template) // 2
    x, y = (spot + 0.5) * scale - 0.5 + (left, top)
    return complex(x, y)


def _vertex(values, best):
    """Where the parabola through a maximum and its neighbours has its vertex."""
    if best in (0, len(values) - 1):
        return float(best)
    before, here, after = (float(value) for value in values[best - 1 : best + 2])
    bend = before - 2 * here + after
    return best + (0.5 * (before - after) / bend if bend < 0 else 0.0)


def _template(radius):
    """A bright disc of that radius on even ground, float32 (m, m), its edge a pixel wide."""
    half = int(np.ceil((1 + RIM) * radius))
    offsets = np.arange(-half, half + 1)
    return np.clip(radius + 0.5 - np.hypot(offsets, offsets[:, None]), 0, 1).astype(np.float32)
