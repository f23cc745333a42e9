"""The pegs of a hub in frame after frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..checks import DetectionError
from .locate import locate_pegs

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import ArrayLike

    from ..targets import Hub
    from .measure import PegObservation


def track_pegs(
    frames: Iterable[ArrayLike],
    hub: Hub,
    *,
    previous: PegObservation | None = None,
    min_area: float | None = None,
    threshold: float | None = None,
) -> Iterator[PegObservation]:
    """Locate the pegs in frame after frame, the labels carried over.

    Parameters
    ----------
    frames : iterable of (height, width) uint8
    hub, previous, min_area, threshold
        As for `locate_pegs`; `previous` is for the first frame.

    Yields
    ------
    PegObservation

    Raises
    ------
    ValueError, DetectionError
        As `locate_pegs` does; the message names the frame, counted from 1.  To go on after it, call
        `locate_pegs` on the next frame with the last observation.
    """
    for number, frame in enumerate(frames, 1):
        try:
            previous = locate_pegs(frame, hub, previous=previous, min_area=min_area, threshold=threshold)
        except DetectionError as error:
            raise DetectionError(f"frame {number}: {error}") from error
        yield previous
