"""The coordinator's loop: claim a job, carry it out, write down how it ended; and again."""

import traceback
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, closing, suppress
from functools import partial
from time import monotonic, time
from types import MappingProxyType
from typing import TYPE_CHECKING

import structlog

from islands.errors import IslandsError
from islands_service.coordinator.heartbeat import CoordinatorStopping, Heartbeat, JobCancelled
from islands_service.domain.job import (
    DISCREPANCY,
    IDENTIFICATION,
    JobOutcome,
    JobState,
    Lease,
    LeaseLostError,
    ProgressReport,
)
from islands_service.liveness import StopRequest, stop_on_signals
from islands_service.runtime.errors import ClusterError
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreError
from islands_service.tracing import Traces

if TYPE_CHECKING:
    from islands.evolution.archipelago import Archipelago
    from islands.evolution.engine import ArchipelagoEpoch, Engine, Stop
    from islands.evolution.problem import Problem

log = structlog.get_logger()

#: Seconds between two looks for a job, and between two tries to reach a store that is away.
LOOK, RETRY = 0.2, 0.5

#: Seconds that the Ray on this machine may take to start.
PATIENCE = 60.0

#: Seconds between two looks for what may be forgotten, and how old a blob without a name has to be.
SWEEP_EVERY, ORPHAN = 600.0, 3600.0

#: Carries out a job: lease, store, blobs, engine, a check that ends it, seconds between checkpoints.
Work = Callable[[Lease, Store, Blobs, "Engine", Callable[[], None], float], JobOutcome]


def _identification(*arguments: object) -> JobOutcome:
    # The search's own imports take half a second: a job is claimed before that.
    from islands_service.coordinator.identification_job import identification  # noqa: PLC0415

    return identification(*arguments)  # type: ignore[arg-type]


def _discrepancy(*arguments: object) -> JobOutcome:
    from islands_service.coordinator.diagnosis_job import discrepancy  # noqa: PLC0415

    return discrepancy(*arguments)  # type: ignore[arg-type]


#: How every kind of job is carried out.
WORK: Mapping[str, Work] = MappingProxyType({IDENTIFICATION: _identification, DISCREPANCY: _discrepancy})


class Coordinator:
    """Carries out jobs, one at a time, on a Ray that it stays connected to.

    Parameters
    ----------
    settings : ServiceSettings
    name : str
        No two living coordinators have the same.
    stopping : StopRequest
        Set to have it stop: its job goes back to the queue, with its last checkpoint.
    """

    def __init__(self, settings: ServiceSettings, name: str, stopping: StopRequest) -> None:
        self._settings, self._name, self._stopping = settings, name, stopping
        self._store = Store(settings.url)
        self._blobs = Blobs(settings.blobs)
        self._traces = Traces(settings.telemetry, "coordinator")
        self._ray = ExitStack()
        self._connected = self._away = False
        self._sweep_at = monotonic() + LOOK

    def run(self) -> None:
        """Go on until told to stop.

        Raises
        ------
        ClusterError
            The cluster is lost: a new process finds the next one.
        """
        log.info("coordinator started", name=self._name)
        with self._store, self._ray, closing(self._traces):
            while not self._stopping.requested:
                if self._ready():
                    self._next()

    def _ready(self) -> bool:
        """Tell whether jobs may be claimed: not while a cluster of somebody else's does not answer."""
        if self._settings.ray_address is not None and not self._connected:
            try:
                self._connect()
            except ClusterError as error:
                log.warning("no cluster", reason=str(error))
                self._stopping.wait(10 * RETRY)
        return self._connected or self._settings.ray_address is None

    def _next(self) -> None:
        try:
            self._sweep_now_and_then()
            lease = self._store.leases.claim(self._name, self._settings.lease)
            if lease is None:
                self._idle()
        except StoreError as error:
            if not self._away:
                log.warning("store unavailable", reason=str(error))
            self._away = True
            self._stopping.wait(RETRY)
        else:
            if self._away:
                log.info("store back")
            self._away = False
            if lease is not None:
                self._carry_out(lease)

    def _idle(self) -> None:
        if not self._connected and self._address() is not None:
            self._connect()
        self._stopping.wait(LOOK)

    def _carry_out(self, lease: Lease) -> None:
        attributes = {"job": lease.job.id, "attempt": lease.job.attempt}
        with (
            structlog.contextvars.bound_contextvars(**attributes),
            self._traces.span(lease.job.kind, **attributes),
        ):
            log.info("job claimed", kind=lease.job.kind)
            began = monotonic()
            try:
                with Heartbeat(self._store, lease, self._settings.lease, self._stopping) as heartbeat:
                    outcome = self._outcome(lease, heartbeat)
                    self._finish(lease, outcome, heartbeat)
                log.info("job finished", state=outcome.state, seconds=round(monotonic() - began, 3))
            except LeaseLostError as error:
                log.warning("lease lost", reason=str(error))
            except CoordinatorStopping:
                self._release(lease)
            except StoreError as error:
                log.warning("job given back", reason=str(error))
                self._release(lease)
                self._stopping.wait(RETRY)
            except ClusterError as error:
                log.error("cluster lost", reason=str(error))
                self._release(lease, attempted=self._connected)
                raise

    def _outcome(self, lease: Lease, heartbeat: Heartbeat) -> JobOutcome:
        try:
            heartbeat.check()
            self._wait_for_ray(lease, heartbeat)
            return WORK[lease.job.kind](
                lease,
                self._store,
                self._blobs,
                _Watched(self._engine(lease), heartbeat),
                partial(self._check, heartbeat),
                self._settings.checkpoint_every,
            )
        except JobCancelled:
            return JobOutcome(JobState.CANCELLED)
        except (LeaseLostError, CoordinatorStopping, ClusterError, StoreError):
            raise
        except IslandsError as error:
            return JobOutcome(JobState.FAILED, problem=problem_of(error))
        except Exception as error:
            log.error("job failed", trace=traceback.format_exc())
            return JobOutcome(
                JobState.FAILED,
                problem={
                    "type": "defect",
                    "title": "The job met a defect of the service",
                    "detail": f"{type(error).__name__}: {error}. Please report it with the job's id.",
                },
            )

    def _check(self, heartbeat: Heartbeat) -> None:
        """Return if a job is to go on: see `Heartbeat.check`."""
        heartbeat.check()
        # A job that runs for days leaves a checkpoint every few seconds.
        try:
            self._sweep_now_and_then()
        except (StoreError, OSError) as error:
            log.warning("sweep failed", reason=str(error))

    def _finish(self, lease: Lease, outcome: JobOutcome, heartbeat: Heartbeat) -> None:
        """Write down how a job ended; a store that is away or full is waited for: the work is done."""
        while True:
            try:
                return self._store.leases.finish(lease, outcome)
            except StoreError as error:
                log.warning("cannot finish yet", reason=str(error))
                # Whoever cancels it now is too late.
                with suppress(JobCancelled):
                    heartbeat.check()
                self._stopping.wait(RETRY)

    def _release(self, lease: Lease, attempted: bool = False) -> None:
        try:
            self._store.leases.release(lease, attempted)
            log.info("job released")
        except (LeaseLostError, StoreError) as error:
            # It is taken over when its lease has run out.
            log.warning("job not released", reason=str(error))

    def _wait_for_ray(self, lease: Lease, heartbeat: Heartbeat) -> None:
        if self._connected:
            return
        self._store.leases.report(lease, ProgressReport({"phase": "starting", "note": "waiting for Ray"}))
        until = monotonic() + PATIENCE
        while self._address() is None:
            heartbeat.check()
            if monotonic() > until:
                raise ClusterError(f"Ray has not started within {PATIENCE:.0f} s")
            self._stopping.wait(LOOK)
        self._connect()

    def _address(self) -> str | None:
        if self._settings.ray_address is not None:
            return self._settings.ray_address
        try:
            return self._settings.ray_address_file.read_text() or None
        except FileNotFoundError:
            return None

    def _connect(self) -> None:
        from islands.facade.warm_up import warm_up  # noqa: PLC0415
        from islands_service.runtime.cluster import cluster  # noqa: PLC0415

        self._ray.enter_context(cluster(self._address()))
        stop_on_signals(self._stopping)
        self._connected = True
        log.info("connected to Ray", address=self._address())
        warm_up(lambda line: log.info("kernels", note=line))

    def _engine(self, lease: Lease) -> "Engine":
        from islands_service.runtime.actor_pool import kill_stale_actors  # noqa: PLC0415
        from islands_service.runtime.ray_engine import RayEngine  # noqa: PLC0415

        if ended := kill_stale_actors(lease.job.id, lease.epoch):
            log.warning("actors of a lost lease ended", actors=ended)

        def warn(message: str, _fraction: float | None = None, /) -> None:
            log.warning("islands", note=message)

        return RayEngine(warn, f"{lease.job.id}.{lease.epoch}")

    def _sweep_now_and_then(self) -> None:
        if monotonic() > self._sweep_at:
            self._sweep_at = monotonic() + SWEEP_EVERY
            self._sweep()

    def _sweep(self) -> None:
        if self._settings.retention:
            self._store.retention.delete_expired(self._settings.retention)
        # The time first, then the names, then the files: what is named after this is younger than an hour.
        before = time() - ORPHAN
        removed = self._blobs.sweep(self._store.retention.named_blobs(), before)
        log.info("swept", blobs=removed)


class _Watched:
    """An engine whose search ends this process where it hangs."""

    def __init__(self, engine: "Engine", heartbeat: Heartbeat) -> None:
        self._engine, self._heartbeat = engine, heartbeat

    def run(self, problem: "Problem", start: "Archipelago", stop: "Stop") -> Generator["ArchipelagoEpoch"]:
        """See `islands.evolution.engine.Engine`."""
        with self._heartbeat.search():
            yield from self._engine.run(problem, start, stop)


def problem_of(error: IslandsError) -> dict[str, str]:
    """Describe why a job failed, for its owner."""
    kind = PROBLEMS.get(type(error).__name__, "job-failed")
    return {"type": kind, "title": "The job failed", "detail": str(error)}


#: The types of problems that a job's own input can cause.
PROBLEMS: Mapping[str, str] = MappingProxyType(
    {
        "RecordError": "invalid-record",
        "SettingsError": "invalid-settings",
        "ModelError": "invalid-model",
        "DatasetNotFoundError": "no-such-dataset",
        "BlobNotFoundError": "no-such-blob",
    }
)
