"""Schedule of a search on many actors: which epochs may be submitted, and when an archipelago is complete.

An island waits only for the previous epochs of the islands that it receives from: there is no barrier. The
scheduler handles generations and values, and is independent of actors and Ray.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import make_topology
from islands.evolution.epoch import IslandEpoch, next_stop, select_migrants
from islands.evolution.problem import Problem

#: Data that is kept of an island's epoch.
T = TypeVar("T")

#: Epochs that an island may be ahead of the last complete archipelago. It evens out differences in speed.
MAX_EPOCHS_AHEAD = 3


@dataclass(frozen=True, slots=True)
class EpochTask:
    """One epoch of one island, between two generations."""

    island: int
    begin: int
    end: int


class EpochScheduler(Generic[T]):
    """Tracks the submitted and the completed epochs of a search.

    A submitted task may depend on epochs that are not complete yet: Ray passes their values on when they are.

    Parameters
    ----------
    problem : Problem
    start : Archipelago
    keep : callable
        Returns the data to keep of an epoch; also applied to the start.
    ahead : int
        Epochs that an island may be ahead of the last complete archipelago.
    """

    def __init__(
        self,
        problem: Problem,
        start: Archipelago,
        keep: Callable[[IslandEpoch], T],
        ahead: int = MAX_EPOCHS_AHEAD,
    ) -> None:
        self._settings, self._ahead = problem.settings, ahead
        self.sources = make_topology(problem, start).sources
        self.completed_generation = start.generation
        self._sent = [start.generation] * len(start.islands)
        #: Kept data of each island by generation, from the last complete archipelago on.
        self.known: list[dict[int, T]] = []
        for island in start.islands:
            leaving = select_migrants(island, problem.settings_of(island.index))
            self.known.append({start.generation: keep(IslandEpoch(island, leaving, ()))})

    @property
    def finished(self) -> bool:
        """Whether the archipelago of the last generation is complete."""
        return self.completed_generation >= self._settings.generations

    def ready_tasks(self) -> Iterator[EpochTask]:
        """Yield the tasks that may be submitted, earlier epochs first, and mark each as submitted."""
        begin, end = self.completed_generation, self._next_stop(self.completed_generation)
        for _ in range(self._ahead):
            for island, sent in enumerate(self._sent):
                if sent == begin:
                    self._sent[island] = end
                    yield EpochTask(island, begin, end)
            if end >= self._settings.generations:
                return
            begin, end = end, self._next_stop(end)

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
            if not all(end in known for known in self.known):
                return
            for known in self.known:
                del known[self.completed_generation]
            self.completed_generation = end
            yield tuple(known[end] for known in self.known)

    def _next_stop(self, generation: int) -> int:
        return next_stop(generation, self._settings)
