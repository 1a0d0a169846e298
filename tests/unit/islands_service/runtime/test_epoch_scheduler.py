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

#: The record is not used, since numbers replace islands.
from support.epoch_runs import (
    SEED,
    PlayedRun,
    orders,
    play,
    run_in_lockstep,
    searches,
)


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


@given(searches(), orders)
def test_epochs_before_the_last_complete_archipelago_are_dropped(search, choose):
    problem_, ends, ahead = search
    run = PlayedRun(problem_, ends, ahead)
    while not run.scheduler.finished:
        run.send()
        task = choose.choice(run.ready())
        run.carry(task)
        run.report(task)
        known = [sorted(each) for each in run.scheduler.known.values()]
        assert {each[0] for each in known} == {run.scheduler.completed_generation}
        assert all(len(each) <= ahead + 1 for each in known)


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


@given(searches(), orders)
def test_ready_tasks_of_earlier_epochs_come_first(search, choose):
    problem_, ends, ahead = search
    run = PlayedRun(problem_, ends, ahead)
    while not run.scheduler.finished:
        begins = [task.begin for task in run.send()]
        assert begins == sorted(begins)
        task = choose.choice(run.ready())
        run.carry(task)
        run.report(task)
