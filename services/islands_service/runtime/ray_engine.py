"""Search engine on Ray: submits epochs of islands to actors and repeats those that are lost."""

from collections.abc import Callable, Generator, Mapping
from time import monotonic, sleep

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayError, RayTaskError

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Caches, Stop
from islands.evolution.problem import Problem
from islands.evolution.progress import ProgressCallback, ignore_progress
from islands.model.expression import Primitive
from islands_service.runtime.actor_pool import IslandActorPool
from islands_service.runtime.cluster import LOSS_ERRORS
from islands_service.runtime.epoch_deadline import EpochDeadlines
from islands_service.runtime.epoch_scheduler import EpochScheduler, EpochTask
from islands_service.runtime.errors import ClusterError
from islands_service.runtime.packed_epoch import PackedEpoch, PackedIslands, pack_epoch

#: Seconds to wait for a result between two checks of the stop function.
_POLL_SECONDS = 0.1

#: References to the packed epoch of an island and to its emigrants.
References = tuple["ray.ObjectRef[PackedEpoch]", "ray.ObjectRef"]


class RayEngine:
    """Runs islands on actors of the Ray cluster to which this process is connected.

    Parameters
    ----------
    progress : ProgressCallback
        Receives a message for the user if an actor is lost or must wait for a CPU.
    title : str
        Prefix of the names of the actors, ``<job>.<lease epoch>``; empty for unnamed ones.
    autoscaling : bool
        Whether the cluster starts machines for actors that wait for a CPU.
    observe : callable
        See `IslandActorPool`.
    """

    def __init__(
        self,
        progress: ProgressCallback = ignore_progress,
        title: str = "",
        autoscaling: bool = False,
        observe: Callable[[int, int], None] = lambda *_: None,
    ) -> None:
        self._progress, self._title, self._autoscaling = progress, title, autoscaling
        self._observe = observe

    def run(self, problem: Problem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield the epochs of a search; see `islands.evolution.engine.Engine`."""
        scheduler = EpochScheduler(problem, start, pack_epoch)
        if scheduler.finished:
            return
        islands = len(start.islands)
        pool = IslandActorPool(
            problem, islands, self._progress, self._title, self._autoscaling, self._observe
        )
        try:
            deadlines = EpochDeadlines(len(start.islands), problem.settings.population)
            yield from _run_epochs(scheduler, pool, deadlines, problem.settings.primitive_table, stop)
        except RayError as error:
            raise ClusterError(f"Ray failed, and the search cannot continue: {error}") from error
        finally:
            pool.shutdown()


def _run_epochs(
    scheduler: EpochScheduler[PackedEpoch],
    pool: IslandActorPool,
    deadlines: EpochDeadlines,
    primitives: Mapping[str, Primitive],
    stop: Stop,
) -> Generator[ArchipelagoEpoch]:
    in_flight = _InFlight(scheduler, pool, deadlines)
    while not (scheduler.finished or stop()):
        if pool.maintain():
            in_flight.submit()
        in_flight.wait()
        for reports in scheduler.completed_epochs():
            if stop():
                return
            pool.reset_losses()
            deadlines.reset()
            in_flight.drop_old_references()
            yield ArchipelagoEpoch(
                Archipelago(PackedIslands(reports, primitives)),
                tuple(report.steps for report in reports),
                in_flight.memory,
            )


class _InFlight:
    """Submitted tasks, and references to values that actors hold or will compute."""

    def __init__(
        self, scheduler: EpochScheduler[PackedEpoch], pool: IslandActorPool, deadlines: EpochDeadlines
    ) -> None:
        self._scheduler, self._pool, self._deadlines = scheduler, pool, deadlines
        self._references: dict[tuple[int, int], References] = {}
        # In the order of submission, in which each actor runs its tasks.
        self._pending: dict[ray.ObjectRef[PackedEpoch], tuple[EpochTask, ActorHandle]] = {}
        self._checked_at = monotonic()
        self._caches: dict[str, Caches] = {}

    @property
    def memory(self) -> Caches:
        """Memory of the caches of all actors."""
        names = {name for caches in self._caches.values() for name in caches}
        return {
            name: (
                sum(caches[name][0] for caches in self._caches.values()),
                sum(caches[name][1] for caches in self._caches.values()),
            )
            for name in sorted(names)
        }

    def submit(self) -> None:
        """Submit all tasks that are ready. Ray passes the emigrants on as soon as they are computed."""
        for task in self._scheduler.ready_tasks():
            before, _ = self._get_references(task.island, task.begin)
            arriving = [
                self._get_references(source, task.begin)[1] for source in self._scheduler.sources[task.island]
            ]
            actor = self._pool.actor_for(task.island)
            report, leaving = actor.advance.remote(before, *arriving)
            self._references[task.island, task.end] = report, leaving
            self._pending[report] = task, actor

    def _get_references(self, island: int, generation: int) -> References:
        key = island, generation
        if key not in self._references:
            report = self._scheduler.known[island][generation]
            self._references[key] = ray.put(report), ray.put(report.emigrants)
        return self._references[key]

    def wait(self) -> None:
        """Wait a moment for a result, and collect all that are ready."""
        if not self._pending:
            sleep(_POLL_SECONDS)
            return
        ray.wait(list(self._pending), num_returns=1, timeout=_POLL_SECONDS)
        ready, _ = ray.wait(list(self._pending), num_returns=len(self._pending), timeout=0)
        done = {reference: self._pending.pop(reference)[0] for reference in ready}
        lost = [task for reference, task in done.items() if not self._collect(task, reference)]
        if (now := monotonic()) - self._checked_at > _POLL_SECONDS:
            self._checked_at = now
            lost += self._replace_frozen(now)
        if lost:
            self._reschedule(lost)

    def _replace_frozen(self, now: float) -> list[EpochTask]:
        """Kill the actors whose deadline has passed; return their tasks."""
        first: dict[ActorHandle, EpochTask] = {}
        for task, actor in self._pending.values():
            first.setdefault(actor, task)
        computing = {actor: task for actor, task in first.items() if self._is_computable(task)}
        frozen = {actor: computing[actor] for actor in self._deadlines.find_frozen(now, computing)}
        for actor, task in frozen.items():
            seconds = self._deadlines.seconds_allowed(task)
            self._pool.replace(actor, f"an actor did not answer for {seconds:.0f} s and was replaced")
        queues = {reference: task for reference, (task, actor) in self._pending.items() if actor in frozen}
        for reference in queues:
            del self._pending[reference]
        return list(queues.values())

    def _is_computable(self, task: EpochTask) -> bool:
        """Return whether the results that a task needs are known."""
        return all(
            task.begin in self._scheduler.known[island]
            for island in (task.island, *self._scheduler.sources[task.island])
        )

    def drop_old_references(self) -> None:
        """Drop object references older than the last complete epoch."""
        complete = self._scheduler.completed_generation
        self._references = {key: kept for key, kept in self._references.items() if key[1] >= complete}

    def _collect(self, task: EpochTask, reference: "ray.ObjectRef[PackedEpoch]") -> bool:
        """Store the result of a task; return False if it was lost."""
        try:
            report = ray.get(reference)
        except LOSS_ERRORS:
            return False
        except RayTaskError as error:
            raise error.cause from error
        self._caches[report.actor] = report.caches
        self._deadlines.record(task, report.seconds)
        self._scheduler.complete(task, report)
        return True

    def _reschedule(self, tasks: list[EpochTask]) -> None:
        """Discard lost tasks and the later tasks of their islands."""
        self._deadlines.extend()
        first: dict[int, int] = {}
        for task in tasks:
            self._scheduler.reschedule(task)
            first[task.island] = min(task.end, first.get(task.island, task.end))
        self._pending = {
            reference: (task, actor)
            for reference, (task, actor) in self._pending.items()
            if task.end <= first.get(task.island, task.end)
        }
        # Objects with known values may have been lost with their machine: put those values again.
        self._references = {
            (island, generation): references
            for (island, generation), references in self._references.items()
            if generation not in self._scheduler.known[island]
            and generation < first.get(island, generation + 1)
        }
        self._caches.clear()  # drop the caches of lost actors; the others report theirs with the next epoch
        self._pool.maintain(at_once=True)
