"""Contract of engines: equal epochs, bit for bit, from every start.

The tests run for every entry of the table of engines. On Ray, tests of one history are fast because they
share actors.
"""

from collections import Counter
from dataclasses import replace
from math import inf

import pytest

from islands.errors import RecordError
from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.engine import SerialEngine, run_epoch
from islands.evolution.hall_of_fame import merge
from islands.evolution.problem import make_problem
from islands.evolution.settings import Settings
from islands.expressions.tree import Lagged
from islands.facade.identify import identify
from islands.persistence.checkpoints import read_checkpoint, write_checkpoint
from islands.records.dataset import Dataset
from islands_service.engines import ENGINES
from support import own_primitive
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

#: Ends of the epochs: the first population, three epochs of two generations, and the rest.
GENERATIONS = [0, 2, 4, 6, 7]


#: Levels of the tests that resume a search on Ray; one of them runs for every change.
RESUMED = [pytest.mark.nightly, pytest.mark.ci, pytest.mark.nightly, pytest.mark.nightly]


def on_engines(mark):
    """Return the engines as parameters, all except the serial one with a mark."""
    return [pytest.param(name, marks=() if name == "serial" else mark) for name in ENGINES]


def separate_actors(mark):
    """Mark a test that starts separate actors (two seconds of CPU) on all engines except the serial one."""
    return pytest.mark.parametrize("name", on_engines(mark), indirect=True, scope="module")


#: A Ray takes seven seconds of CPU to start and to end.
ON_ENGINES = on_engines(pytest.mark.ci)


def never_stop():
    return False


@pytest.fixture(scope="module")
def search_problem():
    return make_problem(record(300), SETTINGS)


@pytest.fixture(params=ON_ENGINES, scope="module")
def name(request):
    return request.param


@pytest.fixture(scope="module")
def engine(request, name):
    address = request.getfixturevalue("ray_address") if name == "ray" else None
    with ENGINES[name](address, print) as started:
        yield started


@pytest.fixture(scope="module")
def histories():
    """Histories of the engines that have run, for any order of the tests."""
    return {}


@pytest.fixture(scope="module")
def history(name, engine, search_problem, histories):
    """All epochs of an uninterrupted run with three islands."""
    if name not in histories:
        histories[name] = list(engine.run(search_problem, empty_archipelago(3, 7), never_stop))
    return histories[name]


def archipelagos(epochs):
    return [epoch.archipelago for epoch in epochs]


def test_epochs_end_at_migrations_and_at_the_last_generation(history):
    assert [epoch.archipelago.generation for epoch in history] == GENERATIONS
    for epoch in history:
        islands = epoch.archipelago.islands
        assert [island.generation for island in islands] == [epoch.archipelago.generation] * 3
        assert [island.index for island in islands] == [0, 1, 2]
        assert {island.seed for island in islands} == {7}


def test_engine_equals_single_epochs_of_the_islands(history, search_problem):
    """By definition every island runs separately and passes its emigrants to the next one."""
    evolutions = [search_problem.open() for _ in range(3)]
    islands, leaving = empty_archipelago(3, 7).islands, [(), (), ()]
    for epoch in history:
        epochs = [
            run_epoch(island, [leaving[index - 1]], evolutions[index], never_stop)
            for index, island in enumerate(islands)
        ]
        islands, leaving = [each.island for each in epochs], [each.emigrants for each in epochs]
        assert epoch.archipelago == Archipelago(tuple(islands))
        assert epoch.steps == tuple(each.steps for each in epochs)


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
def test_run_resumed_from_any_epoch_equals_an_uninterrupted_run(engine, history, search_problem, stop):
    resumed = engine.run(search_problem, history[stop].archipelago, never_stop)
    assert archipelagos(resumed) == archipelagos(history)[stop + 1 :]


@separate_actors(pytest.mark.nightly)
def test_run_resumed_from_a_checkpoint_has_equal_bits(engine, history, search_problem, tmp_path):
    paths = tmp_path / "uninterrupted.json", tmp_path / "resumed.json", tmp_path / "stop.json"
    write_checkpoint(history[1].archipelago, paths[2], {})
    stored, _ = read_checkpoint(paths[2])
    assert stored == history[1].archipelago
    # The thresholds determine which individuals the islands abandon next.
    assert all(island.abandon_threshold < inf for island in stored.islands)
    *_, last = engine.run(search_problem, stored, never_stop)
    write_checkpoint(history[-1].archipelago, paths[0], {})
    write_checkpoint(last.archipelago, paths[1], {})
    assert paths[0].read_bytes() == paths[1].read_bytes()


@separate_actors(pytest.mark.nightly)
def test_run_with_more_generations_continues_a_shorter_run(engine, history, search_problem):
    shorter = replace(search_problem, settings=replace(SETTINGS, generations=4))
    *_, stopped = engine.run(shorter, empty_archipelago(3, 7), never_stop)
    assert (
        archipelagos(engine.run(search_problem, stopped.archipelago, never_stop)) == archipelagos(history)[3:]
    )


@separate_actors(pytest.mark.nightly)
def test_run_that_ended_between_stops_continues_to_the_same_stops(engine, history, search_problem):
    shorter = replace(search_problem, settings=replace(SETTINGS, generations=5))
    *_, stopped = engine.run(shorter, empty_archipelago(3, 7), never_stop)
    assert stopped.archipelago.generation == 5
    assert (
        archipelagos(engine.run(search_problem, stopped.archipelago, never_stop)) == archipelagos(history)[3:]
    )


@separate_actors(pytest.mark.nightly)
def test_stopped_engine_yields_no_further_epochs(engine, history, search_problem):
    seen = []
    for epoch in engine.run(search_problem, empty_archipelago(3, 7), lambda: len(seen) == 2):
        seen.append(epoch.archipelago)  # noqa: PERF401 - the engine asks while the list grows
    assert seen == archipelagos(history)[:2]
    assert list(engine.run(search_problem, empty_archipelago(3, 7), lambda: True)) == []


def test_steps_report_all_generations(history):
    before = -1
    for epoch in history:
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


def test_hall_of_fame_of_an_archipelago_merges_those_of_the_islands(history):
    last = history[-1].archipelago
    assert exactly(last.hall_of_fame) == exactly(
        merge(island.hall_of_fame for island in reversed(last.islands))
    )
    for size, entry in last.hall_of_fame.best().items():
        assert entry.fitness == min(
            island.hall_of_fame.best()[size].fitness
            for island in last.islands
            if size in island.hall_of_fame.best()
        )
    assert Archipelago().hall_of_fame.entries == ()


@separate_actors(pytest.mark.ci)
def test_errors_of_a_problem_are_raised_unchanged(engine, search_problem):
    """They are not treated as lost actors, which would be replaced again and again."""
    for wrong in (
        replace(search_problem, seeds=((Lagged(2),),)),
        replace(
            search_problem,
            record=Dataset(
                search_problem.record.u[:3], search_problem.record.y[:3], search_problem.record.dt
            ),
        ),
    ):
        with pytest.raises(RecordError) as raised:
            list(engine.run(wrong, empty_archipelago(3, 7), never_stop))
        assert type(raised.value) is RecordError


@separate_actors(pytest.mark.ci)
@pytest.mark.ci  # compiles the primitive
def test_search_with_a_primitive_of_the_user_equals_that_of_the_serial_engine(engine):
    # The workers of Ray cannot import the module of this function.
    data = own_primitive.record()
    changes = {**own_primitive.SEARCH, "generations": 5, "islands": 2, "migrate_every": 2, "migrants": 2}
    here, there = (identify(data, engine=each, **changes) for each in (SerialEngine(), engine))
    assert [exactly(each.model) for each in there.models] == [exactly(each.model) for each in here.models]
    assert there.search_result.search.history == here.search_result.search.history
    assert "dead_zone" in there.best.export("python")
