"""Rings that few ellipses agree on: two ellipses of like size give the pattern's affine image, the others vote."""

import cv2
import numpy as np

from .plane import _images

LIKE_SIZE = 1.45  # ratio of radii of two seeds of one ring: perspective, and competing edges of one disc
PROPORTION = 1.6  # ratio of the discs' radius in the picture to what pattern and distance of two seeds make of it
LOOSE, CLOSER, TIGHT = 0.16, 0.12, 0.08  # of the pitch radius: how near a seed lies to a place, step by step
SEED_OFF = 0.03  # of the pitch radius: distance of a seed from its place
SEED_SIZE = 0.12  # of a seed's radius
PRIOR = np.array([20, 20, 20, 20, 20, 20, 1 / 0.2**2, 1 / 0.2**2, 1 / 0.15**2], float)
"""What is known of a step: A and b less than 0.2, the vanishing line's coefficients about 0.2 per pitch radius, and the
radius 15 %."""
MOST_PAIRS = 150_000  # hypotheses that are looked at: pairs of seeds times pairs of places
CHUNK = 10_000  # of them that vote at a time: their arrays stay small
MOST_REFINED = 600  # hypotheses that are fitted to the seeds
MOST_TRIED = 16  # hypotheses that are returned
GOLDEN = 0.6180339887498949  # its multiples, modulo 1, fill the interval evenly
LARGEST_RATIO = 3.0  # of the axes of a circle's image


def _hypotheses(seeds, places, disc_radius, turns):
    """Homographies (m, 3, 3) from the pattern to the picture, and their votes (m,), the best first.

    `places` (n, 2) are relative to their middle, with mean distance 1 from it.  Of a symmetric pattern
    only one of the equal labellings is looked at.
    """
    if len(seeds) < 2:
        return np.empty((0, 3, 3)), np.empty(0)
    maps = _maps_of_pairs(seeds, places, disc_radius, turns)
    if len(maps) == 0:
        return maps, np.empty(0)
    votes = _Votes(seeds)
    parts = np.array_split(maps, len(maps) // CHUNK + 1)
    score = np.concatenate([votes.of(part, places, disc_radius, LOOSE)[0] for part in parts])
    maps = maps[_first(score, MOST_REFINED)]
    for reach in (LOOSE, LOOSE, CLOSER, TIGHT):
        _, nearest, weights = votes.of(maps, places, disc_radius, reach)
        maps = _drawn(maps, places, seeds, nearest, weights, disc_radius)
        maps = maps[_is_possible(maps, places)]
    score = votes.of(maps, places, disc_radius, TIGHT)[0]
    order = _first(score, len(maps))
    kept = order[_distinct(maps[order], places, disc_radius, turns)]
    return maps[kept], score[kept]


def _maps_of_pairs(seeds, places, disc_radius, turns):
    """The affine map of each pair of seeds at each pair of places, as far as sizes and distance allow.

    The mean shape of two ellipses is the image of a disc up to a turn; their distance gives turn and scale.
    """
    k = len(seeds)
    i, j = np.nonzero(~np.eye(k, dtype=bool))
    like = np.abs(np.log(seeds.radii[i] / seeds.radii[j])) < np.log(LIKE_SIZE)
    i, j = i[like], j[like]
    squares = seeds.shapes @ seeds.shapes.transpose(0, 2, 1)
    roots = _root((squares[i] + squares[j]) / 2)
    steps = np.linalg.solve(roots, (seeds.centers[j] - seeds.centers[i])[:, :, None])[:, :, 0] * disc_radius
    a, b = _pairs_of_places(len(places), turns)
    goals = places[b] - places[a]
    found = []
    for first, second, goal in zip(a, b, goals, strict=True):
        ratio = np.linalg.norm(steps, axis=1) / np.linalg.norm(goal)
        fits = np.flatnonzero(np.abs(np.log(ratio)) < np.log(PROPORTION))
        found.append(_map_pair(seeds, places, i[fits], j[fits], roots[fits], steps[fits], first, second))
        if sum(map(len, found)) > MOST_PAIRS:
            break
    return np.concatenate(found)


def _map_pair(seeds, places, i, j, roots, steps, first, second):
    """Affine maps (m, 3, 3) that take place `first` to seed i and `second` to seed j."""
    turn = steps @ (1, 1j) / ((places[second] - places[first]) @ (1, 1j))
    spin = np.stack([turn.real, -turn.imag, turn.imag, turn.real], axis=1).reshape(-1, 2, 2)
    linear = roots @ spin / np.linalg.norm(spin[:, 0], axis=1)[:, None, None]
    length = np.linalg.norm(seeds.centers[j] - seeds.centers[i], axis=1)
    now = np.linalg.norm(linear @ (places[second] - places[first]), axis=1)
    linear *= (length / now)[:, None, None]
    middle = (seeds.centers[i] + seeds.centers[j]) / 2 - linear @ ((places[first] + places[second]) / 2)
    maps = np.tile(np.eye(3), (len(i), 1, 1))
    maps[:, :2, :2], maps[:, :2, 2] = linear, middle
    return maps


def _pairs_of_places(n, turns):
    """Ordered pairs of places, one of those that a turn takes into each other, mixed: the first ones hold all places."""
    a, b = np.nonzero(~np.eye(n, dtype=bool))
    names = np.min([turn[a] * n + turn[b] for turn in turns], axis=0)
    first = names == a * n + b
    mixed = np.argsort(np.arange(first.sum()) * GOLDEN % 1, kind="stable")
    return a[first][mixed], b[first][mixed]


def _root(squares):
    """Symmetric roots of positive matrices (m, 2, 2)."""
    s = np.sqrt(np.linalg.det(squares))[:, None, None]
    trace = np.trace(squares, axis1=1, axis2=2)[:, None, None]
    return (squares + s * np.eye(2)) / np.sqrt(trace + 2 * s)


class _Votes:
    """Counts the seeds near a map's places, by a picture of the nearest seed."""

    CELLS = 800  # along the longer side of the picture of nearest seeds

    def __init__(self, seeds):
        self.seeds, self.low = seeds, seeds.centers.min(axis=0)
        size = np.ptp(seeds.centers, axis=0)
        self.cell = max(size.max() / self.CELLS, seeds.radii.min() / 4)
        margin = 0.3 * size.max() / self.cell + 8  # places may lie beyond the outermost seed
        self.low = self.low - margin * self.cell
        shape = np.ceil(size / self.cell + 2 * margin).astype(int) + 1
        spots = ((seeds.centers - self.low) / self.cell).round().astype(int)
        empty = np.full(shape[::-1], 255, np.uint8)
        empty[spots[:, 1], spots[:, 0]] = 0
        labels = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)[1]
        rows = np.zeros(labels.max() + 1, int)
        order = np.arange(len(seeds))[::-1]  # of two seeds in one cell the better one
        rows[labels[spots[order, 1], spots[order, 0]]] = order
        self.nearest = rows[labels]

    def of(self, maps, places, disc_radius, reach):
        """Scores (m,) of maps, the nearest seeds (m, n) and the weight (m, n) with which they count."""
        spots, jacobians = _images(maps, places)
        scale = np.sqrt(np.abs(np.linalg.det(jacobians)))
        cells = ((spots - self.low) / self.cell).round().astype(int)
        inside = ((cells >= 0) & (cells < self.nearest.shape[::-1])).all(axis=2)
        cells = np.clip(cells, 0, np.array(self.nearest.shape[::-1]) - 1)
        nearest = self.nearest[cells[:, :, 1], cells[:, :, 0]]
        apart = np.linalg.norm(self.seeds.centers[nearest] - spots, axis=2) / (reach * scale)
        size = np.log(self.seeds.radii[nearest] / (disc_radius * scale)) / np.log(PROPORTION)
        weights = np.maximum(1 - apart**2, 0) * np.maximum(1 - size**2, 0.1) * self.seeds.shares[nearest]
        weights *= inside
        return weights.sum(axis=1), nearest, weights


def _drawn(maps, places, seeds, nearest, weights, disc_radius):
    """The maps H (I + D) drawn to the seeds near the places; D moves a place q by A q + b - q (c . q).

    The seeds' radii r tell the vanishing line c: log r grows by tr A / 2 - 3/2 c . q, and by what all discs are larger
    than the pattern says, the ninth unknown.
    """
    m, n = weights.shape
    spots, jacobians = _images(maps, places)
    x, y = places.T
    zero, one = np.zeros(n), np.ones(n)
    moves = np.array([[x, y, zero, zero, one, zero, -x * x, -x * y], [zero, zero, x, y, zero, one, -x * y, -y * y]])
    scale = np.sqrt(np.abs(np.linalg.det(jacobians)))
    design = np.einsum("mnij,jkn->mnik", jacobians, moves) / scale[:, :, None, None] / SEED_OFF
    goal = (seeds.centers[nearest] - spots) / scale[:, :, None] / SEED_OFF
    sizes = np.array([one / 2, zero, zero, one / 2, zero, zero, -1.5 * x, -1.5 * y, one]).T / SEED_SIZE
    log_radius = np.log(seeds.radii[nearest] / (scale * disc_radius)) / SEED_SIZE
    normal = np.zeros((m, 9, 9))
    normal[:, :8, :8] = np.einsum("mn,mnik,mnil->mkl", weights, design, design)
    normal += np.einsum("mn,nk,nl->mkl", weights, sizes, sizes) + np.diag(PRIOR)
    right = np.einsum("mn,mn,nk->mk", weights, log_radius, sizes)
    right[:, :8] += np.einsum("mn,mnik,mni->mk", weights, design, goal)
    right[:, 6:8] -= PRIOR[6:8] * maps[:, 2, :2]
    steps = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
    change = np.tile(np.eye(3), (m, 1, 1))
    change[:, :2, :2] += steps[:, :4].reshape(m, 2, 2)
    change[:, :2, 2] += steps[:, 4:6]
    change[:, 2, :2] += steps[:, 6:8]
    maps = maps @ change
    return maps / maps[:, 2:, 2:]


def _is_possible(maps, places):
    """Whether the maps show the front of the plane, everywhere, and are not too flat."""
    depth = places @ maps[:, 2, :2].T + 1
    jacobians = _images(maps, np.zeros((1, 2)))[1][:, 0]
    singular = np.linalg.svd(jacobians, compute_uv=False)
    upright = (np.linalg.det(jacobians) > 0) & (depth.min(axis=0) > 0.3)
    return upright & (singular[:, 0] < LARGEST_RATIO * singular[:, 1])


def _first(score, count):
    """Indices of the largest scores, first come first where they are equal but for last digits."""
    return np.argsort(-score.round(6), kind="stable")[:count]


def _distinct(maps, places, disc_radius, turns):
    """Indices of the maps, without those that put all places where a better one has them, turned or not."""
    spots, jacobians = _images(maps, places)
    scale = np.sqrt(np.linalg.det(jacobians)).mean(axis=1) * disc_radius
    kept, seen = [], np.empty((0, *places.shape))
    for i in range(len(maps)):
        if len(kept) == 0 or (np.abs(seen - spots[i]).max(axis=(1, 2)) > 0.5 * scale[i]).all():
            kept.append(i)
            seen = np.concatenate([seen, [spots[i][turn] for turn in turns]])
        if len(kept) == MOST_TRIED:
            break
    return kept
