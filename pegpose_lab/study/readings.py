"""The two readings of an ambiguous equation as numbers, one function a place: A as it is printed, B as it may be meant.

Each place is treated at length in the notebook of its step; the audit (notebook 08) needs the numbers alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..calibration import TwoStageObjective, blend_crossover, minimize_genetic, power_mutation
from ..checks import as_number
from ..pose import line_angle, line_angle_printed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from ..calibration import Calibration
    from ..targets import Hub

_DRAWN = 100_000  # children drawn to see what an operator does: shares to 0.2 %
_FORMS = {"A": "printed", "B": "corrected"}


class ValleyReadings(NamedTuple):
    """Eq. 7 along the valley of one view with k_1 per point (A) and per chromosome (B), px; depth in mm."""

    per_point: float
    per_point_range: float
    lowest: float
    highest: float
    depth: float


def eq6_readings(
    object_points: ArrayLike, image_points: ArrayLike, linear: Calibration, box: float, *, depths: int = 101
) -> ValleyReadings:
    r"""Return what either reading of Eq. 6 gives along the valley of f and T_z.

    .. math:: k_1 = \frac{c_3 f}{c_1 (c_2 + T_z)} - \frac{c_4}{c_1} \tag{6}

    Depths lie closer together in the middle of the box; at each of them the best of 401 focal lengths within 1 % of
    the one that leaves the magnification of the board's middle unchanged is taken.

    Parameters
    ----------
    object_points : (n, 3) array_like
        mm.
    image_points : (n, 2) array_like
        px.
    linear : Calibration
        Stage 1 of this view.
    box : float
        Half the width of the box (Eq. 5), as a share of stage 1's T_z.
    depths : int
        How many T_z are tried.

    Returns
    -------
    ValleyReadings
        Where B is lowest (`depth`), its lowest and highest, A and its range over all (f, T_z).

    Examples
    --------
    >>> from pegpose_lab import calibrate_tsai, paper
    >>> truth = paper.paper_experiment()
    >>> board = truth.world_from_board.apply(truth.board.object_points)
    >>> corners = truth.camera.project(truth.board.object_points, truth.cam_from_boards[0])
    >>> found = eq6_readings(board, corners, calibrate_tsai(board, corners, truth.camera.sensor), 0.27)
    >>> found.per_point_range < 1e-9, found.lowest < 0.01 < 1 < found.highest
    (True, True)
    """
    per_point = TwoStageObjective(object_points, image_points, linear, kappa1="per-point")
    shared = TwoStageObjective(object_points, image_points, linear)
    t_z, middle = linear.cam_from_object[0].translation[2], shared.c2.mean()
    tried = t_z * (1 + box * np.linspace(-1, 1, depths) ** 3)
    magnification = linear.camera.focal_length / (t_z + middle)
    f = magnification * (tried[:, None] + middle) * np.linspace(0.99, 1.01, 401)
    grid = np.stack([f, np.broadcast_to(tried[:, None], f.shape)], axis=2).reshape(-1, 2)
    flat, valley = per_point(grid), shared(grid).reshape(f.shape).min(axis=1)
    numbers = flat.mean(), np.ptp(flat), valley.min(), valley.max(), tried[valley.argmin()]
    return ValleyReadings(*map(float, numbers))


class GenerationReadings(NamedTuple):
    """Crossover alone from equal chromosomes (A) and from uniform ones (B): errors in px, spread in mm."""

    equal_spread: float
    equal_error: float
    uniform_error: float


def eq4_readings(
    objective: TwoStageObjective, start: ArrayLike, box: float, *, generations: int = 20, rng: int = 0
) -> GenerationReadings:
    """Return where crossover alone, without mutation, leads from either first generation.

    A, Eq. 4 as printed: all chromosomes equal stage 1's (f, T_z).  B: uniform over the box of Eq. 5.

    Parameters
    ----------
    objective : TwoStageObjective
    start : (2,) array_like
        f and T_z of stage 1, mm.
    box : float
        Half the width of the box, as a share of `start`.
    generations, rng : int

    Returns
    -------
    GenerationReadings

    Examples
    --------
    >>> found = eq4_readings(lambda genes: np.abs(genes - [9.0, 11.0]).sum(axis=1), [10.0, 10.0], 0.25)
    >>> found.equal_spread, found.equal_error, found.uniform_error < 0.1
    (0.0, 2.0, True)
    """
    start, options = np.asarray(start, np.float64), {"mutation_rate": 0.0, "generations": generations, "rng": rng}
    bounds = start[:, None] * [1 - box, 1 + box]
    equal, uniform = (
        minimize_genetic(objective, bounds, initial=start, initialisation=form, keep_populations=True, **options)
        for form in ("equal", "uniform")
    )
    return GenerationReadings(float(equal.populations.std(axis=1).max()), float(equal.fun), float(uniform.fun))


def eq9_readings(alpha: float, *, rng: int = 0) -> dict[str, tuple[float, float]]:
    """Return {"A", "B": width of the children's interval for rising and for falling parents at distance 1}.

    A: Eq. 9 as printed, with q_j - q_{j+1}.  B: with its absolute value, as in BLX-alpha.

    Examples
    --------
    >>> {key: np.round(widths, 2).tolist() for key, widths in eq9_readings(0.75).items()}
    {'A': [0.5, 2.5], 'B': [2.5, 2.5]}
    """
    pairs = np.tile([[0.0], [1.0]], (_DRAWN, 1))  # rising and falling in turn
    widths = {}
    for key, form in _FORMS.items():
        children = blend_crossover(pairs, np.random.default_rng([rng, 9]), alpha=alpha, form=form)[:, 0]
        widths[key] = float(np.ptp(children[::2])), float(np.ptp(children[1::2]))
    return widths


def eq10_readings(index: float = 10.0, *, rng: int = 0) -> dict[str, tuple[float, float]]:
    """Return {"A", "B": share of genes that leave the box, and that move up, %} for genes uniform in their box.

    A: Eq. 10 as printed.  B: Deep and Thakur's power mutation, from which it comes.

    Examples
    --------
    >>> shares = eq10_readings()
    >>> shares["A"][0] > 10, shares["A"][1], shares["B"][0]
    (True, 0.0, 0.0)
    """
    genes = np.random.default_rng([rng, 10, 0]).random((_DRAWN, 1))
    shares = {}
    for key, form in _FORMS.items():
        options = {"index": index, "rate": 1.0, "form": form}
        mutants = power_mutation(genes, np.zeros(1), np.ones(1), np.random.default_rng([rng, 10, 1]), **options)
        outside = (mutants < 0) | (mutants > 1)
        shares[key] = float(100 * outside.mean()), float(100 * np.mean(mutants > genes))
    return shares


def eq7_readings(error: float) -> dict[str, float]:
    r"""Return {"A", "B": sigma per axis, px} if `error` is a mean distance (A) or a root mean square (B), px.

    .. math:: E_{rms} = \frac{1}{n} \sum_l \sqrt{(x_f - x_i)^2 + (y_f - y_i)^2} \tag{7}

    For errors that are normal with one sigma per axis the first is sqrt(pi/2) sigma, the second sqrt(2) sigma.

    Examples
    --------
    >>> {key: round(sigma, 4) for key, sigma in eq7_readings(0.0310).items()}
    {'A': 0.0247, 'B': 0.0219}
    """
    error = as_number(error, "error", 0, exclusive=True)
    return {"A": float(error / np.sqrt(np.pi / 2)), "B": float(error / np.sqrt(2))}


class AngleReadings(NamedTuple):
    """Of how many whole degrees a line's angle is found by slopes (A) and by atan2 (B); a vertical line by slopes."""

    slopes: int
    two_arguments: int
    angles: int
    vertical_by_slopes: bool


def _angle_or_nan(found: Callable[[ArrayLike, ArrayLike], float], point: ArrayLike) -> float:
    """Angle of the line from the origin to `point`, rad; NaN where the equation has no value."""
    try:
        return found(point, (0.0, 0.0))
    except ValueError:
        return np.nan


def eq11_readings() -> AngleReadings:
    r"""Return for how many whole degrees of a turn either reading of Eq. 11 gives the angle.

    .. math:: \tan\theta = \frac{m_1 - m_2}{1 + m_1 m_2} \tag{11}

    A vertical line has no slope, so both of its directions count as not found by slopes.

    Examples
    --------
    >>> eq11_readings()
    AngleReadings(slopes=179, two_arguments=360, angles=360, vertical_by_slopes=False)
    """
    truth = np.deg2rad(np.arange(-179, 181))
    points = np.column_stack([np.cos(truth), np.sin(truth)])
    points[np.abs(points) < 1e-12] = 0.0  # cos(90 deg) is 6e-17 in floating point: lines that are vertical, made so
    slopes, both = ([_angle_or_nan(found, point) for point in points] for found in (line_angle_printed, line_angle))
    vertical = not np.isnan(slopes)[points[:, 0] == 0].any()
    correct = [int(np.count_nonzero(np.abs(angles - truth) < 1e-9)) for angles in (slopes, both)]
    return AngleReadings(*correct, len(truth), bool(vertical))


class LabelReadings(NamedTuple):
    """What a half turn makes of the pegs (numbers, misfit in mm), and below which turn (deg) a label can be followed."""

    half_turn: tuple[int, ...]
    misfit: float
    followed_below: int


def label_readings(hub: Hub) -> LabelReadings:
    """Return whether one image tells a hub from itself turned by 180 degrees (A), and how far labels are followed (B).

    Examples
    --------
    >>> from pegpose_lab import Hub
    >>> found = label_readings(Hub())
    >>> found.half_turn, found.misfit < 1e-9, found.followed_below
    ((3, 4, 1, 2), True, 90)
    """
    half_turn = Rotation.from_rotvec([0, 0, np.pi])
    gaps = [np.linalg.norm(half_turn.apply(p)[:, None] - p, axis=2) for p in (hub.peg_centers, hub.screw_centers)]
    turns = np.deg2rad(np.arange(0, 181))
    followed = np.cos(turns) > np.cos(turns - np.pi)  # is the true screw the nearer one?
    becomes = tuple(int(number) for number in gaps[0].argmin(axis=1) + 1)
    return LabelReadings(becomes, float(max(gap.min(axis=1).max() for gap in gaps)), int(followed.sum()))
