"""Heartbeat of a lease: renews the lease and reports whether the job may continue."""

import os
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from math import inf
from threading import Event, Thread
from time import monotonic, process_time
from types import TracebackType
from typing import TYPE_CHECKING

import structlog

from islands.errors import IslandsError
from islands_service.domain.job import JobOutcome, JobState, Lease, LeaseLostError
from islands_service.liveness import StopRequest
from islands_service.store import Store
from islands_service.store.database import StoreError

if TYPE_CHECKING:
    from islands.evolution.archipelago import Archipelago
    from islands.evolution.engine import ArchipelagoEpoch, Engine
    from islands.evolution.problem import Problem
    from islands.evolution.progress import Stop

log = structlog.get_logger()

#: Renewals in the duration of a lease; several may be late.
RENEWALS_PER_LEASE = 10

#: Seconds between two checks whether cancellation of the job is requested.
CANCEL_POLL = 0.2

#: Seconds that a job has to end by itself. Then the heartbeat stores the cancellation and abandons the job.
CANCEL_GRACE = 0.4

#: Seconds without a call of `Heartbeat.check` after which a search counts as hanging. A search checks many
#: times a second; a checkpoint of a thousand islands takes half a minute.
HANG_TIMEOUT = 600.0

#: The same outside the search, if the process uses less than this fraction of a core meanwhile. Reading
#: before a search and refinement after it take long without a check if the record is long, but they compute.
IDLE_TIMEOUT, IDLE_SHARE = 3600.0, 0.05


class JobCancelled(IslandsError):  # noqa: N818 - control flow, not an error
    """The owner has cancelled the job."""


class CoordinatorStopping(IslandsError):  # noqa: N818 - control flow, not an error
    """The coordinator is stopping. It releases the job, which another coordinator continues."""


class Heartbeat:
    """Context manager that renews a lease from a background thread.

    Parameters
    ----------
    store : Store
    lease : Lease
    seconds : float
        Duration of the lease.
    stopping : StopRequest
        Stop request of the coordinator.
    abandon : callable
        Called if a cancelled job, or one whose lease is lost, does not end by itself: the computation is in a
        long step without checks. `restart_process` ends it; the default lets it come to its end.
    """

    def __init__(
        self,
        store: Store,
        lease: Lease,
        seconds: float,
        stopping: StopRequest,
        abandon: Callable[[], None] = lambda: None,
    ) -> None:
        self._store, self._lease, self._seconds, self._stopping = store, lease, seconds, stopping
        self._abandon = abandon
        self._over = Event()
        self._lost = self._cancelled = self._completed = self._abandoned = False
        self._searching = False
        self._checked_at, self._cpu_at_check = monotonic(), process_time()
        self._thread = Thread(target=self._beat, name="heartbeat", daemon=True)

    def __enter__(self) -> "Heartbeat":
        self._cancelled = self._lease.job.cancel_requested
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        self._thread.join()

    def check(self) -> None:
        """Raise the reason why the job must end; return if it may continue.

        Raises
        ------
        LeaseLostError, JobCancelled, CoordinatorStopping
        """
        self._checked_at, self._cpu_at_check = monotonic(), process_time()
        if self._lost:
            raise LeaseLostError(f"the lease of job {self._lease.job.id} is lost")
        if self._cancelled:
            raise JobCancelled(f"job {self._lease.job.id} is cancelled")
        if self._stopping.requested:
            raise CoordinatorStopping("the coordinator is stopping")

    def complete(self) -> None:
        """Mark the computation as complete: a cancellation is too late while its outcome is being stored."""
        self._completed = True

    @contextmanager
    def search(self) -> Iterator[None]:
        """End the process if `check` is not called for `HANG_TIMEOUT` within the block.

        A call of Ray may block for ever.
        """
        self._checked_at, self._searching = monotonic(), True
        try:
            yield
        finally:
            self._searching = False

    def _beat(self) -> None:
        try:
            self._renew_until_over()
        except BaseException as error:
            # For example a lack of memory. Without a heartbeat the job could hang, or run without a lease.
            log.error("heartbeat ended", job=self._lease.job.id, reason=repr(error))
            os._exit(1)

    def _renew_until_over(self) -> None:
        period = self._seconds / RENEWALS_PER_LEASE
        renew_at, end_by = 0.0, inf
        while not self._over.wait(min(period, CANCEL_POLL)):
            self._exit_if_hanging()
            now = monotonic()
            try:
                if self._lost:
                    pass
                elif now >= renew_at:
                    self._cancelled |= self._store.leases.renew(self._lease, self._seconds)
                    renew_at = now + period
                else:
                    self._cancelled |= self._store.leases.is_cancel_requested(self._lease)
                if self._cancelled or self._lost:
                    end_by = min(end_by, now + CANCEL_GRACE)
                if now > end_by and not (self._completed or self._abandoned):
                    self._end_job()
            except LeaseLostError:
                # If the main thread has just stored the outcome, this thread ends before the time is over.
                self._lost, end_by = True, min(end_by, now + CANCEL_GRACE)
            except StoreError as error:
                # The lease may expire meanwhile. Then the next renewal raises `LeaseLostError`.
                log.warning("heartbeat failed", job=self._lease.job.id, reason=str(error))

    def _end_job(self) -> None:
        """Store that the job is cancelled, unless its lease is lost, and abandon the computation."""
        if not self._lost:
            self._store.leases.finish(self._lease, JobOutcome(JobState.CANCELLED))
            self._lost = True
        self._abandoned = True
        log.warning("job abandoned", job=self._lease.job.id)
        self._abandon()

    def _exit_if_hanging(self) -> None:
        seconds = monotonic() - self._checked_at
        computes = process_time() - self._cpu_at_check > IDLE_SHARE * seconds
        if seconds > (HANG_TIMEOUT if self._searching else IDLE_TIMEOUT) and (
            self._searching or not computes
        ):
            log.error(
                "search hangs" if self._searching else "job hangs",
                job=self._lease.job.id,
                seconds=round(seconds),
            )
            # A blocked thread cannot be interrupted. The next coordinator continues from the last checkpoint.
            os._exit(1)


class HangGuard:
    """Engine wrapper that ends the process if the search hangs."""

    def __init__(self, engine: "Engine", heartbeat: Heartbeat) -> None:
        self._engine, self._heartbeat = engine, heartbeat

    def run(self, problem: "Problem", start: "Archipelago", stop: "Stop") -> Generator["ArchipelagoEpoch"]:
        """Run the wrapped engine."""
        with self._heartbeat.search():
            yield from self._engine.run(problem, start, stop)
