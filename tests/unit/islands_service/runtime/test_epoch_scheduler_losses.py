"""`EpochScheduler` with lost tasks, and with islands that evolve."""

import random
from dataclasses import replace

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine, run_epoch
from islands.evolution.individual import Individual
from islands.evolution.problem import make_problem
from islands_service.runtime.epoch_scheduler import EpochTask, schedule_islands

#: The record is not used, since numbers replace islands.
from support.epoch_runs import (
    SEED,
    keep_epoch,
    make_epoch,
    make_scheduler,
)
from support.searches import SMALL, exactly, record

# Lost tasks.


def test_lost_task_and_later_ones_of_its_island_are_ready_again():
    scheduler = make_scheduler(ahead=3)
    assert len(list(scheduler.ready_tasks())) == 9
    scheduler.reschedule(EpochTask(1, 0, 4))
    assert list(scheduler.ready_tasks()) == [EpochTask(1, 0, 4), EpochTask(1, 4, 8)]
    scheduler.reschedule(EpochTask(2, 4, 8))
    scheduler.reschedule(EpochTask(0, -1, 0))
    assert list(scheduler.ready_tasks()) == [
        EpochTask(0, -1, 0),
        EpochTask(0, 0, 4),
        EpochTask(0, 4, 8),
        EpochTask(2, 4, 8),
    ]
    # A later task of the same island is reported as lost after the earlier one.
    scheduler.reschedule(EpochTask(1, -1, 0))
    scheduler.reschedule(EpochTask(1, 4, 8))
    assert list(scheduler.ready_tasks()) == [EpochTask(1, -1, 0), EpochTask(1, 0, 4), EpochTask(1, 4, 8)]


def completed_twice():
    """Return a scheduler whose pending second task is already complete, and that task."""
    scheduler = make_scheduler(text="isolated", islands=1)
    first, second, _ = scheduler.ready_tasks()
    scheduler.complete(second, make_epoch(second))
    scheduler.reschedule(first)
    assert list(scheduler.ready_tasks()) == [first, second, EpochTask(0, 4, 8)]
    scheduler.complete(first, make_epoch(first))
    assert len(list(scheduler.completed_epochs())) == 2
    return scheduler, second


def test_second_result_of_a_complete_task_is_ignored():
    scheduler, second = completed_twice()
    before = {island: dict(known) for island, known in scheduler.known.items()}
    scheduler.complete(second, replace(make_epoch(second), emigrants=(Individual(()),)))
    scheduler.complete(EpochTask(0, -1, 0), make_epoch(EpochTask(0, -1, 0)))
    assert scheduler.known == before
    assert list(scheduler.completed_epochs()) == []


# With islands that evolve.


@pytest.fixture(scope="module")
def evolving():
    setting = replace(
        SMALL,
        population=8,
        generations=5,
        elite=0.5,
        islands=3,
        topology="0>1,2>1,1>0",
        migrate_every=2,
        migrants=3,
        emigrants="random",
        characters=("plain", "pruner"),
    )
    return make_problem(record(150), setting)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("first", [None, 1])
def test_islands_evolve_as_in_the_serial_engine_despite_losses(evolving, first, seed):
    whole = list(SerialEngine().run(evolving, empty_archipelago(3, SEED), lambda: False))
    start = empty_archipelago(3, SEED) if first is None else whole[first].archipelago
    whole = whole if first is None else whole[first + 1 :]
    scheduler, evolution, choose = (
        schedule_islands(evolving, start, keep_epoch),
        evolving.open(),
        random.Random(seed),
    )
    out, found, losses = [], [], 0
    while not scheduler.finished:
        out += scheduler.ready_tasks()
        task = choose.choice(
            [
                task
                for task in out
                if all(
                    task.begin in scheduler.known[each]
                    for each in (task.island, *scheduler.sources[task.island])
                )
            ]
        )
        if choose.random() < 0.3:
            losses += 1
            scheduler.reschedule(task)
            out = [each for each in out if each.island != task.island or each.end < task.end]
            continue
        out.remove(task)
        arriving = [
            scheduler.known[source][task.begin].emigrants for source in scheduler.sources[task.island]
        ]
        island = scheduler.known[task.island][task.begin].island
        scheduler.complete(task, run_epoch(island, arriving, evolution, lambda: False))
        found += scheduler.completed_epochs()
    assert losses > 0
    assert len(found) == len(whole)
    for epochs, expected in zip(found, whole, strict=True):
        assert [exactly(epoch.island) for epoch in epochs] == [
            exactly(island) for island in expected.archipelago.islands
        ]
        assert tuple(epoch.steps for epoch in epochs) == expected.steps
