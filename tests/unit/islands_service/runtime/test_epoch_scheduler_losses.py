"""The itinerary where legs are lost, and where islands evolve on it."""

import random
from dataclasses import replace

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.epoch import IslandEpoch, run_epoch, select_migrants
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Individual
from islands.evolution.problem import problem
from islands_service.runtime.epoch_scheduler import EpochScheduler, EpochTask

#: Where numbers stand for islands nobody looks at the record.
from support.itineraries import (
    SEED,
    as_it_is,
    epoch_of,
    itinerary,
)
from support.searches import SMALL, exactly, record

# What is lost.


def test_a_lost_leg_and_what_was_sent_after_it_are_due_again_and_nobody_else_s():
    plan = itinerary(ahead=3)
    assert len(list(plan.ready_tasks())) == 9
    plan.reschedule(EpochTask(1, 0, 4))
    assert list(plan.ready_tasks()) == [EpochTask(1, 0, 4), EpochTask(1, 4, 8)]
    plan.reschedule(EpochTask(2, 4, 8))
    plan.reschedule(EpochTask(0, -1, 0))
    assert list(plan.ready_tasks()) == [
        EpochTask(0, -1, 0),
        EpochTask(0, 0, 4),
        EpochTask(0, 4, 8),
        EpochTask(2, 4, 8),
    ]
    # Told of the later one besides, as late as may be.
    plan.reschedule(EpochTask(1, -1, 0))
    plan.reschedule(EpochTask(1, 4, 8))
    assert list(plan.ready_tasks()) == [EpochTask(1, -1, 0), EpochTask(1, 0, 4), EpochTask(1, 4, 8)]


def test_a_loss_of_what_is_known_already_holds_nobody_up():
    """The second leg came back, the first one was lost; then what was sent again after it is lost too."""
    plan = itinerary(text="isolated", islands=1, ahead=2)
    first, second = plan.ready_tasks()
    plan.complete(second, epoch_of(second))
    plan.reschedule(first)
    again = list(plan.ready_tasks())
    plan.complete(first, epoch_of(first))
    assert list(plan.completed_epochs()) == [(epoch_of(first),), (epoch_of(second),)]
    for leg in again[1:]:
        plan.reschedule(leg)
    assert EpochTask(0, 4, 8) in list(plan.ready_tasks())


def completed_twice():
    """An island whose second leg is out once more, though it is known and complete; a third is out, too."""
    plan = itinerary(text="isolated", islands=1)
    first, second, _ = plan.ready_tasks()
    plan.complete(second, epoch_of(second))
    plan.reschedule(first)
    assert list(plan.ready_tasks()) == [first, second, EpochTask(0, 4, 8)]
    plan.complete(first, epoch_of(first))
    assert len(list(plan.completed_epochs())) == 2
    return plan, second


def test_a_loss_of_what_is_complete_loses_what_was_sent_after_it():
    plan, second = completed_twice()
    plan.reschedule(second)
    assert list(plan.ready_tasks()) == [EpochTask(0, 4, 8), EpochTask(0, 8, 10)]


def test_what_comes_back_of_what_is_complete_already_is_forgotten():
    plan, second = completed_twice()
    before = [dict(known) for known in plan.known]
    plan.complete(second, replace(epoch_of(second), emigrants=(Individual(()),)))
    plan.complete(EpochTask(0, -1, 0), epoch_of(EpochTask(0, -1, 0)))
    assert plan.known == before
    assert list(plan.completed_epochs()) == []


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
    return problem(record(150), setting)


def test_it_begins_with_those_who_leave_the_islands_of_its_start(evolving):
    for epoch in SerialEngine().run(evolving, empty_archipelago(3, SEED), lambda: False):
        start = epoch.archipelago
        known = EpochScheduler(evolving, start, as_it_is).known
        for island, each in zip(start.islands, known, strict=True):
            leaving = select_migrants(island, evolving.settings_of(island.index))
            assert each == {start.generation: IslandEpoch(island, leaving, ())}
            assert bool(leaving) == (start.generation in (2, 4))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("first", [None, 1])
def test_in_any_order_and_with_losses_islands_evolve_as_one_after_the_other(evolving, first, seed):
    whole = list(SerialEngine().run(evolving, empty_archipelago(3, SEED), lambda: False))
    start = empty_archipelago(3, SEED) if first is None else whole[first].archipelago
    whole = whole if first is None else whole[first + 1 :]
    plan, evaluator, choose = (
        EpochScheduler(evolving, start, as_it_is),
        Evaluator(evolving.record, evolving.settings),
        random.Random(seed),
    )
    out, found, losses = [], [], 0
    while not plan.finished:
        out += plan.ready_tasks()
        leg = choose.choice(
            [
                leg
                for leg in out
                if all(leg.begin in plan.known[each] for each in (leg.island, *plan.sources[leg.island]))
            ]
        )
        if choose.random() < 0.3:
            losses += 1
            plan.reschedule(leg)
            out = [each for each in out if each.island != leg.island or each.end < leg.end]
            continue
        out.remove(leg)
        arriving = [plan.known[source][leg.begin].emigrants for source in plan.sources[leg.island]]
        island = plan.known[leg.island][leg.begin].island
        plan.complete(leg, run_epoch(island, arriving, evaluator, evolving, lambda: False))
        found += plan.completed_epochs()
    assert losses > 0
    assert len(found) == len(whole)
    for epochs, expected in zip(found, whole, strict=True):
        assert [exactly(epoch.island) for epoch in epochs] == [
            exactly(island) for island in expected.archipelago.islands
        ]
        assert tuple(epoch.steps for epoch in epochs) == expected.steps
