"""Messages about the actors of a job, for the log and for its owner."""

from collections.abc import Mapping
from time import monotonic
from typing import Any

import structlog

from islands_service.domain.job import Lease, ProgressReport
from islands_service.store import Store
from islands_service.store.database import StorageFullError, StoreError

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


class JobNotes:
    """Adds messages of the engine to the progress of a job.

    Parameters
    ----------
    lease : Lease
    store : Store
    """

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
