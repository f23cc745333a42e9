"""The rings of a picture: hypotheses of the seeds, drawn to the edges and judged by them."""

import numpy as np

from .consensus import _hypotheses
from .edges import _rims
from .judge import WORTH, _judged, _own
from .plane import _fit_plane, _fit_to_ellipses, _images, _is_sane, _Plane, _starts
from .seeds import _Seeds

CLEAR = 0.85  # value of a ring, and share of all its rims, that leaves little to look for
HOPELESS = 0.6  # of the best votes: after a clear ring, others with less are no rivals
FOLLOWED_REACHES = (0.8, 0.5, 0.3, 0.15, 0.08)  # of the radius: a frame moves a disc less than that, or is searched;
MOVED_REACHES = FOLLOWED_REACHES[3:]  # and where its motion is known
FOLLOWED_SIZE = 0.1  # change of a radius, relative to the ring, that is none of the same edge
MOST_FITTED = 8  # hypotheses that are drawn to the edges
LAST_REACHES = (0.12, 0.08, 0.08, 0.08)  # of the radius, for the ring that is returned
LOST_BY_POLISHING = 0.05  # score, of chance
SAME_RING = 0.5  # of the discs' radius: rings whose places are nearer are one


def _rings(field, seeds, design, max_missing):
    """The rings of a picture, the best first, each once."""
    maps, votes = _hypotheses(seeds, design.places, design.radius, design.turns)
    found = []
    for homography, vote in zip(maps[:MOST_FITTED], votes[:MOST_FITTED], strict=True):
        if found and vote < HOPELESS * votes[0] and max(ring.values.mean() for ring in found) > CLEAR:
            break
        found += _versions(field, seeds, design, homography)
    found.sort(key=lambda ring: -ring.rank(max_missing))
    rings = _without_twins(found, design)
    return [_polished(field, seeds, design, max_missing, rings[0]), *rings[1:]] if rings else []


def _polished(field, seeds, design, max_missing, ring):
    """The ring drawn once more to the edges of the places that are there, if that makes it no worse."""
    used = ~ring.empty
    fit = _fit_plane(field, ring.plane, design.places, design.signs, design.radius, LAST_REACHES, used)
    again = ring if fit is None else _judged(field, seeds, design, *fit)
    return again if again.rank(max_missing) > ring.rank(max_missing) - LOST_BY_POLISHING else ring


def _versions(field, seeds, design, homography):
    """A hypothesis drawn to the edges from up to three radii, drawn to ellipses, and as the seeds have it."""
    plane = _Plane(homography, design.radius)
    found = []
    for start in _starts(field, plane, design.places, design.signs):
        fit = _fit_plane(field, start, design.places, design.signs, design.radius)
        if fit is not None:
            found.append(_judged(field, seeds, design, *fit))
            if found[-1].shares.min() > CLEAR:
                return found
    if _is_sane(plane, plane.outlines(design.places)):
        found += _as_ellipses_say(field, seeds, design, plane)
    return found


def _as_ellipses_say(field, seeds, design, plane):
    """Rings of a hypothesis whose discs have other rims than circles in a plane: cut ones, and those at other depths.

    One is drawn to the ellipses at its places, the other has only their size.
    """
    own = _own(field, seeds, plane, design.places, np.ones(len(design.places)), design.signs)
    if own.held.sum() < 2 * WORTH:
        return []
    drawn = _fit_to_ellipses(plane, design.places, own.centers, own.shapes, own.held, design.radius)
    areas = np.linalg.det(own.shapes) / np.linalg.det(plane.ellipses(design.places)[1])
    as_it_is = _Plane(plane.homography, plane.radius * float(np.sqrt(np.median(np.abs(areas[own.held > 0])))))
    found = []
    for version in (drawn, as_it_is):
        if version is not None:
            outlines = version.outlines(design.places)
            rims, signs = _rims(field, outlines, design.signs, 0.15)
            found.append(_judged(field, seeds, design, version, rims, rims.offsets * outlines.px, signs))
    return found


def _without_twins(rings, design):
    """The rings without those whose places are those of a better one, turned or not."""
    kept, seen = [], []
    for ring in rings:
        spots, jacobians = _images(ring.plane.homography, design.places)
        reach = SAME_RING * ring.plane.radius * np.sqrt(np.linalg.det(jacobians).mean())
        if all(np.abs(spots - other).max() > reach for other in seen):
            kept.append(ring)
            seen += [spots[turn] for turn in design.turns]
    return kept


def _followed(field, design, max_missing, previous, reaches):
    """The ring of the frame before where it moved little: all rims that were seen are clear at once; None elsewhere."""
    homography = previous.homography @ np.linalg.inv(design.normal_from_pattern)
    plane = _Plane(homography / homography[2, 2], design.radius)
    used = np.array([state == "measured" for state in previous.states])
    if used.sum() < min(3, len(used)) or not _is_sane(plane, plane.outlines(design.places)):
        return None
    size = np.sqrt(np.linalg.det(plane.ellipses(design.places)[1]))[used]
    radius = plane.radius * float(np.median(np.asarray(previous.peg_radii)[used]) / np.median(size))
    start = _Plane(plane.homography, radius)
    fit = _fit_plane(field, start, design.places, design.signs, radius, reaches, used)
    if fit is None or abs(np.log(fit[0].radius / radius)) > FOLLOWED_SIZE:
        return None
    ring = _judged(field, _no_seeds(), design, *fit)
    return ring if ring.shares[used].min() > CLEAR and not ring.excess(max_missing) else None


def _no_seeds():
    return _Seeds(np.empty((0, 2)), np.empty((0, 2, 2)), *np.empty((3, 0)))
