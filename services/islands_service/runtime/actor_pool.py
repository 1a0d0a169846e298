"""The crew: the actors that carry islands. It grows with the cluster and replaces who is lost."""

from contextlib import suppress
from importlib.metadata import version
from math import inf
from time import monotonic

import ray
from ray.actor import ActorHandle
from ray.exceptions import RayActorError, RayTaskError

from islands.evolution.problem import Problem
from islands.evolution.progress import ProgressCallback
from islands_service.runtime.cluster import LOST
from islands_service.runtime.errors import ClusterError
from islands_service.runtime.island_actor import IslandActor

#: Seconds that a search waits for its whole crew before it begins with those that are there.
PATIENCE = 10.0

#: Seconds after which the user is told that an actor has not got ready: it takes one or two.
TELL_AFTER = 5.0

#: The place of the actor that stands in for a lost one until that is replaced, which takes two seconds; and
#: the seconds after which a search is long enough to have one.
STAND_IN, STAND_IN_AFTER = -1, 30.0

#: Seconds between two looks at the crew, and at the size of the cluster.
_LOOK, _MEASURE = 0.1, 1.0

#: Losses without any progress between them that are put down to bad luck, for every actor.
_LOSSES = 5

#: Ray's own restarts would lose what an actor knows without a word: recovery is ours, from values.
_ACTOR = ray.remote(max_restarts=0, max_task_retries=0, concurrency_groups={"watch": 1})(IslandActor)


class IslandActorPool:
    """Actors, one for every island as long as there are CPUs for them; further islands share them.

    An actor that finds no place stays in the cluster's queue, and the others do its work meanwhile. One more
    stands by without a CPU of its own, ready to take over from whoever is lost.

    Parameters
    ----------
    problem : Problem
    islands : int
    progress : ProgressCallback
        Told when an actor is lost, and when some have to wait for a CPU.
    title : str
        What the actors' names begin with; "" leaves them without. Who takes over a job finds by it the
        actors of a coordinator that hangs, and would keep their CPUs.
    """

    def __init__(self, problem: Problem, islands: int, progress: ProgressCallback, title: str = "") -> None:
        self._problem = ray.put(problem)
        self._islands, self._report, self._title, self._actor_count = islands, progress, title, 0
        self._size = 0
        # By place; with the reference that ends when the actor is prepared, or when it dies.
        self._joining: dict[int, tuple[ActorHandle, ray.ObjectRef]] = {}
        self._members: dict[int, tuple[ActorHandle, ray.ObjectRef]] = {}
        self._created_at = self._waiting_since = monotonic()
        self._updated_at = self._measured_at = -_MEASURE
        self._started_at = inf
        self._vacant: set[int] = set()  # places whose actors were lost and are not replaced yet
        self._last_report = ""
        self._losses = 0

    def maintain(self, at_once: bool = False) -> bool:
        """Welcome who is ready, replace who is lost, grow with the cluster; tell whether anybody is there.

        Raises
        ------
        ClusterError
            Actors die again and again, or cannot be made at all.
        """
        now = monotonic()
        if at_once or now - self._updated_at > _LOOK:
            self._updated_at = now
            self._update_members(now)
            if self._members and (not self._joining or now - self._created_at > PATIENCE):
                self._started_at = min(self._started_at, now)
        return self._started_at < inf and bool(self._members)

    @property
    def places(self) -> list[int]:
        """The places whose actors are ready, ascending."""
        return sorted(self._members)

    def actor_for(self, island: int) -> ActorHandle:
        """Return the actor for an island: the same one as long as that is there, for its warm caches."""
        place = island % self._size
        if place not in self._members:
            regular = [each for each in self._members if each != STAND_IN]
            if STAND_IN in self._members and (not regular or place == min(self._vacant, default=None)):
                place = STAND_IN
            else:
                place = sorted(regular)[island % len(regular)]
        return self._members[place][0]

    def reset_losses(self) -> None:
        """Forget the losses so far: work gets done in spite of them."""
        self._losses = 0

    def shutdown(self) -> None:
        """End all actors."""
        for actor, _ in (*self._joining.values(), *self._members.values()):
            ray.kill(actor)

    def _update_members(self, now: float) -> None:
        if now - self._measured_at > _MEASURE:
            self._measured_at = now
            cpus = int(ray.cluster_resources().get("CPU", 0))
            self._size = max(self._size, min(self._islands, max(1, cpus)))
        for place in _ended(self._members):
            self._handle_loss(place, self._members.pop(place)[0])
        if not self._members and self._started_at < inf:
            # As at the beginning: the first that is back must not get everybody's work.
            self._started_at, self._created_at = inf, now
        for place in _ended(self._joining):
            actor, prepared = self._joining[place]
            try:
                theirs = ray.get(prepared)
            except LOST as error:
                if isinstance(error, RayActorError) and error.actor_init_failed:
                    raise ClusterError(
                        f"an actor cannot be made; is islands installed on every machine? {error}"
                    ) from error
                self._handle_loss(place, actor)
            except RayTaskError as error:
                raise error.cause from error
            else:
                if theirs != version("islands"):
                    raise ClusterError(
                        f"a machine of the cluster has islands {theirs}, this one {version('islands')}: the "
                        "result would depend on who computes it; install one version on all"
                    )
                self._members[place] = (actor, actor.wait_until_killed.remote())
                self._vacant.discard(place)
            del self._joining[place]
        standing_in = [STAND_IN] if now - self._started_at > STAND_IN_AFTER else []
        for place in (*range(self._size), *standing_in):
            if place not in self._members and place not in self._joining:
                self._actor_count += 1
                actor = _ACTOR.options(
                    name=f"{self._title}.{self._actor_count}" if self._title else None,
                    num_cpus=0 if place == STAND_IN else 1,
                ).remote(self._problem)
                self._joining[place] = (actor, actor.prepare.remote())
        self._report_waiting(now)

    def _handle_loss(self, place: int, actor: ActorHandle) -> None:
        # Perhaps it is only out of reach: it must not keep its CPU from who takes its place.
        ray.kill(actor)
        self._vacant |= {place} - {STAND_IN}
        self._losses += 1
        if self._losses > _LOSSES * self._size:
            raise ClusterError(
                f"{self._losses} actors were lost and no epoch got done: is there enough memory for them? "
                "Take fewer islands, or a larger machine"
            )
        self._report("an actor was lost: its islands go on from their last epoch")

    def _report_waiting(self, now: float) -> None:
        waiting = sum(place != STAND_IN for place in self._joining)
        if not waiting:
            self._waiting_since, self._last_report = now, ""
        elif now - self._waiting_since > TELL_AFTER:
            line = (
                f"waiting for capacity: {self._size - waiting} of {self._size} island actors are ready, the "
                "others need a CPU each"
            )
            if line != self._last_report:
                self._report(line)
            self._last_report = line


def _ended(actors: dict[int, tuple[ActorHandle, ray.ObjectRef]]) -> list[int]:
    """Return the places whose reference has a value or an error."""
    places = {reference: place for place, (_, reference) in actors.items()}
    ended, _ = ray.wait(list(places), num_returns=len(places), timeout=0) if places else ([], [])
    return [places[reference] for reference in ended]


def kill_stale_actors(job: str, epoch: int) -> int:
    """End the actors of a job's leases before this one; return how many.

    Parameters
    ----------
    job : str
    epoch : int
        Of the lease that counts: `RayEngine` names its actors ``<job>.<epoch>.<number>``.
    """
    ended = 0
    for name in ray.util.list_named_actors():
        title, _, _ = name.rpartition(".")
        theirs, _, lease = title.rpartition(".")
        if theirs == job and lease.isdecimal() and int(lease) < epoch:
            # It may have ended by itself meanwhile.
            with suppress(ValueError):
                ray.kill(ray.get_actor(name))
                ended += 1
    return ended
