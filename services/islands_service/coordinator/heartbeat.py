"""Heartbeat of a lease: renews the lease and reports whether the job may continue."""

import os
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
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
    from islands.evolution.engine import ArchipelagoEpoch, Engine, Stop
    from islands.evolution.problem import Problem

log = structlog.get_logger()

#: Renewals in the duration of a lease. Several may be late, and a cancellation request is noticed soon.
RENEWALS_PER_LEASE = 10

#: Seconds that a cancelled job has to end by itself. Then the heartbeat stores the cancellation.
CANCEL_GRACE = 1.0

#: Seconds without a call of `Heartbeat.check` after which a search counts as hanging. A search checks many
#: times a second; a checkpoint of a thousand islands takes half a minute.
HANG_TIMEOUT = 600.0


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
    """

    def __init__(self, store: Store, lease: Lease, seconds: float, stopping: StopRequest) -> None:
        self._store, self._lease, self._seconds, self._stopping = store, lease, seconds, stopping
        self._over = Event()
        self._lost = self._cancelled = False
        self._checked_at: float | None = None
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
        if self._checked_at is not None:
            self._checked_at = monotonic()
        if self._lost:
            raise LeaseLostError(f"the lease of job {self._lease.job.id} is lost")
        if self._cancelled:
            raise JobCancelled(f"job {self._lease.job.id} is cancelled")
        if self._stopping.requested:
            raise CoordinatorStopping("the coordinator is stopping")

    @contextmanager
    def search(self) -> Iterator[None]:
        """End the process if `check` is not called for `HANG_TIMEOUT` within the block.

        A call of Ray may block for ever. Reading before a search and refinement after it are outside the
        block, because both take long without a check if the record is long.
        """
        self._checked_at = monotonic()
        try:
            yield
        finally:
            self._checked_at = None

    def _beat(self) -> None:
        waited = 0.0
        while not self._over.wait(self._seconds / RENEWALS_PER_LEASE):
            self._exit_if_hanging()
            if self._lost:
                continue
            try:
                self._cancelled = self._store.leases.renew(self._lease, self._seconds) or self._cancelled
                waited += self._seconds / RENEWALS_PER_LEASE if self._cancelled else 0.0
                if waited > CANCEL_GRACE:
                    # The job is in a long step without checks, such as a refinement: discard its result.
                    self._store.leases.finish(self._lease, JobOutcome(JobState.CANCELLED))
                    self._lost = True
            except LeaseLostError:
                self._lost = True
            except StoreError as error:
                # The lease may expire meanwhile. Then the next renewal raises `LeaseLostError`.
                log.warning("heartbeat failed", job=self._lease.job.id, reason=str(error))

    def _exit_if_hanging(self) -> None:
        checked_at = self._checked_at
        if checked_at is not None and monotonic() - checked_at > HANG_TIMEOUT:
            log.error("search hangs", job=self._lease.job.id, seconds=round(monotonic() - checked_at))
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
