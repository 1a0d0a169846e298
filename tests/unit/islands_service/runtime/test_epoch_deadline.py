"""`EpochDeadlines`: the deadline of an epoch follows the measured epochs, and only computing time counts."""

import pytest

from islands_service.runtime.epoch_deadline import (
    ALLOWANCE,
    FACTOR,
    FIRST_ALLOWANCE,
    FIRST_FACTOR,
    UNMEASURED_ALLOWANCE,
    EpochDeadlines,
)
from islands_service.runtime.epoch_scheduler import EpochTask

#: An actor, and the epochs of its islands.
ACTOR = "actor"
FIRST = EpochTask(0, -1, 0)
SECOND = EpochTask(0, 0, 5)
THIRD = EpochTask(0, 5, 10)


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


def test_only_the_silent_one_of_two_actors_is_frozen(deadlines, clock):
    deadlines.record(SECOND, 1.0)
    assert clock.frozen_after({"a": THIRD}, most=3.0) == (None, [])
    _, frozen = clock.frozen_after({"a": THIRD, "b": EpochTask(1, 5, 10)})
    assert frozen == ["a"]


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
