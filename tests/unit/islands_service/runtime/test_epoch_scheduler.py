"""Itinerary: an island waits for those it receives from and for nobody else, whatever gets lost on the way.

The actors' side is played here, in any order. An epoch of these islands is a number that is made of the
numbers it began with: a search that mixed anything up would end with another one.
"""

import random
from collections import deque
from dataclasses import replace
from itertools import pairwise

from hypothesis import example, given
from hypothesis import strategies as st

from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands_service.runtime.epoch_scheduler import EpochTask

#: Where numbers stand for islands nobody looks at the record.
from support.itineraries import (
    SEED,
    Voyage,
    epoch_of,
    in_lock_step,
    itinerary,
    orders,
    posed,
    sailed,
    searches,
)


@given(searches(), orders)
def test_every_epoch_comes_once_in_order_and_with_the_right_values(search, choose):
    problem_, ends, ahead = search
    done = sailed(Voyage(problem_, ends, ahead), choose)
    assert done == list(in_lock_step(problem_, ends))


@given(searches(), orders, st.integers(1, 25))
def test_whatever_is_lost_the_search_ends_with_the_same_values(search, choose, losses):
    problem_, ends, ahead = search
    done = sailed(Voyage(problem_, ends, ahead), choose, losses)
    assert done == list(in_lock_step(problem_, ends))


@given(searches(), orders, st.integers(0, 25))
@example((posed("ring", 1, ((0, 1),), 2), [-1, 0, 1, 2], 2), random.Random(57), 5)
def test_it_does_not_matter_in_which_order_it_is_told(search, choose, losses):
    problem_, ends, ahead = search
    done = sailed(Voyage(problem_, ends, ahead), choose, losses, at_once=False)
    assert done == list(in_lock_step(problem_, ends))


@given(searches(), orders, st.integers(0, 25))
def test_every_leg_is_sent_behind_those_that_it_stands_on(search, choose, losses):
    """What it takes may not have come back yet, but there is a reference to it that can be passed on."""
    problem_, ends, ahead = search
    voyage = Voyage(problem_, ends, ahead)
    sailed(voyage, choose, losses)
    sent = set()
    for leg in voyage.sent:
        for needed in (leg.island, *voyage.sources[leg.island]):
            assert leg.begin == ends[0] or (needed, leg.begin) in sent
        sent.add((leg.island, leg.end))
    assert len(sent) == problem_.settings.islands * (len(ends) - 1)


@given(searches())
def test_all_that_is_not_too_far_ahead_is_sent_at_once(search):
    """Nobody has to come back first: not the island itself, and not those that it receives from."""
    problem_, ends, ahead = search
    islands, stages = range(problem_.settings.islands), list(pairwise(ends))[:ahead]
    assert Voyage(problem_, ends, ahead).send() == [
        EpochTask(each, *stage) for stage in stages for each in islands
    ]


@given(searches(), orders, st.data())
def test_it_goes_on_from_any_epoch_as_if_it_had_begun_there(search, choose, data):
    problem_, ends, ahead = search
    first = data.draw(st.sampled_from(ends))
    start = Archipelago(
        tuple(
            replace(each, generation=first)
            for each in empty_archipelago(problem_.settings.islands, SEED).islands
        )
    )
    left = ends[ends.index(first) :]
    done = sailed(Voyage(problem_, left, ahead, start), choose, losses=3)
    assert done == list(in_lock_step(problem_, left, first))
    assert len(done) == len(left) - 1


@given(searches(), orders)
def test_it_remembers_nothing_older_than_the_last_complete_archipelago(search, choose):
    problem_, ends, ahead = search
    voyage = Voyage(problem_, ends, ahead)
    while not voyage.plan.finished:
        voyage.send()
        leg = choose.choice(voyage.ready())
        voyage.carry(leg)
        voyage.report(leg)
        known = [sorted(each) for each in voyage.plan.known]
        assert {each[0] for each in known} == {voyage.plan.completed_generation}
        assert all(len(each) <= ahead + 1 for each in known)


# No barrier.


def distances(sources, island):
    """How many epochs it takes until others feel the want of an island."""
    found, new = {island: 0}, deque([island])
    while new:
        near = new.popleft()
        for other, each in enumerate(sources):
            if near in each and other not in found:
                found[other] = found[near] + 1
                new.append(other)
    return found


@given(searches(), orders, st.data())
def test_who_does_not_depend_on_the_slowest_is_not_held_back_by_it(search, choose, data):
    """Whoever is n islands away from it is n epochs ahead, all others as far as anybody may be."""
    problem_, ends, ahead = search
    voyage = Voyage(problem_, ends, ahead)
    slowest = data.draw(st.integers(0, problem_.settings.islands - 1))
    for _ in range(data.draw(st.integers(0, 12))):
        if not voyage.plan.finished:
            voyage.send()
            leg = choose.choice(voyage.ready())
            voyage.carry(leg)
            voyage.report(leg)
    from_there = ends.index(max(voyage.plan.known[slowest]))
    while not voyage.plan.finished:
        voyage.send()
        ready = [leg for leg in voyage.ready() if leg.island != slowest]
        if not ready:
            break
        leg = choose.choice(ready)
        voyage.carry(leg)
        voyage.report(leg)
    complete, away = ends.index(voyage.plan.completed_generation), distances(voyage.sources, slowest)
    for island, known in enumerate(voyage.plan.known):
        reachable = from_there + away.get(island, len(ends))
        assert ends.index(max(known)) == min(reachable, complete + ahead, len(ends) - 1)


def test_by_default_an_island_is_on_one_epoch_and_has_two_in_the_queue():
    plan = itinerary(islands=2)
    assert list(plan.ready_tasks()) == [
        EpochTask(island, *stage) for stage in ((-1, 0), (0, 4), (4, 8)) for island in (0, 1)
    ]
    assert list(plan.ready_tasks()) == []
    assert (plan.completed_generation, plan.finished) == (-1, False)


@given(searches(), orders)
def test_of_what_is_due_earlier_epochs_come_first(search, choose):
    problem_, ends, ahead = search
    voyage = Voyage(problem_, ends, ahead)
    while not voyage.plan.finished:
        begins = [leg.begin for leg in voyage.send()]
        assert begins == sorted(begins)
        leg = choose.choice(voyage.ready())
        voyage.carry(leg)
        voyage.report(leg)


def test_who_takes_one_of_those_that_are_due_finds_the_others_later():
    all_of_them, plan = list(itinerary().ready_tasks()), itinerary()
    one_by_one = []
    while len(one_by_one) < len(all_of_them):
        one_by_one.append(next(plan.ready_tasks()))
    assert one_by_one == all_of_them
    assert list(plan.ready_tasks()) == []


def test_what_was_told_out_of_order_comes_in_order_as_soon_as_it_is_complete():
    plan = itinerary(islands=2, ahead=2)
    one, other, later, other_later = plan.ready_tasks()
    for leg in (later, other_later, other):
        plan.complete(leg, epoch_of(leg))
        assert list(plan.completed_epochs()) == []
    plan.complete(one, epoch_of(one))
    assert list(plan.completed_epochs()) == [
        (epoch_of(one), epoch_of(other)),
        (epoch_of(later), epoch_of(other_later)),
    ]
    assert plan.completed_generation == 4
    assert list(plan.completed_epochs()) == []
