"""The genetic algorithm as a whole, on known functions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pegpose_lab.calibration import minimize_genetic
from pegpose_lab.calibration.two_stage.genetic import repeat_genetic
from pegpose_lab.tests.calibration.two_stage.test_operators import LOWER, UPPER


def sphere(population):
    return np.sum((population - [0.5, 20.0]) ** 2, axis=1)


@given(st.integers(0, 10**6))
def test_finds_the_minimum_from_any_seed(seed):
    result = minimize_genetic(sphere, [(-2, 3), (10, 50)], rng=seed)
    assert result.x == pytest.approx([0.5, 20.0], abs=1e-6)


def test_minimum_on_the_edge_is_reached():
    result = minimize_genetic(lambda population: population.sum(axis=1), [(-2, 3), (10, 50)], rng=1)
    assert result.x == pytest.approx([-2.0, 10.0], abs=1e-9)


def test_result_is_consistent():
    calls = []

    def objective(population):
        calls.append(len(population))
        return sphere(population)

    result = minimize_genetic(
        objective, [(-2, 3), (10, 50)], population_size=31, generations=12, keep_populations=True, rng=3
    )
    history = result.history
    assert result.populations.shape == (13, 31, 2)
    assert result.evaluations == sum(calls) == history["evaluations"].iloc[-1] == 31 * 13
    assert list(history["generation"]) == list(range(13))
    values = np.array([sphere(population) for population in result.populations])
    for name, expected in {
        "best": values.min(axis=1),
        "mean": values.mean(axis=1),
        "median": np.median(values, axis=1),
        "worst": values.max(axis=1),
        "std": values.std(axis=1),
        "spread_0": result.populations[..., 0].std(axis=1) / 5,
        "spread_1": result.populations[..., 1].std(axis=1) / 40,
    }.items():
        assert history[name].to_numpy() == pytest.approx(expected), name
    assert result.fun == values.min() and np.array_equal(result.x, result.populations[-1, 0])


def test_the_best_is_never_lost_and_the_same_seed_gives_the_same_run():
    runs = [minimize_genetic(sphere, [(-2, 3), (10, 50)], generations=30, rng=5).history for _ in range(2)]
    assert np.all(np.diff(runs[0]["best"]) <= 0)
    assert np.all(np.diff(runs[0]["worst"]) <= 0)
    assert runs[0].equals(runs[1])


def test_defaults_are_the_papers_and_the_stated_ones():
    stated = dict(
        population_size=60,
        generations=100,
        initialisation="uniform",
        crossover="corrected",
        alpha=0.75,
        mutation="corrected",
        mutation_index=10.0,
        mutation_rate=0.05,
    )
    default, explicit = (
        minimize_genetic(sphere, [(-2, 3), (10, 50)], rng=1, **options).history for options in ({}, stated)
    )
    assert default.equals(explicit)
    others = {"alpha": 0.7, "mutation_index": 9.0, "mutation_rate": 0.06, "crossover": "printed"}
    for name, other in others.items():
        changed = minimize_genetic(sphere, [(-2, 3), (10, 50)], rng=1, **(stated | {name: other}))
        assert not changed.history.equals(default), name


def test_eq_4_without_mutation_never_moves():
    result = minimize_genetic(
        sphere, [(-2, 3), (10, 50)], initial=[1, 30], initialisation="equal", mutation_rate=0.0, rng=0
    )
    assert np.array_equal(result.x, [1.0, 30.0])


def test_printed_operators_are_clipped_to_the_box():
    result = minimize_genetic(
        sphere,
        [(-2, 3), (10, 50)],
        crossover="printed",
        mutation="printed",
        mutation_rate=0.5,
        keep_populations=True,
        rng=1,
    )
    assert np.all((result.populations >= LOWER) & (result.populations <= UPPER))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"bounds": [(3, 3), (0, 1)]}, "bounds"),
        ({"bounds": [(0, np.nan), (0, 1)]}, "bounds"),
        ({"bounds": []}, "bounds"),
        ({"population_size": 1}, "population_size"),
        ({"population_size": 2.5}, "population_size"),
        ({"generations": 0}, "generations"),
        ({"alpha": -1}, "alpha"),
        ({"alpha": "large"}, "alpha"),
        ({"mutation_rate": 1.5}, "mutation_rate"),
        ({"mutation_index": 0}, "mutation_index"),
        ({"crossover": "none"}, "crossover"),
        ({"mutation": "none"}, "mutation"),
        ({"initialisation": "none"}, "initialisation"),
        ({"initialisation": "equal"}, "initial"),
        ({"initial": [0, 0]}, "initial"),
        ({"initial": [0, 20, 1]}, "initial"),
        ({"objective": lambda population: np.full(len(population), np.nan)}, "objective"),
        ({"objective": lambda population: population}, "objective"),
    ],
)
def test_unusable_input_is_named(change, named):
    arguments = {"objective": sphere, "bounds": [(-2, 3), (10, 50)], "generations": 3, "rng": 0} | change
    with pytest.raises(ValueError, match=named):
        minimize_genetic(arguments.pop("objective"), arguments.pop("bounds"), **arguments)


# --- many runs side by side --------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{}, {"initialisation": "equal", "crossover": "printed", "mutation": "printed"}])
def test_runs_side_by_side_are_those_one_after_the_other(options):
    centres, bounds = np.array([[0.5, 20.0], [1.0, 30.0], [-1.0, 45.0]]), np.array([(-2, 3), (10, 50)])
    initial = np.array([[0.0, 15.0], [0.1, 25.0], [0.2, 35.0]])
    many = repeat_genetic(
        lambda population: np.sum((population - centres[:, None]) ** 2, axis=-1),
        bounds,
        [4, 5, 6],
        initial=initial,
        generations=20,
        keep_populations=True,
        **options,
    )
    for run, centre, start, seed in zip(many, centres, initial, (4, 5, 6), strict=True):
        one = minimize_genetic(
            lambda population, centre=centre: np.sum((population - centre) ** 2, axis=-1),
            bounds,
            rng=seed,
            initial=start,
            generations=20,
            keep_populations=True,
            **options,
        )
        assert run.populations == pytest.approx(one.populations, rel=1e-12)
        assert run.fun == pytest.approx(one.fun, rel=1e-9) and run.evaluations == one.evaluations
        assert run.history.to_numpy() == pytest.approx(one.history.to_numpy(), rel=1e-9, abs=1e-12)


def test_every_run_has_its_own_bounds():
    bounds = np.array([[(0, 1), (0, 1)], [(2, 3), (4, 5)]])
    low, high = repeat_genetic(lambda population: population.sum(axis=-1), bounds, [1, 2])
    assert low.x == pytest.approx([0, 0], abs=1e-6) and high.x == pytest.approx([2, 4], abs=1e-6)


def test_no_run_and_unknown_options_are_refused():
    with pytest.raises(ValueError, match=r"rngs has length 0.*expected a run"):
        repeat_genetic(sphere, [(-2, 3), (10, 50)], [])
    with pytest.raises(ValueError, match=r"unknown options are \['elitism'\]"):
        repeat_genetic(sphere, [(-2, 3), (10, 50)], [1], elitism=True)


def test_rounding_of_the_objective_does_not_change_where_a_search_ends():
    """Equal chromosomes have exactly equal values, or values that differ in their last bits: all runs end alike."""

    def ends(rounding):
        noise = np.random.default_rng(15)

        def valley(population):
            along, across = population.sum(axis=-1), population[..., 0] - population[..., 1]
            values = np.sqrt(1e-4 + (along - 1) ** 2 + 100 * across**2)
            return values * (1 + rounding * noise.standard_normal(values.shape))

        start = dict(initial=[0.8, 0.8], initialisation="equal")
        return [run.fun for run in repeat_genetic(valley, [(0, 1), (0, 1)], range(40), **start)]

    assert ends(1e-15) == pytest.approx(ends(0.0), abs=1e-6)
