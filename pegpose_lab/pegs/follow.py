"""A hub near where it was in the frame before: its parts are measured where they have moved to, without a search."""

import numpy as np

from ..checks import DetectionError
from .labels import _screws_look_alike
from .measure import PegObservation, _measured_parts
from .moved import _disc_near, _motion

SCREW_REACH = 0.5  # of a screw's radius: how far it may lie from where the pegs' motion takes it


def _followed_hub(image, hub, previous):
    """The `PegObservation` of a hub that moved little; None where that is not certain, and the hub has to be searched.

    It is certain where the pegs' images moved together by less than a radius, all parts of the frame before are
    measured where that motion takes them, and the pegs have the sizes and shapes that follow from their places.
    """
    if not _has_all_parts(previous, hub):
        return None
    motion = _motion(image, previous.peg_centers, previous.peg_radii, np.ones(hub.n_pegs))
    if motion is None:
        return None
    a, b = motion
    places = a * (np.vstack([previous.peg_centers, previous.bore_center, previous.screw_centers]) @ (1, 1j)) + b
    radii = abs(a) * np.concatenate([previous.peg_radii, [previous.bore_radius], previous.screw_radii])
    located = np.column_stack([places.real, places.imag, radii])
    # screws are small, and deeper than the pegs: they may move otherwise by a part of a radius
    for screw in located[hub.n_pegs + 1 :]:
        place = _disc_near(image, screw[:2], screw[2], 1, SCREW_REACH)
        screw[:2] = screw[:2] if place is None else (place.real, place.imag)
    alike = sum(_screws_look_alike(shift, hub) for shift in range(hub.n_pegs))
    try:
        observation = _measured_parts(image, located, hub, "mark" if alike == 1 else "previous frame")
    except DetectionError:
        return None
    return observation if _has_all_parts(observation, hub) else None


def _has_all_parts(previous, hub):
    """Whether the frame before is a `PegObservation` of this hub with all parts measured."""
    return (
        isinstance(previous, PegObservation)
        and len(previous.screw_centers) == len(hub.screw_angles)
        and np.isfinite(previous.bore_sigma).all()
        and np.isfinite(previous.screw_sigmas).all()
        and np.isfinite(previous.peg_sigmas).all()
    )
