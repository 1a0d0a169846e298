"""Itinerary: an island waits for those it receives from and for nobody else, whatever gets lost on the way.

The actors' side is played here, in any order. An epoch of these islands is a number that is made of the
numbers it began with: a search that mixed anything up would end with another one.
"""

import random
from collections import deque
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from islands.evolution.archipelago import Archipelago, founded
from islands.evolution.engine import SerialEngine
from islands.evolution.epoch import IslandEpoch, advance, emigrants
from islands.evolution.evaluation import Evaluator
from islands.evolution.individual import Individual
from islands.evolution.problem import Problem, problem
from islands.evolution.schedule import Schedule
from islands.evolution.topology import topology
from islands_service.runtime.itinerary import AHEAD, Itinerary, Leg
from support.searches import SMALL, exactly, record
from support.strategies import layouts, schedule_text, schedules

#: Where numbers stand for islands nobody looks at the record.
NOTHING = record(3)
SEED = 5


def as_it_is(epoch):
    return epoch


def posed(text="ring", islands=3, pieces=((0, 4),), generations=10):
    settings = replace(
        SMALL,
        population=12,
        islands=islands,
        topology=text,
        migrate_every=schedule_text(pieces),
        generations=generations,
    )
    return Problem(NOTHING, settings)


def itinerary(ahead=AHEAD, **changes):
    made = posed(**changes)
    return Itinerary(made, founded(made.settings.islands, SEED), as_it_is, ahead)


@st.composite
def searches(draw):
    """A problem, the generations at which its epochs end, and how far an island may be ahead."""
    (text, islands), pieces = draw(layouts(8)), draw(schedules(most=6, latest=10))
    generations = draw(st.integers(0, 16))
    stops = [-1, 0, *(each for each in range(generations) if Schedule(pieces).stops_at(each))]
    ends = stops if generations == 0 else [*stops, generations]
    return posed(text, islands, pieces, generations), ends, draw(st.integers(1, 4))


def carried(leg, before, arriving):
    """An epoch of a leg: what it is depends on where it began, and on who arrived from where."""
    number = float(hash((leg.island, leg.begin, leg.end, before.bar, *arriving)) % 2**40)
    leaving = (Individual((), fitness=number),)
    return IslandEpoch(replace(before, generation=leg.end, bar=number), leaving, ())


def bred(epoch):
    """What comes from an island; the first ones have nobody to send."""
    return tuple(each.fitness for each in epoch.emigrants)


def in_lock_step(problem_, ends, first=-1):
    """Every epoch of all islands, one after the other: what must come out."""
    islands = problem_.settings.islands
    sources = topology(problem_.settings.topology, islands, SEED).sources
    epochs = [IslandEpoch(replace(each, generation=first), (), ()) for each in founded(islands, SEED).islands]
    for begin, end in pairwise(ends):
        epochs = [
            carried(
                Leg(island, begin, end),
                epochs[island].island,
                [bred(epochs[source]) for source in sources[island]],
            )
            for island in range(islands)
        ]
        yield tuple(epochs)


class Voyage:
    """An itinerary and its actors: what is out, what the actors hold, and what has been told of it.

    Whatever is sent is held against the law: nobody is sent before those that it needs.
    """

    def __init__(self, problem_, ends, ahead, start=None):
        self.ends, self.ahead = ends, ahead
        self.plan = Itinerary(problem_, start or founded(problem_.settings.islands, SEED), as_it_is, ahead)
        self.sources = topology(problem_.settings.topology, problem_.settings.islands, SEED).sources
        self.out, self.held, self.done = [], {}, []
        self.sent = []

    def at(self, island, generation):
        """An epoch that an actor holds or that is known, None where it is still to come."""
        return self.held.get((island, generation)) or self.plan.known[island].get(generation)

    def send(self):
        legs = list(self.plan.due())
        for leg in legs:
            assert leg not in self.out
            place = self.ends.index(leg.begin)
            assert leg.end == self.ends[place + 1]
            assert place < self.ends.index(self.plan.complete) + self.ahead
            for needed in (leg.island, *self.sources[leg.island]):
                on_its_way = any((each.island, each.end) == (needed, leg.begin) for each in self.out)
                assert on_its_way or self.at(needed, leg.begin)
            self.out.append(leg)
        self.sent += legs
        return legs

    def ready(self):
        """Legs that an actor may carry now: all that they need is there."""
        return [
            leg
            for leg in self.out
            if (leg.island, leg.end) not in self.held
            and all(self.at(needed, leg.begin) for needed in (leg.island, *self.sources[leg.island]))
        ]

    def carry(self, leg):
        arriving = [bred(self.at(source, leg.begin)) for source in self.sources[leg.island]]
        self.held[leg.island, leg.end] = carried(leg, self.at(leg.island, leg.begin).island, arriving)

    def report(self, leg):
        self.out.remove(leg)
        self.plan.back(leg, self.held[leg.island, leg.end])
        for epochs in self.plan.completed():
            assert [epoch.island.generation for epoch in epochs] == [self.plan.complete] * len(epochs)
            self.done.append(epochs)

    def lose(self, leg):
        """With a leg all that was sent of its island after it is gone, and what came of it."""
        self.plan.lost(leg)
        self.out = [each for each in self.out if each.island != leg.island or each.end < leg.end]
        for island, generation in list(self.held):
            if island == leg.island and generation >= leg.end:
                del self.held[island, generation]


def sailed(voyage, choose, losses=0, at_once=True):
    """Go on in any order until all is done; lose some of what is out on the way.

    Where it is not at once, who has been carried is told of later, in any order.
    """
    while not voyage.plan.finished:
        sent = voyage.send()
        assert voyage.out, "nothing is out, and nothing is due"
        if losses and choose.random() < 0.4:
            losses -= 1
            voyage.lose(choose.choice(voyage.out))
            continue
        told = [leg for leg in voyage.out if (leg.island, leg.end) in voyage.held]
        ready = voyage.ready()
        assert told or ready, sent
        leg = choose.choice([*told, *ready])
        if leg in ready:
            voyage.carry(leg)
        if leg in told or at_once:
            voyage.report(leg)
    return voyage.done


orders = st.randoms(use_true_random=False)


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
    assert Voyage(problem_, ends, ahead).send() == [Leg(each, *stage) for stage in stages for each in islands]


@given(searches(), orders, st.data())
def test_it_goes_on_from_any_epoch_as_if_it_had_begun_there(search, choose, data):
    problem_, ends, ahead = search
    first = data.draw(st.sampled_from(ends))
    start = Archipelago(
        tuple(replace(each, generation=first) for each in founded(problem_.settings.islands, SEED).islands)
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
        assert {each[0] for each in known} == {voyage.plan.complete}
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
    complete, away = ends.index(voyage.plan.complete), distances(voyage.sources, slowest)
    for island, known in enumerate(voyage.plan.known):
        reachable = from_there + away.get(island, len(ends))
        assert ends.index(max(known)) == min(reachable, complete + ahead, len(ends) - 1)


def test_by_default_an_island_is_on_one_epoch_and_has_two_in_the_queue():
    plan = itinerary(islands=2)
    assert list(plan.due()) == [
        Leg(island, *stage) for stage in ((-1, 0), (0, 4), (4, 8)) for island in (0, 1)
    ]
    assert list(plan.due()) == []
    assert (plan.complete, plan.finished) == (-1, False)


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
    all_of_them, plan = list(itinerary().due()), itinerary()
    one_by_one = []
    while len(one_by_one) < len(all_of_them):
        one_by_one.append(next(plan.due()))
    assert one_by_one == all_of_them
    assert list(plan.due()) == []


def epoch_of(leg):
    return IslandEpoch(replace(founded(leg.island + 1, SEED).islands[-1], generation=leg.end), (), ())


def test_what_was_told_out_of_order_comes_in_order_as_soon_as_it_is_complete():
    plan = itinerary(islands=2, ahead=2)
    one, other, later, other_later = plan.due()
    for leg in (later, other_later, other):
        plan.back(leg, epoch_of(leg))
        assert list(plan.completed()) == []
    plan.back(one, epoch_of(one))
    assert list(plan.completed()) == [
        (epoch_of(one), epoch_of(other)),
        (epoch_of(later), epoch_of(other_later)),
    ]
    assert plan.complete == 4
    assert list(plan.completed()) == []


# What is lost.


def test_a_lost_leg_and_what_was_sent_after_it_are_due_again_and_nobody_else_s():
    plan = itinerary(ahead=3)
    assert len(list(plan.due())) == 9
    plan.lost(Leg(1, 0, 4))
    assert list(plan.due()) == [Leg(1, 0, 4), Leg(1, 4, 8)]
    plan.lost(Leg(2, 4, 8))
    plan.lost(Leg(0, -1, 0))
    assert list(plan.due()) == [Leg(0, -1, 0), Leg(0, 0, 4), Leg(0, 4, 8), Leg(2, 4, 8)]
    # Told of the later one besides, as late as may be.
    plan.lost(Leg(1, -1, 0))
    plan.lost(Leg(1, 4, 8))
    assert list(plan.due()) == [Leg(1, -1, 0), Leg(1, 0, 4), Leg(1, 4, 8)]


def test_a_loss_of_what_is_known_already_holds_nobody_up():
    """The second leg came back, the first one was lost; then what was sent again after it is lost too."""
    plan = itinerary(text="isolated", islands=1, ahead=2)
    first, second = plan.due()
    plan.back(second, epoch_of(second))
    plan.lost(first)
    again = list(plan.due())
    plan.back(first, epoch_of(first))
    assert list(plan.completed()) == [(epoch_of(first),), (epoch_of(second),)]
    for leg in again[1:]:
        plan.lost(leg)
    assert Leg(0, 4, 8) in list(plan.due())


def completed_twice():
    """An island whose second leg is out once more, though it is known and complete; a third is out, too."""
    plan = itinerary(text="isolated", islands=1)
    first, second, _ = plan.due()
    plan.back(second, epoch_of(second))
    plan.lost(first)
    assert list(plan.due()) == [first, second, Leg(0, 4, 8)]
    plan.back(first, epoch_of(first))
    assert len(list(plan.completed())) == 2
    return plan, second


def test_a_loss_of_what_is_complete_loses_what_was_sent_after_it():
    plan, second = completed_twice()
    plan.lost(second)
    assert list(plan.due()) == [Leg(0, 4, 8), Leg(0, 8, 10)]


def test_what_comes_back_of_what_is_complete_already_is_forgotten():
    plan, second = completed_twice()
    before = [dict(known) for known in plan.known]
    plan.back(second, replace(epoch_of(second), emigrants=(Individual(()),)))
    plan.back(Leg(0, -1, 0), epoch_of(Leg(0, -1, 0)))
    assert plan.known == before
    assert list(plan.completed()) == []


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
    for epoch in SerialEngine().run(evolving, founded(3, SEED), lambda: False):
        start = epoch.archipelago
        known = Itinerary(evolving, start, as_it_is).known
        for island, each in zip(start.islands, known, strict=True):
            leaving = emigrants(island, evolving.settings_of(island.index))
            assert each == {start.generation: IslandEpoch(island, leaving, ())}
            assert bool(leaving) == (start.generation in (2, 4))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("first", [None, 1])
def test_in_any_order_and_with_losses_islands_evolve_as_one_after_the_other(evolving, first, seed):
    whole = list(SerialEngine().run(evolving, founded(3, SEED), lambda: False))
    start = founded(3, SEED) if first is None else whole[first].archipelago
    whole = whole if first is None else whole[first + 1 :]
    plan, evaluator, choose = (
        Itinerary(evolving, start, as_it_is),
        Evaluator(evolving.record, evolving.settings),
        random.Random(seed),
    )
    out, found, losses = [], [], 0
    while not plan.finished:
        out += plan.due()
        leg = choose.choice(
            [
                leg
                for leg in out
                if all(leg.begin in plan.known[each] for each in (leg.island, *plan.sources[leg.island]))
            ]
        )
        if choose.random() < 0.3:
            losses += 1
            plan.lost(leg)
            out = [each for each in out if each.island != leg.island or each.end < leg.end]
            continue
        out.remove(leg)
        arriving = [plan.known[source][leg.begin].emigrants for source in plan.sources[leg.island]]
        island = plan.known[leg.island][leg.begin].island
        plan.back(leg, advance(island, arriving, evaluator, evolving, lambda: False))
        found += plan.completed()
    assert losses > 0
    assert len(found) == len(whole)
    for epochs, expected in zip(found, whole, strict=True):
        assert [exactly(epoch.island) for epoch in epochs] == [
            exactly(island) for island in expected.archipelago.islands
        ]
        assert tuple(epoch.steps for epoch in epochs) == expected.steps
