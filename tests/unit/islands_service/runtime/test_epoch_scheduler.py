"""`EpochScheduler`: an island waits only for its sources, also after losses.

The tests play the actors, in any order. An epoch is a number computed from the numbers that it depends on, so
that any confusion would change the last number.
"""

from collections import deque
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands_service.runtime.epoch_scheduler import (
    ALLOWANCE,
    FACTOR,
    FIRST_ALLOWANCE,
    FIRST_FACTOR,
    UNMEASURED_ALLOWANCE,
    EpochDeadlines,
    EpochTask,
)

#: The record is not used, since numbers replace islands.
from support.epoch_runs import (
    SEED,
    PlayedRun,
    orders,
    play,
    run_in_lockstep,
    searches,
)

#: An actor, and the epochs of its islands.
ACTOR = "actor"
FIRST = EpochTask(0, -1, 0)
SECOND = EpochTask(0, 0, 5)
THIRD = EpochTask(0, 5, 10)


@pytest.mark.ci
@given(searches(), orders)
def test_every_epoch_comes_once_in_order_and_with_the_right_values(search, choose):
    problem_, ends, ahead = search
    done = play(PlayedRun(problem_, ends, ahead), choose)
    assert done == list(run_in_lockstep(problem_, ends))


@given(searches(), orders, st.integers(1, 25))
def test_losses_do_not_change_the_values_of_a_search(search, choose, losses):
    problem_, ends, ahead = search
    done = play(PlayedRun(problem_, ends, ahead), choose, losses)
    assert done == list(run_in_lockstep(problem_, ends))


@given(searches(), orders, st.data())
def test_scheduler_continues_from_any_epoch(search, choose, data):
    problem_, ends, ahead = search
    first = data.draw(st.sampled_from(ends))
    start = Archipelago(
        tuple(
            replace(each, generation=first)
            for each in empty_archipelago(problem_.settings.islands, SEED).islands
        )
    )
    left = ends[ends.index(first) :]
    done = play(PlayedRun(problem_, left, ahead, start), choose, losses=3)
    assert done == list(run_in_lockstep(problem_, left, first))
    assert len(done) == len(left) - 1


# No barrier.


def distances(sources, island):
    """Return the number of epochs after which the lack of an island delays each other one."""
    found, new = {island: 0}, deque([island])
    while new:
        near = new.popleft()
        for other, each in enumerate(sources):
            if near in each and other not in found:
                found[other] = found[near] + 1
                new.append(other)
    return found


@given(searches(), orders, st.data())
def test_islands_independent_of_the_slowest_are_not_delayed(search, choose, data):
    """An island at distance n from the slowest is n epochs ahead; independent ones are at the limit."""
    problem_, ends, ahead = search
    run = PlayedRun(problem_, ends, ahead)
    slowest = data.draw(st.integers(0, problem_.settings.islands - 1))
    for _ in range(data.draw(st.integers(0, 12))):
        if not run.scheduler.finished:
            run.send()
            task = choose.choice(run.ready())
            run.carry(task)
            run.report(task)
    from_there = ends.index(max(run.scheduler.known[slowest]))
    while not run.scheduler.finished:
        run.send()
        ready = [task for task in run.ready() if task.island != slowest]
        if not ready:
            break
        task = choose.choice(ready)
        run.carry(task)
        run.report(task)
    complete, away = ends.index(run.scheduler.completed_generation), distances(run.sources, slowest)
    for island, known in run.scheduler.known.items():
        reachable = from_there + away.get(island, len(ends))
        assert ends.index(max(known)) == min(reachable, complete + ahead, len(ends) - 1)


class Clock:
    """Checks every tenth of a second of a clock that a test moves."""

    def __init__(self, deadlines):
        self._deadlines, self.now = deadlines, 1000.0

    def frozen_after(self, computing, most=1000.0):
        """Return the seconds until an actor counts as frozen, None if none does; and the actors."""
        began = self.now
        while self.now < began + most:
            if frozen := self._deadlines.find_frozen(self.now, computing):
                return self.now - began, frozen
            self.now += 0.1
        return None, []


@pytest.fixture
def deadlines():
    return EpochDeadlines(islands=2, population=100)


@pytest.fixture
def clock(deadlines):
    return Clock(deadlines)


def test_deadline_is_a_multiple_of_the_slowest_recent_epoch(deadlines, clock):
    for seconds in (1.0, 4.0, 2.0):
        deadlines.record(SECOND, seconds)
    seconds, frozen = clock.frozen_after({ACTOR: THIRD})
    assert frozen == [ACTOR]
    assert seconds == pytest.approx(FACTOR * 4.0 + ALLOWANCE, abs=0.25)
    for _ in range(8):
        deadlines.record(SECOND, 1.0)
    assert deadlines.seconds_allowed(THIRD) == FACTOR * 1.0 + ALLOWANCE


def test_unmeasured_epoch_has_a_time_that_grows_with_the_population(deadlines):
    large = EpochDeadlines(islands=2, population=100_000)
    assert UNMEASURED_ALLOWANCE < deadlines.seconds_allowed(FIRST) < large.seconds_allowed(FIRST)
    assert large.seconds_allowed(FIRST) > 3600.0


def test_first_population_of_any_island_bounds_the_others_and_the_next_epochs(deadlines):
    deadlines.record(FIRST, 3.0)
    assert deadlines.seconds_allowed(EpochTask(1, -1, 0)) == FIRST_FACTOR * 3.0 + FIRST_ALLOWANCE
    assert deadlines.seconds_allowed(SECOND) == FIRST_FACTOR * 15.0 + FIRST_ALLOWANCE
    deadlines.record(SECOND, 1.0)
    assert deadlines.seconds_allowed(EpochTask(1, -1, 0)) == FIRST_FACTOR * 3.0 + FIRST_ALLOWANCE


def test_time_in_a_queue_and_time_without_immigrants_do_not_count(deadlines, clock):
    """An actor with many islands is busy with one of them at a time."""
    deadlines.record(SECOND, 1.0)
    for island in range(20):
        seconds, _ = clock.frozen_after({ACTOR: EpochTask(island, 5, 10)}, most=3.0)
        assert seconds is None
    assert clock.frozen_after({}, most=60.0) == (None, [])
    seconds, _ = clock.frozen_after({ACTOR: THIRD})
    assert seconds == pytest.approx(FACTOR * 1.0 + ALLOWANCE, abs=0.25)


def test_overloaded_machine_does_not_cause_endless_replacements(deadlines, clock):
    """Epochs become a hundred times slower: the deadline exceeds them after a few losses, then follows."""
    deadlines.record(SECOND, 1.0)
    losses, slow = 0, 100.0
    while clock.frozen_after({ACTOR: EpochTask(0, 5, 10)}, most=slow)[1]:
        deadlines.extend()
        losses += 1
    assert losses == 5
    deadlines.record(THIRD, slow)
    deadlines.reset()
    assert deadlines.seconds_allowed(THIRD) == FACTOR * slow + ALLOWANCE
