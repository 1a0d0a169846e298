"""Engine that runs the islands of a job on the cluster to which the coordinator is connected."""

from collections.abc import Callable
from sys import maxsize

import structlog

from islands.evolution.engine import Engine
from islands.progress import ProgressCallback
from islands_service.domain.job import IDENTIFICATION, Job, Lease
from islands_service.domain.job_memory import estimate_memory, machine_memory
from islands_service.domain.job_spec import parse_identification
from islands_service.domain.search_limits import resolve_job_settings
from islands_service.runtime.actor_pool import ignore_placement, kill_stale_actors
from islands_service.runtime.cluster import cluster_memory
from islands_service.runtime.ray_engine import RayEngine

log = structlog.get_logger()


def make_job_engine(
    lease: Lease,
    progress: ProgressCallback,
    autoscaling: bool = False,
    observe: Callable[[int, int], None] = ignore_placement,
) -> Engine:
    """Return an engine for a job, and end the actors of its earlier leases.

    Parameters
    ----------
    progress : ProgressCallback
        Receives a message if an actor is lost or must wait for a CPU.
    autoscaling : bool
        Whether the cluster starts machines for actors that wait for a CPU. Its present memory is then no
        limit.
    observe : callable
        Receives the numbers of islands with and without a separate CPU; see `IslandActorPool`.

    Raises
    ------
    JobMemoryError
        The cluster, or the machine of this process, has not enough memory for the job.
    """
    if not autoscaling:
        check_memory(lease.job)
    if ended := kill_stale_actors(lease.job.id, lease.epoch):
        log.warning("actors of a lost lease ended", actors=ended)
    return RayEngine(progress, f"{lease.job.id}.{lease.epoch}", autoscaling, observe)


def check_memory(job: Job) -> None:
    """Check the memory that a job needs when it starts: the cluster may have changed since the submission.

    Raises
    ------
    JobMemoryError
    """
    if job.kind == IDENTIFICATION:
        settings = resolve_job_settings(parse_identification(job.spec), maxsize, maxsize)
        estimate_memory(settings).check_available(cluster_memory(), machine_memory())
