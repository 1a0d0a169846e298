"""What the runner of a job works with: messages to its owner, its turn, and what it may read and write."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any

import structlog

from islands.errors import IslandsError
from islands.progress import AnswerFoundError, Stop, never_stop
from islands_service.domain.job import Job, Lease, ProgressReport
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StorageFullError, StoreError
from islands_service.store.datasets import StoredDataset

if TYPE_CHECKING:
    from islands.evolution.engine import Engine

log = structlog.get_logger()

#: Seconds for which the progress of a job contains a message.
SHOWN_SECONDS = 60.0

#: Beginning of the message that actors wait for CPUs; see `islands_service.runtime.actor_pool`.
WAITING = "waiting for capacity"

#: Phase and note of a job whose result does not fit on the disk.
WAITING_FOR_DISK = "waiting for disk space"
DISK_NOTE = (
    "the result is stored as soon as the disk of the service has room: delete jobs or data sets, or tell the "
    "operator; this time does not count as run time"
)

#: Seconds between two attempts to write to a store that is unavailable or full.
RETRY_SECONDS = 0.5

#: Why the result of the last attempt has no optional steps.
_LAST_ATTEMPT = "the attempts before the last one ended without a result"


class JobNotes:
    """Adds messages of the engine to the progress of a job."""

    def __init__(self, lease: Lease, store: Store) -> None:
        self._lease, self._store = lease, store
        self._progress: Mapping[str, Any] = lease.job.progress or {}
        self._message, self._until, self._waits = "", 0.0, False

    def add(self, message: str, _fraction: float | None = None, /) -> None:
        """Log a message and store it; a progress callback."""
        log.warning("islands", note=message)
        self._message, self._until = message, monotonic() + SHOWN_SECONDS
        phase = {"phase": WAITING} if message.startswith(WAITING) else {}
        self._try_report({**phase, "note": message})

    def begin(self, phase: str) -> None:
        """Store a phase before the first report of an attempt, without the note of an earlier one."""
        self._progress = {name: value for name, value in self._progress.items() if name != "note"}
        self._try_report({"phase": phase})

    def wait_for_store(self, error: Exception) -> None:
        """Store once that the result is computed and waits for room on a full disk, as far as that works."""
        if self._waits or not isinstance(error, StorageFullError):
            return
        try:
            self.report({"phase": WAITING_FOR_DISK, "note": DISK_NOTE}, urgent=True)
            self._waits = True
        except StoreError as refusal:
            log.warning("report failed", job=self._lease.job.id, reason=str(refusal))

    def _try_report(self, changes: Mapping[str, Any]) -> None:
        """Store the last progress with changes, unless the store is unavailable."""
        try:
            self.report(changes)
        except StoreError as error:
            # The next report of the search contains the message.
            log.warning("report failed", job=self._lease.job.id, reason=str(error))

    def report(self, changes: Mapping[str, Any], urgent: bool = False) -> None:
        """Store the last progress with changes, and without its time left, which is that of the last report.

        Raises
        ------
        StoreError
        """
        reached = {name: value for name, value in self._progress.items() if name != "seconds_left"}
        self._store.leases.report(self._lease, ProgressReport({**reached, **changes}), urgent)

    def complete(self, progress: Mapping[str, Any]) -> dict[str, Any]:
        """Return a new progress of the job with the last message, unless that is old."""
        self._progress = progress
        return {**progress, "note": self._message} if monotonic() < self._until else dict(progress)


class TurnOver(IslandsError):  # noqa: N818 - control flow, not an error
    """Another owner waits that has a smaller share of the coordinators."""


class Turn:
    """Turn of a job in this process.

    It begins with the first checkpoint, so that the start of actors on a busy machine takes none of it, and
    ends with a checkpoint, so that each turn makes progress.

    Parameters
    ----------
    seconds : float
        Least duration.
    do_others_wait : callable
        Returns whether another owner waits that has a smaller share.
    """

    def __init__(self, seconds: float, do_others_wait: Callable[[], bool]) -> None:
        self._seconds, self._do_others_wait = seconds, do_others_wait
        self._until: float | None = None

    def end_if_over(self) -> None:
        """End the turn after a checkpoint if it is over and another owner waits.

        Raises
        ------
        TurnOver
        """
        now = monotonic()
        if self._until is None:
            self._until = now + self._seconds
        elif now > self._until and self._do_others_wait():
            raise TurnOver("the turn of the job is over, and a job of another owner waits")


@dataclass(frozen=True, slots=True, eq=False)
class JobRun:
    """A job that this process runs under its lease.

    Attributes
    ----------
    lease : Lease
    store : Store
    blobs : Blobs
    engine : Engine
        Engine for searches.
    check : callable
        Raises the reason if the job must end early.
    checkpoint_every : float
        Least number of seconds between two checkpoints.
    notes : JobNotes
        Messages that the progress of the job contains.
    connect : callable
        Connects this process to the Ray cluster, unless it is connected.
    is_search_stopped : callable
        Returns whether the owner has asked that the search ends with its best models.
    let_others_pass : callable
        Called after each checkpoint. Raises the reason if the job should return to the queue now.
    pause : callable
        Waits after the store has refused the result, before it is tried again.
    """

    lease: Lease
    store: Store
    blobs: Blobs
    engine: "Engine"
    check: Callable[[], None]
    checkpoint_every: float
    notes: JobNotes
    connect: Callable[[], None]
    is_search_stopped: Stop = never_stop
    let_others_pass: Callable[[], None] = lambda: None
    pause: Callable[[Exception], None] = lambda _error: sleep(RETRY_SECONDS)

    @property
    def job(self) -> Job:
        """The job at the time of the claim."""
        return self.lease.job

    @property
    def refusal(self) -> str:
        """Why the optional steps are not computed; empty if they are.

        One of them may have ended the process in the attempts before the last one.
        """
        return _LAST_ATTEMPT if self.lease.is_last else ""

    def keep_answer(self, found: Any) -> None:
        """End the last attempt with its answer, before the optional steps.

        Raises
        ------
        AnswerFoundError
            This is the last attempt.
        """
        if self.refusal:
            raise AnswerFoundError(found, self.refusal)

    def get_dataset(self, identity: str) -> StoredDataset:
        """Return a data set or the FMU of the job, which may have been deleted since its submission."""
        return self.store.datasets.get(self.job.owner, identity, deleted=True, is_fmu=None)
