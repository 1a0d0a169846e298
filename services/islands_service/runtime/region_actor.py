"""Ray actor that schedules the islands of a region on separate actors.

In a search of thousands of islands, the driver exchanges one message per region and epoch with such actors.
The packed islands of a region stay in the object store of its machine.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import ray

from islands.distribution import read_version
from islands.evolution.island import StepInfo
from islands.evolution.protocol import Caches, SearchProblem
from islands_service.runtime.actor_pool import IslandActorPool
from islands_service.runtime.epoch_deadline import EpochDeadlines
from islands_service.runtime.epoch_scheduler import EpochScheduler
from islands_service.runtime.epochs_in_flight import EpochsInFlight
from islands_service.runtime.packed_epoch import PackedEpoch


@dataclass(frozen=True, slots=True)
class RegionStatus:
    """Answer of a region to a check.

    Attributes
    ----------
    version : str
        Version of islands on its machine.
    messages : tuple of str
        Messages for the user since the last check.
    placed, waiting : int
        Number of islands with and without a separate CPU.
    """

    version: str
    messages: tuple[str, ...] = ()
    placed: int = 0
    waiting: int = 0


@dataclass(frozen=True, slots=True)
class RegionReport:
    """Result of an epoch of all islands of a region, without the islands.

    Attributes
    ----------
    steps : tuple of tuple of StepInfo
        For every island of the region, one entry per generation of the epoch.
    emigrants : mapping
        Packed emigrants of the islands from which other regions receive, by island.
    caches : mapping
        Memory of the caches of all actors of the region.
    """

    steps: tuple[tuple[StepInfo, ...], ...]
    emigrants: Mapping[int, bytes]
    caches: Caches = field(default_factory=dict)


class RegionActor:
    """Runs the islands of a region, one epoch of all of them per call.

    Islands without sources in other regions may be ahead of the epoch, as in `EpochScheduler`.

    Parameters
    ----------
    problem : SearchProblem
    sources : sequence of sequences of int
        For every island of the search, the islands that it receives from.
    border : frozenset of int
        Islands of the region from which other regions receive.
    generation : int
        Generation of ``state``.
    state : tuple of PackedEpoch
        The islands of the region.
    share : float
        Fraction of the CPUs of the cluster for this region.
    autoscaling : bool
        See `IslandActorPool`.
    """

    def __init__(
        self,
        problem: SearchProblem,
        sources: Sequence[Sequence[int]],
        border: frozenset[int],
        generation: int,
        state: tuple[PackedEpoch, ...],
        share: float,
        autoscaling: bool,
    ) -> None:
        self._border = border
        self._messages: deque[str] = deque()
        self._placement = 0, len(state)
        start = {report.index: report for report in state}
        self._scheduler = EpochScheduler(problem.settings, sources, generation, start)
        self._pool = IslandActorPool(
            problem,
            len(state),
            self._store_message,
            autoscaling=autoscaling,
            observe=self._store_placement,
            share=share,
        )
        self._deadlines = EpochDeadlines(len(state), problem.settings.population)
        self._in_flight = EpochsInFlight(self._scheduler, self._pool, self._deadlines)

    def _store_message(self, message: str, _fraction: float | None = None, /) -> None:
        self._messages.append(message)

    def _store_placement(self, placed: int, waiting: int) -> None:
        self._placement = placed, waiting

    @ray.method(concurrency_group="watch")
    def check(self) -> RegionStatus:
        """Return the status since the last call."""
        messages = tuple(self._messages.popleft() for _ in range(len(self._messages)))
        return RegionStatus(read_version(), messages, *self._placement)

    @ray.method(num_returns=2)
    def advance(self, *arriving: Mapping[int, bytes]) -> tuple[RegionReport, tuple[PackedEpoch, ...]]:
        """Run all islands to the next stop; return the report and the islands.

        Parameters
        ----------
        *arriving : mapping
            Packed emigrants of islands of other regions at the last stop, by island.
        """
        for emigrants in arriving:
            for island, packed in emigrants.items():
                self._in_flight.receive(island, self._scheduler.completed_generation, packed)
        while (reports := next(self._scheduler.completed_epochs(), None)) is None:
            if self._pool.maintain():
                self._in_flight.submit()
            self._in_flight.wait()
        self._pool.reset_losses()
        self._deadlines.reset()
        self._in_flight.drop_old_references()
        leaving = {each.index: each.emigrants for each in reports if each.index in self._border}
        steps = tuple(each.steps for each in reports)
        return RegionReport(steps, leaving, self._in_flight.memory), reports
