"""Properties of evaluation: results depend only on the individual, its pruning and its threshold."""

from dataclasses import replace
from functools import cache
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution import evaluation
from islands.evolution.evaluation import Evaluator, Limits
from islands.evolution.generation import first_generation
from islands.evolution.individual import Individual
from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings
from islands.expressions.parsing import parse
from islands.simulation.outcome import Status
from support.searches import SMALL, record
from support.variation import random_genes

FREE = Settings(
    constraints="none",
    structure="free",
    fitness="one-step",
    primitives=("mul", "phi1", "phi2", "tanh", "exp"),
    tolerance=1e-3,
    max_terms=5,
    initial_terms=(1, 5),
    max_height=3,
)
CONSTRAINED = replace(FREE, constraints="hysteresis", fitness="shooting", shooting=60)
SETTINGS = {"free": FREE, "constrained": CONSTRAINED}

#: Individuals with every kind of failure, and equal structures in different notation.
AWKWARD = (
    ("u(k-1)",),
    ("phi1(u(k-1), u(k-1))",),
    ("y(k-1)", "exp(exp(7 + u(k-1)))^9"),
    ("y(k-1)", "u(k-1)", "u(k-1) + y(k-1)"),
    ("y(k-2)", "y(k-3)"),
    ("y(k-1)", "y(k-1)^3", "y(k-2)^3"),
    ("y(k-1)", "q2(u(k-1))", "phi1(u(k-1), u(k-2))"),
    ("phi1(u(k-2), u(k-1))", "u(k-3)", "y(k-1)"),
    ("u(k-3)", "y(k-1)", "u(k-3)"),
    ("y(k-1)",),
)


def random_pool(count):
    """Draw genes of individuals, half of them with a linear output."""
    draw = Stream(2, 0, 0, Purpose.INITIAL)
    return [random_genes(setting, 1, draw) for setting in (FREE, CONSTRAINED) for _ in range(count // 2)]


POOL = tuple(
    Individual(genes)
    for genes in (
        *(tuple(map(parse, texts)) for texts in AWKWARD),
        *random_pool(60),
    )
)

#: From limits that keep everything to limits that empty all caches between calls.
LIMITS = [
    Limits(pairs=1 << 17),
    Limits(pairs=0),
    Limits(pairs=1 << 16, genes=0),
    Limits(pairs=1 << 16, structures=0),
    Limits(pairs=0, genes=30_000, structures=9_000),
    Limits(pairs=0, genes=0, structures=0),
]


@cache
def evaluate_alone(name, place, pruned):
    """Evaluate one individual with a new evaluator."""
    evaluator = Evaluator(record(), SETTINGS[name], Limits(pairs=0))
    (found,), duplicates = evaluator.evaluate([(POOL[place], pruned)])
    assert duplicates == 0
    return found


def expected(name, place, pruned, thresholds):
    """Return the expected result: abandoned if simulated and above the threshold of its size."""
    found = evaluate_alone(name, place, pruned)
    simulated = bool(found.outcome) or "interval" in found.outcome.reason
    if thresholds is not None and simulated and found.fitness > thresholds[found.size]:
        return replace(found, theta=(), fitness=inf, outcome=evaluation._ABANDONED)
    return found


populations = st.lists(st.tuples(st.integers(0, len(POOL) - 1), st.booleans()), max_size=30)

#: Thresholds around the occurring fitnesses, or none.
thresholds_by_size = st.none() | st.lists(
    st.sampled_from([0.0, 1e-8, 1e-6, 2e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1.0, 1e6, inf]), min_size=6, max_size=6
)


@pytest.mark.ci
@pytest.mark.parametrize("name", SETTINGS)
@given(st.sampled_from(LIMITS), st.lists(st.tuples(populations, thresholds_by_size), min_size=1, max_size=4))
def test_evaluation_does_not_depend_on_batch_and_cache(name, limits, history):
    evaluator = Evaluator(record(), SETTINGS[name], limits)
    for population, thresholds in history:
        found, duplicates = evaluator.evaluate(
            [(POOL[place], pruned) for place, pruned in population], thresholds
        )
        for (place, pruned), each in zip(population, found, strict=True):
            assert repr(each) == repr(expected(name, place, pruned, thresholds))
        # Each individual is evaluated once; the number of cached ones depends on earlier calls.
        assert len(population) - len(set(population)) <= duplicates <= len(population)


@pytest.mark.parametrize("name", SETTINGS)
@given(thresholds_by_size, populations, populations)
def test_abandoned_individuals_have_a_fitness_above_the_threshold(name, thresholds, before, population):
    evaluator = Evaluator(record(), SETTINGS[name], Limits(pairs=1 << 16))
    evaluator.evaluate([(POOL[place], pruned) for place, pruned in before])
    found, _ = evaluator.evaluate([(POOL[place], pruned) for place, pruned in population], thresholds)
    abandoned = [
        (each, key)
        for each, key in zip(found, population, strict=True)
        if each.outcome.verdict is Status.ABANDONED
    ]
    assert thresholds is not None or not abandoned
    evaluated_again = evaluator.evaluate_abandoned([each for each, _ in abandoned])
    for (each, key), exact in zip(abandoned, evaluated_again, strict=True):
        assert (each.fitness, each.theta) == (inf, ())
        assert exact.fitness > thresholds[each.size]
        assert repr(exact) == repr(evaluate_alone(name, *key))


# Batches.


@pytest.fixture
def batches(monkeypatch):
    """Sizes of the batches whose inner products are computed: of selections, then of evaluations."""
    sizes = []
    original = evaluation.complete_pairs

    def spy(terms, lengths, *others):
        sizes.append(len(lengths))
        return original(terms, lengths, *others)

    monkeypatch.setattr(evaluation, "complete_pairs", spy)
    return sizes


@pytest.mark.parametrize("name", SETTINGS)
def test_small_pair_table_splits_a_generation_into_several_batches(batches, name):
    population = [(each, pruned) for each in POOL for pruned in (False, True)]
    whole = Evaluator(record(), SETTINGS[name]).evaluate(population)
    (selected, evaluated) = batches
    assert evaluated == len(population) - whole[1]
    del batches[:]
    # A batch may use half of 1024 places; five genes and y(k) have 21 pairs.
    parts = Evaluator(record(), SETTINGS[name], Limits(pairs=0)).evaluate(population)
    assert repr(parts) == repr(whole)
    assert batches[0] == 1024 // 2 // 21 < selected
    assert sum(batches) == selected + evaluated


def test_pruning_decision_is_part_of_the_cache_key():
    genes = tuple(parse(text) for text in ("y(k-1)", "phi1(u(k-1), u(k-2))", "phi2(u(k-1), u(k-9))*y(k-3)"))
    each = Individual(genes)
    evaluator = Evaluator(record(), replace(SMALL, tolerance=1e-3))
    (whole, pruned), duplicates = evaluator.evaluate([(each, False), (each, True)])
    assert (whole.size, duplicates) == (3, 0)
    assert pruned.size < 3
    assert evaluator.evaluate([(each, True), (each, False), (each, True)]) == ((pruned, whole, pruned), 3)


# Duplicates.


def test_abandoned_evaluation_answers_only_lower_thresholds():
    """Only a lower bound on the fitness of an abandoned individual is known."""
    place = next(place for place in range(len(POOL)) if evaluate_alone("free", place, False).fitness < inf)
    exact = evaluate_alone("free", place, False)
    evaluator = Evaluator(record(), FREE)

    def evaluated(bar):
        (found,), duplicates = evaluator.evaluate([(POOL[place], False)], [bar] * 6)
        return found.outcome.verdict.name, duplicates

    assert evaluated(exact.fitness / 2) == ("ABANDONED", 0)
    assert evaluated(exact.fitness / 4) == ("ABANDONED", 1)
    assert evaluated(exact.fitness * 2) == ("OK", 0)
    # An exact fitness answers every threshold.
    assert evaluated(exact.fitness / 4) == ("ABANDONED", 1)
    assert evaluated(inf) == ("OK", 1)


def test_duplicates_consume_random_draws():
    """The pruning of every individual is drawn in order, also if the individual is cached."""

    class Spy(Evaluator):
        decisions, known = (), 0

        def evaluate_genes(self, individuals, pruned, thresholds=None):
            self.decisions = pruned.tolist()
            found, self.known = super().evaluate_genes(individuals, pruned, thresholds)
            return found, self.known

    setting = replace(SMALL, prune=0.5, initial_terms=(1, 1), initial_height=0)
    spy = Spy(record(), setting)
    island, info = first_generation(0, 8, spy)
    draw = Stream(8, 0, 0, Purpose.PRUNING)
    assert spy.decisions == [draw.chance(0.5) for _ in range(setting.population)]
    # Individuals of one leaf are mostly duplicates.
    assert setting.population > info.duplicates >= setting.population - 8
    assert spy.known < setting.population
    second_island, second_info = first_generation(0, 8, spy)
    assert spy.known == setting.population
    # The cache affects the speed of a generation, not its result.
    assert (second_island, second_info) == (island, info)


# Emptied caches, and zero genes.


@pytest.mark.parametrize("name", SETTINGS)
def test_threads_do_not_change_the_evaluations(name, monkeypatch):
    monkeypatch.setattr(evaluation, "_THREAD_SAMPLES", 1)
    population = [(each, number % 2 == 0) for number, each in enumerate(POOL)]
    one, three = (
        Evaluator(record(), SETTINGS[name], threads=threads).evaluate(population)[0] for threads in (1, 3)
    )
    assert one == three
    assert sum(bool(each.outcome) for each in one) > 20
