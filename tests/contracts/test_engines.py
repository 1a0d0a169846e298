"""What every engine owes: the same epochs, bit for bit, wherever it starts and however it carries them out.

A new engine joins the table and is held to all of it.
"""

from collections import Counter
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import SerialEngine, together
from islands.evolution.evaluation import Evaluator
from islands.evolution.hall_of_fame import merge
from islands.evolution.island import StepInfo, first_generation, step
from islands.evolution.problem import problem
from islands.evolution.settings import Settings
from islands.io.checkpoints import read_checkpoint, write_checkpoint

ENGINES = {"serial": SerialEngine}

SETTINGS = Settings(
    population=16,
    generations=4,
    prune=0.4,
    max_terms=4,
    initial_terms=(1, 4),
    max_height=3,
    shooting=40,
    library="phi-polynomial",
    library_degree=2,
    from_library=0.5,
)


def record():
    rng = np.random.default_rng(5)
    u = np.cumsum(rng.normal(size=300)) / 10
    y = np.zeros(300)
    for k in range(2, 300):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + 0.8 * rise - 0.3 * y[k - 1] * abs(rise)
    return Dataset(u, y + 1e-3 * rng.normal(size=300), 0.1)


@pytest.fixture(scope="module")
def posed():
    return problem(record(), SETTINGS)


@pytest.fixture(params=ENGINES)
def engine(request):
    return ENGINES[request.param]()


@pytest.fixture(params=ENGINES, scope="module")
def course(request, posed):
    """Every epoch of two islands, never stopped: every engine's is held against every other engine's."""
    return list(ENGINES[request.param]().run(posed, 7, 2, Archipelago()))


def archipelagos(epochs):
    return [epoch.archipelago for epoch in epochs]


def test_epochs_are_counted_from_0_to_the_last_generation(course):
    assert [epoch.archipelago.epoch for epoch in course] == [0, 1, 2, 3, 4]
    for epoch in course:
        assert [island.generation for island in epoch.archipelago.islands] == [epoch.archipelago.epoch] * 2
        assert [island.index for island in epoch.archipelago.islands] == [0, 1]
        assert {island.seed for island in epoch.archipelago.islands} == {7}


def test_an_engine_does_what_the_steps_do(course, posed):
    """The definition: every island by itself, step by step."""
    for index in (0, 1):
        evaluator = Evaluator(posed.record, posed.settings)
        island, _ = first_generation(index, 7, evaluator, posed.seeds)
        for epoch in course:
            assert epoch.archipelago.islands[index] == island
            island, _ = step(island, evaluator, posed.pool)


@pytest.mark.parametrize("stop", [0, 1, 2, 3])
def test_resumed_from_any_epoch_equals_never_stopped(engine, course, posed, stop):
    resumed = engine.run(posed, 7, 2, course[stop].archipelago)
    assert archipelagos(resumed) == archipelagos(course)[stop + 1 :]


def test_resumed_from_a_checkpoint_equals_never_stopped_bit_for_bit(engine, course, posed, tmp_path):
    paths = tmp_path / "never-stopped.json", tmp_path / "resumed.json", tmp_path / "stop.json"
    write_checkpoint(course[1].archipelago, paths[2], {})
    stored, _ = read_checkpoint(paths[2])
    assert stored == course[1].archipelago
    # What the islands abandon next hangs on their bars.
    assert all(island.bar < inf for island in stored.islands)
    *_, last = engine.run(posed, 7, 2, stored)
    write_checkpoint(course[-1].archipelago, paths[0], {})
    write_checkpoint(last.archipelago, paths[1], {})
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_an_engine_may_run_twice_and_stop_between(engine, course, posed):
    first = engine.run(posed, 7, 2, Archipelago())
    assert next(first).archipelago == course[0].archipelago
    first.close()
    assert archipelagos(engine.run(posed, 7, 2, Archipelago())) == archipelagos(course)


def test_from_the_last_epoch_there_is_nothing_to_do(engine, course, posed):
    assert list(engine.run(posed, 7, 2, course[-1].archipelago)) == []


def test_more_generations_go_on_where_fewer_ended(engine, course, posed):
    shorter = replace(posed, settings=replace(SETTINGS, generations=2))
    *_, stopped = engine.run(shorter, 7, 2, Archipelago())
    assert archipelagos(engine.run(posed, 7, 2, stopped.archipelago)) == archipelagos(course)[3:]


def test_the_islands_of_a_start_are_those_that_go_on(engine, course, posed):
    """Number and seed of the call are those of a new run; a start brings its own."""
    assert archipelagos(engine.run(posed, 99, 5, course[2].archipelago)) == archipelagos(course)[3:]


def test_two_islands_differ_and_neither_knows_of_the_other(engine, course, posed):
    alone = archipelagos(engine.run(posed, 7, 1, Archipelago()))
    for one, two in zip(alone, archipelagos(course), strict=True):
        assert len(one.islands) == 1
        assert one.islands[0] == two.islands[0]
    here, there = course[-1].archipelago.islands
    assert here.population != there.population
    assert not set(here.population) >= set(there.population)


def test_another_seed_is_another_run(engine, course, posed):
    other = next(iter(engine.run(posed, 8, 2, Archipelago()))).archipelago
    assert [island.population for island in other.islands] != [
        island.population for island in course[0].archipelago.islands
    ]


def test_what_is_said_of_an_epoch_is_the_sum_over_its_islands(course):
    for epoch in course:
        assert epoch.info.evaluations == 2 * SETTINGS.population
        assert sum(epoch.info.outcomes.values()) == epoch.info.evaluations
        assert epoch.info.outcomes == Counter(
            each.outcome.verdict.name.lower()
            for island in epoch.archipelago.islands
            for each in island.population
        )
        assert 0 <= epoch.info.duplicates < epoch.info.evaluations


def test_an_epoch_says_what_the_caches_take_and_what_they_may(course):
    for epoch in course:
        assert set(epoch.caches) == {"pairs", "genes", "structures"}
        assert all(0 < taken <= limit for taken, limit in epoch.caches.values())


def test_what_several_islands_did_is_added_up():
    """For every engine to use, and for the sum not to depend on which."""
    one, other = StepInfo(3, 1, {"ok": 2, "singular": 1}), StepInfo(5, 2, {"diverged": 1, "ok": 4})
    expected = StepInfo(8, 3, {"ok": 6, "singular": 1, "diverged": 1})
    assert together([one, other]) == together([other, one]) == expected
    assert together([]) == StepInfo(0, 0, {})


def test_the_hall_of_an_archipelago_is_gathered_from_its_islands(course):
    last = course[-1].archipelago
    assert last.hall == merge(last.islands[1].hall, last.islands[0].hall)
    for size, entry in last.hall.best().items():
        assert entry.fitness == min(
            island.hall.best()[size].fitness for island in last.islands if size in island.hall.best()
        )
    assert Archipelago().hall.entries == ()
