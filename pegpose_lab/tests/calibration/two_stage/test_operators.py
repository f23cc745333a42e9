"""Each operator of the genetic algorithm against the paper's formula as a loop."""

import numpy as np
import pytest

from pegpose_lab.calibration import blend_crossover, power_mutation
from pegpose_lab.calibration.two_stage.operators import first_generation, roulette

LOWER, UPPER = np.array([-2.0, 10.0]), np.array([3.0, 50.0])


class Constant:
    """A generator whose every draw is one number."""

    def __init__(self, value):
        self.value = value

    def random(self, shape):
        return np.full(shape, self.value)


def blend_loop(parents, draws, alpha, form):
    """Eq. 9 word for word, a chromosome and a gene at a time."""
    n, genes = parents.shape
    children = np.empty_like(parents)
    for j in range(n):
        for i in range(genes):
            q, q_next = parents[j, i], parents[(j + 1) % n, i]
            difference = q - q_next if form == "printed" else abs(q - q_next)
            o1 = min(q, q_next) - alpha * difference
            o2 = max(q, q_next) + alpha * difference
            children[j, i] = (o2 - o1) * draws[j, i] + o1
    return children


def mutation_loop(population, draws, index, rate, form):
    """Eq. 10 word for word, with the second sign and s of Deep & Thakur where corrected."""
    chosen, direction, sample = draws
    mutants = population.copy()
    for j in range(len(population)):
        for i in range(population.shape[1]):
            q, q_min, q_max = population[j, i], LOWER[i], UPPER[i]
            u, r, s_r = (q - q_min) / (q_max - q_min), direction[j, i], 1 - sample[j, i]
            s = index * s_r ** (index - 1) if form == "printed" else s_r**index
            if chosen[j, i] >= rate:
                continue
            if u < r:
                mutants[j, i] = q - s * (q - q_min)
            elif form == "printed":
                mutants[j, i] = q - s * (q_max - q)
            else:
                mutants[j, i] = q + s * (q_max - q)
    return mutants


@pytest.mark.parametrize("form", ["printed", "corrected"])
@pytest.mark.parametrize("alpha", [0.75, 0.3])
def test_blend_crossover_is_the_loop(form, alpha):
    parents = np.random.default_rng(1).uniform(LOWER, UPPER, (7, 2))
    draws = np.random.default_rng(2).random((7, 2))
    children = blend_crossover(parents, np.random.default_rng(2), alpha=alpha, form=form)
    assert children == pytest.approx(blend_loop(parents, draws, alpha, form), abs=1e-13)


@pytest.mark.parametrize("form", ["printed", "corrected"])
@pytest.mark.parametrize(("index", "rate"), [(10.0, 0.5), (4.0, 1.0), (0.25, 1.0)])
def test_power_mutation_is_the_loop(form, index, rate):
    population = np.random.default_rng(3).uniform(LOWER, UPPER, (9, 2))
    draws = np.random.default_rng(4).random((3, 9, 2))
    mutants = power_mutation(population, LOWER, UPPER, np.random.default_rng(4), index=index, rate=rate, form=form)
    assert mutants == pytest.approx(mutation_loop(population, draws, index, rate, form), rel=1e-12)


def test_blend_reaches_three_quarters_of_the_distance_beyond_each_parent():
    """Eq. 9 with the paper's alpha = 0.75, by default and in both orders of the parents."""
    parents = np.array([[0.0], [4.0]])
    assert blend_crossover(parents, Constant(0.0)).ravel() == pytest.approx([-3.0, -3.0])
    assert blend_crossover(parents, Constant(1.0)).ravel() == pytest.approx([7.0, 7.0])


def test_printed_blend_narrows_the_interval_when_the_first_parent_is_smaller():
    parents = np.array([[0.0], [4.0]])
    assert blend_crossover(parents, Constant(0.0), form="printed").ravel() == pytest.approx([3.0, -3.0])
    assert blend_crossover(parents, Constant(1.0), form="printed").ravel() == pytest.approx([1.0, 7.0])


def test_equal_parents_have_equal_children():
    parents = np.tile([1.0, 20.0], (5, 1))
    assert np.array_equal(blend_crossover(parents, np.random.default_rng(0)), parents)


def test_corrected_mutation_stays_in_the_box_and_printed_does_not():
    population = np.random.default_rng(5).uniform(LOWER, UPPER, (2000, 2))
    for form, stays in (("corrected", True), ("printed", False)):
        mutants = power_mutation(population, LOWER, UPPER, np.random.default_rng(6), rate=1.0, form=form)
        assert np.all((mutants >= LOWER) & (mutants <= UPPER)) == stays


def test_corrected_mutation_goes_either_way_with_power_distributed_steps():
    """u < r has probability 1 - u; s = s_r^p has the quantiles 0.25^p, 0.5^p, 0.75^p of the way to the bound."""
    population = np.full((40000, 1), 0.2)
    mutants = power_mutation(population, np.zeros(1), np.ones(1), np.random.default_rng(8), index=3.0, rate=1.0)
    moves = mutants[:, 0] - 0.2
    assert np.mean(moves < 0) == pytest.approx(0.8, abs=0.01)
    for steps in (-moves[moves < 0] / 0.2, moves[moves > 0] / 0.8):
        assert np.quantile(steps, [0.25, 0.5, 0.75]) == pytest.approx(np.array([0.25, 0.5, 0.75]) ** 3, abs=0.02)


def test_mutation_rate_is_the_fraction_of_mutated_genes():
    population = np.random.default_rng(9).uniform(LOWER, UPPER, (20000, 2))
    mutants = power_mutation(population, LOWER, UPPER, np.random.default_rng(10))
    assert np.mean(mutants != population) == pytest.approx(0.05, abs=0.005)


def test_roulette_is_proportionate():
    values = np.array([1.0, 2.0, 5.0, 5.0, 4.0])
    chosen = roulette(values, 100000, np.random.default_rng(11))
    assert np.bincount(chosen, minlength=5) / 1e5 == pytest.approx(np.array([4, 3, 0, 0, 1]) / 8, abs=0.01)
    shifted = roulette(1e3 * values - 7, 100000, np.random.default_rng(11))
    assert np.array_equal(chosen, shifted)


def test_roulette_of_equals_is_fair():
    chosen = roulette(np.full(4, 3.0), 40000, np.random.default_rng(12))
    assert np.bincount(chosen) / 4e4 == pytest.approx(np.full(4, 0.25), abs=0.02)


@pytest.mark.parametrize("spread", [0.0, 1e-16, 1e-12, 1.0])
def test_roulette_draws_equally_many_numbers_whether_values_are_equal_or_not(spread):
    """What is drawn afterwards must not depend on whether rounding has made the last values equal."""
    rng, other = np.random.default_rng(13), np.random.default_rng(13)
    roulette(1.0 + spread * np.arange(7), 60, rng)
    other.random(60)
    assert rng.random() == other.random()


def test_roulette_draws_for_each_run_by_its_own_values():
    values = np.array([[1.0, 2.0, 2.0], [2.0, 2.0, 1.0], [5.0, 5.0, 5.0]])
    chosen = roulette(values, 3000, np.random.default_rng(14))
    assert chosen.shape == (3, 3000)
    assert np.all(chosen[0] == 0) and np.all(chosen[1] == 2)
    assert np.bincount(chosen[2]) / 3000 == pytest.approx(np.full(3, 1 / 3), abs=0.04)


def test_first_generation_of_eq_4_is_the_initial_chromosome():
    population = first_generation(LOWER, UPPER, 6, np.random.default_rng(0), initial=[1, 20], form="equal")
    assert np.array_equal(population, np.tile([1.0, 20.0], (6, 1)))


def test_uniform_first_generation_fills_the_box_and_holds_the_initial_chromosome():
    population = first_generation(LOWER, UPPER, 20000, np.random.default_rng(0), initial=[1, 20])
    assert np.array_equal(population[0], [1.0, 20.0])
    assert population.min(axis=0) == pytest.approx(LOWER, abs=0.01)
    assert population.max(axis=0) == pytest.approx(UPPER, abs=0.01)
    assert population.mean(axis=0) == pytest.approx((LOWER + UPPER) / 2, abs=0.2)
