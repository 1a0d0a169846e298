"""Main loop of the coordinator: claim a job, run it, store its outcome."""

import traceback
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from logging import ERROR, INFO, WARNING
from math import inf
from time import monotonic
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias, TypedDict

import structlog

from islands.errors import IslandsError
from islands_service.coordinator.heartbeat import CoordinatorStopping, HangGuard, Heartbeat, JobCancelled
from islands_service.coordinator.job_failures import (
    RETRY_BACKOFF,
    TRANSIENT_ERRORS,
    JobDeclinedError,
    check_readable,
    describe_interruption,
    make_problem_document,
)
from islands_service.coordinator.job_run import RETRY_SECONDS, JobNotes, JobRun, Turn, TurnOver
from islands_service.coordinator.metrics import CoordinatorMetrics
from islands_service.coordinator.sweeper import Sweeper
from islands_service.domain.job import (
    DISCREPANCY,
    IDENTIFICATION,
    MONITORING,
    Job,
    JobOutcome,
    JobState,
    Lease,
    LeaseLostError,
)
from islands_service.liveness import StopRequest, stop_on_signals
from islands_service.logs import OutageLog
from islands_service.runtime import ClusterError
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.buckets import ObjectStoreError
from islands_service.store.cached_blobs import open_blobs
from islands_service.store.database import StoreError
from islands_service.telemetry import Traces

#: Runs a job of one kind and returns its outcome.
JobRunner: TypeAlias = Callable[[JobRun], JobOutcome]


def _run_identification(run: JobRun) -> JobOutcome:
    # These imports take half a second: claim the job before them.
    from islands_service.coordinator.identification_job import run_identification_job  # noqa: PLC0415

    return run_identification_job(run)


def _run_diagnosis(run: JobRun) -> JobOutcome:
    from islands_service.coordinator.diagnosis_job import run_diagnosis_job  # noqa: PLC0415

    return run_diagnosis_job(run)


def _run_monitoring(run: JobRun) -> JobOutcome:
    from islands_service.coordinator.monitoring_job import run_monitoring_job  # noqa: PLC0415

    return run_monitoring_job(run)


#: Runner of each kind of job.
JOB_RUNNERS: Mapping[str, JobRunner] = MappingProxyType(
    {IDENTIFICATION: _run_identification, DISCREPANCY: _run_diagnosis, MONITORING: _run_monitoring}
)


if TYPE_CHECKING:
    from islands.evolution.engine import Engine

log = structlog.get_logger()

#: Seconds between two looks for a change of the database.
POLL_SECONDS = 0.2

#: Seconds between two attempts to claim a job without such a change: a lease or a pause may have ended.
CLAIM_SECONDS = 1.0

#: Seconds without a job after which a process that has run jobs ends. Kernels, libraries and Ray keep 150 MB.
IDLE_SECONDS = 10.0

#: Seconds until a job is tried again that needs an object store which does not answer.
OBJECT_STORE_PAUSE = 5.0

#: Note of a job that has let others pass.
OTHERS_PASS = "waits for its next turn: other owners share the service; it continues from its checkpoint"

#: Seconds that the Ray head on this machine may take to start.
RAY_STARTUP_TIMEOUT = 60.0


class QuotaDefaults(TypedDict):
    """Quotas of running jobs, and of their islands, of an owner for which none were set."""

    most_running: int | None
    most_islands: int | None


class Coordinator:
    """Runs jobs one at a time. It connects to a Ray cluster when a job needs one, and stays connected.

    Parameters
    ----------
    settings : ServiceSettings
    name : str
        Unique among the running coordinators.
    stopping : StopRequest
        Ends the loop. The current job is released with its last checkpoint.
    abandon : callable
        See `Heartbeat`.
    metrics : CoordinatorMetrics, optional
    demand_ray : callable
        Asks the supervisor to run the Ray head of this machine as long as this process runs.
    """

    def __init__(
        self,
        settings: ServiceSettings,
        name: str,
        stopping: StopRequest,
        abandon: Callable[[], None] = lambda: None,
        metrics: CoordinatorMetrics | None = None,
        demand_ray: Callable[[], None] = lambda: None,
    ) -> None:
        self._settings, self._name, self._stopping, self._abandon = settings, name, stopping, abandon
        self._metrics = metrics or CoordinatorMetrics()
        self._store = Store(settings.url)
        self._store.database.observe_commit = self._metrics.commits.observe
        self._blobs = open_blobs(settings)
        self._blobs.observe_write = self._metrics.blob_writes.observe
        self._blobs.observe_object = self._metrics.observe_object
        self._traces = Traces(settings.telemetry, "coordinator")
        self._demand_ray, self._ray = demand_ray, ExitStack()
        self._connected = self._prepared = False
        self._ran_at: float | None = None
        self._claim_at = -inf
        self._cluster_outage = OutageLog("no cluster", "cluster back")
        self._store_outage = OutageLog("store unavailable", "store back")
        self._quotas = QuotaDefaults(
            most_running=settings.max_running, most_islands=settings.max_running_islands
        )
        self._sweeper = Sweeper(settings, self._store, self._blobs, POLL_SECONDS)

    def run(self) -> None:
        """Process jobs until a stop is requested, or until none has come for a while after others.

        Raises
        ------
        SettingsError
            The object store refuses the service.
        ClusterError
            Ray has not started, or the connection to the cluster is lost. Only a new process can connect to
            another one.
        """
        log.info("coordinator started", name=self._name)
        with self._store, self._ray, closing(self._traces):
            self._blobs.check_settings()
            while not (self._stopping.requested or self._is_dispensable()):
                if self._can_claim():
                    self._claim_next()
            if not self._stopping.requested:
                log.info("coordinator ends to free memory", name=self._name)

    def _is_dispensable(self) -> bool:
        """Return whether a new process would do the same with less memory, and no metric would be lost."""
        ran_at = self._ran_at
        return (
            ran_at is not None
            and monotonic() - ran_at > IDLE_SECONDS
            and self._metrics.are_read_since(ran_at)
        )

    def _can_claim(self) -> bool:
        """Return whether jobs may be claimed: not while a configured external cluster does not answer."""
        if self._settings.ray_address is not None and not self._connected:
            try:
                self._connect()
                self._cluster_outage.succeed()
            except ClusterError as error:
                self._cluster_outage.fail(error)
                self._stopping.wait(10 * RETRY_SECONDS)
        return self._connected or self._settings.ray_address is None

    def _claim_next(self) -> None:
        try:
            self._sweeper.sweep_if_due()
            lease = self._claim()
            if lease is None:
                self._idle()
        except StoreError as error:
            self._store_outage.fail(error)
            self._stopping.wait(RETRY_SECONDS)
        else:
            self._store_outage.succeed()
            if lease is not None:
                self._process(lease)

    def _claim(self) -> Lease | None:
        """Claim a job; None if there is none, also without an attempt if nothing can have changed."""
        now = monotonic()
        if not self._store.database.has_changed() and now < self._claim_at:
            return None
        self._claim_at = now  # the next attempt if this one fails
        lease = self._store.leases.claim(self._name, self._settings.lease, **self._quotas)
        self._claim_at = now + CLAIM_SECONDS
        return lease

    def _idle(self) -> None:
        self._prepare()
        self._stopping.wait(POLL_SECONDS)

    def _process(self, lease: Lease) -> None:
        attributes = {"job": lease.job.id, "attempt": lease.job.attempt}
        with (
            structlog.contextvars.bound_contextvars(**attributes),
            self._traces.span(lease.job.kind, **attributes),
            self._metrics.running.track_inprogress(),
        ):
            log.info("job claimed", kind=lease.job.kind)
            self._metrics.attempts.labels(lease.job.kind).inc()
            started = monotonic()
            try:
                with Heartbeat(
                    self._store,
                    lease,
                    self._settings.lease,
                    self._stopping,
                    self._abandon,
                    self._settings.max_run_seconds,
                ) as heartbeat:
                    notes = JobNotes(lease, self._store)
                    outcome = self._run_job(lease, heartbeat, notes)
                    self._finish(lease, outcome, heartbeat, notes)
                self._metrics.finished.labels(lease.job.kind, outcome.state).inc()
                log.info("job finished", state=outcome.state, seconds=round(monotonic() - started, 3))
            except Exception as error:
                interruption = find_interruption(error)
                if interruption is None:
                    raise
                details = {"trace": traceback.format_exc()} if interruption.level == ERROR else {}
                log.log(interruption.level, interruption.message, reason=str(error), **details)
                self._metrics.given_back.labels(interruption.label).inc()
                interruption.react(self, lease, error)
            finally:
                self._ran_at = monotonic()

    def _run_job(self, lease: Lease, heartbeat: Heartbeat, notes: JobNotes) -> JobOutcome:
        try:
            heartbeat.check()
            if not self._prepared:
                notes.begin("loading the library")
            self._prepare()
            self._demand_ray_early(lease.job)
            connect = partial(self._wait_for_ray, lease, notes, heartbeat)
            run = JobRun(
                lease,
                self._store,
                self._blobs,
                engine=HangGuard(self._make_engine(lease, connect, notes, heartbeat), heartbeat),
                check=partial(self._check, heartbeat),
                checkpoint_every=self._settings.checkpoint_every,
                notes=notes,
                connect=connect,
                is_search_stopped=heartbeat.is_search_stopped,
                pause=partial(self._pause, notes, heartbeat),
                let_others_pass=Turn(
                    self._settings.turn, partial(self._store.leases.is_turn_over, lease, **self._quotas)
                ).end_if_over,
            )
            return JOB_RUNNERS[lease.job.kind](run)
        except JobCancelled:
            return JobOutcome(JobState.CANCELLED)
        except Exception as error:
            if find_interruption(error) is not None:
                raise
            check_readable(lease.job.versions["job"], "job", error)
            trace = None if isinstance(error, IslandsError) else traceback.format_exc()
            log.error("job failed", reason=str(error), trace=trace)
            return JobOutcome(JobState.FAILED, problem=make_problem_document(error))

    def _check(self, heartbeat: Heartbeat) -> None:
        """Raise the reason why a job must end; see `Heartbeat.check`."""
        heartbeat.check()
        # A job that runs for days writes a checkpoint every few seconds: delete replaced ones meanwhile.
        self._sweeper.sweep_if_due()

    def _pause(self, notes: JobNotes, heartbeat: Heartbeat, error: Exception) -> None:
        """Wait after the store has refused the result of a job, and say so."""
        notes.wait_for_store(error)
        heartbeat.pause(RETRY_SECONDS)

    def _finish(self, lease: Lease, outcome: JobOutcome, heartbeat: Heartbeat, notes: JobNotes) -> None:
        """Store the outcome of a job. Retry while the store is unavailable or full: the work is done."""
        heartbeat.complete()
        outage = OutageLog("cannot finish yet", "job can be finished")
        while True:
            try:
                self._store.leases.finish(lease, outcome)
            except StoreError as error:
                outage.fail(error)
                heartbeat.check()
                self._pause(notes, heartbeat, error)
            else:
                return outage.succeed()

    def _leave(self, _lease: Lease, _error: Exception) -> None:
        """Leave a job to the process that has its lease now."""

    def _release(self, lease: Lease, _error: Exception) -> None:
        self._give_back(self._store.leases.release, lease)

    def _pass(self, lease: Lease, _error: Exception) -> None:
        self._give_back(partial(self._store.leases.release, reason=OTHERS_PASS), lease)

    def _release_later(self, lease: Lease, error: Exception) -> None:
        """Release a job, and wait for the store before the next claim."""
        self._release(lease, error)
        self._stopping.wait(RETRY_SECONDS)

    def _release_and_end(self, lease: Lease, error: Exception) -> None:
        """Release a job, and end this process. It is an attempt if the cluster was there at its start."""
        self._give_back(self._store.leases.release, lease, self._connected)
        raise error

    def _decline(self, lease: Lease, error: Exception) -> None:
        self._give_back(self._store.leases.decline, lease, str(error))

    def _postpone(self, lease: Lease, error: Exception) -> None:
        self._give_back(self._store.leases.postpone, lease, describe_interruption(error), RETRY_BACKOFF)

    def _postpone_for_objects(self, lease: Lease, _error: Exception) -> None:
        # No attempt: the job is not lost however long the object store is away.
        note = "waiting for the object store, which does not answer"
        postpone = partial(self._store.leases.postpone, attempted=False)
        self._give_back(postpone, lease, note, OBJECT_STORE_PAUSE)

    def _give_back(self, how: Callable[..., None], *arguments: object) -> None:
        """Return a job to the queue, by an operation of the store."""
        try:
            how(*arguments)
            log.info("job released")
        except (LeaseLostError, StoreError) as error:
            # Another coordinator claims the job after the lease has expired.
            log.warning("job not released", reason=str(error))

    def _wait_for_ray(self, lease: Lease, notes: JobNotes, heartbeat: Heartbeat) -> None:
        if self._connected:
            return
        self._demand_ray()
        if self._find_address() is None:
            notes.report({"phase": "starting", "note": "waiting for Ray"})
            # The supervisor kills this process if Ray ends. Five of its starts must not make the job fail.
            self._store.leases.count_attempt(lease, -1)
            try:
                self._wait_for_address(heartbeat)
            finally:
                self._store.leases.count_attempt(lease, 1)
        self._connect()

    def _wait_for_address(self, heartbeat: Heartbeat) -> None:
        until = monotonic() + RAY_STARTUP_TIMEOUT
        while self._find_address() is None:
            heartbeat.check()
            if monotonic() > until:
                raise ClusterError(f"Ray has not started within {RAY_STARTUP_TIMEOUT:.0f} s")
            self._stopping.wait(POLL_SECONDS)

    def _find_address(self) -> str | None:
        if self._settings.ray_address is not None:
            return self._settings.ray_address
        try:
            return self._settings.ray_address_file.read_text() or None
        except FileNotFoundError:
            return None

    def _connect(self) -> None:
        from islands_service.runtime.cluster import cluster  # noqa: PLC0415

        self._ray.enter_context(cluster(self._find_address()))
        stop_on_signals(self._stopping)
        self._connected = True
        log.info("connected to Ray", address=self._find_address())

    def _prepare(self) -> None:
        """Import what most jobs need, and compile the kernels: it would delay the first job."""
        if self._prepared:
            return
        from islands.facade.warm_up import warm_up  # noqa: PLC0415
        from islands.processes import freeze_garbage_collector  # noqa: PLC0415

        freeze_garbage_collector()  # before the compilation, which makes many objects
        warm_up(lambda line: log.info("kernels", note=line))
        self._prepared = True

    def _demand_ray_early(self, job: Job) -> None:
        """Let Ray start while a job reads its record and selects seeds."""
        from islands_service.coordinator.job_engine import expects_cluster  # noqa: PLC0415

        stored = self._store.datasets
        datasets = [stored.get(job.owner, dataset, deleted=True, is_fmu=None) for dataset in job.datasets]
        # An FMU has none.
        samples = sum(dataset.preview.get("samples", 0) for dataset in datasets)
        if expects_cluster(job, samples, self._settings.short_search):
            self._demand_ray()

    def _make_engine(
        self, lease: Lease, connect: Callable[[], None], notes: JobNotes, heartbeat: Heartbeat
    ) -> "Engine":
        from islands_service.coordinator.job_engine import JobEngine  # noqa: PLC0415

        def observe(placed: int, waiting: int) -> None:
            self._metrics.observe_islands(placed, waiting)
            heartbeat.observe_islands(placed, waiting)

        settings = self._settings
        return JobEngine(lease, settings.short_search, connect, notes.add, settings.autoscaling, observe)


@dataclass(frozen=True, slots=True)
class Interruption:
    """What a coordinator does after an error that ends an attempt without an outcome of the job.

    Attributes
    ----------
    errors : exception type or tuple of these
    label : str
        Reason in the metric of attempts given back.
    level : int
        Level of the message in the log.
    message : str
    react : callable
        Gives the job back, or leaves it.
    """

    errors: type[Exception] | tuple[type[Exception], ...]
    label: str
    level: int
    message: str
    react: Callable[[Coordinator, Lease, Exception], None]


#: Errors that end an attempt; of several that apply, the first one counts.
INTERRUPTIONS = (
    Interruption(LeaseLostError, "lease-lost", WARNING, "lease lost", Coordinator._leave),
    Interruption(JobDeclinedError, "declined", WARNING, "job declined", Coordinator._decline),
    Interruption(TRANSIENT_ERRORS, "interrupted", ERROR, "job interrupted", Coordinator._postpone),
    Interruption(TurnOver, "turn-over", INFO, "job lets others pass", Coordinator._pass),
    Interruption(CoordinatorStopping, "stopping", INFO, "job stopped", Coordinator._release),
    Interruption(
        *(ObjectStoreError, "object-store", WARNING, "object store unavailable"),
        Coordinator._postpone_for_objects,
    ),
    Interruption(StoreError, "store", WARNING, "job given back", Coordinator._release_later),
    Interruption(ClusterError, "cluster", ERROR, "cluster lost", Coordinator._release_and_end),
)


def find_interruption(error: Exception) -> Interruption | None:
    """Return what a coordinator does after an error; None if the error is that of the job."""
    return next((each for each in INTERRUPTIONS if isinstance(error, each.errors)), None)
