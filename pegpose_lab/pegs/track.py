"""The pegs of a hub in frame after frame."""

from ..checks import DetectionError
from .locate import locate_pegs


def track_pegs(frames, hub, *, previous=None, min_area=None, threshold=None):
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
