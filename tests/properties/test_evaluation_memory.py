"""Properties of the memory of an evaluator: caches keep their limits and report their size."""

import gc
import tracemalloc
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.evaluation import Evaluator, Limits
from islands.evolution.gene_index import GeneIndex
from islands.evolution.generation import first_generation, step
from islands.evolution.individual import Individual
from islands.evolution.rng import Purpose, Stream
from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged
from support.searches import SMALL, evolved, islands_of, record
from support.variation import random_gene

LIMITS = Limits(pairs=1 << 14, genes=100_000, structures=40_000)


@pytest.mark.ci
def test_caches_exceed_their_limits_by_at_most_one_generation():
    evaluator = Evaluator(record(), SMALL, LIMITS)
    # Genes with regressors, and individuals of a generation, including those evaluated for tournaments.
    generation = {
        "pairs": 0,
        "genes": SMALL.population * SMALL.max_terms * 6_000,
        "structures": 2 * SMALL.population * 2_000,
    }
    island, _ = first_generation(0, 3, evaluator)
    emptied = dict.fromkeys(generation, 0)
    for _ in range(40):
        before = evaluator.memory
        island, _ = step(island, evaluator)
        for name, (taken, limit) in evaluator.memory.items():
            assert limit == getattr(LIMITS, name)
            assert 0 < taken <= limit + generation[name]
            emptied[name] += taken < before[name][0]
    # The test is meaningful only if all limits are reached.
    assert all(emptied.values()), emptied
    assert repr(island) == repr(evolved(40))


@pytest.mark.ci
def test_measured_memory_of_an_evaluator_is_bounded():
    evaluator = Evaluator(record(), SMALL, LIMITS)
    islands_of(evaluator, 15)
    tracemalloc.start()
    try:
        measured = []
        for seed in range(3):
            islands_of(evaluator, 7, seed=seed)
            gc.collect()
            measured.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert max(measured) < 3 * (LIMITS.genes + LIMITS.structures)


@pytest.fixture
def memory_growth():
    """Return a function that measures the growth of traced memory."""
    # Compile the functions first, because compilation takes memory, too.
    GeneIndex(CONSTRAINTS["none"], [parse("tanh(exp(y(k-1)))")])
    gc.collect()
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]

    def growth():
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - before

    yield growth
    tracemalloc.stop()


HIGH = replace(SMALL, max_height=5, initial_height=5)


FREE = replace(HIGH, constraints="none", structure="free", primitives=("mul", "tanh", "exp", "add"))


@pytest.mark.ci
@pytest.mark.parametrize(
    "setting",
    [pytest.param(HIGH, id="paper", marks=pytest.mark.nightly), pytest.param(FREE, id="free")],
)
def test_measured_memory_of_genes_equals_the_estimate(memory_growth, setting):
    gene_index = GeneIndex(CONSTRAINTS[setting.constraints], [Lagged(0, 0)])
    draw = Stream(7, 0, 0, Purpose.INITIAL)
    for _ in range(400):
        gene_index.index_of(random_gene(setting, 2, draw))
    taken = memory_growth()
    assert gene_index.bytes > 300_000
    assert gene_index.bytes / 2.5 < taken < gene_index.bytes * 2.5


@pytest.mark.ci
def test_measured_memory_of_structures_equals_the_estimate(memory_growth):
    setting = replace(SMALL, max_terms=6, constraints="none", structure="free")
    evaluator = Evaluator(record(), setting)
    genes = [parse(text) for lag in range(1, 11) for text in (f"u(k-{lag})", f"y(k-{lag})*u(k-1)")]
    evaluator.evaluate([(Individual((each,)), False) for each in genes])
    structures = [chosen for size in (2, 3, 5, 6) for chosen in list(combinations(genes, size))[:180]]
    rng = np.random.default_rng(0)
    population = [(Individual(chosen), bool(rng.integers(2))) for chosen in structures]
    estimated, before = evaluator.memory["structures"][0], memory_growth()
    evaluator.evaluate(population)
    estimated, taken = evaluator.memory["structures"][0] - estimated, memory_growth() - before
    assert estimated > 300_000
    assert estimated / 2.5 < taken < estimated * 2.5


def test_pair_table_has_the_size_of_its_limit():
    for limit in (1 << 15, 1 << 18):
        evaluator = Evaluator(record(), SMALL, Limits(pairs=limit))
        assert evaluator.memory["pairs"] == (0, limit)
        table = evaluator._pairs
        assert sum(array.nbytes for array in table[:2]) == limit
    assert set(Evaluator(record(), SMALL).memory) == {"pairs", "genes", "structures"}


def test_pair_table_has_room_for_one_individual_at_any_limit():
    """60 genes and y(k) have 1891 pairs; the smallest table has 1024 places."""
    texts = [f"y(k-{1 + place % 10})*u(k-{1 + place // 10})" for place in range(60)]
    setting = replace(SMALL, constraints="none", structure="free", max_terms=60, fitness="one-step")
    large = [(Individual(tuple(map(parse, texts))), True)]
    expected = Evaluator(record(), setting).evaluate(large)
    assert expected[0][0].outcome
    evaluator = Evaluator(record(), setting, Limits(pairs=0))
    for _ in range(3):
        evaluator.evaluate([(Individual((Lagged(0), parse(texts[0]))), False)])
        assert repr(evaluator.evaluate(large)[0]) == repr(expected[0])
