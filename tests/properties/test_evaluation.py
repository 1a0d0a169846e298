"""Laws of evaluation: what comes out depends on the individual and its bar, not on company or on the past."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.generation import evaluation
from islands.evolution.generation.evaluation import Evaluator, Limits
from islands.evolution.generation.variation import random_genes
from islands.evolution.gp.individual import Individual
from islands.evolution.gp.rng import Purpose, Stream
from islands.evolution.island import first_generation
from islands.evolution.settings import Settings
from islands.model.expression import Constant, Lagged
from islands.model.parsing import parse
from islands.simulation.outcome import Status
from support.searches import SMALL, evolved, record

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

#: Individuals that fail in every way that there is, and some of one structure written in two ways.
AWKWARD = (
    ("u(k-1)",),
    ("phi1(u(k-1), u(k-1))",),
    ("y(k-1)", "exp(exp(7 + u(k-1)))^9"),
    ("y(k-1)", "u(k-1)", "u(k-1) + y(k-1)"),
    ("y(k-2)", "y(k-3)"),
    ("y(k-1)", "q2(u(k-1))", "phi1(u(k-1), u(k-2))"),
    ("phi1(u(k-2), u(k-1))", "u(k-3)", "y(k-1)"),
    ("u(k-3)", "y(k-1)", "u(k-3)"),
    ("y(k-1)",),
)


def drawn(count):
    """Half of them have a linear y."""
    draw = Stream(2, 0, 0, Purpose.INITIAL)
    return [random_genes(setting, 1, draw) for setting in (FREE, CONSTRAINED) for _ in range(count // 2)]


POOL = tuple(
    Individual(genes)
    for genes in (
        *(tuple(map(parse, texts)) for texts in AWKWARD),
        *drawn(60),
    )
)

#: From an evaluator that remembers all to one that forgets whatever it can between two calls.
LIMITS = [
    Limits(pairs=1 << 17),
    Limits(pairs=0),
    Limits(pairs=1 << 16, genes=0),
    Limits(pairs=1 << 16, structures=0),
    Limits(pairs=0, genes=30_000, structures=9_000),
    Limits(pairs=0, genes=0, structures=0),
]


@cache
def alone(name, place, pruned):
    """What an evaluator that has never seen anybody says of one individual."""
    evaluator = Evaluator(record(), SETTINGS[name], Limits(pairs=0))
    (found,), duplicates = evaluator.evaluate([(POOL[place], pruned)])
    assert duplicates == 0
    return found


def expected(name, place, pruned, bars):
    """The definition of being abandoned: simulated, and beyond the bar of its size."""
    found = alone(name, place, pruned)
    simulated = bool(found.outcome) or "interval" in found.outcome.reason
    if bars is not None and simulated and found.fitness > bars[found.size]:
        return replace(found, theta=(), fitness=inf, outcome=evaluation._ABANDONED)
    return found


populations = st.lists(st.tuples(st.integers(0, len(POOL) - 1), st.booleans()), max_size=30)

#: Bars around the fitnesses that there are, one of them exactly; and none.
bars_of_sizes = st.none() | st.lists(
    st.sampled_from([0.0, 1e-8, 1e-6, 2e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1.0, 1e6, inf]), min_size=6, max_size=6
)


def test_the_individuals_of_these_laws_end_in_every_way():
    for name, others in (
        ("free", {"OK", "SINGULAR", "INFEASIBLE", "DIVERGED"}),
        ("constrained", {"OK", "INFEASIBLE", "DIVERGED"}),
    ):
        found = [alone(name, place, pruned) for place in range(len(POOL)) for pruned in (False, True)]
        assert {each.outcome.verdict.name for each in found} == others
        assert len({each.fitness for each in found if each.outcome}) > 20
        assert any(
            alone(name, place, True).size < alone(name, place, False).size for place in range(len(POOL))
        )
    diverged = {alone("constrained", place, False).outcome.reason for place in range(len(POOL))}
    assert diverged >= {"a regressor overflows on the record", "an interval left the bound"}


@pytest.mark.parametrize("name", SETTINGS)
@given(st.sampled_from(LIMITS), st.lists(st.tuples(populations, bars_of_sizes), min_size=1, max_size=4))
def test_whatever_was_evaluated_before_and_beside_it_an_individual_is_the_same_to_the_last_bit(
    name, limits, history
):
    evaluator = Evaluator(record(), SETTINGS[name], limits)
    for population, bars in history:
        found, duplicates = evaluator.evaluate([(POOL[place], pruned) for place, pruned in population], bars)
        for (place, pruned), each in zip(population, found, strict=True):
            assert repr(each) == repr(expected(name, place, pruned, bars))
        # Nobody is evaluated twice; how many were known depends on the past.
        assert len(population) - len(set(population)) <= duplicates <= len(population)


@pytest.mark.parametrize("name", SETTINGS)
@given(bars_of_sizes, populations, populations)
def test_who_is_abandoned_has_an_exact_fitness_above_its_bar_and_can_be_settled(
    name, bars, before, population
):
    evaluator = Evaluator(record(), SETTINGS[name], Limits(pairs=1 << 16))
    evaluator.evaluate([(POOL[place], pruned) for place, pruned in before])
    found, _ = evaluator.evaluate([(POOL[place], pruned) for place, pruned in population], bars)
    abandoned = [
        (each, key)
        for each, key in zip(found, population, strict=True)
        if each.outcome.verdict is Status.ABANDONED
    ]
    assert bars is not None or not abandoned
    settled = evaluator.evaluate_abandoned([each for each, _ in abandoned])
    for (each, key), exact in zip(abandoned, settled, strict=True):
        assert (each.fitness, each.theta) == (inf, ())
        assert exact.fitness > bars[each.size]
        assert repr(exact) == repr(alone(name, *key))


def test_without_permission_to_abandon_bars_change_nothing():
    population = [(each, True) for each in POOL]
    patient = Evaluator(record(), CONSTRAINED, abandon=False)
    assert patient.evaluate(population, [0.0] * 6) == Evaluator(record(), CONSTRAINED).evaluate(population)


def test_a_bar_that_is_exactly_the_fitness_abandons_nobody():
    for name, setting in SETTINGS.items():
        known = [alone(name, place, False) for place in range(len(POOL))]
        for place, each in enumerate(known):
            if each.outcome:
                bars = [each.fitness if size == each.size else 0.0 for size in range(6)]
                evaluator = Evaluator(record(), setting, Limits(pairs=0))
                assert repr(evaluator.evaluate([(POOL[place], False)], bars)[0][0]) == repr(each)


# Batches.


def test_a_batch_equals_one_by_one():
    population = [(each, bool(place % 3)) for place, each in enumerate(evolved(2).population)]
    together, duplicates = Evaluator(record(), SMALL).evaluate(population)
    one_by_one = [Evaluator(record(), SMALL, Limits(pairs=0)).evaluate([pair])[0][0] for pair in population]
    assert repr(list(together)) == repr(one_by_one)
    backwards, others = Evaluator(record(), SMALL).evaluate(population[::-1])
    assert list(backwards[::-1]) == one_by_one
    assert duplicates == others > 0


@pytest.fixture
def calls(monkeypatch):
    """Sizes of the batches that the kernel was given."""
    sizes = []
    original = evaluation.kernel.evaluate

    def spy(structures, *others):
        sizes.append(len(structures))
        return original(structures, *others)

    monkeypatch.setattr(evaluation.kernel, "evaluate", spy)
    return sizes


@pytest.mark.parametrize("name", SETTINGS)
def test_a_generation_is_one_call_and_several_where_the_table_of_pairs_is_small(calls, name):
    population = [(each, pruned) for each in POOL for pruned in (False, True)]
    whole = Evaluator(record(), SETTINGS[name]).evaluate(population)
    assert calls == [len(population) - whole[1]]
    del calls[:]
    # 1024 places, half of them for one call: of five genes and y(k) 21 pairs each.
    parts = Evaluator(record(), SETTINGS[name], Limits(pairs=0)).evaluate(population)
    assert repr(parts) == repr(whole)
    assert max(calls) == 1024 // 2 // 21
    assert sum(calls) == len(population) - whole[1]


def test_a_table_that_is_nearly_full_is_emptied_between_calls():
    evaluator = Evaluator(record(), FREE, Limits(pairs=0))
    course = []
    for lag in range(1, 17):
        for other in range(1, 14, 4):
            texts = [f"u(k-{lag})*y(k-{other + more})" for more in range(4)]
            evaluator.evaluate([(Individual(tuple(map(parse, texts))), False)])
            course.append(evaluator.memory["pairs"][0])
    # Fifteen pairs of four regressors and y(k); that of y(k) with itself is known to the second.
    assert course[:2] == [15 * 16, 29 * 16]
    assert max(course) <= 1024 * 16 * 3 // 4
    assert any(after < before for before, after in pairwise(course))


# Duplicates.


def test_the_pruning_decision_is_part_of_a_duplicate_s_key():
    genes = tuple(parse(text) for text in ("y(k-1)", "phi1(u(k-1), u(k-2))", "phi2(u(k-1), u(k-9))*y(k-3)"))
    each = Individual(genes)
    evaluator = Evaluator(record(), replace(SMALL, tolerance=1e-3))
    (whole, pruned), duplicates = evaluator.evaluate([(each, False), (each, True)])
    assert (whole.size, duplicates) == (3, 0)
    assert pruned.size < 3
    assert evaluator.evaluate([(each, True), (each, False), (each, True)]) == ((pruned, whole, pruned), 3)


def test_a_bar_that_was_lower_is_no_answer_and_one_that_was_higher_is():
    """Of an abandoned one all that is known is a bound."""
    place = next(place for place in range(len(POOL)) if alone("free", place, False).fitness < inf)
    exact = alone("free", place, False)
    evaluator = Evaluator(record(), FREE)

    def evaluated(bar):
        (found,), duplicates = evaluator.evaluate([(POOL[place], False)], [bar] * 6)
        return found.outcome.verdict.name, duplicates

    assert evaluated(exact.fitness / 2) == ("ABANDONED", 0)
    assert evaluated(exact.fitness / 4) == ("ABANDONED", 1)
    assert evaluated(exact.fitness * 2) == ("OK", 0)
    # What is known exactly is known for every bar, and does not spoil it.
    assert evaluated(exact.fitness / 4) == ("ABANDONED", 1)
    assert evaluated(inf) == ("OK", 1)


def test_a_duplicate_consumes_the_same_draws():
    """Every individual draws its pruning, in order, known or not."""

    class Spy(Evaluator):
        decisions, known = (), 0

        def evaluate(self, population, bars=None):
            self.decisions = [pruned for _, pruned in population]
            found, self.known = super().evaluate(population, bars)
            return found, self.known

    setting = replace(SMALL, prune=0.5, initial_terms=(1, 1), initial_height=0)
    spy = Spy(record(), setting)
    island, info = first_generation(0, 8, spy)
    draw = Stream(8, 0, 0, Purpose.PRUNING)
    assert spy.decisions == [draw.chance(0.5) for _ in range(setting.population)]
    # Leaves alone: hardly any individual is the first of its kind.
    assert setting.population > info.duplicates >= setting.population - 8
    assert spy.known < setting.population
    once_more, seen_before = first_generation(0, 8, spy)
    assert spy.known == setting.population
    # What the evaluator has seen tells how long a generation takes, and nothing of the generation.
    assert (once_more, seen_before) == (island, info)


# Forgetting, and genes that say nothing.


def test_a_forgetful_evaluator_changes_nothing():
    forgetful = Evaluator(record(), SMALL, Limits(pairs=0, genes=0, structures=0))
    known = [(Individual((Lagged(0),)), False)]
    assert [forgetful.evaluate(known)[1] for _ in range(3)] == [0, 0, 0]
    assert [Evaluator(record(), SMALL).evaluate(known * 2)[1] for _ in range(2)] == [1, 1]
    assert repr(evolved(4, evaluator=forgetful)) == repr(evolved(4))


def test_forgetting_empties_everything_and_changes_nothing():
    evaluator = Evaluator(record(), FREE)
    population = [(each, False) for each in POOL]
    first = evaluator.evaluate(population)
    assert evaluator.evaluate(population)[1] == len(POOL)
    assert all(taken > 0 for taken, _ in evaluator.memory.values())
    evaluator.clear_caches()
    assert all(taken == 0 for taken, _ in evaluator.memory.values())
    assert repr(evaluator.evaluate(population)) == repr(first)


def test_zero_genes_and_constants_are_no_surprise():
    """phi of equal lags is zero; such a gene is left out, and an individual of nothing else is infeasible."""
    zero = parse("phi1(q2(u(k-1)), q2(u(k-1)))")
    evaluator = Evaluator(record(), replace(SMALL, constraints="none"))
    (nothing, something), _ = evaluator.evaluate(
        [(Individual((zero,)), False), (Individual((zero, Constant(3.0), Lagged(0))), False)]
    )
    assert (nothing.outcome.verdict.name, nothing.outcome.reason) == ("INFEASIBLE", "no gene is left")
    assert nothing.genes == (zero,)
    assert something.genes == (Constant(3.0), Lagged(0))
    assert something.key == ("y(k-1)", "1")
