"""The itinerary: which island's epoch may be sent off, and when an archipelago is complete.

An island waits for the epoch before of those that it receives from, and for nobody else: there is no barrier.
It knows generations and values, and neither actors nor Ray.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import make_topology
from islands.evolution.epoch import IslandEpoch, next_stop, select_migrants
from islands.evolution.problem import Problem

#: What is kept of an island's epoch.
T = TypeVar("T")

#: Epochs that an island may be ahead of the last complete archipelago: it evens out faster and slower ones.
AHEAD = 3


@dataclass(frozen=True, slots=True)
class EpochTask:
    """One epoch of one island, between two generations."""

    island: int
    begin: int
    end: int


class EpochScheduler(Generic[T]):
    """Keeps what has been sent and what has come back of a search.

    Whatever is sent may stand on what has not come back yet: Ray hands it over when it is there.

    Parameters
    ----------
    problem : Problem
    start : Archipelago
    keep : callable
        From an epoch, what is kept of it: of the start it is made here.
    ahead : int
        Epochs that an island may be ahead of the last complete archipelago.
    """

    def __init__(
        self, problem: Problem, start: Archipelago, keep: Callable[[IslandEpoch], T], ahead: int = AHEAD
    ) -> None:
        self._settings, self._ahead = problem.settings, ahead
        self.sources = make_topology(problem, start).sources
        self.completed_generation = start.generation
        self._sent = [start.generation] * len(start.islands)
        #: What is known of every island by generation, from the last complete archipelago on.
        self.known: list[dict[int, T]] = []
        for island in start.islands:
            leaving = select_migrants(island, problem.settings_of(island.index))
            self.known.append({start.generation: keep(IslandEpoch(island, leaving, ()))})

    @property
    def finished(self) -> bool:
        """Whether the last generation is complete."""
        return self.completed_generation >= self._settings.generations

    def ready_tasks(self) -> Iterator[EpochTask]:
        """Yield the legs that may be sent off, and take each for sent; those of earlier epochs come first."""
        begin, end = self.completed_generation, self._next_stop(self.completed_generation)
        for _ in range(self._ahead):
            for island, sent in enumerate(self._sent):
                if sent == begin:
                    self._sent[island] = end
                    yield EpochTask(island, begin, end)
            if end >= self._settings.generations:
                return
            begin, end = end, self._next_stop(end)

    def reschedule(self, leg: EpochTask) -> None:
        """Take a leg, and what was sent of its island after it, for not sent."""
        self._sent[leg.island] = max(self.completed_generation, min(self._sent[leg.island], leg.begin))

    def complete(self, leg: EpochTask, epoch: T) -> None:
        """Take note of what a leg brought."""
        if leg.end > self.completed_generation:
            self.known[leg.island][leg.end] = epoch

    def completed_epochs(self) -> Iterator[tuple[T, ...]]:
        """Yield what all islands brought, epoch by epoch as far as it is complete."""
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
