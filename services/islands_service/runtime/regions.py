"""Regions of a search of thousands of islands: a tree of coordinators with one level.

One process schedules some two thousand islands at epochs of a second. With more of them, every region of a
few hundred islands has a separate coordinator, a `RegionActor`. The driver passes the emigrants across the
borders of regions on, and merges the statistics. The result does not depend on the number of regions.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from time import monotonic
from typing import Any

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayError, RayTaskError

from islands.distribution import read_version
from islands.evolution.archipelago import Archipelago, Island, StepInfo
from islands.evolution.engine import ArchipelagoEpoch, Caches, SearchProblem, make_topology, next_stop
from islands.evolution.individual import AnyIndividual
from islands.progress import ProgressCallback
from islands_service.runtime import ClusterError
from islands_service.runtime.actor_pool import IslandActorPool, ignore_placement, put_problem
from islands_service.runtime.cluster import LOSS_ERRORS, check_version
from islands_service.runtime.epoch_scheduler import (
    MAX_EPOCHS_AHEAD,
    EpochDeadlines,
    EpochScheduler,
    begin_epoch,
)
from islands_service.runtime.epochs_in_flight import EpochsInFlight
from islands_service.runtime.packed_epoch import (
    LazyIslands,
    PackedEpoch,
    PackedIslands,
    pack_best,
    pack_epoch,
    sum_caches,
    unpack_individuals,
)

#: Islands for which one coordinator is sufficient at epochs of a second.
REGION_SIZE = 500

#: Seconds between two checks of the coordinator of a region.
_CHECK_SECONDS = 1.0

#: Seconds after which a coordinator that does not answer is replaced, and seconds that it has for its start.
_SILENCE_SECONDS, _START_SECONDS = 15.0, 120.0

#: Seconds to wait for a result between two checks of the stop function.
_POLL_SECONDS = 0.1

#: Losses of a region, without a completed epoch between them, after which the search fails.
_MAX_LOSSES = 5


def _render(
    problem: SearchProblem, state: tuple[PackedEpoch, ...], function: Callable[[Island], bytes]
) -> list[bytes]:
    return [*map(function, PackedIslands(state, problem.settings.primitive_table))]


def _pack_best(problem: SearchProblem, state: tuple[PackedEpoch, ...]) -> bytes:
    return pack_best(state, problem.settings.primitive_table)


#: Ray prefers the machine that has the islands. Its CPUs are busy with islands, so that no CPU is requested.
_TASK = ray.remote(num_cpus=0, max_retries=3)(_render)


_BEST_TASK = ray.remote(num_cpus=0, max_retries=3)(_pack_best)


class RegionIslands(LazyIslands):
    """Islands of all regions. A region is fetched at the first access to one of its islands.

    Parameters
    ----------
    starts : sequence of int
        First island of every region.
    size : int
        Number of islands.
    states : sequence of references to tuples of PackedEpoch
        Islands of every region.
    problem : SearchProblem
    shared : reference to SearchProblem
        The problem in the object store.

    Raises
    ------
    ClusterError
        Later, at an access: the islands of a region were lost with their machine.
    """

    def __init__(
        self,
        starts: Sequence[int],
        size: int,
        states: Sequence["ray.ObjectRef"],
        problem: SearchProblem,
        shared: "ray.ObjectRef[SearchProblem]",
    ) -> None:
        super().__init__(size)
        self._starts, self._states = starts, states
        self._primitives, self._shared = problem.settings.primitive_table, shared
        self._regions: dict[int, PackedIslands] = {}

    def fetch(self) -> None:
        """Fetch all regions: later the cluster may not exist any more."""
        for region in range(len(self._starts)):
            self._get_region(region)

    def render(self, function: Callable[[Island], bytes]) -> Iterator[bytes]:
        """Yield the bytes that a function returns for each island; see `Archipelago.render`.

        A region that was not fetched is rendered by a task of Ray, and all of them at the same time.

        Raises
        ------
        ClusterError
            The islands of a region were lost with their machine.
        """
        tasks = {
            region: _TASK.remote(self._shared, state, function)
            for region, state in enumerate(self._states)
            if region not in self._regions
        }
        try:
            for region in range(len(self._states)):
                if region in tasks:
                    yield from _get(tasks[region])
                    del tasks[region]
                else:
                    yield from map(function, self._regions[region])
        finally:
            for reference in tasks.values():
                ray.cancel(reference, force=True)

    def find_best(self) -> Iterator[AnyIndividual]:
        """Yield the best individual of every size of every region.

        Tasks of Ray find them, all at the same time.

        Raises
        ------
        ClusterError
            The islands of a region were lost with their machine.
        """
        tasks = [_BEST_TASK.remote(self._shared, state) for state in self._states]
        try:
            for task in tasks:
                yield from unpack_individuals(_get(task), self._primitives)
        finally:
            for task in tasks:
                ray.cancel(task, force=True)

    def _read(self, place: int) -> Island:
        region = bisect_right(self._starts, place) - 1
        return self._get_region(region)[place - self._starts[region]]

    def _get_region(self, region: int) -> PackedIslands:
        if region not in self._regions:
            self._regions[region] = PackedIslands(_get(self._states[region]), self._primitives)
        return self._regions[region]


def _get(reference: "ray.ObjectRef") -> Any:
    """Return a value of the object store."""
    try:
        return ray.get(reference)
    except RayError as error:
        if isinstance(error, RayTaskError) and not isinstance(error.cause, RayError):
            raise error.cause from error
        raise ClusterError(f"islands were lost, and the search cannot continue: {error}") from error


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
        leaving = {report.index: report.emigrants for report in reports if report.index in self._border}
        steps = tuple(report.steps for report in reports)
        return RegionReport(steps, leaving, self._in_flight.memory), reports


_ACTOR = ray.remote(max_restarts=0, max_task_retries=0, num_cpus=0, concurrency_groups={"watch": 1})(
    RegionActor
)


def count_regions(islands: int, cpus: int) -> int:
    """Return the number of regions for a number of islands and of CPUs: what computes at once counts."""
    return max(1, -(-min(islands, cpus) // REGION_SIZE))


def run_regions(
    problem: SearchProblem,
    start: Archipelago,
    stop: Callable[[], bool],
    regions: int,
    progress: ProgressCallback,
    title: str = "",
    autoscaling: bool = False,
    observe: Callable[[int, int], None] = ignore_placement,
) -> Generator[ArchipelagoEpoch]:
    """Yield the epochs of a search in regions of consecutive islands; see `islands.evolution.engine.Engine`.

    Parameters
    ----------
    regions : int
        See `count_regions`.
    progress, title, autoscaling, observe
        See `IslandActorPool`.

    Raises
    ------
    ClusterError
        Regions are lost repeatedly or cannot be started, or the islands of a region were lost with their
        machine. The search can continue from a checkpoint.
    """
    if start.generation >= problem.settings.generations:
        return
    tree = _Tree(problem, start, regions, progress, title, autoscaling, observe)
    try:
        while not (tree.finished or stop()):
            tree.submit()
            tree.wait()
            for epoch in tree.completed_epochs():
                if stop():
                    return
                yield epoch
    except RayError as error:
        raise ClusterError(f"Ray failed, and the search cannot continue: {error}") from error
    finally:
        tree.shutdown()


class _Region:
    """A region: its actor, its last islands, and its reports since the last epoch of all regions."""

    def __init__(self, index: int, islands: range, generation: int, state: "ray.ObjectRef") -> None:
        self.index, self.islands = index, islands
        #: Last generation with a report, and the islands by generation.
        self.generation = generation
        self.states = {generation: state}
        self.reports: dict[int, RegionReport] = {}
        self.actor: ActorHandle | None = None
        #: References to the report and to the islands of the epoch in progress.
        self.pending: tuple[ray.ObjectRef, ray.ObjectRef] | None = None
        #: Reference to the answer of a check, when it was asked, and the seconds that the actor has for it.
        self.check: tuple[ray.ObjectRef, float, float] | None = None
        self.losses = 0
        #: Number of islands with and without a separate CPU.
        self.placement = 0, len(islands)


class _Tree:
    """The regions of a search."""

    def __init__(
        self,
        problem: SearchProblem,
        start: Archipelago,
        regions: int,
        progress: ProgressCallback,
        title: str,
        autoscaling: bool,
        observe: Callable[[int, int], None],
    ) -> None:
        self._problem, self._shared, self._settings = problem, put_problem(problem), problem.settings
        self._progress, self._title, self._autoscaling = progress, title, autoscaling
        self._observe = observe
        self._sources = make_topology(problem, start).sources
        self._size, self._generation, self._actor_count = len(start.islands), start.generation, 0
        bounds = [self._size * number // regions for number in range(regions + 1)]
        spans = [range(first, last) for first, last in pairwise(bounds)]
        region_of = {island: index for index, span in enumerate(spans) for island in span}
        #: For every region, the regions that it receives from.
        self._neighbours = [
            sorted({region_of[source] for island in span for source in self._sources[island]} - {index})
            for index, span in enumerate(spans)
        ]
        self._borders = [
            frozenset(
                source
                for island in range(self._size)
                for source in self._sources[island]
                if source in span and island not in span
            )
            for span in spans
        ]
        self._regions, islands = [], iter(start.islands)
        for index, span in enumerate(spans):
            state = tuple(pack_epoch(begin_epoch(problem, island)) for island in islice(islands, len(span)))
            region = _Region(index, span, start.generation, ray.put(state))
            border = {each.index: each.emigrants for each in state if each.index in self._borders[index]}
            region.reports[start.generation] = RegionReport((), border)
            self._regions.append(region)
        self._last: RegionIslands | None = None

    @property
    def finished(self) -> bool:
        return self._generation >= self._settings.generations

    def submit(self) -> None:
        """Submit the next epoch of every region whose neighbours have reported the last one."""
        for region in self._regions:
            actor = region.actor or self._start_actor(region)
            if region.pending is not None or region.generation >= self._settings.generations:
                continue
            # Reports of this region that not all others have: how far it is ahead.
            if sum(generation > self._generation for generation in region.reports) >= MAX_EPOCHS_AHEAD:
                continue
            neighbours = [self._regions[index] for index in self._neighbours[region.index]]
            if all(region.generation in neighbour.reports for neighbour in neighbours):
                arriving = [neighbour.reports[region.generation].emigrants for neighbour in neighbours]
                region.pending = tuple(actor.advance.remote(*arriving))

    def wait(self) -> None:
        """Wait a moment for a report, collect all that are ready, and check the actors."""
        pending = {region.pending[0]: region for region in self._regions if region.pending is not None}
        if pending:
            ray.wait(list(pending), num_returns=1, timeout=_POLL_SECONDS)
            ready, _ = ray.wait(list(pending), num_returns=len(pending), timeout=0)
            for reference in ready:
                self._collect(pending[reference])
        now = monotonic()
        for region in self._regions:
            self._check(region, now)

    def completed_epochs(self) -> Iterator[ArchipelagoEpoch]:
        """Yield the epochs that all regions have completed, in order."""
        while not self.finished:
            end = next_stop(self._generation, self._settings)
            if not all(end in region.reports for region in self._regions):
                return
            for region in self._regions:
                del region.reports[self._generation], region.states[self._generation]
                region.losses = 0
            self._generation = end
            reports = [region.reports[end] for region in self._regions]
            self._last = RegionIslands(
                [region.islands.start for region in self._regions],
                self._size,
                [region.states[end] for region in self._regions],
                self._problem,
                self._shared,
            )
            steps = tuple(steps for report in reports for steps in report.steps)
            yield ArchipelagoEpoch(
                Archipelago(self._last), steps, sum_caches(report.caches for report in reports)
            )

    def shutdown(self) -> None:
        """Fetch the islands of the last epoch, and kill all actors. Those of islands end with their owner."""
        try:
            if self._last is not None:
                self._last.fetch()
        finally:
            for region in self._regions:
                if region.actor is not None:
                    ray.kill(region.actor)
            self._observe(0, 0)

    def _start_actor(self, region: _Region) -> ActorHandle:
        self._actor_count += 1
        actor = _ACTOR.options(name=f"{self._title}.{self._actor_count}" if self._title else None).remote(
            self._shared,
            self._sources,
            self._borders[region.index],
            region.generation,
            region.states[region.generation],
            len(region.islands) / self._size,
            self._autoscaling,
        )
        region.actor, region.check = actor, (actor.check.remote(), monotonic(), _START_SECONDS)
        return actor

    def _collect(self, region: _Region) -> None:
        assert region.pending is not None
        reference, state = region.pending
        try:
            report = ray.get(reference)
        except LOSS_ERRORS:
            self._handle_loss(region, "was lost")
            return
        except RayTaskError as error:
            raise error.cause from error
        region.generation = next_stop(region.generation, self._settings)
        region.reports[region.generation], region.states[region.generation] = report, state
        region.pending = None

    def _check(self, region: _Region, now: float) -> None:
        """Pass messages of a region on, and replace its actor if it does not answer."""
        if region.check is None or now - region.check[1] < _CHECK_SECONDS:
            return
        reference, asked_at, limit = region.check
        if not ray.wait([reference], timeout=0)[0]:
            if now - asked_at > limit:
                self._handle_loss(region, f"did not answer for {now - asked_at:.0f} s")
            return
        try:
            status = ray.get(reference)
        except LOSS_ERRORS:
            self._handle_loss(region, "was lost")
            return
        check_version(status.version)
        for message in status.messages:
            self._progress(message)
        region.placement = status.placed, status.waiting
        placed, waiting = zip(*(each.placement for each in self._regions), strict=True)
        self._observe(sum(placed), sum(waiting))
        assert region.actor is not None
        region.check = region.actor.check.remote(), now, _SILENCE_SECONDS

    def _handle_loss(self, region: _Region, reason: str) -> None:
        region.losses += 1
        name = f"the coordinator of the islands {region.islands.start} to {region.islands.stop - 1}"
        if region.losses > _MAX_LOSSES:
            raise ClusterError(
                f"{name} {reason} {region.losses} times, and no epoch was completed: is there enough memory?"
            )
        self._progress(f"{name} {reason}: they continue from their last epoch")
        if region.actor is not None:
            ray.kill(region.actor)
        region.actor = region.pending = region.check = None
        region.placement = 0, len(region.islands)
