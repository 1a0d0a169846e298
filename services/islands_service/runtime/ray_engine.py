"""The engine on Ray: sends islands' epochs to actors, and replays from values what gets lost."""

from collections.abc import Generator
from time import sleep

import ray
from ray.exceptions import RayError, RayTaskError

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Caches, Stop
from islands.evolution.problem import Problem
from islands.evolution.progress import ProgressCallback, ignore_progress
from islands_service.runtime.actor_pool import IslandActorPool
from islands_service.runtime.cluster import LOST
from islands_service.runtime.epoch_scheduler import EpochScheduler, EpochTask
from islands_service.runtime.errors import ClusterError
from islands_service.runtime.packed_epoch import PackedEpoch, PackedIslands, pack_epoch

#: Seconds between two looks at whether the search is to stop.
_LOOK = 0.1

#: The report of an epoch, and its emigrants, wherever they are.
References = tuple["ray.ObjectRef[PackedEpoch]", "ray.ObjectRef"]


class RayEngine:
    """Runs every island on an actor of the cluster that this process is connected to.

    Parameters
    ----------
    progress : ProgressCallback
        Takes a line for the user when an actor is lost, or has to wait for a CPU.
    title : str
        What the names of the actors begin with: ``<job>.<lease epoch>``.
    """

    def __init__(self, progress: ProgressCallback = ignore_progress, title: str = "") -> None:
        self._progress, self._title = progress, title

    def run(self, problem: Problem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """See `islands.evolution.engine.Engine`."""
        itinerary = EpochScheduler(problem, start, pack_epoch)
        if itinerary.finished:
            return
        crew = IslandActorPool(problem, len(start.islands), self._progress, self._title)
        try:
            yield from _carried_out(itinerary, crew, stop)
        except RayError as error:
            raise ClusterError(f"Ray failed in a way that nobody can go on from: {error}") from error
        finally:
            crew.shutdown()


def _carried_out(
    itinerary: EpochScheduler[PackedEpoch], crew: IslandActorPool, stop: Stop
) -> Generator[ArchipelagoEpoch]:
    voyage = _Voyage(itinerary, crew)
    while not (itinerary.finished or stop()):
        if crew.maintain():
            voyage.send()
        voyage.wait()
        for reports in itinerary.completed_epochs():
            if stop():
                return
            crew.reset_losses()
            voyage.forget()
            yield ArchipelagoEpoch(
                Archipelago(PackedIslands(reports)),
                tuple(report.steps for report in reports),
                voyage.memory,
            )


class _Voyage:
    """What is on its way: references to values that actors hold, or are about to make."""

    def __init__(self, itinerary: EpochScheduler[PackedEpoch], crew: IslandActorPool) -> None:
        self._itinerary, self._crew = itinerary, crew
        self._references: dict[tuple[int, int], References] = {}
        self._out: dict[ray.ObjectRef[PackedEpoch], EpochTask] = {}
        self._caches: dict[str, Caches] = {}

    @property
    def memory(self) -> Caches:
        """What the caches of all actors take."""
        names = {name for caches in self._caches.values() for name in caches}
        return {
            name: (
                sum(caches[name][0] for caches in self._caches.values()),
                sum(caches[name][1] for caches in self._caches.values()),
            )
            for name in sorted(names)
        }

    def send(self) -> None:
        """Send off all that may go. Ray hands the emigrants over when they are there."""
        for leg in self._itinerary.ready_tasks():
            before, _ = self._at(leg.island, leg.begin)
            arriving = [self._at(source, leg.begin)[1] for source in self._itinerary.sources[leg.island]]
            report, leaving = self._crew.actor_for(leg.island).advance.remote(before, *arriving)
            self._references[leg.island, leg.end] = report, leaving
            self._out[report] = leg

    def _at(self, island: int, generation: int) -> References:
        key = island, generation
        if key not in self._references:
            report = self._itinerary.known[island][generation]
            self._references[key] = ray.put(report), ray.put(report.emigrants)
        return self._references[key]

    def wait(self) -> None:
        """Wait a moment for somebody to come back, and take in all who are."""
        if not self._out:
            sleep(_LOOK)
            return
        ray.wait(list(self._out), num_returns=1, timeout=_LOOK)
        back, _ = ray.wait(list(self._out), num_returns=len(self._out), timeout=0)
        lost = [leg for reference in back if not self._taken(leg := self._out.pop(reference), reference)]
        if lost:
            self._lose(lost)

    def forget(self) -> None:
        """Let go of what lies behind the last complete epoch: nothing will stand on it."""
        complete = self._itinerary.completed_generation
        self._references = {key: kept for key, kept in self._references.items() if key[1] >= complete}

    def _taken(self, leg: EpochTask, reference: "ray.ObjectRef[PackedEpoch]") -> bool:
        """Take in what a leg brought; return False where it was lost."""
        try:
            report = ray.get(reference)
        except LOST:
            return False
        except RayTaskError as error:
            raise error.cause from error
        self._caches[report.actor] = report.caches
        self._itinerary.complete(leg, report)
        return True

    def _lose(self, legs: list[EpochTask]) -> None:
        """Forget legs that were lost, and what was sent of their islands after them."""
        first: dict[int, int] = {}
        for leg in legs:
            self._itinerary.reschedule(leg)
            first[leg.island] = min(leg.end, first.get(leg.island, leg.end))
        self._out = {
            reference: leg
            for reference, leg in self._out.items()
            if leg.end <= first.get(leg.island, leg.end)
        }
        # What is known may have been lost with the machine that held it: it is sent from here again.
        self._references = {
            (island, generation): references
            for (island, generation), references in self._references.items()
            if generation not in self._itinerary.known[island]
            and generation < first.get(island, generation + 1)
        }
        self._caches.clear()  # whose they were may be gone; who is there tells anew
        self._crew.maintain(at_once=True)
