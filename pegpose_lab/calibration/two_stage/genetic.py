"""A real-coded genetic algorithm over a box (Sect. 3.1, "GA operators").  It knows nothing about cameras.

One generation of `minimize_genetic`::

    population (n)  --roulette-->  mating pool (n)  --blend crossover-->  children (n)  --power mutation-->
    children (n)    --clipped to the box, evaluated-->  the best n of parents and children survive

The paper fixes real genes, proportionate reproduction, blend crossover with alpha = 0.75 (Eq. 9) and power
mutation (Eq. 10).  It says that "bad off-springs ... will be eliminated by the subsequent reproduction phase", so here
parents and children compete.  The paper does not give the map from objective to fitness, the size of the population,
the number of generations, the rate and index of the mutation, or what happens outside the bounds.  Here these are
arguments, or the function that decides them documents them.

Eqs. 9 and 10 are available both ``"printed"`` and ``"corrected"``.  Each operator is a function of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from ...checks import as_count, as_points
from .operators import blend_crossover, first_generation, power_mutation, roulette

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    import pandas as pd
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class GeneticResult:
    """The result of `minimize_genetic`.

    Attributes
    ----------
    x : (d,) ndarray
        The best chromosome.
    fun : float
        Its objective value.
    evaluations : int
        Number of chromosomes evaluated.
    history : DataFrame
        One row per generation, from 0 (the initial population): ``generation``, ``evaluations``; ``best``,
        ``mean``, ``median``, ``worst``, ``std`` of the objective; ``spread_0`` ... ``spread_<d-1>``, the
        standard deviation of each gene as a fraction of its box.
    populations : (generations + 1, n, d) ndarray or None
        Every generation, best chromosome first, if requested.
    """

    x: np.ndarray
    fun: float
    evaluations: int
    history: pd.DataFrame
    populations: np.ndarray | None = None


def minimize_genetic(
    objective: Callable[[NDArray[np.float64]], ArrayLike],
    bounds: ArrayLike,
    *,
    initial: ArrayLike | None = None,
    population_size: int = 60,
    generations: int = 100,
    initialisation: str = "uniform",
    crossover: str = "corrected",
    alpha: float = 0.75,
    mutation: str = "corrected",
    mutation_index: float = 10.0,
    mutation_rate: float = 0.05,
    keep_populations: bool = False,
    rng: int | np.random.Generator | None = None,
) -> GeneticResult:
    """Minimise a function over a box with the paper's genetic algorithm (Eqs. 4, 5, 8-10).

    Selection is proportionate (`roulette`) and survival is elitist: the best `population_size` of the parents and
    equally many children survive, so the best chromosome is never lost.  Genes of children outside the box are set
    to its edge (Eq. 8's constraint).  All generations are run.

    Parameters
    ----------
    objective : callable
        Maps chromosomes (n, d) to finite values (n,); called once per generation.
    bounds : (d, 2) array_like
        Lower and upper bound of each gene (Eq. 5).
    initial : (d,) array_like, optional
        A chromosome in the box.  With ``initialisation="equal"`` it fills the whole first generation; with
        ``"uniform"`` it is the first member.
    population_size, generations : int
        Number of chromosomes in a generation (at least 2), and of generations after the first (at least 1).
    initialisation : {"uniform", "equal"}
        First generation: uniform over the box, or equal chromosomes as in Eq. 4.
    crossover, alpha
        Form of Eq. 9 and its alpha, see `blend_crossover`.
    mutation, mutation_index, mutation_rate
        Form of Eq. 10, its index p and the probability that a gene mutates, see `power_mutation`.
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

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab.calibration import minimize_genetic
    >>> found = minimize_genetic(lambda x: np.sum((x - 1) ** 2, axis=1), [(-5, 5), (-5, 5)], rng=0)
    >>> found.x.round(1).tolist(), found.fun < 1e-3
    ([1.0, 1.0], True)
    """
    options = {name: value for name, value in locals().items() if name in _OPTIONS}
    return repeat_genetic(lambda population: np.asarray(objective(population[0]))[None], bounds, [rng], **options)[0]


_OPTIONS = tuple(set(minimize_genetic.__kwdefaults__) - {"rng"})


def repeat_genetic(
    objective: Callable[[NDArray[np.float64]], ArrayLike],
    bounds: ArrayLike,
    rngs: Sequence[int | np.random.Generator | None],
    **options: Any,
) -> list[GeneticResult]:
    """Run `minimize_genetic` many times side by side, which takes a fraction of the time of separate runs.

    Parameters
    ----------
    objective : callable
        Maps the chromosomes of all r runs (r, n, d) to finite values (r, n); called once per generation.
    bounds : (d, 2) or (r, d, 2) array_like
        For all runs or for each run.
    rngs : sequence
        The source of randomness of each run: None, int or Generator.
    **options
        Options of `minimize_genetic`; `initial` may be (r, d), one for each run.

    Returns
    -------
    list of GeneticResult
        Each run has the result of `minimize_genetic`, except for the last digits.

    Raises
    ------
    ValueError
        As for `minimize_genetic`; also if there is no run or an option is unknown.
    """
    unknown = set(options) - set(_OPTIONS)
    if unknown or not len(rngs):
        raise ValueError(
            f"rngs has length {len(rngs)}, unknown options are {sorted(unknown)}; expected a run, and none"
        )
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
    """The random generators of several runs: each draws for its own run, along the first axis of the result."""

    def __init__(self, rngs):
        self.generators = [np.random.default_rng(rng) for rng in rngs]

    def random(self, shape):
        return np.stack([generator.random(shape[1:]) for generator in self.generators])


def _children(population, values, lower, upper, rng, settings):
    """A generation's children (r, n, d), in the box."""
    pool = np.take_along_axis(population, roulette(values, population.shape[1], rng)[..., None], axis=1)
    children = blend_crossover(pool, rng, alpha=settings.alpha, form=settings.crossover)
    children = power_mutation(
        np.clip(children, lower, upper),
        lower,
        upper,
        rng,
        index=settings.mutation_index,
        rate=settings.mutation_rate,
        form=settings.mutation,
    )
    return np.clip(children, lower, upper)


def _survivors(population, values, size):
    """The best `size` chromosomes of each run and their values, best first; the older one wins a tie."""
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
    """One row of each run's history; `values` must be sorted."""
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
    """Lower and upper bounds, each (d,), or (r, 1, d) if every run has its own bounds."""
    shape = np.shape(bounds)
    flat = as_points(np.reshape(bounds, (-1, shape[-1])) if len(shape) == 3 else bounds, 2, "bounds")
    if np.any(flat[:, 0] >= flat[:, 1]):
        raise ValueError(f"bounds {flat.tolist()} are not increasing; expected lower < upper for each gene")
    return flat.T if len(shape) != 3 else np.moveaxis(flat.reshape(shape), 2, 0)[:, :, None]
