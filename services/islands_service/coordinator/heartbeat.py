"""The heartbeat of a lease: says that the coordinator lives, and hears whether it is to go on."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from types import TracebackType

import structlog

from islands.errors import IslandsError
from islands_service.domain.job import JobOutcome, JobState, Lease, LeaseLostError
from islands_service.liveness import StopRequest
from islands_service.store import Store
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Beats in the time of a lease: some may come late, and a wish to cancel is heard soon.
BEATS = 10

#: Seconds that a cancelled job's coordinator has to let go of it; then it is cancelled over its head.
GRACE = 1.0

#: Seconds after which a search that does not ask whether it is to go on hangs. It asks many times a second;
#: a checkpoint of a thousand islands takes half a minute.
HANGS = 600.0


class JobCancelled(IslandsError):  # noqa: N818 - ends a job, and is no error
    """The owner has cancelled the job."""


class CoordinatorStopping(IslandsError):  # noqa: N818 - ends a process, and is no error
    """The coordinator is to stop: its job goes on elsewhere."""


class Heartbeat:
    """Beats in a thread of its own, as long as the block lasts.

    Parameters
    ----------
    store : Store
    lease : Lease
    seconds : float
        Of the lease.
    stopping : StopRequest
        Set when the coordinator is to stop.
    """

    def __init__(self, store: Store, lease: Lease, seconds: float, stopping: StopRequest) -> None:
        self._store, self._lease, self._seconds, self._stopping = store, lease, seconds, stopping
        self._over = Event()
        self._lost = self._cancelled = False
        self._asked: float | None = None
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
        """Return if the job is to go on.

        Raises
        ------
        LeaseLostError, JobCancelled, CoordinatorStopping
        """
        if self._asked is not None:
            self._asked = monotonic()
        if self._lost:
            raise LeaseLostError(f"job {self._lease.job.id} is not ours any more")
        if self._cancelled:
            raise JobCancelled(f"job {self._lease.job.id} is cancelled")
        if self._stopping.requested:
            raise CoordinatorStopping("the coordinator is to stop")

    @contextmanager
    def search(self) -> Iterator[None]:
        """End this process if nobody checks for long within the block: a call of Ray's may never come back.

        Reading before a search, and refining after it, take long without a check where the record is long.
        """
        self._asked = monotonic()
        try:
            yield
        finally:
            self._asked = None

    def _beat(self) -> None:
        waited = 0.0
        while not self._over.wait(self._seconds / BEATS):
            self._end_hanging()
            if self._lost:
                continue
            try:
                self._cancelled = self._store.leases.renew(self._lease, self._seconds) or self._cancelled
                waited += self._seconds / BEATS if self._cancelled else 0.0
                if waited > GRACE:
                    # Something long that asks nobody, a refinement perhaps: its result comes too late.
                    self._store.leases.finish(self._lease, JobOutcome(JobState.CANCELLED))
                    self._lost = True
            except LeaseLostError:
                self._lost = True
            except StoreError as error:
                # The lease may run out meanwhile: then the next beat is told so.
                log.warning("heartbeat failed", job=self._lease.job.id, reason=str(error))

    def _end_hanging(self) -> None:
        asked = self._asked
        if asked is not None and monotonic() - asked > HANGS:
            log.error("search hangs", job=self._lease.job.id, seconds=round(monotonic() - asked))
            # The thread that hangs cannot be told. Whoever has the job next goes on from its checkpoint.
            os._exit(1)
