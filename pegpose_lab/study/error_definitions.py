"""What is called "the error" of a calibration: five definitions of one number from the same residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

DEFINITIONS = ("mean distance (Eq. 7)", "rms (OpenCV)", "sd x (toolbox)", "sd y (toolbox)", "||e||/n (tutorial)")


def errors_by_definition(residuals: Sequence[ArrayLike], n_parameters: int | None = None) -> dict[str, float]:
    r"""Return the error of a calibration by each of `DEFINITIONS`, and the corners' noise that it implies.

    With the residuals :math:`e_l` of n points they are

    .. math::
        \frac1n \sum |e_l|, \quad \sqrt{\tfrac1n \sum |e_l|^2}, \quad s_x, \quad s_y, \quad
        \tfrac1n \sqrt{\sum |e_l|^2}, \quad \hat\sigma = \sqrt{\tfrac{\sum |e_l|^2}{2 n - p}},

    where :math:`s_x` and :math:`s_y` are standard deviations with the divisor n - 1.

    Parameters
    ----------
    residuals : sequence of (n, 2) array_like
        px, one entry per view.
    n_parameters : int, optional
        p, where a method minimises the sum of squares over all its parameters; otherwise there is no sigma.

    Returns
    -------
    dict
        px, by the names in `DEFINITIONS`, and ``sigma`` (NaN without `n_parameters`).

    Examples
    --------
    >>> found = errors_by_definition([[[3.0, 4.0], [-3.0, -4.0]], [[0.0, 5.0], [0.0, -5.0]]], 4)
    >>> {name: round(value, 2) for name, value in found.items()}  # doctest: +NORMALIZE_WHITESPACE
    {'mean distance (Eq. 7)': 5.0, 'rms (OpenCV)': 5.0, 'sd x (toolbox)': 2.45, 'sd y (toolbox)': 5.23,
     '||e||/n (tutorial)': 2.5, 'sigma': 5.0}
    """
    e = np.concatenate([np.asarray(view, float) for view in residuals])
    squared, n = float(np.sum(e**2)), len(e)
    rms = np.sqrt(squared / n)
    values = [np.hypot(*e.T).mean(), rms, *e.std(axis=0, ddof=1), rms / np.sqrt(n)]
    sigma = np.nan if n_parameters is None else np.sqrt(squared / (2 * n - n_parameters))
    return {name: float(value) for name, value in zip((*DEFINITIONS, "sigma"), [*values, sigma], strict=True)}


def error_numbers(residuals: Sequence[ArrayLike]) -> dict[str, float]:
    r"""Return the four numbers that are called the error of residuals [(n, 2), ...], px.

    "Eq. 7": mean distance.  "rms": root of the mean squared distance (OpenCV's `calibrateCamera`).  "sd per axis":
    standard deviation of all coordinates (MATLAB toolbox).  "norm / n": :math:`\lVert e\rVert / n`, which is the rms
    over :math:`\sqrt n` (OpenCV's tutorial).

    Examples
    --------
    >>> {name: round(number, 3) for name, number in error_numbers([[[3.0, 4.0]], [[-3.0, -4.0]]]).items()}
    {'Eq. 7': 5.0, 'rms': 5.0, 'sd per axis': 4.082, 'norm / n': 3.536}
    """
    by_definition = errors_by_definition(residuals)
    mean, rms, norm = (by_definition[DEFINITIONS[k]] for k in (0, 1, 4))
    spread = np.concatenate([np.asarray(view, np.float64) for view in residuals]).std(ddof=1)
    return {"Eq. 7": mean, "rms": rms, "sd per axis": float(spread), "norm / n": norm}
