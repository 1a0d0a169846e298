"""Laws of an epoch: it is its steps and nothing else, and it ends at a stop."""

from dataclasses import replace

import pytest

from islands.evolution.epoch import next_stop, receive_migrants, run_epoch, select_migrants
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.island import Island, first_generation, step
from islands.evolution.problem import Problem, problem
from support.migrations import SETTINGS, advanced, evaluator, every_replaced, keys, models, recorded
from support.searches import SMALL, exactly


@pytest.fixture(scope="module")
def posed():
    """With a library: its seeds found an island, and its genes are in the pool."""
    setting = replace(
        SMALL,
        population=12,
        elite=0.5,
        generations=8,
        migrate_every=3,
        library="phi-polynomial",
        library_degree=2,
        from_library=0.5,
        characters=("pruner", "explorer"),
    )
    return problem(recorded(), setting)


def begun(posed, index=0):
    """Islands at the end of the first epochs: generations 0, 3 and 6."""
    epochs = [advanced(Island(index, 7, -1, (), (), HallOfFame()), posed)]
    epochs.append(advanced(epochs[-1].island, posed))
    epochs.append(advanced(epochs[-1].island, posed))
    return epochs


@pytest.mark.parametrize("index", [0, 1])
def test_an_epoch_is_its_steps_one_by_one(posed, index):
    judge, setting = Evaluator(posed.record, posed.settings), posed.settings_of(index)
    founding, first, second = begun(posed, index)
    island, info = first_generation(index, 7, judge, posed.seeds, setting)
    assert exactly(founding.island) == exactly(island)
    assert (founding.steps, founding.emigrants) == ((info,), ())
    for epoch in (first, second):
        infos = []
        for _ in range(3):
            island, info = step(island, judge, posed.pool, setting)
            infos.append(info)
        assert exactly(epoch.island) == exactly(island)
        assert epoch.steps == tuple(infos)
        assert epoch.emigrants == select_migrants(island, setting)
        assert len(epoch.emigrants) == 1


@every_replaced
def test_an_epoch_begins_with_those_who_arrive(posed, replaced):
    posed = replace(posed, settings=replace(posed.settings, replaced=replaced, migrants=6))
    here, there = begun(posed, 0)[1], begun(posed, 1)[1]
    judge = Evaluator(posed.record, posed.settings)
    arrived = receive_migrants(here.island, [there.emigrants], judge, posed.settings_of(0))
    assert arrived != here.island
    after = advanced(here.island, posed, [there.emigrants])
    infos = []
    for _ in range(3):
        arrived, info = step(arrived, judge, posed.pool, posed.settings_of(0))
        infos.append(info)
    assert exactly(after.island) == exactly(arrived)
    assert after.steps == tuple(infos)
    assert after.island != advanced(here.island, posed).island


def test_who_arrives_is_bred_from():
    fittest, *others = sorted(models(), key=lambda each: each.fitness)
    island = Island(0, 3, 3, tuple(others[-6:]), tuple(others[-3:]), HallOfFame())
    copies = Problem(recorded(), replace(SETTINGS, crossover=0.0, mutation=0.0, prune=0.0, generations=4))
    assert fittest.key in keys(advanced(island, copies, [(fittest,)]).island.population)
    assert fittest.key not in keys(advanced(island, copies).island.population)


def test_epochs_without_arrivals_compose(posed):
    """Two epochs of three generations are one of six: a stop by itself changes nothing."""
    founding, first, second = begun(posed)
    longer = replace(posed, settings=replace(posed.settings, migrate_every=6))
    whole = advanced(founding.island, longer)
    assert exactly(whole.island) == exactly(second.island)
    assert whole.steps == first.steps + second.steps
    assert whole.emigrants == second.emigrants


def test_a_run_that_ends_between_two_stops_goes_on_as_if_never_stopped(posed):
    *_, sixth = begun(posed)
    last = advanced(sixth.island, posed)
    assert [info.generation for info in last.steps] == [7, 8]
    assert last.emigrants == ()
    longer = replace(posed, settings=replace(posed.settings, generations=20))
    assert exactly(advanced(last.island, longer).island) == exactly(advanced(sixth.island, longer).island)


def test_an_epoch_ends_at_the_next_stop_or_with_the_run():
    setting = replace(SETTINGS, migrate_every="3,7:2", generations=12)
    assert [next_stop(generation, setting) for generation in range(-1, 12)] == [
        *(0, 3, 3, 3, 6, 6, 6, 7, 9, 9, 11, 11, 12)
    ]
    assert next_stop(-1, replace(setting, generations=0)) == 0
    assert next_stop(0, replace(setting, generations=2)) == 2


@pytest.mark.parametrize("asked", [1, 2, 3])
def test_who_is_told_to_stop_brings_nothing_back(posed, asked):
    founding, first, _ = begun(posed)
    judge, answers = Evaluator(posed.record, posed.settings), iter([False] * (asked - 1) + [True])
    assert run_epoch(founding.island, [], judge, posed, lambda: next(answers)) is None
    assert list(answers) == []
    # What has been done of the epoch is lost, and harms nobody.
    assert exactly(advanced(founding.island, posed, judge=judge).island) == exactly(first.island)


def test_it_is_asked_before_every_generation_and_not_after_the_last(posed):
    founding, first, _ = begun(posed)
    answers = iter([False] * 3)
    epoch = run_epoch(
        founding.island, [], Evaluator(posed.record, posed.settings), posed, lambda: next(answers)
    )
    assert list(answers) == []
    assert exactly(epoch.island) == exactly(first.island)
    before_the_first = Island(0, 7, -1, (), (), HallOfFame())
    assert run_epoch(before_the_first, [], evaluator(), Problem(recorded(), SETTINGS), lambda: True) is None
