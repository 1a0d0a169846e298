"""What every engine owes: the same epochs, bit for bit, wherever it starts and however it carries them out.

A new engine joins the table of engines and is held to all of it. On Ray the laws about one course are fast,
since they share its actors.
"""

from collections import Counter
from dataclasses import replace
from math import inf

import pytest

from islands.data.dataset import Dataset
from islands.errors import RecordError
from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.epoch import run_epoch, select_migrants
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.hall_of_fame import merge
from islands.evolution.problem import problem
from islands.evolution.settings import Settings
from islands.io.checkpoints import read_checkpoint, write_checkpoint
from islands.model.expression import Lagged
from islands_service.engines import ENGINES
from support.searches import exactly, record

SETTINGS = Settings(
    population=16,
    generations=7,
    prune=0.4,
    max_terms=4,
    initial_terms=(1, 4),
    max_height=3,
    shooting=40,
    library="phi-polynomial",
    library_degree=2,
    from_library=0.5,
    islands=3,
    topology="ring",
    migrate_every=2,
    migrants=2,
    characters=("plain", "explorer"),
)

#: The first populations, two epochs of two generations, a third, and what is left.
GENERATIONS = [0, 2, 4, 6, 7]


#: On Ray a search that is resumed in the middle is enough for every change.
RESUMED = [pytest.mark.nightly, pytest.mark.ci, pytest.mark.nightly, pytest.mark.nightly]


def elsewhere(mark):
    """Mark a law that starts actors of its own, two seconds of CPU, on every engine but the serial one."""
    engines = [pytest.param(name, marks=() if name == "serial" else mark) for name in ENGINES]
    return pytest.mark.parametrize("name", engines, indirect=True, scope="module")


def never():
    return False


@pytest.fixture(scope="module")
def posed():
    return problem(record(300), SETTINGS)


@pytest.fixture(params=ENGINES, scope="module")
def name(request):
    return request.param


@pytest.fixture(scope="module")
def engine(request, name):
    address = request.getfixturevalue("ray_address") if name == "ray" else None
    with ENGINES[name](address, print) as started:
        yield started


@pytest.fixture(scope="module")
def courses():
    """The course of every engine that has run, whatever the order of the tests."""
    return {}


@pytest.fixture(scope="module")
def course(name, engine, posed, courses):
    """Every epoch of three islands, never stopped: every engine's is held against every other engine's."""
    if name not in courses:
        courses[name] = list(engine.run(posed, empty_archipelago(3, 7), never))
    return courses[name]


def archipelagos(epochs):
    return [epoch.archipelago for epoch in epochs]


def test_epochs_end_where_islands_migrate_and_at_the_last_generation(course):
    assert [epoch.archipelago.generation for epoch in course] == GENERATIONS
    for epoch in course:
        islands = epoch.archipelago.islands
        assert [island.generation for island in islands] == [epoch.archipelago.generation] * 3
        assert [island.index for island in islands] == [0, 1, 2]
        assert {island.seed for island in islands} == {7}


def test_an_engine_does_what_the_islands_do_one_by_one(course, posed):
    """The definition: every island by itself, and every island's emigrants handed to the next one."""
    evaluators = [Evaluator(posed.record, posed.settings) for _ in range(3)]
    islands, leaving = empty_archipelago(3, 7).islands, [(), (), ()]
    for epoch in course:
        epochs = [
            run_epoch(island, [leaving[index - 1]], evaluators[index], posed, never)
            for index, island in enumerate(islands)
        ]
        islands, leaving = [each.island for each in epochs], [each.emigrants for each in epochs]
        assert epoch.archipelago == Archipelago(tuple(islands))
        assert epoch.steps == tuple(each.steps for each in epochs)


@elsewhere(pytest.mark.nightly)
def test_migration_makes_a_difference(course, engine, posed):
    alone = replace(posed, settings=replace(SETTINGS, topology="isolated"))
    isolated = archipelagos(engine.run(alone, empty_archipelago(3, 7), never))
    # Whoever leaves at generation 2 arrives at the beginning of the epoch behind it.
    assert isolated[:2] == archipelagos(course)[:2]
    assert isolated[-1] != course[-1].archipelago
    assert all(select_migrants(island, SETTINGS) for island in course[1].archipelago.islands)


@pytest.mark.parametrize(
    ("name", "stop"),
    [
        pytest.param(name, stop, marks=() if name == "serial" else RESUMED[stop])
        for name in ENGINES
        for stop in range(4)
    ],
    indirect=["name"],
    scope="module",
)
def test_resumed_from_any_epoch_equals_never_stopped(engine, course, posed, stop):
    resumed = engine.run(posed, course[stop].archipelago, never)
    assert archipelagos(resumed) == archipelagos(course)[stop + 1 :]


@elsewhere(pytest.mark.nightly)
def test_resumed_from_a_checkpoint_equals_never_stopped_bit_for_bit(engine, course, posed, tmp_path):
    paths = tmp_path / "never-stopped.json", tmp_path / "resumed.json", tmp_path / "stop.json"
    write_checkpoint(course[1].archipelago, paths[2], {})
    stored, _ = read_checkpoint(paths[2])
    assert stored == course[1].archipelago
    # What the islands abandon next hangs on their bars.
    assert all(island.abandon_threshold < inf for island in stored.islands)
    *_, last = engine.run(posed, stored, never)
    write_checkpoint(course[-1].archipelago, paths[0], {})
    write_checkpoint(last.archipelago, paths[1], {})
    assert paths[0].read_bytes() == paths[1].read_bytes()


@elsewhere(pytest.mark.nightly)
def test_an_engine_may_run_twice_and_be_left_between(engine, course, posed):
    first = engine.run(posed, empty_archipelago(3, 7), never)
    assert next(first).archipelago == course[0].archipelago
    first.close()
    assert archipelagos(engine.run(posed, empty_archipelago(3, 7), never)) == archipelagos(course)


def test_from_the_last_epoch_there_is_nothing_to_do(engine, course, posed):
    assert list(engine.run(posed, course[-1].archipelago, never)) == []


@elsewhere(pytest.mark.nightly)
def test_more_generations_go_on_where_fewer_ended(engine, course, posed):
    shorter = replace(posed, settings=replace(SETTINGS, generations=4))
    *_, stopped = engine.run(shorter, empty_archipelago(3, 7), never)
    assert archipelagos(engine.run(posed, stopped.archipelago, never)) == archipelagos(course)[3:]


@elsewhere(pytest.mark.nightly)
def test_a_run_that_ended_between_two_stops_goes_on_to_the_same_stops(engine, course, posed):
    shorter = replace(posed, settings=replace(SETTINGS, generations=5))
    *_, stopped = engine.run(shorter, empty_archipelago(3, 7), never)
    assert stopped.archipelago.generation == 5
    assert archipelagos(engine.run(posed, stopped.archipelago, never)) == archipelagos(course)[3:]


@elsewhere(pytest.mark.ci)
def test_told_to_stop_an_engine_ends_and_what_it_yielded_stands(engine, course, posed):
    seen = []
    for epoch in engine.run(posed, empty_archipelago(3, 7), lambda: len(seen) == 2):
        seen.append(epoch.archipelago)  # noqa: PERF401 - the engine asks while the list grows
    assert seen == archipelagos(course)[:2]
    assert list(engine.run(posed, empty_archipelago(3, 7), lambda: True)) == []


@elsewhere(pytest.mark.nightly)
def test_another_seed_is_another_run(engine, course, posed):
    other = next(iter(engine.run(posed, empty_archipelago(3, 8), never))).archipelago
    assert [island.population for island in other.islands] != [
        island.population for island in course[0].archipelago.islands
    ]


def test_every_step_is_told(course):
    before = -1
    for epoch in course:
        for island, steps in zip(epoch.archipelago.islands, epoch.steps, strict=True):
            assert [info.generation for info in steps] == list(range(before + 1, island.generation + 1))
            assert all(info.evaluations == SETTINGS.population for info in steps)
            assert all(sum(info.outcomes.values()) == info.evaluations for info in steps)
            assert all(0 <= info.duplicates <= info.evaluations for info in steps)
            assert steps[-1].best == {size: each.fitness for size, each in island.hall_of_fame.best().items()}
            assert steps[-1].outcomes == Counter(
                each.outcome.verdict.name.lower() for each in island.population
            )
        before = epoch.archipelago.generation


def test_an_epoch_says_what_the_caches_take_and_what_they_may(course):
    for epoch in course:
        assert set(epoch.caches) == {"pairs", "genes", "structures"}
        assert all(0 < taken <= limit for taken, limit in epoch.caches.values())


def test_the_hall_of_an_archipelago_is_gathered_from_its_islands(course):
    last = course[-1].archipelago
    assert exactly(last.hall_of_fame) == exactly(
        merge(*(island.hall_of_fame for island in reversed(last.islands)))
    )
    for size, entry in last.hall_of_fame.best().items():
        assert entry.fitness == min(
            island.hall_of_fame.best()[size].fitness
            for island in last.islands
            if size in island.hall_of_fame.best()
        )
    assert Archipelago().hall_of_fame.entries == ()


@elsewhere(pytest.mark.ci)
def test_what_is_wrong_with_a_problem_comes_out_as_it_is(engine, posed):
    """Not as a lost actor that is replaced again and again."""
    for wrong in (
        replace(posed, seeds=((Lagged(2),),)),
        replace(posed, record=Dataset(posed.record.u[:3], posed.record.y[:3], posed.record.dt)),
    ):
        with pytest.raises(RecordError) as raised:
            list(engine.run(wrong, empty_archipelago(3, 7), never))
        assert type(raised.value) is RecordError


@elsewhere(pytest.mark.ci)
def test_more_islands_than_processors_share_them(engine, posed):
    many = replace(posed, settings=replace(SETTINGS, islands=9, topology="torus", migrants=1, generations=2))
    *_, last = engine.run(many, empty_archipelago(9, 1), never)
    apart = replace(many, settings=replace(many.settings, generations=0))
    *_, first = engine.run(apart, empty_archipelago(9, 1), never)
    assert last.archipelago.generation == 2
    assert len({island.population for island in first.archipelago.islands}) == 9
