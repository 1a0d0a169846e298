"""Schedule of a search on many actors: which epochs may be submitted, and when an archipelago is complete.

An island waits only for the previous epochs of the islands that it receives from: there is no barrier. The
scheduler handles generations and values, and is independent of actors and Ray.
"""

from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from islands.evolution.archipelago import Archipelago, Island
from islands.evolution.engine import IslandEpoch, SearchProblem, make_topology, next_stop, select_migrants
from islands.evolution.settings import Settings

#: Data that is kept of an island's epoch.
T = TypeVar("T")

#: Epochs that an island may be ahead of the last complete archipelago. It evens out differences in speed.
MAX_EPOCHS_AHEAD = 3

#: Identity of an actor.
A = TypeVar("A", bound=Hashable)

#: Multiple of the slowest recent epoch that an epoch may take.
FACTOR = 2.0

#: Seconds that an epoch may take in addition, for example while the machine swaps.
ALLOWANCE = 2.0

#: Multiple of the slowest first population that the others may take, and seconds in addition.
FIRST_FACTOR, FIRST_ALLOWANCE = 10.0, 30.0

#: Seconds per individual, and in all, that an epoch may take before any is measured.
UNMEASURED_PER_INDIVIDUAL, UNMEASURED_ALLOWANCE = 0.05, 60.0

#: Epochs per island from which the slowest is taken.
_RECENT = 4

#: Longest time between two checks that counts, in seconds. The process may have been suspended, or has
#: written a large checkpoint, and the answers of this time are not collected yet.
_LONGEST_STEP = 1.0

#: Largest multiple of a deadline after losses.
_MAX_PATIENCE = 64.0


@dataclass(frozen=True, slots=True)
class EpochTask:
    """One epoch of one island, between two generations."""

    island: int
    begin: int
    end: int


class EpochScheduler(Generic[T]):
    """Tracks the submitted and the completed epochs of some islands of a search.

    A submitted task may depend on epochs that are not complete yet: Ray passes their values on when they are.
    Only emigrants of islands that are scheduled elsewhere must have arrived before.

    Parameters
    ----------
    settings : Settings
    sources : sequence of sequences of int
        For every island of the search, the islands that it receives from.
    generation : int
        Generation of the start.
    start : mapping
        Kept data of the islands to schedule, by their index in ascending order.
    ahead : int
        Epochs that an island may be ahead of the last complete epoch of all these islands.
    """

    def __init__(
        self,
        settings: Settings,
        sources: Sequence[Sequence[int]],
        generation: int,
        start: Mapping[int, T],
        ahead: int = MAX_EPOCHS_AHEAD,
    ) -> None:
        self._settings, self._ahead = settings, ahead
        self.sources = sources
        self.completed_generation = generation
        self._sent = dict.fromkeys(start, generation)
        #: Kept data of each island by generation, from the last complete epoch on.
        self.known: dict[int, dict[int, T]] = {island: {generation: kept} for island, kept in start.items()}
        self._all_here = all(source in start for island in start for source in sources[island])
        self._received: set[tuple[int, int]] = set()

    @property
    def finished(self) -> bool:
        """Whether all islands have reached the last generation."""
        return self.completed_generation >= self._settings.generations

    def knows(self, island: int, generation: int) -> bool:
        """Return whether the data of an island at a generation are known."""
        return generation in self.known.get(island, ()) or (island, generation) in self._received

    def receive(self, island: int, generation: int) -> None:
        """Note that the emigrants of an island that is scheduled elsewhere have arrived."""
        self._received.add((island, generation))

    def ready_tasks(self) -> Iterator[EpochTask]:
        """Yield the tasks that may be submitted, earlier epochs first, and mark each as submitted."""
        if self.finished:
            return
        begin, end = self.completed_generation, self._next_stop(self.completed_generation)
        for _ in range(self._ahead):
            for island, sent in self._sent.items():
                if sent == begin and (self._all_here or self._can_depend(island, begin)):
                    self._sent[island] = end
                    yield EpochTask(island, begin, end)
            if end >= self._settings.generations:
                return
            begin, end = end, self._next_stop(end)

    def _can_depend(self, island: int, generation: int) -> bool:
        """Return whether the epochs before a task are submitted, or have arrived from elsewhere."""
        return all(
            self._sent[source] >= generation
            if source in self._sent
            else (source, generation) in self._received
            for source in self.sources[island]
        )

    def reschedule(self, task: EpochTask) -> None:
        """Mark a lost task, and the later tasks of its island, as not submitted."""
        self._sent[task.island] = max(self.completed_generation, min(self._sent[task.island], task.begin))

    def complete(self, task: EpochTask, epoch: T) -> None:
        """Store the result of a task."""
        if task.end > self.completed_generation:
            self.known[task.island][task.end] = epoch

    def completed_epochs(self) -> Iterator[tuple[T, ...]]:
        """Yield the results of all islands for each epoch that is now complete, in order."""
        while not self.finished:
            end = self._next_stop(self.completed_generation)
            if not all(end in known for known in self.known.values()):
                return
            for known in self.known.values():
                del known[self.completed_generation]
            self.completed_generation = end
            self._received = {key for key in self._received if key[1] >= end}
            yield tuple(known[end] for known in self.known.values())

    def _next_stop(self, generation: int) -> int:
        return next_stop(generation, self._settings)


def begin_epoch(problem: SearchProblem, island: Island) -> IslandEpoch:
    """Return an island of a start with its emigrants, as if an epoch had ended there."""
    return IslandEpoch(island, select_migrants(island, problem.settings_of(island.index)), ())


def schedule_islands(
    problem: SearchProblem,
    start: Archipelago,
    keep: Callable[[IslandEpoch], T],
    ahead: int = MAX_EPOCHS_AHEAD,
) -> EpochScheduler[T]:
    """Return a scheduler of all islands of a search.

    Parameters
    ----------
    keep : callable
        Returns the data to keep of an epoch; also applied to the start.
    """
    kept = {island.index: keep(begin_epoch(problem, island)) for island in start.islands}
    sources = make_topology(problem, start).sources
    return EpochScheduler(problem.settings, sources, start.generation, kept, ahead)


class EpochDeadlines:
    """Measured durations of epochs, and the time for which each actor has computed its present one.

    Parameters
    ----------
    islands : int
    population : int
        Individuals of an island.
    """

    def __init__(self, islands: int, population: int) -> None:
        self._population = population
        # Seconds per generation, and seconds of the first populations.
        self._rates: deque[float] = deque(maxlen=_RECENT * islands)
        self._first: deque[float] = deque(maxlen=islands)
        self._patience = 1.0
        self._computing: dict[Hashable, tuple[EpochTask, float]] = {}
        self._checked_at: float | None = None

    def record(self, task: EpochTask, seconds: float) -> None:
        """Record the duration of a completed epoch.

        Parameters
        ----------
        seconds : float
            Duration measured by the actor, without the time in its queue.
        """
        if task.begin < 0:
            self._first.append(seconds)
        else:
            self._rates.append(seconds / (task.end - task.begin))

    def extend(self) -> None:
        """Double all deadlines after a loss: caches are empty, and the machine may be overloaded."""
        self._patience = min(2.0 * self._patience, _MAX_PATIENCE)

    def reset(self) -> None:
        """Undo the extension, since an epoch of all islands was completed and measured in spite of losses."""
        self._patience = 1.0

    def seconds_allowed(self, task: EpochTask) -> float:
        """Return the time in seconds that an actor has for a task."""
        generations = task.end - task.begin
        if task.begin >= 0 and self._rates:
            seconds = FACTOR * max(self._rates) * generations + ALLOWANCE
        elif self._first:
            seconds = FIRST_FACTOR * max(self._first) * generations + FIRST_ALLOWANCE
        else:
            seconds = UNMEASURED_PER_INDIVIDUAL * self._population * generations + UNMEASURED_ALLOWANCE
        return self._patience * seconds

    def find_frozen(self, now: float, computing: Mapping[A, EpochTask]) -> list[A]:
        """Return the actors whose deadline has passed.

        Parameters
        ----------
        now : float
            Seconds of a monotonic clock.
        computing : mapping
            The task that each actor must be computing: the first in its queue, if its dependencies are known.
            Every call must have been preceded by the collection of all results.
        """
        step = 0.0 if self._checked_at is None else min(now - self._checked_at, _LONGEST_STEP)
        self._checked_at = now
        current: dict[Hashable, tuple[EpochTask, float]] = {}
        for actor, task in computing.items():
            before, seconds = self._computing.get(actor, (None, 0.0))
            current[actor] = task, seconds + step if before is task else 0.0
        self._computing = current
        return [actor for actor, task in computing.items() if current[actor][1] > self.seconds_allowed(task)]
