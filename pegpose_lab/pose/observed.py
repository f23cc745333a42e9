"""What was observed of a hub or a ring, as discs with the information about their images."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import CalibrationError, as_points
from ..patterns import RingPattern
from .discs import _as_radii
from .fit import Discs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..pegs import PegObservation
    from ..targets import Hub

LEAST_PEGS = 3
"""Three discs determine the six numbers of a pose."""

LEAST_SIGMA = 1e-6
"""px: what rounding leaves of a sigma that is stated as 0, as of simulated pegs without noise."""

OTHER_SIGMA = 1.0
"""px, of the bore and the screws: their edges may be found by the Hough transform only, and their places on a part differ
by some tenths of a millimetre.  Seen from the wrong one of a plane's two poses, they are off by several px."""


def observed_discs(observation: PegObservation, hub: Hub | RingPattern) -> tuple[Discs, Discs, NDArray[np.bool_], bool]:
    """The pegs that were measured, all pegs, which are used (n,), and whether their sigmas are known.

    Raises
    ------
    ValueError
        If the observation is unusable.
    CalibrationError
        If fewer than `LEAST_PEGS` were measured.
    """
    ring = isinstance(hub, RingPattern)
    n = hub.n_places if ring else hub.n_pegs
    places = np.column_stack([hub.places, np.zeros(n)]) if ring else hub.peg_centers
    if not hasattr(observation, "peg_centers"):  # such as a `LostFrame`
        raise ValueError(f"observation is {type(observation).__name__}; expected a PegObservation")
    centers = as_points(observation.peg_centers, 2, "observation.peg_centers")
    if len(centers) != n:
        raise ValueError(f"observation.peg_centers has {len(centers)} rows; expected one for each peg: {n}")
    image_radii = _as_radii(observation.peg_radii, n, "observation.peg_radii")
    noise, radius_sigmas = _covariances(observation, n), _radius_sigmas(observation, n)
    used = np.isfinite(noise).all(axis=(1, 2)) if noise is not None else np.ones(n, bool)
    if used.sum() < LEAST_PEGS:
        raise CalibrationError(
            f"{used.sum()} of {n} pegs were measured; at least {LEAST_PEGS} determine a pose: clear the view of the others"
        )
    information = np.zeros((n, 3, 3))
    information[:, :2, :2] = np.eye(2)
    if noise is not None:
        information[used, :2, :2] = np.linalg.inv(noise[used] + LEAST_SIGMA**2 * np.eye(2))
        information[:, 2, 2] = 1 / (radius_sigmas**2 + LEAST_SIGMA**2)
    radii = np.full(n, float(hub.disc_radius if ring else hub.peg_radius))
    everything = Discs(places, radii, centers, image_radii, information)
    return everything.chosen(used), everything, used, noise is not None


def other_parts(observation: PegObservation, hub: Hub | RingPattern) -> Discs | None:
    """Screws and bore, which lie below the pegs' plane; None for a ring, which is flat.  ValueError if unusable."""
    if isinstance(hub, RingPattern):
        return None
    screws = as_points(observation.screw_centers, 2, "observation.screw_centers")
    if len(screws) != len(hub.screw_centers):
        raise ValueError(f"observation.screw_centers has {len(screws)} rows; expected {len(hub.screw_centers)}")
    bore = as_points([observation.bore_center], 2, "observation.bore_center")
    radii = np.array([hub.screw_radius] * len(screws) + [hub.bore_radius])
    information = np.tile(np.diag([1.0, 1.0, 0.0]) / OTHER_SIGMA**2, (len(radii), 1, 1))
    centers = np.vstack([hub.screw_centers, hub.bore_center])
    return Discs(centers, radii, np.vstack([screws, bore]), np.zeros(len(radii)), information)


def _covariances(observation, count):
    """Covariances (n, 2, 2) of the pegs' centres, px^2, or None where the observation tells none; infinite is allowed."""
    for name, shape in (("peg_covariances", (count, 2, 2)), ("peg_sigmas", (count, 2))):
        if getattr(observation, name, None) is not None:
            stated = np.asarray(getattr(observation, name), np.float64)
            if stated.shape != shape or np.isnan(stated).any():
                raise ValueError(f"observation.{name} has shape {stated.shape}; expected {shape}, without NaN")
            covariances = stated if stated.ndim == 3 else np.where(np.eye(2, dtype=bool), stated[..., None] ** 2, 0.0)
            finite = covariances[np.isfinite(covariances).all(axis=(1, 2))]
            if (np.linalg.eigvalsh(finite) < 0).any():
                raise ValueError(f"observation.{name} has a negative variance; expected covariances")
            return covariances
    return None


def _radius_sigmas(observation, count):
    """Standard deviations (n,) of the pegs' radii, px; infinite where the observation tells none."""
    stated = getattr(observation, "peg_radius_sigmas", None)
    if stated is None:
        return np.full(count, np.inf)
    stated = np.asarray(stated, np.float64)
    if stated.shape != (count,) or not (stated >= 0).all():
        raise ValueError(f"observation.peg_radius_sigmas has shape {stated.shape}; expected ({count},), none negative")
    return stated
