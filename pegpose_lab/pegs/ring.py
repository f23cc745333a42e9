"""A ring of a given pattern in one picture: `locate_pegs` for a `RingPattern`."""

from dataclasses import replace

import numpy as np

from ..checks import REMAP_LIMIT, DetectionError, as_number
from ..flags import Flag
from .design import SIGNS, _design
from .edges import _field, _field_near, _refined
from .judge import WORTH, _agreement
from .measure import PegObservation
from .moved import _motion
from .places import _by_grey_values, _by_own_rim, _measured_places, _own_rims, _residual
from .search import FOLLOWED_REACHES, MOVED_REACHES, _followed, _no_seeds, _rings
from .seeds import _seeds
from .turns import _label, _rotation

LEAST_RADIUS = 3.0  # px: smaller discs have too few edge points for an ellipse
LARGEST_RING = 0.75  # of the picture's shorter side: pitch radius of a ring that is looked for without a radius range
SMALLEST_RING = 0.05
LEAST_VALUE = 0.45  # mean over the places that are there: less is what texture gives
CLEAR_VALUE, CLEAR_VISIBLE = 0.65, 0.75  # mean value and visible share of the places; below these the ring is flagged
MANY = 7  # places: their centres alone tell a ring, since four determine a homography
MOST_SURE = 0.6  # of the places that are there: so many have to show a disc, as a part of one counts half
BORE_REACHES = (0.5, 0.3, 0.15)  # of the bore's radius: it may lie deeper than the places, and so look shifted
BORE_OFF = 0.6  # of the bore's radius: by how much
REGION = 2.5  # of the discs' radius: part of the picture round the ring of the frame before that is looked at
RIVAL = 0.85  # of the best ring's score
PROPORTION = 0.15  # of the radius: more than what a marking by hand or a chamfer changes
MISFIT = 2.5  # ratio of the residual to that of single ellipses, and
LEAST_MISFIT = 0.3, 0.012  # px, and part of the radius: a residual below both is no misfit
MARK_SIGMA = 0.5  # px, of a mark that is not fitted as a disc: it is found on a grid of places
STEEP = 2.5  # ratio of the axes of a circle's image


def _locate_ring(image, pattern, radius_range, previous):
    """The `PegObservation` of a ring."""
    if max(image.shape) > REMAP_LIMIT:
        raise ValueError(f"image has shape {image.shape}; a ring is looked for in up to {REMAP_LIMIT} px: cut it out")
    design = _design(pattern)
    low, high = _radius_range(image, pattern, radius_range)
    if getattr(previous, "homography", None) is not None:
        observation = _followed_ring(image, design, pattern, previous)
        if observation is not None:
            return observation
    field = _field(image)
    seeds = _seeds(image, field, (low, high), pattern.polarity)
    if len(seeds) < 2:
        raise DetectionError(_nothing_seen(seeds, pattern, (low, high)))
    rings = _rings(field, seeds, design, pattern.max_missing)
    if not rings:
        raise DetectionError(_nothing_seen(seeds, pattern, (low, high)))
    _demand_ring(rings[0], seeds, pattern)
    return _observed(image, field, seeds, rings, design, pattern, previous)


def _followed_ring(image, design, pattern, previous):
    """The ring near the one of the frame before, in the part of the picture round that; None where it is not clear."""
    used = np.array([state == "measured" for state in previous.states])
    motion = _motion(image, previous.peg_centers[used], previous.peg_radii[used], design.signs[used])
    before, reaches = (previous, FOLLOWED_REACHES) if motion is None else (_moved(previous, *motion), MOVED_REACHES)
    reach = REGION * np.max(before.peg_radii)
    around = np.vstack([before.peg_centers, *(before.screw_centers if len(before.screw_centers) else ())])
    reach = max(reach, before.bore_radius - np.ptp(before.peg_centers, axis=0).max() / 2 + reach / 2)
    low = np.clip(np.floor(around.min(axis=0) - reach), 0, None).astype(int)
    high = np.ceil(around.max(axis=0) + reach).astype(int)
    part = np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]])
    if min(part.shape) < reach:
        return None
    before = _moved(before, 1.0, -complex(*low))
    centers = np.vstack([before.peg_centers, before.screw_centers, before.bore_center])
    radii = np.concatenate([before.peg_radii, before.screw_radii, [before.bore_radius]])
    lost = motion is None or not np.isfinite(before.screw_sigmas).all()  # marks may be anywhere
    field = _field(part) if lost else _field_near(part, centers, REGION / 1.5 * radii + 4)
    ring = _followed(field, design, pattern.max_missing, before, reaches)
    if ring is None:
        return None
    return _moved(_observed(part, field, _no_seeds(), [ring], design, pattern, before), 1.0, complex(*low))


def _moved(observation, a, b):
    """An observation after a similarity z -> a z + b of the places x + i y."""
    matrix = np.array([[a.real, -a.imag, b.real], [a.imag, a.real, b.imag], [0, 0, 1]])
    homography, size = matrix @ observation.homography, abs(a)
    names = "peg_centers", "screw_centers", "bore_center", "hub_center"
    return replace(
        observation,
        **{name: getattr(observation, name) @ matrix[:2, :2].T + matrix[:2, 2] for name in names},
        peg_radii=size * observation.peg_radii,
        screw_radii=size * observation.screw_radii,
        bore_radius=size * observation.bore_radius,
        homography=homography / homography[2, 2],
    )


def _radius_range(image, pattern, radius_range):
    """The discs' radii to look for, px; by default all that a ring in the picture can have."""
    if radius_range is None:
        ratio, side = pattern.disc_radius / pattern.scale, min(image.shape)
        high = max(LARGEST_RING * side * ratio, LEAST_RADIUS + 1)
        return max(LEAST_RADIUS, SMALLEST_RING * side * ratio), high
    try:
        low, high = radius_range
    except (TypeError, ValueError) as error:
        raise ValueError(f"radius_range is {radius_range!r}; expected a pair (r_min, r_max) in px") from error
    low = as_number(low, "radius_range[0]", 0, exclusive=True)
    return low, as_number(high, "radius_range[1]", low)


def _demand_ring(ring, seeds, pattern):
    """Raise unless a ring is there, as far as places may be missing."""
    n, there = pattern.n_places, ring.values[~ring.empty]
    best = f"the best ring shows {len(there)} of {n} places"
    if ring.excess(pattern.max_missing):
        raise DetectionError(
            f"found {len(seeds)} {_kind(pattern)}discs, but no ring of this pattern: {best}, and "
            f"{pattern.max_missing} may be missing; check n, polarity and proportions, or raise max_missing"
        )
    if len(there) < 2 or there.mean() < LEAST_VALUE:
        raise DetectionError(
            f"found {len(seeds)} {_kind(pattern)}discs, but no ring of this pattern: {best}, with rims that are "
            f"{there.mean() if len(there) else 0:.0%} clear; check n, polarity and proportions, or show the whole ring"
        )


def _demand_discs(places, ring, pattern):
    """Raise if most of the ring's places do not show discs of the ring: texture has rims everywhere."""
    states = places.states
    count = {state: int((states == state).sum()) for state in ("measured", "partial", "contradicted", "missing")}
    there = pattern.n_places - count["missing"]
    clear = ring.values[states != "missing"].mean() >= CLEAR_VALUE
    sure = count["measured"] + (0 if there < MANY else int(places.cut.sum()))
    sure += 0.5 * (count["partial"] + count["contradicted"]) if clear else 0
    if sure < MOST_SURE * there or (there <= 3 and count["contradicted"]):
        raise DetectionError(
            f"no ring of this pattern: of {pattern.n_places} places of the best one {count['measured']} show a disc, "
            f"{count['partial']} part of one, {count['contradicted']} another rim; check n, polarity and proportions"
        )


def _kind(pattern):
    return "" if pattern.polarity == "either" else f"{pattern.polarity} "


def _nothing_seen(seeds, pattern, radius_range):
    """The message for a picture with hardly a disc."""
    return (
        f"found {len(seeds)} {_kind(pattern)}discs with radii of {radius_range[0]:.0f} to {radius_range[1]:.0f} px, and no "
        f"two that lie like places of this ring of {pattern.n_places}; check polarity and radius_range"
    )


def _observed(image, field, seeds, rings, design, pattern, previous):
    """Measure the best ring and label it."""
    ring = rings[0]
    places = _measured_places(image, field, ring, design)
    _demand_discs(places, ring, pattern)
    bore_center, bore_radius, bore_sigma, bore_off, base = _bore(image, field, ring, design)
    labels = _label(field, ring, design, pattern, previous, base)
    turn, marks = labels.turn, _measured_marks(image, labels, pattern)
    residual, ratio = _residual(ring, design, places.states)
    normal_from_pattern = design.normal_from_pattern
    homography = ring.plane.homography @ _rotation(design, turn) @ normal_from_pattern
    states = tuple(str(state) for state in places.states[turn])
    rivals = [other for other in rings[1:] if _is_rival(other, ring, pattern)]
    flags = _flags_of_places(states) + _flags_of_marks(labels, pattern, bore_sigma)
    flags += _flags_of_ring(ring, places.visible[places.states != "missing"], rivals, design, residual, ratio, bore_off)
    flags += _further_discs(ring, seeds, design)
    middle = homography @ (0, 0, 1)
    sigmas = np.sqrt(np.diagonal(places.covariances, axis1=1, axis2=2))
    return PegObservation(
        peg_centers=places.centers[turn],
        peg_radii=places.radii[turn],
        peg_sigmas=sigmas[turn],
        hub_center=middle[:2] / middle[2],
        screw_centers=marks[0],
        screw_radii=marks[2],
        screw_sigmas=np.sqrt(np.diagonal(marks[1], axis1=1, axis2=2)),
        bore_center=bore_center,
        bore_radius=bore_radius,
        bore_sigma=bore_sigma,
        flags=tuple(flags),
        peg_covariances=places.covariances[turn],
        states=states,
        visible=places.visible[turn],
        homography=homography / homography[2, 2],
        residual=residual,
        residual_over_sigma=ratio,
        labelled_by=labels.labelled_by,
        turns=np.array(labels.turns),
        rivals=tuple(_homography_of(other, normal_from_pattern) for other in rivals),
    )


def _measured_marks(image, labels, pattern):
    """Centres (m, 2), covariances (m, 2, 2) and radii (m,) of the marks, by the fit to the grey values where it holds."""
    sigmas = np.where(labels.seen > 0, MARK_SIGMA, np.inf)
    covariances = np.zeros((len(sigmas), 2, 2))
    covariances[:, 0, 0] = covariances[:, 1, 1] = sigmas**2
    found = [labels.marks[0].copy(), covariances, np.sqrt(np.abs(np.linalg.det(labels.marks[1])))]
    signs = np.array([SIGNS[mark.polarity] for mark in pattern.marks])
    return _by_grey_values(image, found, np.where(labels.seen >= WORTH, "measured", "missing"), signs, most=0)


def _homography_of(ring, normal_from_pattern):
    homography = ring.plane.homography @ normal_from_pattern
    return homography / homography[2, 2]


def _is_rival(other, ring, pattern):
    """Whether another ring is as good as one that would be accepted."""
    there = ~other.empty
    return other.score > RIVAL * ring.score and not other.excess(pattern.max_missing) and there.any()


def _bore(image, field, ring, design):
    """Centre, radius and sigma of the bore, px, how much its radius is off, and where it is, where the ring's plane has it
    and how much larger it is: a bore may lie deeper than the places.  Without a bore the ring's middle.
    """
    if design.bore is None:
        return ring.plane.ellipses(np.zeros((1, 2)))[0][0], 0.0, np.full(2, np.inf), 0.0, None
    place, ratio, sign = design.bore
    centers, shapes = ring.plane.ellipses(np.array([place]), ring.plane.radius * np.array([ratio]))
    own = _refined(field, centers, shapes, np.array([sign]), BORE_REACHES)
    expected = float(np.sqrt(np.linalg.det(shapes[0])))
    if _agreement(centers, shapes, *own[:2], BORE_OFF)[0] * own[2][0] < WORTH:
        return centers[0], expected, np.full(2, np.inf), 0.0, None
    found = _by_own_rim(own, _own_rims(field, *own[:2], own[4]), centers, np.zeros(1))
    found = _by_grey_values(image, found, np.array(["measured"]), own[4])
    larger = float(found[2][0]) / expected
    base = found[0][0], centers[0], larger
    return found[0][0], float(found[2][0]), np.sqrt(np.diagonal(found[1][0])), larger - 1, base


def _flags_of_places(states):
    """A flag for each place that is not simply there."""
    flags = []
    for k, state in enumerate(states, 1):
        if state == "missing":
            flags.append(Flag("place-missing", f"peg {k}: the place is empty, or its rim cannot be seen"))
        elif state == "contradicted":
            flags.append(Flag("place-contradicted", f"peg {k}: the rim there is not that of a disc of this ring"))
    return flags


def _flags_of_marks(labels, pattern, bore_sigma):
    """Flags for bore and marks that are not seen, and for labels that nothing decides."""
    flags = []
    if pattern.bore is not None and not np.isfinite(bore_sigma).all():
        flags.append(Flag("bore-not-measured", "bore: no rim where the ring has its bore"))
    for k, seen in enumerate(labels.seen, 1):
        if seen < WORTH:
            flags.append(Flag("screw-not-measured", f"mark {k}: not seen where the labels have it"))
    if len(labels.turns) > 1:
        text = f"{len(labels.turns)} labellings are equally possible; a mark or the previous frame would decide"
        flags.append(Flag("labels-undecided", text))
    return flags


def _flags_of_ring(ring, visible, rivals, design, residual, ratio, bore_off):
    """Flags for a ring that may be another one."""
    flags = []
    there = ~ring.empty
    if rivals:
        flags.append(Flag("rival-ring", f"{len(rivals)} other rings fit the pattern nearly as well"))
    off = ring.plane.radius / design.radius - 1
    if max(abs(off), abs(bore_off)) > PROPORTION:
        text = f"the discs are {off:+.0%} off the pattern's radius, the bore {bore_off:+.0%} off its own"
        flags.append(Flag("other-proportions", f"{text}; another edge of the part, or another part"))
    if ring.values[there].mean() < CLEAR_VALUE or visible.mean() < CLEAR_VISIBLE or there.sum() < 3:
        text = f"{there.sum()} places, their rims {ring.values[there].mean():.0%} clear"
        flags.append(Flag("weak-ring", f"the ring rests on little: {text}"))
    radius = np.sqrt(np.linalg.det(ring.plane.ellipses(design.places)[1])).mean()
    if residual > max(LEAST_MISFIT[0], LEAST_MISFIT[1] * radius) and ratio > MISFIT:
        text = f"{residual:.2f} px, {ratio:.1f} times what single ellipses leave"
        flags.append(Flag("ring-misfit", f"the rims are not those of equal discs in one plane: {text}"))
    if ring.plane.tilt > STEEP:
        flags.append(Flag("steep-view", f"a circle looks like an ellipse of axis ratio {ring.plane.tilt:.1f}"))
    return flags


def _further_discs(ring, seeds, design):
    """A flag where like discs stand on the ring between its places: the pattern may have too few."""
    inverse = np.linalg.inv(ring.plane.homography)
    full = seeds.centers @ inverse[:, :2].T + inverse[:, 2]
    spots = full[:, :2] / full[:, 2:]
    reach = np.linalg.norm(design.places, axis=1)
    on_ring = np.abs(np.linalg.norm(spots, axis=1) - np.median(reach)) < ring.plane.radius
    apart = np.linalg.norm(spots[:, None] - design.places, axis=2).min(axis=1) > 1.5 * ring.plane.radius
    size = np.sqrt(np.linalg.det(ring.plane.ellipses(spots)[1]))
    like = (np.abs(np.log(seeds.radii / size)) < 0.2) & (seeds.shares > 0.85)
    count = int((on_ring & apart & like & (reach.max() < 1.2 * reach.min())).sum())
    if count == 0:
        return []
    return [
        Flag("further-disc", f"{count} more like discs lie on the ring, between its places; check n and the angles")
    ]
