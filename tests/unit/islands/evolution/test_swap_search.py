"""Swap search: its structures are locally optimal, and it includes its starts."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from islands.evolution import swap_search as module
from islands.evolution.evaluation import Evaluator
from islands.evolution.gene_structure import with_phi
from islands.evolution.individual import Individual
from islands.evolution.problem import make_problem
from islands.evolution.settings import Settings
from islands.evolution.swap_search import swap_search
from islands.models.candidate_library import candidates
from islands.records.dataset import Dataset
from support.searches import record

HYSTERESIS = Settings(
    library="phi-polynomial", library_degree=2, library_lags=3, max_terms=4, initial_terms=(1, 4), shooting=60
)
SMOOTH = replace(
    HYSTERESIS, library="polynomial", library_lags=2, constraints="none", structure="free", shifts=(1,)
)


def smooth(samples=400, seed=0):
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1, 1, samples)
    y = np.zeros(samples)
    for k in range(2, samples):
        y[k] = 0.7 * y[k - 1] - 0.1 * y[k - 2] + 0.4 * u[k - 1] + 0.2 * u[k - 1] * u[k - 2]
    return Dataset(u, y + 0.02 * rng.normal(size=samples), 1.0)


def pool(settings):
    items = candidates(settings.library, settings.library_degree, settings.library_lags, 1)
    return [with_phi(item.expression) for item in items]


@pytest.mark.parametrize(("data", "settings"), [(record(), HYSTERESIS), (smooth(), SMOOTH)])
def test_exchange_of_one_gene_cannot_improve_the_best_structure(data, settings):
    evaluator = Evaluator(data, settings)
    best = swap_search(evaluator, pool(settings))[-1][0]
    assert best.size == settings.max_terms
    exchanged = [
        (Individual((*best.genes[:place], gene, *best.genes[place + 1 :])), False)
        for place in range(best.size)
        for gene in pool(settings)
    ]
    same_size = [each.fitness for each in evaluator.evaluate(exchanged)[0] if each.size == best.size]
    assert min(same_size) >= (1.0 - 1e-3) * best.fitness


def test_search_over_pairs_equals_the_exhaustive_search():
    """From the best single gene, exchanges reach the best pair of this record."""
    settings = replace(SMOOTH, max_terms=2, initial_terms=(1, 2))
    evaluator, genes = Evaluator(smooth(), settings), pool(settings)
    pairs, _ = evaluator.evaluate([(Individual(pair), False) for pair in combinations(genes, 2)])
    assert swap_search(evaluator, genes)[1][0].fitness == min(each.fitness for each in pairs)


def test_budget_of_evaluations_ends_the_search(monkeypatch):
    monkeypatch.setattr(module, "MAX_EVALUATIONS", 1)
    found = swap_search(Evaluator(smooth(), SMOOTH), pool(SMOOTH))
    assert [population[0].size for population in found] == [1]


def test_problem_has_the_best_structure_of_every_size_first():
    settings = replace(HYSTERESIS, swap_search=True)
    seeds = make_problem(record(), settings).seeds
    found = swap_search(Evaluator(record(), settings), pool(settings))
    assert [len(genes) for genes in seeds[: len(found)]] == [population[0].size for population in found]
    assert {len(genes) for genes in seeds} == {1, 2, 3, 4}
