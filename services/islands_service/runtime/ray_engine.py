"""Search engine on Ray: submits epochs of islands to actors and repeats those that are lost."""

from collections.abc import Callable, Generator, Mapping

from ray.exceptions import RayError

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, SearchProblem
from islands.expressions.tree import Primitive
from islands.progress import ProgressCallback, Stop, ignore_progress
from islands_service.runtime import ClusterError
from islands_service.runtime.actor_pool import IslandActorPool, ignore_placement
from islands_service.runtime.cluster import cluster_cpus
from islands_service.runtime.epoch_scheduler import EpochDeadlines, EpochScheduler, schedule_islands
from islands_service.runtime.epochs_in_flight import EpochsInFlight
from islands_service.runtime.packed_epoch import PackedEpoch, PackedIslands, pack_epoch
from islands_service.runtime.regions import count_regions, run_regions


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
        observe: Callable[[int, int], None] = ignore_placement,
    ) -> None:
        self._progress, self._title, self._autoscaling = progress, title, autoscaling
        self._observe = observe

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield the epochs of a search; see `islands.evolution.engine.Engine`."""
        islands = len(start.islands)
        cpus = islands if self._autoscaling else int(cluster_cpus())
        if (regions := count_regions(islands, cpus)) > 1:
            yield from run_regions(
                problem, start, stop, regions, self._progress, self._title, self._autoscaling, self._observe
            )
            return
        scheduler = schedule_islands(problem, start, pack_epoch)
        if scheduler.finished:
            return
        pool = IslandActorPool(
            problem, islands, self._progress, self._title, self._autoscaling, self._observe
        )
        try:
            deadlines = EpochDeadlines(islands, problem.settings.population)
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
    in_flight = EpochsInFlight(scheduler, pool, deadlines)
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
