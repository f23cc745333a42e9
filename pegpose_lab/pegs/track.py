"""The pegs of a hub in one frame after another (tracking)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..checks import DetectionError
from .locate import locate_pegs

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import ArrayLike

    from ..patterns import RingPattern
    from ..targets import Hub
    from .measure import PegObservation


def track_pegs(
    frames: Iterable[ArrayLike],
    hub: Hub | RingPattern,
    *,
    radius_range: tuple[float, float] | None = None,
    previous: PegObservation | None = None,
    min_area: float | None = None,
    threshold: float | None = None,
) -> Iterator[PegObservation]:
    """Track the pegs: locate them in one frame after another and carry the labels over.

    Parameters
    ----------
    frames : iterable of (height, width) uint8
    hub, radius_range, previous, min_area, threshold
        As for `locate_pegs`; `previous` is for the first frame.

    Yields
    ------
    PegObservation

    Raises
    ------
    ValueError, DetectionError
        As `locate_pegs` does; the message names the frame, counted from 1.  To go on after it, call
        `locate_pegs` on the next frame with the last observation.

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
    for number, frame in enumerate(frames, 1):
        try:
            previous = locate_pegs(
                frame, hub, radius_range=radius_range, previous=previous, min_area=min_area, threshold=threshold
            )
        except DetectionError as error:
            raise DetectionError(f"frame {number}: {error}") from error
        yield previous
