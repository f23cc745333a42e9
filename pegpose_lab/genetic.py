r"""A real-coded genetic algorithm over a box (Sect. 3.1, "GA operators").  It knows nothing of cameras.

One generation of `minimize_genetic`::

    population (n)  --roulette-->  mating pool (n)  --blend crossover-->  children (n)  --power mutation-->
    children (n)    --clipped to the box, evaluated-->  the best n of parents and children survive

The paper fixes real genes, proportionate reproduction, blend crossover with alpha = 0.75 (Eq. 9) and power
mutation (Eq. 10), and says that "bad off-springs ... will be eliminated by the subsequent reproduction phase":
hence the competition of parents and children.  It prints neither the map from objective to fitness, the
population, the generations, the rate and index of the mutation nor what happens outside the bounds; here they
are arguments or stated with the function that settles them.

Eqs. 9 and 10 are kept both ``"printed"`` and ``"corrected"``.  Each operator is a function of its own.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .checks import as_number, as_points


@dataclass(frozen=True, eq=False)
class GeneticResult:
    """What `minimize_genetic` found.

    Attributes
    ----------
    x : (d,) ndarray
        The best chromosome.
    fun : float
        Its objective.
    evaluations : int
        Chromosomes evaluated.
    history : DataFrame
        A row a generation, from 0 (the initial population): ``generation``, ``evaluations``; ``best``,
        ``mean``, ``median``, ``worst``, ``std`` of the objective; ``spread_0`` ... ``spread_<d-1>``, the
        standard deviation of each gene as a fraction of its box.
    populations : (generations + 1, n, d) ndarray or None
        Every generation, best chromosome first, if they were asked for.
    """

    x: np.ndarray
    fun: float
    evaluations: int
    history: pd.DataFrame
    populations: np.ndarray | None = None


def minimize_genetic(
    objective,
    bounds,
    *,
    initial=None,
    population_size=60,
    generations=100,
    initialisation="uniform",
    crossover="corrected",
    alpha=0.75,
    mutation="corrected",
    mutation_index=10.0,
    mutation_rate=0.05,
    keep_populations=False,
    rng=None,
):
    """Minimise a function over a box with the paper's genetic algorithm (Eqs. 4, 5, 8-10).

    Selection is proportionate (`roulette`), survival elitist: of the `population_size` parents and as many
    children the best `population_size` live on, so the best chromosome is never lost.  Genes of children
    that leave the box are set to its edge (Eq. 8's constraint).  All generations are run.

    Parameters
    ----------
    objective : callable
        Maps chromosomes (n, d) to finite values (n,); called once a generation.
    bounds : (d, 2) array_like
        Lower and upper bound of each gene (Eq. 5).
    initial : (d,) array_like, optional
        A chromosome in the box.  With ``initialisation="equal"`` the whole first generation, with
        ``"uniform"`` its first member.
    population_size, generations : int
        Chromosomes in a generation (at least 2), and generations after the first (at least 1).
    initialisation : {"uniform", "equal"}
        First generation: uniform over the box, or equal chromosomes as Eq. 4 prints it.
    crossover, alpha
        Form of Eq. 9 and its alpha, see `blend_crossover`.
    mutation, mutation_index, mutation_rate
        Form of Eq. 10, its index p and the probability of a gene to mutate, see `power_mutation`.
    keep_populations : bool
        Keep every generation in the result.
    rng : None, int or Generator
        Source of randomness.

    Returns
    -------
    GeneticResult

    Raises
    ------
    ValueError
        If an argument is unusable, or the objective does not return n finite values.
    """
    rng = np.random.default_rng(rng)
    lower, upper = _as_bounds(bounds)
    size = _as_count(population_size, "population_size", 2)
    population = first_generation(lower, upper, size, rng, initial=initial, form=initialisation)
    values = _evaluate(objective, population)
    population, values = _survivors(population, values, size)
    kept, rows = [population], [_summary(population, values, lower, upper)]
    for _ in range(_as_count(generations, "generations", 1)):
        pool = population[roulette(values, size, rng)]
        children = blend_crossover(pool, rng, alpha=alpha, form=crossover)
        children = np.clip(children, lower, upper)
        children = power_mutation(
            children, lower, upper, rng, index=mutation_index, rate=mutation_rate, form=mutation
        )
        children = np.clip(children, lower, upper)
        both = np.vstack([population, children])
        population, values = _survivors(both, np.append(values, _evaluate(objective, children)), size)
        rows.append(_summary(population, values, lower, upper))
        if keep_populations:
            kept.append(population)
    history = pd.DataFrame(rows)
    history.insert(0, "generation", np.arange(len(rows)))
    history.insert(1, "evaluations", size * np.arange(1, len(rows) + 1))
    return GeneticResult(
        x=population[0].copy(),
        fun=float(values[0]),
        evaluations=size * len(rows),
        history=history,
        populations=np.array(kept) if keep_populations else None,
    )


def first_generation(lower, upper, size, rng, *, initial=None, form="uniform"):
    r"""Return the first generation (size, d).

    ``"uniform"`` draws it from the box, with `initial`, if given, as its first member; ``"equal"`` is
    Eq. 4: :math:`q^j_1 = q_{linear}` for all j.  Equal parents have equal children, so from there only
    mutation moves.

    Raises
    ------
    ValueError
        If the form is unknown, or `initial` is missing, of another length or outside the box.
    """
    _check_form(form, "initialisation", ("uniform", "equal"))
    if initial is not None:
        initial = as_points([initial], len(lower), "initial")[0]
        if np.any(initial < lower) or np.any(initial > upper):
            raise ValueError(f"initial is {initial}; expected it between the bounds {lower} and {upper}")
    elif form == "equal":
        raise ValueError('initial is None; expected the chromosome that initialisation="equal" (Eq. 4) repeats')
    if form == "equal":
        return np.tile(initial, (size, 1))
    population = rng.uniform(lower, upper, (size, len(lower)))
    if initial is not None:
        population[0] = initial
    return population


def roulette(values, size, rng):
    r"""Proportionate reproduction: draw `size` indices with probability proportional to fitness.

    The paper does not print the fitness of an objective to be minimised.  Here it falls linearly from the
    best to the worst of the population, which gets none: :math:`F_j = \max_i E_i - E_j`; if all are equal,
    so are their chances.  This map does not change with the unit or the zero of E.
    """
    values = np.asarray(values, np.float64)
    fitness = values.max() - values
    total = fitness.sum()
    return rng.choice(len(values), size=size, p=fitness / total if total > 0 else None)


def blend_crossover(parents, rng, *, alpha=0.75, form="corrected"):
    r"""Blend crossover (BLX-alpha), Eq. 9: one child from each chromosome and the next one in the pool.

    .. math::

        o_1 = \min(q_j, q_{j+1}) - \alpha d, \quad o_2 = \max(q_j, q_{j+1}) + \alpha d, \quad
        q' = o_1 + (o_2 - o_1)\, rand

    gene by gene; the last chromosome is paired with the first.  ``"printed"`` has
    :math:`d = q_j - q_{j+1}`, which narrows the interval instead of widening it whenever
    :math:`q_j < q_{j+1}`; ``"corrected"`` has :math:`d = |q_j - q_{j+1}|`.

    Parameters
    ----------
    parents : (n, d) ndarray
        The mating pool.
    rng : Generator
    alpha : float
        By how much of the parents' distance the interval is widened on each side.
    form : {"corrected", "printed"}

    Returns
    -------
    (n, d) ndarray
        Children; they may lie outside the box.
    """
    _check_form(form, "crossover", ("corrected", "printed"))
    alpha = as_number(alpha, "alpha", 0)
    following = np.roll(parents, -1, axis=0)
    difference = parents - following
    if form == "corrected":
        difference = np.abs(difference)
    low = np.minimum(parents, following) - alpha * difference
    high = np.maximum(parents, following) + alpha * difference
    return low + (high - low) * rng.random(parents.shape)


def power_mutation(population, lower, upper, rng, *, index=10.0, rate=0.05, form="corrected"):
    r"""Power mutation (Deep & Thakur 2007), Eq. 10, of each gene with probability `rate`.

    .. math::

        q' = \begin{cases} q - s (q - q_{min}) & u < r \\ q + s (q_{max} - q) & u \ge r \end{cases}
        \qquad u = \frac{q - q_{min}}{q_{max} - q_{min}}

    with r and s_r uniform between 0 and 1.  ``"corrected"`` is this with :math:`s = s_r^p`, mostly small steps
    for p > 1 that never leave the box.  ``"printed"`` subtracts in both branches and takes
    :math:`s = p\, s_r^{p-1}`, the density of the power distribution and not a sample of it: up to p times
    the way to the bound, or out of the box on the other side.

    Parameters
    ----------
    population : (n, d) ndarray
        Chromosomes in the box.
    lower, upper : (d,) ndarray
        Bounds of the genes.
    rng : Generator
    index : float
        p > 0, the index of the distribution.
    rate : float
        Probability of a gene to mutate.
    form : {"corrected", "printed"}

    Returns
    -------
    (n, d) ndarray
        A new population.
    """
    _check_form(form, "mutation", ("corrected", "printed"))
    index, rate = as_number(index, "mutation_index", 0, exclusive=True), as_number(rate, "mutation_rate", 0, 1)
    chosen, direction, sample = rng.random((3, *population.shape))
    sample = 1 - sample  # in (0, 1]: zero has no power p - 1 < 0
    position = (population - lower) / (upper - lower)
    if form == "corrected":
        step, towards_upper = sample**index, upper - population
    else:
        step, towards_upper = index * sample ** (index - 1), population - upper
    move = np.where(position < direction, lower - population, towards_upper)
    return np.where(chosen < rate, population + step * move, population)


def _survivors(population, values, size):
    """The best `size` chromosomes and their values, best first; the older one wins a tie."""
    order = np.argsort(values, kind="stable")[:size]
    return population[order], values[order]


def _evaluate(objective, population):
    values = np.asarray(objective(population.copy()), np.float64)
    if values.shape != (len(population),) or not np.isfinite(values).all():
        raise ValueError(
            f"objective returned shape {values.shape} with {np.count_nonzero(~np.isfinite(values))} non-finite "
            f"values for {len(population)} chromosomes; expected one finite value each"
        )
    return values


def _summary(population, values, lower, upper):
    """One row of the history; `values` is sorted."""
    spread = population.std(axis=0) / (upper - lower)
    return {
        "best": values[0],
        "mean": values.mean(),
        "median": np.median(values),
        "worst": values[-1],
        "std": values.std(),
        **{f"spread_{gene}": width for gene, width in enumerate(spread)},
    }


def _as_bounds(bounds):
    bounds = as_points(bounds, 2, "bounds")
    if np.any(bounds[:, 0] >= bounds[:, 1]):
        raise ValueError(f"bounds {bounds.tolist()} are not increasing; expected lower < upper for each gene")
    return bounds.T


def _as_count(value, name, minimum):
    if as_number(value, name, minimum) != int(value):
        raise ValueError(f"{name} is {value}; expected a whole number")
    return int(value)


def _check_form(value, name, allowed):
    if value not in allowed:
        raise ValueError(f"{name} is {value!r}; expected one of {', '.join(map(repr, allowed))}")
