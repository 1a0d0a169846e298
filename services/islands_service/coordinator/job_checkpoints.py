"""Checkpoints of an identification job: read, written, and deleted when they are superseded."""

import gzip
import zlib
from dataclasses import dataclass
from typing import Any

import structlog

from islands.errors import IslandsError
from islands.evolution.search_state import SearchState
from islands.facade.automatic.kind_choice import Choice, choice_from_document
from islands.io.checkpoints import (
    archipelago_from_document,
    checkpoint_text,
    state_document,
    state_from_document,
)
from islands_service.coordinator.job_failures import check_readable
from islands_service.domain.job import Job
from islands_service.store.blobs import BlobNotFoundError, Blobs
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Errors of a lost or damaged checkpoint. Other errors of the operating system may pass.
_LOSS_ERRORS = (
    *(BlobNotFoundError, FileNotFoundError, gzip.BadGzipFile, EOFError, zlib.error),
    *(IslandsError, KeyError, TypeError, ValueError),
)

#: Note in the progress and the summary of a job whose checkpoint was lost.
RESTARTED = "the last checkpoint was lost or damaged: the search started again, which gives the same result"


@dataclass(frozen=True, slots=True)
class JobStart:
    """Where a search starts.

    Attributes
    ----------
    state : SearchState or None
        State at the last checkpoint; None if the search starts from the beginning.
    spent : float
        Seconds spent until then.
    choice : Choice or None
        Choice of the preset auto.
    note : str
        What the owner of the job should know.
    """

    state: SearchState | None = None
    spent: float = 0.0
    choice: Choice | None = None
    note: str = ""


class JobCheckpoints:
    """Checkpoints of a job while this process has its lease.

    Parameters
    ----------
    job : Job
        The job at the time of the claim.
    blobs : Blobs
    """

    def __init__(self, job: Job, blobs: Blobs) -> None:
        self._job, self._blobs = job, blobs
        # Blobs that the job named, or may have named, before its current checkpoint.
        self._earlier = set() if job.checkpoint is None else {job.checkpoint}

    def read(self) -> JobStart:
        """Return the state at the last checkpoint of the job.

        A search without its checkpoint gives the same result as one that continues. Therefore a lost
        checkpoint costs only time.

        Raises
        ------
        JobDeclinedError
            A newer version of islands wrote the checkpoint, and this one cannot read it.
        OSError, StoreError
            The file cannot be read now.
        """
        job = self._job
        if job.checkpoint is None:
            return JobStart()
        try:
            text = gzip.decompress(self._blobs.read(job.checkpoint)).decode()
            archipelago, about = archipelago_from_document(text, f"the checkpoint of job {job.id}")
            choice = choice_from_document(about["choice"]) if about.get("choice") else None
            return JobStart(state_from_document(archipelago, about), float(about["wall_s"]), choice)
        except StoreError:
            raise
        except _LOSS_ERRORS as error:
            check_readable(job.versions["checkpoint"], "checkpoint", error)
            log.error("checkpoint lost", job=job.id, reason=str(error))
            return JobStart(note=RESTARTED)

    def write(self, state: SearchState, spent: float, choice: Choice | None) -> str:
        """Write a checkpoint; return its blob.

        Raises
        ------
        StorageFullError, ObjectStoreError
        """
        about: dict[str, Any] = {
            "job": self._job.id,
            "wall_s": spent,
            "choice": None if choice is None else choice.to_document(),
            **state_document(state),
        }
        text = checkpoint_text(state.archipelago, about)
        return self._blobs.write(gzip.compress(text.encode(), compresslevel=1, mtime=0))

    def remember(self, blob: str) -> None:
        """Remember a blob of which it is unknown whether the job names it."""
        self._earlier.add(blob)

    def supersede(self, blob: str) -> None:
        """Delete the earlier checkpoints after the job durably names a new one.

        The lease was valid then, so that any later reader of the job finds the new one.
        """
        for earlier in self._earlier - {blob}:
            self._blobs.discard(earlier)
        self._earlier = {blob}
