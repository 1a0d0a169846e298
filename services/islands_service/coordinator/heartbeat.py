"""Heartbeat of a lease: renews the lease and reports whether the job may continue."""

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from math import inf
from pathlib import Path
from sys import maxsize
from threading import Event, Thread
from time import monotonic, process_time
from typing import TYPE_CHECKING, NoReturn

import structlog

from islands.errors import IslandsError
from islands_service.coordinator.job_failures import make_problem_document
from islands_service.domain.job import JobOutcome, JobState, Lease, LeaseLostError
from islands_service.liveness import STARTING, StopRequest, send_heartbeat
from islands_service.logs import OutageLog
from islands_service.store import Store
from islands_service.store.database import StoreError

if TYPE_CHECKING:
    from islands.evolution.archipelago import Archipelago
    from islands.evolution.engine import ArchipelagoEpoch, Engine, SearchProblem
    from islands.progress import Stop

log = structlog.get_logger()

#: Renewals in the duration of a lease; several may be late.
RENEWALS_PER_LEASE = 10

#: Seconds between two checks whether cancellation of the job is requested.
CANCEL_POLL = 0.2

#: Seconds that a job has to end by itself. Then the heartbeat stores the cancellation and abandons the job.
CANCEL_GRACE = 1.5

#: The same at the limit of run time: the models that the search has found are wanted.
RUN_LIMIT_GRACE = 60.0

#: Seconds without a call of `Heartbeat.check` after which a search counts as hanging. A search checks many
#: times a second; a checkpoint of a thousand islands takes half a minute.
HANG_TIMEOUT = 600.0

#: The same outside the search, if the process uses less than this fraction of a core meanwhile. Reading
#: before a search and refinement after it take long without a check if the record is long, but they compute.
IDLE_TIMEOUT, IDLE_SHARE = 3600.0, 0.05

#: Standard input, output and error.
_STANDARD = (0, 1, 2)


class JobCancelled(IslandsError):  # noqa: N818 - control flow, not an error
    """The owner has cancelled the job."""


class RunTimeLimitError(IslandsError):
    """The job has run for as long as its owner may let a job run."""

    def __init__(self, limit: int) -> None:
        super().__init__(
            f"the job ran for {limit} s, the limit of the run time of one job, and had no result yet: resume "
            "it to continue from its last checkpoint for as long again, submit one with less work (a shorter "
            "record, smaller populations), or ask the operator for a longer time"
        )
        self.limit = limit


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
        Called if a job does not end by itself that is cancelled, has reached its limit of run time, or has
        lost its lease: the computation is in a long step without checks. `restart_process` ends it; the
        default lets it come to its end.
    max_run_seconds : int
        Limit of the run time of jobs whose owner has no such quota.
    """

    def __init__(
        self,
        store: Store,
        lease: Lease,
        seconds: float,
        stopping: StopRequest,
        abandon: Callable[[], None] = lambda: None,
        max_run_seconds: int = maxsize,
    ) -> None:
        self._store, self._lease, self._seconds, self._stopping = store, lease, seconds, stopping
        self._abandon, self._max_run_seconds = abandon, max_run_seconds
        self._over = Event()
        self._outage = OutageLog("heartbeat failed", "heartbeat works again")
        self._lost = self._cancelled = self._completed = self._abandoned = False
        self._search_stopped = False
        self._searching = self._waiting = False
        # The limit of run time, once it is reached.
        self._reached_limit: int | None = None
        self._counted_until = monotonic()
        self._checked_at, self._cpu_at_check = monotonic(), process_time()
        self._thread = Thread(target=self._beat, name="heartbeat", daemon=True)

    def __enter__(self) -> "Heartbeat":
        self._cancelled = self._lease.job.cancel_requested
        self._search_stopped = self._lease.job.stop_requested
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._over.set()
        self._thread.join()

    def check(self) -> None:
        """Raise the reason why the job must end; return if it may continue.

        Raises
        ------
        LeaseLostError, JobCancelled, CoordinatorStopping, RunTimeLimitError
        """
        self._checked_at, self._cpu_at_check = monotonic(), process_time()
        if self._lost:
            raise LeaseLostError(f"the lease of job {self._lease.job.id} is lost")
        if self._cancelled and not self._completed:
            raise JobCancelled(f"job {self._lease.job.id} is cancelled")
        if self._stopping.requested:
            raise CoordinatorStopping("the coordinator is stopping")
        if self._reached_limit is not None and not self._completed:
            raise RunTimeLimitError(self._reached_limit)

    def is_search_stopped(self) -> bool:
        """Return whether the owner has asked that the search ends with its best models."""
        return self._search_stopped

    def complete(self) -> None:
        """Mark the computation as complete: from now on neither a cancellation nor a limit ends the job."""
        self._completed = True

    def pause(self, seconds: float) -> None:
        """Wait, or until the coordinator stops. The time does not count as run time."""
        began = monotonic()
        self._stopping.wait(seconds)
        self._counted_until += monotonic() - began

    def observe_islands(self, placed: int, waiting: int) -> None:
        """Exclude from the run time the time in which all islands wait for a CPU of the cluster.

        Parameters
        ----------
        placed, waiting : int
            Numbers of islands with and without a separate CPU.
        """
        self._waiting = waiting > 0 and placed == 0

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
                    self._renew(now)
                    renew_at = now + period
                else:
                    self._keep_requests(*self._store.leases.read_requests(self._lease))
                if self._cancelled or self._lost:
                    end_by = min(end_by, now + CANCEL_GRACE)
                elif self._reached_limit is not None:
                    end_by = min(end_by, now + RUN_LIMIT_GRACE)
                if now > end_by and not (self._completed or self._abandoned):
                    self._end_job()
            except LeaseLostError:
                # If the main thread has just stored the outcome, this thread ends before the time is over.
                self._lost, end_by = True, min(end_by, now + CANCEL_GRACE)
            except StoreError as error:
                # The lease may expire meanwhile. Then the next renewal raises `LeaseLostError`.
                self._outage.fail(error, job=self._lease.job.id)
            else:
                self._outage.succeed(job=self._lease.job.id)

    def _renew(self, now: float) -> None:
        """Renew the lease, and count the run time since the last renewal."""
        ran = 0.0 if self._waiting else now - self._counted_until
        renewal = self._store.leases.renew(self._lease, self._seconds, ran)
        self._counted_until = now
        self._keep_requests(renewal.cancel_requested, renewal.stop_requested)
        limit = self._max_run_seconds if renewal.max_run_seconds is None else renewal.max_run_seconds
        if self._reached_limit is None and renewal.run_seconds >= limit:
            self._reached_limit = limit

    def _keep_requests(self, cancel: bool, stop: bool) -> None:
        """Keep requests of the owner. None is withdrawn while a job runs."""
        self._cancelled |= cancel
        self._search_stopped |= stop

    def _end_job(self) -> None:
        """Store that the job is cancelled or at its limit, unless its lease is lost, and abandon it."""
        if not self._lost:
            self._store.leases.finish(self._lease, self._make_outcome())
            self._lost = True
        self._abandoned = True
        log.warning("job abandoned", job=self._lease.job.id)
        self._abandon()

    def _make_outcome(self) -> JobOutcome:
        if self._cancelled or self._reached_limit is None:
            return JobOutcome(JobState.CANCELLED)
        problem = make_problem_document(RunTimeLimitError(self._reached_limit))
        return JobOutcome(JobState.FAILED, problem=problem)

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

    def run(
        self, problem: "SearchProblem", start: "Archipelago", stop: "Stop"
    ) -> Generator["ArchipelagoEpoch"]:
        """Run the wrapped engine."""
        with self._heartbeat.search():
            yield from self._engine.run(problem, start, stop)


def restart_process(lifeline: int | None, *kept: int | None) -> NoReturn:
    """Start the program of this process again in its place, with the same arguments and environment.

    All threads end at once, whatever they compute, and child processes are killed. Ray notices that the
    connections of this driver are closed, and ends its tasks and actors. For the supervisor it is the same
    process.

    Parameters
    ----------
    lifeline : int or None
        Heartbeat pipe of the supervisor, which stays open.
    *kept : int or None
        Further file descriptors that stay open.
    """
    for child in _find_children():
        with suppress(ProcessLookupError, ChildProcessError):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    for descriptor in [int(each.name) for each in Path("/proc/self/fd").iterdir()]:
        # Without this, Ray's connections would stay open.
        if descriptor not in (*_STANDARD, lifeline, *kept):
            with suppress(OSError):
                os.set_inheritable(descriptor, False)
    send_heartbeat(lifeline, STARTING)
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def _find_children() -> list[int]:
    children: list[int] = []
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            children += map(int, (task / "children").read_text().split())
    return children
