"""Free run of the best model so far, stored as an artefact of a job with the reports of its progress."""

import json
from time import monotonic
from typing import Any

from islands_service.domain.free_runs import SearchFreeRun
from islands_service.domain.job import SEARCH_FREE_RUN, Job
from islands_service.outage_log import OutageLog
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreError

#: Least number of seconds between two free runs that are stored.
_EVERY = 2.0


class StoredFreeRun:
    """The free run that the store has, or gets with the next report.

    Parameters
    ----------
    job : Job
    blobs : Blobs
    """

    def __init__(self, job: Job, blobs: Blobs) -> None:
        self._job, self._blobs = job.id, blobs
        self._due = 0.0
        #: The newest one that was written, its blob, and whether the store is known to name it.
        self._written: SearchFreeRun | None = None
        self._blob, self._is_named = "", False
        #: Blob that the store named before.
        self._earlier: str | None = None
        self._outage = OutageLog("free run not stored", "free runs stored again")

    def write(self, found: SearchFreeRun | None) -> dict[str, str]:
        """Write a free run; return the blob that the next report has to name, by artefact name.

        None is written if another one was written a moment ago, or if the disk is full or the object store
        does not answer: the progress of the job is reported without it.
        """
        pending = self._written is not None and not self._is_named
        if found is not None and found is not self._written and not pending and monotonic() >= self._due:
            self._due = monotonic() + _EVERY
            # The name of the job keeps the blob apart from that of an equal search.
            document = json.dumps({"job": self._job, **found.document})
            try:
                blob = self._blobs.write(document.encode())
            except StoreError as error:
                self._outage.fail(error, job=self._job)
                return {}
            self._outage.succeed(job=self._job)
            if self._earlier is not None:
                self._blobs.discard(self._earlier)
            self._earlier = self._blob or None
            self._written, self._blob, self._is_named, pending = found, blob, False, True
        return {SEARCH_FREE_RUN: self._blob} if pending else {}

    def confirm(self) -> None:
        """Keep in mind that the store durably names the newest blob."""
        self._is_named = True

    def describe(self) -> dict[str, Any]:
        """Return the part of the progress about the free run that the store names, or gets with it."""
        return {} if self._written is None else {"free_run": self._written.mark}
