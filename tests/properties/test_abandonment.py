"""Laws of abandonment: a search that gives up the hopeless finds what one finds that never gives up."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import inf

import pytest

from islands.evolution.generation.evaluation import Evaluator, Limits
from islands.evolution.gp.individual import Individual
from islands.evolution.hall_of_fame import DEPTH
from islands.evolution.island import _abandon_threshold, _thresholds_by_size, first_generation, step
from islands.evolution.problem import problem
from islands.simulation.outcome import Status
from support.searches import SMALL, exactly, islands_of, record

GENERATIONS = 9

#: Whose individuals fail now and then, besides.
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


#: At the fast level every kind of constraints, of fitness and of elite stands once or more.
FAST = (
    "hysteresis shooting copies",
    "none one-step distinct",
    "hysteresis free-run distinct",
    "none shooting copies",
)


def abandoned(island):
    return [each for each in island.population if each.outcome.verdict is Status.ABANDONED]


@cache
def course_of(name):
    return islands_of(Evaluator(record(), SETTINGS[name]), GENERATIONS)


@pytest.fixture(
    params=[name if name in FAST else pytest.param(name, marks=pytest.mark.nightly) for name in SETTINGS]
)
def setting(request):
    return SETTINGS[request.param]


@pytest.fixture
def course(setting):
    """The islands of a search; it is made once for a setting."""
    (name,) = (name for name, each in SETTINGS.items() if each is setting)
    return course_of(name)


def test_halls_elites_and_genes_are_those_of_a_search_that_abandons_nobody(setting, course):
    patient = islands_of(Evaluator(record(), setting, abandon=False), GENERATIONS)
    for one, other in zip(course, patient, strict=True):
        assert repr(one.hall_of_fame) == repr(other.hall_of_fame)
        assert repr(one.elite) == repr(other.elite)
        assert [each.genes for each in one.population] == [each.genes for each in other.population]
        assert not abandoned(other)
        # Everybody else is known exactly, and who was abandoned is known to be a model.
        for each, known in zip(one.population, other.population, strict=True):
            if each.outcome.verdict is Status.ABANDONED:
                assert each == replace(known, theta=(), fitness=inf, outcome=each.outcome)
                assert known.fitness > one.abandon_threshold
            else:
                assert repr(each) == repr(known)
    # The law says nothing where nobody is given up.
    assert sum(len(abandoned(island)) for island in course) > 15


def test_whoever_is_abandoned_is_less_fit_than_the_island_s_bar_and_settles_to_the_exact_evaluation(
    setting, course
):
    seasoned = Evaluator(record(), setting)
    fresh = Evaluator(record(), setting, Limits(pairs=1 << 16), abandon=False)
    for island in course:
        given_up = abandoned(island)
        settled = seasoned.evaluate_abandoned(given_up)
        exact, _ = fresh.evaluate([(Individual(each.genes), False) for each in given_up])
        assert repr(settled) == repr(exact)
        assert all(each.fitness > island.abandon_threshold for each in settled)
        assert all(each.outcome or "interval" in each.outcome.reason for each in settled)
        # Nobody is in an elite or a hall by less than its fitness.
        assert all(each.outcome.verdict is not Status.ABANDONED for each in island.elite)
        assert all(each.fitness < inf for each in island.hall_of_fame.entries)


def test_what_an_evaluator_has_seen_does_not_change_who_is_abandoned(setting, course):
    """Not even that it knows an individual's fitness already."""
    seasoned = Evaluator(record(), setting)
    for island in course:
        seasoned.evaluate_abandoned([Individual(each.genes) for each in island.population])
    islands_of(seasoned, 3, seed=99)
    forgetful = Evaluator(record(), setting, Limits(pairs=0, genes=0, structures=0))
    for evaluator in (seasoned, forgetful):
        again = islands_of(evaluator, GENERATIONS)
        assert [exactly(island) for island in again] == [exactly(island) for island in course]


def test_with_a_library_s_genes_it_is_the_same():
    setting = replace(
        SMALL, library="phi-polynomial", library_degree=3, from_library=0.5, structure="increment"
    )
    posed = problem(record(), setting)
    ends = []
    for abandon in (True, False):
        evaluator = Evaluator(posed.record, setting, abandon=abandon)
        island, _ = first_generation(0, 4, evaluator, posed.seeds)
        given_up = 0
        for _ in range(GENERATIONS):
            island, info = step(island, evaluator, posed.pool)
            given_up += info.outcomes.get("abandoned", 0)
        assert (given_up > 10) == abandon
        ends.append(
            (repr(island.hall_of_fame), repr(island.elite), [each.genes for each in island.population])
        )
    assert ends[0] == ends[1]


# The bar.


def test_the_bar_follows_from_the_island_before_the_step(setting, course):
    assert course[0].abandon_threshold == inf
    for before, after in pairwise(course):
        assert after.abandon_threshold == _abandon_threshold(before, setting)
    assert course[-1].abandon_threshold < inf


def test_the_bar_lets_pass_whoever_may_enter_the_elite_or_the_hall(setting, course):
    for island in course:
        bar = _abandon_threshold(island, setting)
        full = len(island.elite) == setting.elites
        assert bar >= (island.elite[-1].fitness if full else inf)
        bars = _thresholds_by_size(island.hall_of_fame, bar, setting.max_terms)
        assert len(bars) == setting.max_terms + 1
        for size, allowed in enumerate(bars):
            known = [entry.fitness for entry in island.hall_of_fame.entries if entry.size == size]
            assert allowed == (max(bar, known[-1]) if len(known) == DEPTH else inf)


def test_four_of_five_parents_are_better_than_the_bar_where_as_many_are_known():
    (bred,) = islands_of(Evaluator(record(), SMALL), 0)
    parents = sorted(each.fitness for each in (*bred.elite, *bred.population))
    known = sum(fitness < inf for fitness in parents)
    bar = _abandon_threshold(bred, SMALL)
    expected = parents[min(int(0.8 * len(parents)), known - 1)]
    assert bar == max(expected, bred.elite[-1].fitness)


def test_where_most_parents_are_copies_of_the_best_the_whole_elite_is_within_the_bar():
    setting = SETTINGS["none shooting distinct"]
    island = islands_of(Evaluator(record(), setting), 5)[-1]
    alike = replace(island, population=island.elite[:1] * setting.population)
    assert alike.elite[-1].fitness > alike.elite[0].fitness
    assert _abandon_threshold(alike, setting) == alike.elite[-1].fitness
    elites = []
    for abandon in (True, False):
        following, _ = step(alike, Evaluator(record(), setting, abandon=abandon))
        elites.append(repr(following.elite))
    assert elites[0] == elites[1]


def test_as_long_as_the_elite_is_not_full_everybody_enters_and_nobody_is_abandoned():
    """Of a single lag there are fewer models than an elite has room for, and more than a hall keeps."""
    setting = replace(
        SMALL,
        constraints="none",
        distinct=True,
        elite=1.0,
        initial_height=1,
        max_height=1,
        max_terms=1,
        initial_terms=(1, 1),
        prune=0.0,
        primitives=(),
    )
    seen = set()
    for island in islands_of(Evaluator(record(), setting), 6):
        seen |= {each.key for each in island.population}
        assert {each.key for each in island.elite} == seen
        assert len(island.elite) < setting.elites
        assert not abandoned(island)
    assert len(seen) > DEPTH
    assert island.abandon_threshold == inf
