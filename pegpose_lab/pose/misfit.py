"""Whether the pegs lie where a pose puts them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..flags import Flag

if TYPE_CHECKING:
    from .fit import Discs, Fit

MISFIT = 5.0  # times the sigmas: real rims err by two or three, a wrong part or camera by tens
LEAST_MISFIT = 0.1  # px


def misfit_flags(fit: Fit, discs: Discs, unknowns: int, known: bool) -> tuple[Flag, ...]:
    """A flag if the pegs' images differ from those of the fit by far more than their sigmas allow.

    `unknowns` is the number of the pose's degrees of freedom, `known` whether the sigmas are.
    """
    counts = np.diagonal(discs.information, axis1=1, axis2=2) > 0
    residuals = np.where(counts, discs.residuals(fit.images), 0.0)
    factor = np.sqrt(fit.cost / max(np.count_nonzero(counts) - unknowns, 1))
    rms = np.sqrt(np.mean(np.sum(residuals**2, axis=1)))
    if not known or factor < MISFIT or rms < LEAST_MISFIT:
        return ()
    text = (
        f"The pegs' images differ by {rms:.2g} px (rms) from what this pose lets expect, {factor:.0f} times what their sigmas "
        "allow: part, camera or plane is not as described, and the covariance does not hold."
    )
    return (Flag("misfit-pegs", text),)
