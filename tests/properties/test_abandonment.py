"""Properties of abandonment: it never changes the result of a search."""

from dataclasses import replace
from functools import cache
from math import inf

import pytest

from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import _abandon_threshold, _thresholds_by_size, first_generation, step
from islands.evolution.individual import Individual
from islands.evolution.problem import make_problem
from islands.simulation.outcome import Status
from support.searches import SMALL, islands_of, record

pytestmark = pytest.mark.ci

GENERATIONS = 9

#: Settings under which some individuals fail.
UNSTRUCTURED = {"constraints": "none", "structure": "free", "primitives": ("mul", "phi1", "phi2", "tanh")}

SETTINGS = {
    f"{constraints} {fitness} {'distinct' if distinct else 'copies'}": replace(
        SMALL,
        population=40,
        elite=0.2,
        fitness=fitness,
        distinct=distinct,
        **(UNSTRUCTURED if constraints == "none" else {}),
    )
    for constraints in ("hysteresis", "none")
    for fitness in ("shooting", "one-step", "free-run")
    for distinct in (False, True)
}


#: The fast level includes every kind of constraint, fitness and elite at least once.
FAST = (
    "hysteresis shooting copies",
    "none one-step distinct",
    "hysteresis free-run distinct",
    "none shooting copies",
)


def abandoned(island):
    return [each for each in island.population if each.outcome.verdict is Status.ABANDONED]


@cache
def make_history(name):
    return islands_of(Evaluator(record(), SETTINGS[name]), GENERATIONS)


@pytest.fixture(
    params=[name if name in FAST else pytest.param(name, marks=pytest.mark.nightly) for name in SETTINGS]
)
def setting(request):
    return SETTINGS[request.param]


@pytest.fixture
def history(setting):
    """Islands of a search after every generation, computed once per setting."""
    (name,) = (name for name, each in SETTINGS.items() if each is setting)
    return make_history(name)


def test_abandonment_does_not_change_halls_elites_and_genes(setting, history):
    complete = islands_of(Evaluator(record(), setting, abandon=False), GENERATIONS)
    for one, other in zip(history, complete, strict=True):
        assert repr(one.hall_of_fame) == repr(other.hall_of_fame)
        assert repr(one.elite) == repr(other.elite)
        assert [each.genes for each in one.population] == [each.genes for each in other.population]
        assert not abandoned(other)
        # Other individuals are equal; abandoned individuals differ only in parameters, fitness and outcome.
        for each, known in zip(one.population, other.population, strict=True):
            if each.outcome.verdict is Status.ABANDONED:
                assert each == replace(known, theta=(), fitness=inf, outcome=each.outcome)
                assert known.fitness > one.abandon_threshold
            else:
                assert repr(each) == repr(known)
    # The test is meaningful only if individuals are abandoned.
    assert sum(len(abandoned(island)) for island in history) > 5


def test_abandonment_does_not_change_a_search_with_a_library():
    setting = replace(
        SMALL, library="phi-polynomial", library_degree=3, from_library=0.5, structure="increment"
    )
    search_problem = make_problem(record(), setting)
    ends = []
    for abandon in (True, False):
        evaluator = Evaluator(search_problem.record, setting, abandon=abandon)
        island, _ = first_generation(0, 4, evaluator, search_problem.seeds)
        abandoned_individuals = 0
        for _ in range(GENERATIONS):
            island, info = step(island, evaluator, search_problem.pool)
            abandoned_individuals += info.outcomes.get("abandoned", 0)
        assert (abandoned_individuals > 10) == abandon
        ends.append(
            (repr(island.hall_of_fame), repr(island.elite), [each.genes for each in island.population])
        )
    assert ends[0] == ends[1]


# The abandon threshold.


def test_threshold_admits_candidates_of_elite_and_hall_of_fame(setting, history):
    for island in history:
        threshold = _abandon_threshold(island, setting)
        full = len(island.elite) == setting.elites
        assert threshold >= (island.elite[-1].fitness if full else inf)
        thresholds = _thresholds_by_size(island.hall_of_fame, threshold, setting.max_terms)
        assert len(thresholds) == setting.max_terms + 1
        for size, allowed in enumerate(thresholds):
            known = [entry.fitness for entry in island.hall_of_fame.entries if entry.size == size]
            assert allowed == (max(threshold, known[-1]) if len(known) == Individual.kept else inf)


def test_threshold_is_the_80_percent_quantile_of_known_parents():
    (first,) = islands_of(Evaluator(record(), SMALL), 0)
    parents = sorted(each.fitness for each in (*first.elite, *first.population))
    known = sum(fitness < inf for fitness in parents)
    threshold = _abandon_threshold(first, SMALL)
    expected = parents[min(int(0.8 * len(parents)), known - 1)]
    assert threshold == max(expected, first.elite[-1].fitness)
