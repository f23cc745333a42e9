"""The pegs of a hub in one frame after another (tracking)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..checks import DetectionError
from ..flags import Flag
from ..patterns import RingPattern
from .design import _design
from .labels import CLEAR_TURN, _screws_look_alike
from .locate import locate_pegs

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import ArrayLike

    from ..targets import Hub
    from .measure import PegObservation


@dataclass(frozen=True)
class LostFrame:
    """A frame in which the hub was not found; it counts as false.

    Attributes
    ----------
    number : int
        Of the frame, counted from 1.
    reason : str
        What `locate_pegs` said.

    Examples
    --------
    >>> lost = LostFrame(3, "found 0 discs")
    >>> bool(lost), lost.number, lost.reason
    (False, 3, 'found 0 discs')
    """

    number: int
    reason: str

    def __bool__(self) -> bool:
        return False


def largest_turn(equal_labellings: int) -> float:
    r"""Largest turn, rad, of a hub from one frame to the next over which its labels are carried.

    A turn by an angle a moves the pegs by :math:`2 R \sin(a / 2)`, and the next labelling of m equal ones, as much the other
    way, by :math:`2 R \sin(\pi / m - a / 2)`: the labels are carried while the first is less than 0.8 of the second.
    A turn beyond :math:`2 \pi / m` less that limit is taken for one in the other direction.

    Parameters
    ----------
    equal_labellings : int
        2 for opposite screws on four pegs; 1 if the screws or marks decide, and no turn is too large.

    Returns
    -------
    float

    Examples
    --------
    >>> round(float(np.degrees(largest_turn(2))), 1), round(float(np.degrees(largest_turn(4))), 1)
    (77.3, 39.7)
    """
    if equal_labellings == 1:
        return float(np.pi)
    apart = np.pi / equal_labellings
    return float(2 * np.arctan2(CLEAR_TURN * np.sin(apart), 1 + CLEAR_TURN * np.cos(apart)))


def track_pegs(
    frames: Iterable[ArrayLike],
    hub: Hub | RingPattern,
    *,
    radius_range: tuple[float, float] | None = None,
    previous: PegObservation | None = None,
    min_area: float | None = None,
    threshold: float | None = None,
) -> Iterator[PegObservation | LostFrame]:
    """Track the pegs: locate them in one frame after another and carry the labels over.

    A frame in which the hub is not found gives a `LostFrame`, and the hub is searched again in the next.  Labels that
    several turns leave open are carried from the last frame in which it was found, however often it turns: from one such
    frame to the next by `largest_turn` at most (77 degrees, for opposite screws on four pegs).  A larger turn is not told
    from a smaller one in the other direction; over lost frames the labels have the flag "labels-over-gap".  Where the
    turn is so near to half-way that it cannot be told, the labels begin anew, with the flag "labels-undecided".

    Parameters
    ----------
    frames : iterable of (height, width) uint8
    hub, radius_range, previous, min_area, threshold
        As for `locate_pegs`; `previous` is for the first frame.

    Yields
    ------
    PegObservation or LostFrame
        One for each frame.

    Raises
    ------
    ValueError
        If an argument or a frame is unusable.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    >>> image = pl.render_hub(camera, cam_from_hub, hub, rng=0)
    >>> turn = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, 0.1]))
    >>> frames = [image, pl.render_hub(camera, cam_from_hub * turn, hub, rng=1)]
    >>> [observation.peg_centers[0].round().tolist() for observation in pl.track_pegs(frames, hub)]
    [[111.0, 119.0], [114.0, 110.0]]
    """
    options = {"radius_range": radius_range, "min_area": min_area, "threshold": threshold}
    last = 0  # the frame in which it was last found
    for number, frame in enumerate(frames, 1):
        try:
            observation = _next(frame, hub, previous, options)
        except DetectionError as error:
            yield LostFrame(number, str(error))
            continue
        if previous is not None and last < number - 1 and observation.labelled_by == "previous frame":
            observation = _flagged(observation, "labels-over-gap", (
                f"labels were carried over {number - 1 - last} lost frames: they are right if the hub turned by less than "
                f"{np.degrees(largest_turn(_equal_labellings(hub))):.0f} degrees meanwhile"
            ))  # fmt: skip
        previous, last = observation, number
        yield observation


def _next(frame, hub, previous, options):
    """The observation with the labels of the frame before; where these cannot be told, labelled anew."""
    try:
        return locate_pegs(frame, hub, previous=previous, **options)
    except DetectionError as error:
        if previous is None:
            raise
        observation = locate_pegs(frame, hub, **options)
        return _flagged(observation, "labels-undecided", f"labels begin anew: {error}")


def _equal_labellings(hub):
    """How many turns of the hub, or of the ring without its marks, look the same."""
    if isinstance(hub, RingPattern):
        return len(_design(hub).turns)
    return sum(_screws_look_alike(shift, hub) for shift in range(hub.n_pegs))


def _flagged(observation, code, text):
    return replace(observation, flags=(*observation.flags, Flag(code, text)))
