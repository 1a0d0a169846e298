"""Tasks of islands on actors: submission, collection of results, and repetition of lost ones."""

from time import monotonic, sleep

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayTaskError

from islands.evolution.engine import Caches
from islands_service.runtime.actor_pool import IslandActorPool
from islands_service.runtime.cluster import LOSS_ERRORS
from islands_service.runtime.epoch_scheduler import EpochDeadlines, EpochScheduler, EpochTask
from islands_service.runtime.packed_epoch import PackedEpoch, sum_caches

#: Seconds to wait for a result between two checks of the stop function.
_POLL_SECONDS = 0.1

#: References to the packed epoch of an island and to its emigrants.
References = tuple["ray.ObjectRef", "ray.ObjectRef"]


class EpochsInFlight:
    """Submitted tasks, and references to values that actors hold or will compute."""

    def __init__(
        self, scheduler: EpochScheduler[PackedEpoch], pool: IslandActorPool, deadlines: EpochDeadlines
    ) -> None:
        self._scheduler, self._pool, self._deadlines = scheduler, pool, deadlines
        #: Emigrants of islands that are scheduled elsewhere, by island and generation.
        self._received: dict[tuple[int, int], bytes] = {}
        self._references: dict[tuple[int, int], References] = {}
        # In the order of submission, in which each actor runs its tasks.
        self._pending: dict[ray.ObjectRef[PackedEpoch], tuple[EpochTask, ActorHandle]] = {}
        self._checked_at = monotonic()
        self._caches: dict[str, Caches] = {}

    @property
    def memory(self) -> Caches:
        """Memory of the caches of all actors."""
        return sum_caches(self._caches.values())

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

    def receive(self, island: int, generation: int, emigrants: bytes) -> None:
        """Store the emigrants of an island that is scheduled elsewhere."""
        self._received[island, generation] = emigrants
        self._scheduler.receive(island, generation)

    def _get_references(self, island: int, generation: int) -> References:
        key = island, generation
        if key not in self._references:
            self._references[key] = self._put(key)
        return self._references[key]

    def _put(self, key: tuple[int, int]) -> References:
        """Put known values into the object store again, from where they may have been lost."""
        if key in self._received:
            emigrants = ray.put(self._received[key])
            return emigrants, emigrants
        island, generation = key
        report = self._scheduler.known[island][generation]
        return ray.put(report), ray.put(report.emigrants)

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
            self._scheduler.knows(island, task.begin)
            for island in (task.island, *self._scheduler.sources[task.island])
        )

    def drop_old_references(self) -> None:
        """Drop object references older than the last complete epoch."""
        complete = self._scheduler.completed_generation
        self._references = {key: kept for key, kept in self._references.items() if key[1] >= complete}
        self._received = {key: kept for key, kept in self._received.items() if key[1] >= complete}

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
            if not self._scheduler.knows(island, generation)
            and generation < first.get(island, generation + 1)
        }
        self._caches.clear()  # drop the caches of lost actors; the others report theirs with the next epoch
        self._pool.maintain(at_once=True)
