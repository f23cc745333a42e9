"""The two-stage Hough transform: centres by votes along the gradient, then the radius by a histogram.

References
----------
H. K. Yuen, J. Princen, J. Illingworth and J. Kittler, "Comparative study of Hough transform methods for circle finding",
Image and Vision Computing 8(1), 1990.
E. R. Davies, "A modified Hough scheme for general circle location", Pattern Recognition Letters 7(1), 1988.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .peaks import _find_by_votes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .request import _Request


def find(window: NDArray[np.uint8], request: _Request) -> NDArray[np.float64]:
    """Rows x, y, r, score of the circles in one window."""
    return _find_by_votes(window, request, _radius_by_histogram)


def _radius_by_histogram(_votes, gradient, x, y, request):
    """The whole radius at which the mean gradient in a ring of one pixel's width is largest."""
    reach = int(np.ceil(request.r_max)) + 1
    row, column = int(round(y)), int(round(x))
    rows = np.arange(max(row - reach, 0), min(row + reach + 1, gradient.magnitude.shape[0]))
    columns = np.arange(max(column - reach, 0), min(column + reach + 1, gradient.magnitude.shape[1]))
    patch = gradient.magnitude[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    bins = np.rint(np.hypot(columns - x, (rows - y)[:, None])).astype(int).ravel()
    total, count = np.bincount(bins, patch.ravel()), np.bincount(bins)
    low, high = int(np.ceil(request.r_min)), int(np.floor(request.r_max))
    mean = total[low : high + 1] / np.maximum(count[low : high + 1], 1)
    return float(low + mean.argmax()) if len(mean) else 0.5 * (request.r_min + request.r_max)
