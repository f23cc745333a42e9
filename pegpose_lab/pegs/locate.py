"""The pegs of a hub in one image, and the messages when something is missing."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ..checks import DetectionError, as_image
from ..patterns import RingPattern
from .candidates import _circles_of_parts
from .follow import _followed_hub
from .hidden import LEAST_MEASURED, _rings_with_a_gap
from .labels import _choose, _labellings, _nearest, _screw_places
from .measure import _measure
from .ring import _locate_ring
from .rings import _find_rings, _neighbours

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..targets import Hub
    from .measure import PegObservation


def locate_pegs(
    image: ArrayLike,
    hub: Hub | RingPattern,
    *,
    radius_range: tuple[float, float] | None = None,
    previous: PegObservation | None = None,
    min_area: float | None = None,
    threshold: float | None = None,
) -> PegObservation:
    """Find a hub's pegs, bore and screws (bright discs), or any ring of equal discs, and label them.

    Labels run clockwise on the screen (about the hub's z axis, away from the camera) from the gap with the
    first screw, as in Table 2; the paper's "anticlockwise" holds with y up.  Where the screws leave several
    labellings (with four pegs and opposite screws the image is the same after half a turn), `previous`
    decides: the labels are those with which the pegs move least relative to their middle.  Without it the first
    screw is the one further left in the image, of two equally far left the upper one.

    Of a hub of four or more pegs, one may be hidden or spoilt: the sizes, shapes and places of the others tell which.

    Of a `RingPattern` the places may be bright or dark, on any ground, and some may be empty.  Ellipses of like
    size, in the picture and its logarithm, vote for the pattern's image; a homography and one radius are then fitted to the
    edges of all discs together, which decides between competing edges, and each place is judged by its own.  Marks
    decide the labels, else `previous`; else place 1 is the one further left, and `turns` has the other possible ones.

    Parameters
    ----------
    image : (height, width) uint8
    hub : Hub or RingPattern
    radius_range : (r_min, r_max) px, optional
        Radii of a ring's discs; by default all that a ring in the picture can have, which takes longer.  Not used for a
        hub, whose bore gives the scale.
    previous : PegObservation, optional
        The same hub in the frame before.  Where its discs moved together by less than their radius, they are measured
        where they have moved to, without a search; what is not certain there (a disc that is not measured, or has
        another size or shape than its place asks for) is searched in the whole picture.  Labels hold
        up to turns of not quite half the angle between two equal labellings.
    min_area, threshold : float, optional
        For a hub, as for `segment`; `min_area` has to be below the area of a screw (px).  With one of them every frame is
        segmented and searched: `previous` then decides the labels only.

    Returns
    -------
    PegObservation

    Raises
    ------
    ValueError
        If an argument is unusable.
    DetectionError
        If a part is missing or cannot be measured (of four or more pegs one may be), screws fit more than one labelling, or the
        hub turned so far since `previous` that the labels cannot be carried over.  For a ring, if more than `max_missing`
        places are empty, or the picture shows none; the message says what was seen.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    >>> image = pl.render_hub(camera, cam_from_hub, hub, rng=0)
    >>> observation = pl.locate_pegs(image, hub)
    >>> observation.peg_centers.round().tolist()
    [[111.0, 119.0], [232.0, 55.0], [296.0, 176.0], [175.0, 240.0]]

    The same ring, described without screws, and with the bore that is the only thing in its middle:

    >>> ring = pl.RingPattern(4, pitch_radius=48.5, disc_radius=10.1)
    >>> observation = pl.locate_pegs(image, ring, radius_range=(12, 30))
    >>> observation.peg_centers.round().tolist(), observation.states[0]
    ([[111.0, 119.0], [232.0, 55.0], [296.0, 176.0], [175.0, 240.0]], 'measured')
    >>> observation.labelled_by, len(observation.turns)
    ('nothing', 4)
    """
    image = as_image(image)
    n = hub.n_places if isinstance(hub, RingPattern) else hub.n_pegs
    if previous is not None and np.shape(getattr(previous, "peg_centers", None)) != (n, 2):
        raise ValueError(f"previous is not a PegObservation of {n} pegs")
    if isinstance(hub, RingPattern):
        return _locate_ring(image, hub, radius_range, previous)
    if previous is not None and min_area is None and threshold is None:
        observation = _followed_hub(image, hub, previous)
        if observation is not None:
            return observation
    error, tried = None, []
    for circles, says_what in _circles_of_parts(image, min_area, threshold):
        tried.append(circles)
        try:
            return _locate(image, circles, hub, previous)
        except DetectionError as reason:
            if says_what:
                error = reason
    observation = _locate_hidden(image, tried, hub, previous)
    if observation is None:
        raise error
    return observation


def _locate(image, circles, hub, previous):
    """`locate_pegs` among some circles."""
    rings = _find_rings(circles, hub)
    if not rings:
        raise DetectionError(_missing_pegs(circles, hub))
    for ring in rings:
        observation = _labelled(image, circles, ring, hub, previous)
        if observation is not None:
            return observation
    raise DetectionError(_missing_screws(circles, rings[0], hub))


def _labelled(image, circles, ring, hub, previous):
    """The observation of a ring; None if no screws label it."""
    labellings = _labellings(image, circles, ring, hub)
    if not labellings:
        return None
    chosen = _choose(labellings, circles, previous)
    return _measure(image, circles, ring, chosen, hub, *_remaining(labellings, chosen, previous))


def _locate_hidden(image, tried, hub, previous):
    """The observation of a hub of four or more pegs one of which was not found in any of the sets of circles, or None."""
    if hub.n_pegs <= LEAST_MEASURED:
        return None
    for circles in tried:
        completed, rings = _rings_with_a_gap(circles, hub)
        for ring in rings:
            with suppress(DetectionError):
                observation = _labelled(image, completed, ring, hub, previous)
                if observation is not None:
                    return observation
    return None


def _remaining(labellings, chosen, previous):
    """What decided the labels, and the labellings (m, n_pegs) that remain, as indices into the chosen one."""
    if len(labellings) == 1 or previous is not None:
        by = "mark" if len(labellings) == 1 else "previous frame"
        return by, np.arange(len(chosen.pegs))[None]
    place = {int(peg): k for k, peg in enumerate(chosen.pegs)}
    turns = [[place[int(peg)] for peg in labelling.pegs] for labelling in labellings]
    return "nothing", np.array(sorted(turns))


# ---- what to say when something is missing ----


def _missing_pegs(circles, hub):
    """The message for an image without a ring."""
    counts = [min(len(_neighbours(circles, bore, hub)), hub.n_pegs) for bore in range(len(circles.radii))]
    best = max(counts, default=0)
    seen = f"found {len(circles.radii)} discs, among them at most {best} of {hub.n_pegs} pegs around a bore"
    if best == hub.n_pegs:
        seen += ", but not in a ring"
    return (
        f"{seen}; show the whole hub with bright pegs and bore, light it evenly, or give threshold and min_area; "
        "check the hub's measures"
    )


def _missing_screws(circles, ring, hub):
    """The message for a ring whose screws are not seen."""
    counts = []
    for shift in range(hub.n_pegs):
        places, radius = _screw_places(circles, ring, shift, hub)
        counts.append(sum(_nearest(place[None], radius, circles, ring) is not None for place in places))
    return (
        f"found {hub.n_pegs} of {hub.n_pegs} pegs and the bore, but {max(counts)} of {len(hub.screw_angles)} "
        "screws: the pegs cannot be labelled; clear the screws, or lower min_area below their area"
    )
