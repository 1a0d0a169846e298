"""Runs of the epoch scheduler without actors: an epoch is a number computed from its dependencies."""

from dataclasses import replace
from itertools import pairwise

from hypothesis import strategies as st

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import IslandEpoch
from islands.evolution.individual import Individual
from islands.evolution.migration import Schedule, parse_topology
from islands.evolution.problem import Problem
from islands_service.runtime.epoch_scheduler import MAX_EPOCHS_AHEAD, EpochTask, schedule_islands
from support.searches import SMALL, record
from support.strategies import layouts, schedule_text, schedules

#: The record is not used, since numbers replace islands.
NOTHING = record(3)
SEED = 5


def keep_epoch(epoch):
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


def make_scheduler(ahead=MAX_EPOCHS_AHEAD, **changes):
    made = posed(**changes)
    return schedule_islands(made, empty_archipelago(made.settings.islands, SEED), keep_epoch, ahead)


@st.composite
def searches(draw):
    """Draw a problem, the generations at which its epochs end, and how far an island may be ahead."""
    (text, islands), pieces = draw(layouts(8)), draw(schedules(most=6, latest=10))
    generations = draw(st.integers(0, 16))
    stops = [-1, 0, *(each for each in range(generations) if Schedule(pieces).stops_at(each))]
    ends = stops if generations == 0 else [*stops, generations]
    return posed(text, islands, pieces, generations), ends, draw(st.integers(1, 4))


def compute_epoch(task, before, arriving):
    """Return the epoch of a task, a function of its beginning and of the immigrants in order."""
    number = float(hash((task.island, task.begin, task.end, before.abandon_threshold, *arriving)) % 2**40)
    leaving = (Individual((), fitness=number),)
    return IslandEpoch(replace(before, generation=task.end, abandon_threshold=number), leaving, ())


def get_emigrants(epoch):
    """Return the emigrants of an epoch; the first ones have none."""
    return tuple(each.fitness for each in epoch.emigrants)


def run_in_lockstep(problem_, ends, first=-1):
    """Yield the expected epochs of all islands, computed one after the other."""
    islands = problem_.settings.islands
    sources = parse_topology(problem_.settings.topology, islands, SEED).sources
    epochs = [
        IslandEpoch(replace(each, generation=first), (), ())
        for each in empty_archipelago(islands, SEED).islands
    ]
    for begin, end in pairwise(ends):
        epochs = [
            compute_epoch(
                EpochTask(island, begin, end),
                epochs[island].island,
                [get_emigrants(epochs[source]) for source in sources[island]],
            )
            for island in range(islands)
        ]
        yield tuple(epochs)


class PlayedRun:
    """A scheduler and its actors: pending tasks, computed epochs, and completed ones.

    Every submitted task is checked: its dependencies must be submitted before.
    """

    def __init__(self, problem_, ends, ahead, start=None):
        self.ends, self.ahead = ends, ahead
        self.scheduler = schedule_islands(
            problem_, start or empty_archipelago(problem_.settings.islands, SEED), keep_epoch, ahead
        )
        self.sources = parse_topology(problem_.settings.topology, problem_.settings.islands, SEED).sources
        self.out, self.held, self.done = [], {}, []
        self.sent = []

    def at(self, island, generation):
        """Return an epoch that is computed or known; None if it is pending."""
        return self.held.get((island, generation)) or self.scheduler.known[island].get(generation)

    def send(self):
        tasks = list(self.scheduler.ready_tasks())
        for task in tasks:
            assert task not in self.out
            place = self.ends.index(task.begin)
            assert task.end == self.ends[place + 1]
            assert place < self.ends.index(self.scheduler.completed_generation) + self.ahead
            for needed in (task.island, *self.sources[task.island]):
                pending = any((each.island, each.end) == (needed, task.begin) for each in self.out)
                assert pending or self.at(needed, task.begin)
            self.out.append(task)
        self.sent += tasks
        return tasks

    def ready(self):
        """Return the tasks whose dependencies are computed."""
        return [
            task
            for task in self.out
            if (task.island, task.end) not in self.held
            and all(self.at(needed, task.begin) for needed in (task.island, *self.sources[task.island]))
        ]

    def carry(self, task):
        arriving = [get_emigrants(self.at(source, task.begin)) for source in self.sources[task.island]]
        self.held[task.island, task.end] = compute_epoch(
            task, self.at(task.island, task.begin).island, arriving
        )

    def report(self, task):
        self.out.remove(task)
        self.scheduler.complete(task, self.held[task.island, task.end])
        for epochs in self.scheduler.completed_epochs():
            assert [epoch.island.generation for epoch in epochs] == [
                self.scheduler.completed_generation
            ] * len(epochs)
            self.done.append(epochs)

    def lose(self, task):
        """Lose a task, the later tasks of its island, and their results."""
        self.scheduler.reschedule(task)
        self.out = [each for each in self.out if each.island != task.island or each.end < task.end]
        for island, generation in list(self.held):
            if island == task.island and generation >= task.end:
                del self.held[island, generation]


def play(run, choose, losses=0, at_once=True):
    """Run tasks in any order until the search is complete, and lose some of them.

    Unless ``at_once``, computed tasks are completed later, in any order.
    """
    while not run.scheduler.finished:
        sent = run.send()
        assert run.out, "no task is pending, and none is ready"
        if losses and choose.random() < 0.4:
            losses -= 1
            run.lose(choose.choice(run.out))
            continue
        computed = [task for task in run.out if (task.island, task.end) in run.held]
        ready = run.ready()
        assert computed or ready, sent
        task = choose.choice([*computed, *ready])
        if task in ready:
            run.carry(task)
        if task in computed or at_once:
            run.report(task)
    return run.done


orders = st.randoms(use_true_random=False)


def make_epoch(task):
    return IslandEpoch(
        replace(empty_archipelago(task.island + 1, SEED).islands[-1], generation=task.end), (), ()
    )
