"""Engine of a job: a short search runs in this process, any other one on actors of a Ray cluster."""

from collections.abc import Callable, Generator
from sys import maxsize

import structlog

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Engine, SearchProblem, SerialEngine
from islands.evolution.settings import LATENT, Settings
from islands.facade.identification_progress import estimate_state_space_seconds
from islands.persistence.models import NARX
from islands.progress import ProgressCallback, Stop
from islands_service.domain.job import DISCREPANCY, IDENTIFICATION, Job, Lease
from islands_service.domain.job_spec import parse_identification
from islands_service.domain.search_limits import estimate_memory, machine_memory, resolve_job_settings

log = structlog.get_logger()

#: Seconds of one core that an individual takes, and in addition for each sample of the record. Measured with
#: the presets narx, hysteresis and paper-case1: 50 to 120 us with 500 samples, 120 to 230 us with 100 000.
INDIVIDUAL_SECONDS, SAMPLE_SECONDS = 1e-4, 1.5e-9


def estimate_seconds(settings: Settings, samples: int) -> float:
    """Estimate the time of the epochs of a whole search on one core.

    A search that continues has the same estimate, and therefore the same engine.
    """
    individuals = settings.islands * settings.population * (settings.generations + 1)
    if settings.model_class == LATENT:
        return individuals * estimate_state_space_seconds(samples)
    return individuals * (INDIVIDUAL_SECONDS + samples * SAMPLE_SECONDS)


def expects_cluster(job: Job, samples: int, short: float) -> bool:
    """Return whether a job will need a cluster, as far as that is known before its record is read.

    Parameters
    ----------
    job : Job
    samples : int
        Number of samples of its data sets.
    short : float
        See `JobEngine`.

    Raises
    ------
    SettingsError
        Another version of islands wrote the specification.
    """
    if job.kind != IDENTIFICATION:
        return job.kind == DISCREPANCY
    spec = parse_identification(job.spec)
    if spec.model != NARX:
        return False
    settings = resolve_job_settings(spec, maxsize, maxsize)
    return max(estimate_seconds(each, samples) for each in settings) > short


class JobEngine:
    """Engine that needs a cluster only for long searches.

    Starting an actor takes 1.2 s of a core, and Ray itself five: a short search has ended by then.

    Parameters
    ----------
    lease : Lease
    short : float
        Largest estimate in seconds of a search that runs in this process.
    connect : callable
        Connects this process to the cluster, unless it is connected.
    progress : ProgressCallback
        Receives a message if an actor is lost or must wait for a CPU.
    autoscaling : bool
        Whether the cluster starts machines for actors that wait for a CPU. Its present memory is then no
        limit.
    observe : callable
        Receives the numbers of islands with and without a separate CPU; see `IslandActorPool`.
    """

    def __init__(
        self,
        lease: Lease,
        short: float,
        connect: Callable[[], None],
        progress: ProgressCallback,
        autoscaling: bool,
        observe: Callable[[int, int], None],
    ) -> None:
        self._lease, self._short, self._connect = lease, short, connect
        self._progress, self._autoscaling, self._observe = progress, autoscaling, observe

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield the epochs of a search; see `islands.evolution.engine.Engine`.

        Raises
        ------
        JobMemoryError
            The cluster, or the machine of this process, has not enough memory for the search.
        """
        engine = self._choose(problem.settings, problem.record.samples)
        yield from engine.run(problem, start, stop)

    def _choose(self, settings: Settings, samples: int) -> Engine:
        check_memory = estimate_memory([settings]).check_available
        if estimate_seconds(settings, samples) <= self._short:
            check_memory(machine_memory(), machine_memory())
            return SerialEngine()
        self._connect()
        # Importing Ray takes a quarter of a second and 40 MB.
        from islands_service.runtime.actor_pool import kill_stale_actors  # noqa: PLC0415
        from islands_service.runtime.cluster import cluster_memory  # noqa: PLC0415
        from islands_service.runtime.ray_engine import RayEngine  # noqa: PLC0415

        if not self._autoscaling:
            check_memory(cluster_memory(), machine_memory())
        job, epoch = self._lease.job.id, self._lease.epoch
        if ended := kill_stale_actors(job, epoch):
            log.warning("actors of a lost lease ended", actors=ended)
        return RayEngine(self._progress, f"{job}.{epoch}", self._autoscaling, self._observe)
