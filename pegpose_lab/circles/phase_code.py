"""The phase-coding Hough transform: one complex accumulator, whose phase at a centre gives the radius.

References
----------
T. J. Atherton and D. J. Kerbyson, "Size invariant circle detection", Image and Vision Computing 17(11), 1999.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .peaks import SMOOTHING, _find_by_votes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .request import _Request


def find(window: NDArray[np.uint8], request: _Request) -> NDArray[np.float64]:
    """Rows x, y, r, score of the circles in one window."""
    return _find_by_votes(window, request, _radius_by_phase)


def _radius_by_phase(votes, _gradient, x, y, request):
    """Radius from the phase of the votes around a centre (weighted by the smoothing's Gaussian)."""
    reach = int(3 * SMOOTHING)
    row, column = int(round(y)), int(round(x))
    rows = np.arange(max(row - reach, 0), min(row + reach + 1, votes.shape[0]))
    columns = np.arange(max(column - reach, 0), min(column + reach + 1, votes.shape[1]))
    down = np.exp(-0.5 * ((rows - y) / SMOOTHING) ** 2)
    across = np.exp(-0.5 * ((columns - x) / SMOOTHING) ** 2)
    peak = down @ votes[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] @ across
    phase = np.angle(peak) % (2 * np.pi)
    return request.r_min * (request.r_max / request.r_min) ** (phase / (2 * np.pi))
