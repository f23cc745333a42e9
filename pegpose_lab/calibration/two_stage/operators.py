"""The operators of the genetic algorithm: first generation (Eq. 4), selection, crossover (Eq. 9), mutation (Eq. 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import as_choice, as_number, as_points

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def first_generation(
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    size: int | tuple[int, int],
    rng: np.random.Generator,
    *,
    initial: ArrayLike | None = None,
    form: str = "uniform",
) -> NDArray[np.float64]:
    r"""Return the first generation (size, d), or (r, size, d) of r runs if `size` is (r, size).

    ``"uniform"`` draws it from the box, with `initial`, if given, as its first member.  ``"equal"`` is
    Eq. 4: :math:`q^j_1 = q_{linear}` for all j.  Crossover of equal parents gives equal children, so only
    mutation can change them.

    Raises
    ------
    ValueError
        If the form is unknown, or `initial` is missing, has another length or lies outside the box.
    """
    as_choice(form, "initialisation", ("uniform", "equal"))
    shape = (*np.atleast_1d(size), np.shape(lower)[-1])
    if initial is not None:
        initial = as_points(np.reshape(initial, (-1, np.shape(initial)[-1])), shape[-1], "initial")[:, None]
        if np.any(initial < lower) or np.any(initial > upper):
            raise ValueError(f"initial is {initial}; expected it between the bounds {lower} and {upper}")
        initial = initial if len(shape) == 3 else initial[0]
    elif form == "equal":
        raise ValueError('initial is None; expected the chromosome that initialisation="equal" (Eq. 4) repeats')
    if form == "equal":
        return np.broadcast_to(initial, shape).copy()
    population = lower + (upper - lower) * rng.random(shape)
    if initial is not None:
        population[..., :1, :] = initial
    return population


def roulette(values: ArrayLike, size: int, rng: np.random.Generator) -> NDArray[np.intp]:
    r"""Proportionate reproduction: draw `size` indices with probability proportional to fitness.

    The paper does not give the fitness for an objective to be minimised.  Here it falls linearly from the best
    of the population to the worst, which gets zero: :math:`F_j = \max_i E_i - E_j`.  If all values are equal, all
    probabilities are equal.  This map does not depend on the unit or the zero of E.

    Each index is drawn by one uniform number on the cumulated probabilities, whatever the values are.  So later
    draws do not depend on whether rounding makes two values equal.

    Parameters
    ----------
    values : (..., n) array_like
        Objective of each chromosome; leading axes are runs.
    size : int
    rng : Generator

    Returns
    -------
    (..., size) ndarray of int
    """
    values = np.asarray(values, np.float64)
    fitness = values.max(axis=-1, keepdims=True) - values
    total = fitness.sum(axis=-1, keepdims=True)
    chances = np.cumsum(np.where(total > 0, fitness, 1.0), axis=-1)
    chances /= chances[..., -1:]
    draws = rng.random((*values.shape[:-1], size))
    return np.sum(chances[..., None, :] <= draws[..., None], axis=-1)


def blend_crossover(
    parents: NDArray[np.float64], rng: np.random.Generator, *, alpha: float = 0.75, form: str = "corrected"
) -> NDArray[np.float64]:
    r"""Blend crossover (BLX-alpha), Eq. 9: one child from each chromosome and the next one in the pool.

    .. math::

        o_1 = \min(q_j, q_{j+1}) - \alpha d, \quad o_2 = \max(q_j, q_{j+1}) + \alpha d, \quad
        q' = o_1 + (o_2 - o_1)\, rand

    gene by gene; the last chromosome is paired with the first.  ``"printed"`` has
    :math:`d = q_j - q_{j+1}`, which narrows the interval instead of widening it whenever
    :math:`q_j < q_{j+1}`; ``"corrected"`` has :math:`d = |q_j - q_{j+1}|`.

    Parameters
    ----------
    parents : (..., n, d) ndarray
        The mating pool; leading axes are runs.
    rng : Generator
    alpha : float
        Fraction of the parents' distance by which the interval is widened on each side.
    form : {"corrected", "printed"}

    Returns
    -------
    (..., n, d) ndarray
        Children; they may lie outside the box.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab.calibration import blend_crossover
    >>> children = blend_crossover(np.array([[0.0], [1.0]]), np.random.default_rng(0), alpha=0.5)
    >>> children.shape, bool(np.all((children >= -0.5) & (children <= 1.5)))
    ((2, 1), True)

    References
    ----------
    L. J. Eshelman and J. D. Schaffer, "Real-coded genetic algorithms and interval-schemata", Foundations of Genetic
    Algorithms 2, 187-202, 1993.
    """
    as_choice(form, "crossover", ("corrected", "printed"))
    alpha = as_number(alpha, "alpha", 0)
    following = np.roll(parents, -1, axis=-2)
    difference = parents - following
    if form == "corrected":
        difference = np.abs(difference)
    low = np.minimum(parents, following) - alpha * difference
    high = np.maximum(parents, following) + alpha * difference
    return low + (high - low) * rng.random(parents.shape)


def power_mutation(
    population: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    index: float = 10.0,
    rate: float = 0.05,
    form: str = "corrected",
) -> NDArray[np.float64]:
    r"""Power mutation (Deep & Thakur 2007), Eq. 10, of each gene with probability `rate`.

    .. math::

        q' = \begin{cases} q - s (q - q_{min}) & u < r \\ q + s (q_{max} - q) & u \ge r \end{cases}
        \qquad u = \frac{q - q_{min}}{q_{max} - q_{min}}

    with r and s_r uniform between 0 and 1.  ``"corrected"`` takes :math:`s = s_r^p`, the distribution function of the
    power distribution at s_r, as Deep and Thakur do: for p > 1 most steps are small, and no step leaves the box.  (As a
    random number this s has a power distribution of index 1/p; one of index p would be :math:`s_r^{1/p}`.)
    ``"printed"`` subtracts in both branches and takes :math:`s = p\, s_r^{p-1}`, the density at s_r.  Its steps are
    up to p times the distance to the bound, or leave the box on the other side.

    Parameters
    ----------
    population : (..., n, d) ndarray
        Chromosomes in the box; leading axes are runs.
    lower, upper : (d,) or (..., 1, d) ndarray
        Bounds of the genes.
    rng : Generator
    index : float
        p > 0, the exponent of the distribution function.
    rate : float
        Probability that a gene mutates.
    form : {"corrected", "printed"}

    Returns
    -------
    (..., n, d) ndarray
        A new population.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab.calibration import power_mutation
    >>> population = np.full((1000, 1), 0.5)
    >>> mutated = power_mutation(population, np.zeros(1), np.ones(1), np.random.default_rng(0), rate=0.1)
    >>> bool(np.all((mutated >= 0) & (mutated <= 1))), bool(60 < np.sum(mutated != population) < 140)
    (True, True)

    References
    ----------
    K. Deep and M. Thakur, "A new mutation operator for real coded genetic algorithms", Applied Mathematics and
    Computation 193(1), 211-230, 2007.
    """
    as_choice(form, "mutation", ("corrected", "printed"))
    index, rate = as_number(index, "mutation_index", 0, exclusive=True), as_number(rate, "mutation_rate", 0, 1)
    chosen, direction, sample = (rng.random(population.shape) for _ in range(3))
    sample = 1 - sample  # in (0, 1], because zero has no power p - 1 < 0
    position = (population - lower) / (upper - lower)
    if form == "corrected":
        step, towards_upper = sample**index, upper - population
    else:
        step, towards_upper = index * sample ** (index - 1), population - upper
    move = np.where(position < direction, lower - population, towards_upper)
    return np.where(chosen < rate, population + step * move, population)
