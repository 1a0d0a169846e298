"""Properties of the memory of an evaluator: caches keep their limits and report their size."""

import gc
import tracemalloc

import pytest

from islands.evolution.evaluation import Evaluator, Limits
from islands.evolution.generation import first_generation, step
from support.searches import SMALL, evolved, islands_of, record

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
