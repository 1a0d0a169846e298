"""Voyages of epochs whose actors are played: every epoch is a number that is made of what came before it."""

from dataclasses import replace
from itertools import pairwise

from hypothesis import strategies as st

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.epoch import IslandEpoch
from islands.evolution.gp.individual import Individual
from islands.evolution.migration.schedule import Schedule
from islands.evolution.migration.topology import topology
from islands.evolution.problem import Problem
from islands_service.runtime.epoch_scheduler import AHEAD, EpochScheduler, EpochTask
from support.searches import SMALL, record
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
    return EpochScheduler(made, empty_archipelago(made.settings.islands, SEED), as_it_is, ahead)


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
    number = float(hash((leg.island, leg.begin, leg.end, before.abandon_threshold, *arriving)) % 2**40)
    leaving = (Individual((), fitness=number),)
    return IslandEpoch(replace(before, generation=leg.end, abandon_threshold=number), leaving, ())


def bred(epoch):
    """What comes from an island; the first ones have nobody to send."""
    return tuple(each.fitness for each in epoch.emigrants)


def in_lock_step(problem_, ends, first=-1):
    """Every epoch of all islands, one after the other: what must come out."""
    islands = problem_.settings.islands
    sources = topology(problem_.settings.topology, islands, SEED).sources
    epochs = [
        IslandEpoch(replace(each, generation=first), (), ())
        for each in empty_archipelago(islands, SEED).islands
    ]
    for begin, end in pairwise(ends):
        epochs = [
            carried(
                EpochTask(island, begin, end),
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
        self.plan = EpochScheduler(
            problem_, start or empty_archipelago(problem_.settings.islands, SEED), as_it_is, ahead
        )
        self.sources = topology(problem_.settings.topology, problem_.settings.islands, SEED).sources
        self.out, self.held, self.done = [], {}, []
        self.sent = []

    def at(self, island, generation):
        """An epoch that an actor holds or that is known, None where it is still to come."""
        return self.held.get((island, generation)) or self.plan.known[island].get(generation)

    def send(self):
        legs = list(self.plan.ready_tasks())
        for leg in legs:
            assert leg not in self.out
            place = self.ends.index(leg.begin)
            assert leg.end == self.ends[place + 1]
            assert place < self.ends.index(self.plan.completed_generation) + self.ahead
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
        self.plan.complete(leg, self.held[leg.island, leg.end])
        for epochs in self.plan.completed_epochs():
            assert [epoch.island.generation for epoch in epochs] == [self.plan.completed_generation] * len(
                epochs
            )
            self.done.append(epochs)

    def lose(self, leg):
        """With a leg all that was sent of its island after it is gone, and what came of it."""
        self.plan.reschedule(leg)
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


def epoch_of(leg):
    return IslandEpoch(
        replace(empty_archipelago(leg.island + 1, SEED).islands[-1], generation=leg.end), (), ()
    )
