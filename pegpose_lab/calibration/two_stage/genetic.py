"""A real-coded genetic algorithm over a box (Sect. 3.1, "GA operators").  It knows nothing of cameras.

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
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from ...checks import as_choice, as_count, as_number, as_points

if TYPE_CHECKING:
    import pandas as pd


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
    history: "pd.DataFrame"
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
    options = {name: value for name, value in locals().items() if name in _OPTIONS}
    return repeat_genetic(lambda population: np.asarray(objective(population[0]))[None], bounds, [rng], **options)[0]


_OPTIONS = tuple(set(minimize_genetic.__kwdefaults__) - {"rng"})


def repeat_genetic(objective, bounds, rngs, **options):
    """`minimize_genetic` for many runs side by side, which takes a fraction of the time of one after the other.

    Parameters
    ----------
    objective : callable
        Maps the chromosomes of all r runs (r, n, d) to finite values (r, n); called once a generation.
    bounds : (d, 2) or (r, d, 2) array_like
        Of all runs or of each.
    rngs : sequence
        The source of randomness of each run, None, int or Generator.
    **options
        Of `minimize_genetic`; `initial` may be (r, d), one for each run.

    Returns
    -------
    list of GeneticResult
        A run's result is that of `minimize_genetic`, but for the last digits.

    Raises
    ------
    ValueError
        As `minimize_genetic`; if there is no run, or an option is unknown.
    """
    unknown = set(options) - set(_OPTIONS)
    if unknown or not len(rngs):
        raise ValueError(f"rngs has length {len(rngs)}, unknown options are {sorted(unknown)}; expected a run, and none")
    settings = SimpleNamespace(**(minimize_genetic.__kwdefaults__ | options))
    rng = _SideBySide(rngs)
    lower, upper = _as_bounds(bounds)
    size = as_count(settings.population_size, "population_size", 2)
    generations = as_count(settings.generations, "generations", 1)
    population = first_generation(
        lower, upper, (len(rngs), size), rng, initial=settings.initial, form=settings.initialisation
    )
    population, values = _survivors(population, _evaluate(objective, population), size)
    kept, rows = [population], [_summary(population, values, lower, upper)]
    for _ in range(generations):
        children = _children(population, values, lower, upper, rng, settings)
        both = np.concatenate([population, children], axis=1)
        both_values = np.concatenate([values, _evaluate(objective, children)], axis=1)
        population, values = _survivors(both, both_values, size)
        rows.append(_summary(population, values, lower, upper))
        if settings.keep_populations:
            kept.append(population)
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    counts = {"generation": np.arange(len(rows)), "evaluations": size * np.arange(1, len(rows) + 1)}
    import pandas as pd

    return [
        GeneticResult(
            x=population[run, 0].copy(),
            fun=float(values[run, 0]),
            evaluations=size * len(rows),
            history=pd.DataFrame(counts | {name: column[:, run] for name, column in table.items()}),
            populations=np.array([generation[run] for generation in kept]) if settings.keep_populations else None,
        )
        for run in range(len(rngs))
    ]


class _SideBySide:
    """The generators of several runs: each draws for its own run, along the first axis of what is asked for."""

    def __init__(self, rngs):
        self.generators = [np.random.default_rng(rng) for rng in rngs]

    def random(self, shape):
        return np.stack([generator.random(shape[1:]) for generator in self.generators])


def _children(population, values, lower, upper, rng, settings):
    """A generation's children (r, n, d), in the box."""
    pool = np.take_along_axis(population, roulette(values, population.shape[1], rng)[..., None], axis=1)
    children = blend_crossover(pool, rng, alpha=settings.alpha, form=settings.crossover)
    children = power_mutation(
        np.clip(children, lower, upper), lower, upper, rng,
        index=settings.mutation_index, rate=settings.mutation_rate, form=settings.mutation,
    )
    return np.clip(children, lower, upper)


def first_generation(lower, upper, size, rng, *, initial=None, form="uniform"):
    r"""Return the first generation (size, d), or (r, size, d) of r runs if `size` is (r, size).

    ``"uniform"`` draws it from the box, with `initial`, if given, as its first member; ``"equal"`` is
    Eq. 4: :math:`q^j_1 = q_{linear}` for all j.  Equal parents have equal children, so from there only
    mutation moves.

    Raises
    ------
    ValueError
        If the form is unknown, or `initial` is missing, of another length or outside the box.
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


def roulette(values, size, rng):
    r"""Proportionate reproduction: draw `size` indices with probability proportional to fitness.

    The paper does not print the fitness of an objective to be minimised.  Here it falls linearly from the
    best to the worst of the population, which gets none: :math:`F_j = \max_i E_i - E_j`; if all are equal,
    so are their chances.  This map does not change with the unit or the zero of E.

    The draw is a uniform number on the cumulated chances, one number an index whatever the values are: what
    is drawn afterwards does not depend on whether rounding makes two values equal.

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
    parents : (..., n, d) ndarray
        The mating pool; leading axes are runs.
    rng : Generator
    alpha : float
        By how much of the parents' distance the interval is widened on each side.
    form : {"corrected", "printed"}

    Returns
    -------
    (..., n, d) ndarray
        Children; they may lie outside the box.
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
    population : (..., n, d) ndarray
        Chromosomes in the box; leading axes are runs.
    lower, upper : (d,) or (..., 1, d) ndarray
        Bounds of the genes.
    rng : Generator
    index : float
        p > 0, the index of the distribution.
    rate : float
        Probability of a gene to mutate.
    form : {"corrected", "printed"}

    Returns
    -------
    (..., n, d) ndarray
        A new population.
    """
    as_choice(form, "mutation", ("corrected", "printed"))
    index, rate = as_number(index, "mutation_index", 0, exclusive=True), as_number(rate, "mutation_rate", 0, 1)
    chosen, direction, sample = (rng.random(population.shape) for _ in range(3))
    sample = 1 - sample  # in (0, 1]: zero has no power p - 1 < 0
    position = (population - lower) / (upper - lower)
    if form == "corrected":
        step, towards_upper = sample**index, upper - population
    else:
        step, towards_upper = index * sample ** (index - 1), population - upper
    move = np.where(position < direction, lower - population, towards_upper)
    return np.where(chosen < rate, population + step * move, population)


def _survivors(population, values, size):
    """Of each run the best `size` chromosomes and their values, best first; the older one wins a tie."""
    order = np.argsort(values, axis=1, kind="stable")[:, :size]
    return np.take_along_axis(population, order[..., None], axis=1), np.take_along_axis(values, order, axis=1)


def _evaluate(objective, population):
    values = np.asarray(objective(population.copy()), np.float64)
    if values.shape != population.shape[:2] or not np.isfinite(values).all():
        raise ValueError(
            f"objective returned shape {values.shape[1:]} with {np.count_nonzero(~np.isfinite(values))} non-finite "
            f"values for {population.shape[1]} chromosomes; expected one finite value each"
        )
    return values


def _summary(population, values, lower, upper):
    """One row of each run's history; `values` is sorted."""
    spread = population.std(axis=1) / (upper - lower).reshape(-1, population.shape[-1])
    middle = values.shape[1] // 2
    return {
        "best": values[:, 0],
        "mean": values.mean(axis=1),
        "median": (values[:, middle] + values[:, -middle - 1]) / 2,
        "worst": values[:, -1],
        "std": values.std(axis=1),
        **{f"spread_{gene}": width for gene, width in enumerate(spread.T)},
    }


def _as_bounds(bounds):
    """Lower and upper bounds, each (d,), or (r, 1, d) if every run has its own."""
    shape = np.shape(bounds)
    flat = as_points(np.reshape(bounds, (-1, shape[-1])) if len(shape) == 3 else bounds, 2, "bounds")
    if np.any(flat[:, 0] >= flat[:, 1]):
        raise ValueError(f"bounds {flat.tolist()} are not increasing; expected lower < upper for each gene")
    return flat.T if len(shape) != 3 else np.moveaxis(flat.reshape(shape), 2, 0)[:, :, None]
