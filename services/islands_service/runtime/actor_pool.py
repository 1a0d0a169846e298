"""Pool of the actors that run islands. It grows with the cluster and replaces lost actors."""

import sys
from collections.abc import Callable
from contextlib import suppress
from math import inf
from threading import Event
from time import monotonic

import ray
from ray import cloudpickle
from ray.actor import ActorHandle
from ray.exceptions import RayActorError, RayTaskError

from islands.distribution import read_version
from islands.evolution.archipelago import Island
from islands.evolution.engine import SearchProblem, run_epoch
from islands.expressions.primitives import PRIMITIVES
from islands.facade.warm_up import warm_up
from islands.processes import freeze_garbage_collector
from islands.progress import ProgressCallback
from islands_service.runtime import ClusterError
from islands_service.runtime.cluster import LOSS_ERRORS, check_version, cluster_cpus, reserved_cpus
from islands_service.runtime.packed_epoch import PackedEpoch, pack_epoch, unpack_individuals, unpack_island

#: Seconds that a search waits for all actors before it begins with those that are ready.
STARTUP_TIMEOUT = 10.0

#: Seconds that the preparation of an actor may take. The compilation of all kernels takes a fifth of it.
PREPARATION_TIMEOUT = 300.0

#: Seconds after which the user is informed that actors are not ready; starting one takes one or two.
WAITING_NOTICE_AFTER = 5.0

#: Seconds after which this information is repeated.
WAITING_NOTICE_EVERY = 30.0

#: Slot of the standby actor, which replaces a lost one until that is restarted. A restart takes two seconds.
STANDBY = -1

#: Seconds of a search after which a standby actor is started.
STANDBY_AFTER = 30.0

#: Seconds between two checks of the actors.
_POLL_SECONDS = 0.1

#: Seconds between two queries of the size of the cluster.
_RESIZE_SECONDS = 1.0

#: Losses per actor, without a completed epoch between them, after which the search fails.
_MAX_LOSSES = 5


class IslandActor:
    """Runs islands of one problem, one epoch per call.

    Parameters
    ----------
    problem : SearchProblem
        From the object store: all actors of a machine share one copy of its record.
    """

    def __init__(self, problem: SearchProblem) -> None:
        self._problem, self._primitives = problem, problem.settings.primitive_table
        self._islands: dict[int, tuple[bytes, Island]] = {}
        self._name = str(ray.get_runtime_context().get_actor_id())

    @ray.method(concurrency_group="watch")
    def confirm_start(self) -> None:
        """Do nothing. The reference to this call resolves when the actor has a CPU and its process runs."""

    def prepare(self, _started: None = None) -> str:
        """Compile kernels, prepare the evaluation, and return the version of islands.

        An error in the problem is raised here.

        Parameters
        ----------
        _started : None
            Result of `confirm_start`, so that this call begins after that one has ended.
        """
        warm_up(lambda _line: None)
        self._evolution = self._problem.open()
        freeze_garbage_collector()
        return read_version()

    @ray.method(concurrency_group="watch")
    def wait_until_killed(self) -> None:
        """Block for ever. The reference to this call fails when the actor dies."""
        Event().wait()

    @ray.method(num_returns=2)
    def advance(self, before: PackedEpoch, *arriving: bytes) -> tuple[PackedEpoch, bytes]:
        """Run an island from its last stop to the next one; return the packed epoch and its emigrants."""
        began = monotonic()
        immigrants = [unpack_individuals(packed, self._primitives) for packed in arriving]
        # A search that ends kills its actors, so no stop function is needed.
        epoch = run_epoch(self._island(before), immigrants, self._evolution, lambda: False)
        assert epoch is not None
        report = pack_epoch(epoch, self._name, self._evolution.memory, monotonic() - began)
        self._islands[report.index] = report.packed, epoch.island
        return report, report.emigrants

    def _island(self, before: PackedEpoch) -> Island:
        """Return an island, unpacked unless it is the one that was packed here last."""
        packed, island = self._islands.pop(before.index, (b"", None))
        if island is not None and packed == before.packed:
            return island
        return unpack_island(before.packed, self._primitives)


#: Ray's own restarts would lose the state of an actor silently. Islands are recovered from values instead.
_ACTOR = ray.remote(max_restarts=0, max_task_retries=0, concurrency_groups={"watch": 1})(IslandActor)


def ignore_placement(_placed: int, _waiting: int) -> None:
    """Do nothing with the numbers of islands with and without a separate CPU; the default of observers."""


class IslandActorPool:
    """Actors for islands: one per island while there are CPUs, otherwise islands share them.

    An actor without a free CPU stays in the queue of the cluster, and the others run its islands meanwhile.
    In a long search a standby actor without a reserved CPU replaces a lost one immediately.

    Parameters
    ----------
    problem : SearchProblem
    islands : int
    progress : ProgressCallback
        Receives a message if an actor is lost or must wait for a CPU.
    title : str
        Prefix of the names of the actors; empty for unnamed ones. The coordinator that takes over a
        job finds by it the actors of a hanging one (`kill_stale_actors`), which would keep their CPUs.
    autoscaling : bool
        Request an actor for each island, even beyond the CPUs of the cluster, since it starts machines for
        actors that wait.
    observe : callable, optional
        Receives the number of islands with and without a separate CPU, when an actor is
        ready or lost, and zeros at the end.
    share : float
        Fraction of the CPUs of the cluster that the pool uses.
    """

    def __init__(
        self,
        problem: SearchProblem,
        islands: int,
        progress: ProgressCallback,
        title: str = "",
        autoscaling: bool = False,
        observe: Callable[[int, int], None] = ignore_placement,
        share: float = 1.0,
    ) -> None:
        self._observe = observe
        self._problem, self._autoscaling, self._share = put_problem(problem), autoscaling, share
        self._islands, self._report, self._title, self._actor_count = islands, progress, title, 0
        self._size = 0
        # By slot: the actor, and a reference that resolves when the actor is prepared (joining) or dies
        # (members).
        self._joining: dict[int, tuple[ActorHandle, ray.ObjectRef]] = {}
        self._members: dict[int, tuple[ActorHandle, ray.ObjectRef]] = {}
        # By slot of a joining actor: a reference that resolves when its process runs, and the time of that.
        self._unstarted: dict[int, tuple[ActorHandle, ray.ObjectRef]] = {}
        self._started: dict[int, float] = {}
        self._created_at = self._waiting_since = monotonic()
        self._updated_at = self._measured_at = -_RESIZE_SECONDS
        self._started_at = inf
        self._vacant: set[int] = set()  # slots whose lost actors are not replaced yet
        self._last_report, self._reported_at = "", 0.0
        self._losses = 0

    def maintain(self, at_once: bool = False) -> bool:
        """Add ready actors, replace failed ones, grow with the cluster; return whether any actor is ready.

        Raises
        ------
        ClusterError
            Actors die repeatedly or cannot be started, or a machine has another version of islands.
        """
        now = monotonic()
        if at_once or now - self._updated_at > _POLL_SECONDS:
            self._updated_at = now
            self._update_members(now)
            if self._members and (not self._joining or now - self._created_at > STARTUP_TIMEOUT):
                self._started_at = min(self._started_at, now)
        return self._started_at < inf and bool(self._members)

    @property
    def slots(self) -> list[int]:
        """Slots with a ready actor, in ascending order."""
        return sorted(self._members)

    def actor_for(self, island: int) -> ActorHandle:
        """Return the actor of an island: the same one while it lives, because its caches are warm."""
        slot = island % self._size
        if slot not in self._members:
            regular = [each for each in self._members if each != STANDBY]
            if STANDBY in self._members and (not regular or slot == min(self._vacant, default=None)):
                slot = STANDBY
            else:
                slot = sorted(regular)[island % len(regular)]
        return self._members[slot][0]

    def replace(self, actor: ActorHandle, reason: str) -> None:
        """Kill an actor that does not answer; the next `maintain` starts another one in its slot.

        Parameters
        ----------
        reason : str
            Beginning of the message to the user: what happened to the actor.
        """
        for slot, (member, _) in list(self._members.items()):
            if member == actor:
                del self._members[slot]
                self._handle_loss(slot, actor, reason)

    def reset_losses(self) -> None:
        """Reset the count of losses, since an epoch was completed in spite of them."""
        self._losses = 0

    def shutdown(self) -> None:
        """Kill all actors."""
        for actor, _ in (*self._joining.values(), *self._members.values()):
            ray.kill(actor)
        self._observe(0, 0)

    def _update_members(self, now: float) -> None:
        self._resize(now)
        for slot in _find_ended(self._members):
            self._handle_loss(slot, self._members.pop(slot)[0])
        if not self._members and self._started_at < inf:
            # Wait for all actors as at the start: the first one that is back must not get all islands.
            self._started_at, self._created_at = inf, now
        for slot in _find_ended(self._joining):
            self._admit(slot)
        for slot in _find_ended(self._unstarted):
            del self._unstarted[slot]
            self._started[slot] = now
        for slot in [each for each, begin in self._started.items() if now - begin > PREPARATION_TIMEOUT]:
            reason = f"an actor was not prepared within {PREPARATION_TIMEOUT:.0f} s"
            self._handle_loss(slot, self._joining[slot][0], reason)
            self._forget_joining(slot)
        standby = [STANDBY] if now - self._started_at > STANDBY_AFTER else []
        for slot in (*range(self._size), *standby):
            if slot not in self._members and slot not in self._joining:
                self._start(slot)
        self._report_waiting(now)
        ready = len(self._members.keys() - {STANDBY})
        self._observe(ready, self._islands - ready)

    def _resize(self, now: float) -> None:
        """Measure the CPUs of the cluster from time to time; the pool grows with them."""
        if now - self._measured_at > _RESIZE_SECONDS:
            self._measured_at = now
            cpus = self._islands if self._autoscaling else int(self._share * cluster_cpus())
            self._size = max(self._size, min(self._islands, max(1, cpus)))

    def _admit(self, slot: int) -> None:
        """Make an actor a member whose preparation has ended, unless it has failed."""
        actor, prepared = self._joining[slot]
        try:
            actor_version = ray.get(prepared)
        except LOSS_ERRORS as error:
            if isinstance(error, RayActorError) and error.actor_init_failed:
                raise ClusterError(
                    f"an actor cannot be started; is islands installed on every machine? {error}"
                ) from error
            self._handle_loss(slot, actor)
        except RayTaskError as error:
            raise error.cause from error
        else:
            check_version(actor_version)
            self._members[slot] = (actor, actor.wait_until_killed.remote())
            self._vacant.discard(slot)
        self._forget_joining(slot)

    def _start(self, slot: int) -> None:
        """Start an actor that joins when it is prepared."""
        self._actor_count += 1
        actor = _ACTOR.options(
            name=f"{self._title}.{self._actor_count}" if self._title else None,
            num_cpus=0.0 if slot == STANDBY else reserved_cpus(),
        ).remote(self._problem)
        started = actor.confirm_start.remote()
        self._unstarted[slot] = (actor, started)
        self._joining[slot] = (actor, actor.prepare.remote(started))

    def _forget_joining(self, slot: int) -> None:
        del self._joining[slot]
        self._unstarted.pop(slot, None)
        self._started.pop(slot, None)

    def _handle_loss(self, slot: int, actor: ActorHandle, reason: str = "an actor was lost") -> None:
        # The actor may only be unreachable; kill it so that its replacement gets the CPU.
        ray.kill(actor)
        self._vacant |= {slot} - {STANDBY}
        self._losses += 1
        if self._losses > _MAX_LOSSES * self._size:
            raise ClusterError(
                f"{self._losses} actors were lost and no epoch was completed: is there enough memory for "
                "them? Take fewer islands, or a larger machine"
            )
        self._report(f"{reason}: its islands continue from their last epoch")

    def _report_waiting(self, now: float) -> None:
        waiting = sum(slot != STANDBY for slot in self._joining)
        if not waiting:
            self._waiting_since, self._last_report = now, ""
        elif now - self._waiting_since > WAITING_NOTICE_AFTER:
            line = (
                f"waiting for capacity: {self._size - waiting} of {self._size} island actors are ready, the "
                "others need a CPU each"
            )
            if line != self._last_report or now - self._reported_at > WAITING_NOTICE_EVERY:
                self._last_report, self._reported_at = line, now
                self._report(line)


def put_problem(problem: SearchProblem) -> "ray.ObjectRef[SearchProblem]":
    """Put a problem into the object store, with the code of the user's functions.

    By default Ray sends the name of a function, and a worker may be unable to import its module.
    """
    modules = {
        sys.modules[entry.scalar.__module__]
        for name, entry in problem.settings.primitive_table.items()
        if name not in PRIMITIVES and getattr(entry.scalar, "__module__", None) in sys.modules
    }
    for module in modules:
        cloudpickle.register_pickle_by_value(module)
    try:
        return ray.put(problem)
    finally:
        for module in modules:
            cloudpickle.unregister_pickle_by_value(module)


def _find_ended(actors: dict[int, tuple[ActorHandle, ray.ObjectRef]]) -> list[int]:
    """Return the slots whose reference has resolved to a value or an error."""
    slots = {reference: slot for slot, (_, reference) in actors.items()}
    ended, _ = ray.wait(list(slots), num_returns=len(slots), timeout=0) if slots else ([], [])
    return [slots[reference] for reference in ended]


def kill_stale_actors(job: str, epoch: int) -> int:
    """Kill the actors of earlier leases of a job; return their number.

    Parameters
    ----------
    job : str
    epoch : int
        Epoch of the current lease: `RayEngine` names its actors ``<job>.<epoch>.<number>``.
    """
    killed = 0
    for name in ray.util.list_named_actors():
        title, _, _ = name.rpartition(".")
        owner, _, lease = title.rpartition(".")
        if owner == job and lease.isdecimal() and int(lease) < epoch:
            # The actor may have ended meanwhile.
            with suppress(ValueError):
                ray.kill(ray.get_actor(name))
                killed += 1
    return killed
