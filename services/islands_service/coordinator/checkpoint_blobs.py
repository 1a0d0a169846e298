"""Checkpoints of a job as blobs: read, written, and deleted when they are superseded."""

import gzip
import zlib
from collections.abc import Callable
from typing import TypeVar

import structlog

from islands.errors import IslandsError
from islands_service.coordinator.job_failures import check_readable
from islands_service.domain.job import Job
from islands_service.store.blobs import BlobNotFoundError, Blobs
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Largest fraction of a run that checkpoints may take: one of a thousand islands takes half a minute.
CHECKPOINT_SHARE = 0.05

#: Errors of a lost or damaged checkpoint. Other errors of the operating system may pass.
_LOSS_ERRORS = (
    *(BlobNotFoundError, FileNotFoundError, gzip.BadGzipFile, EOFError, zlib.error),
    *(IslandsError, KeyError, TypeError, ValueError),
)

T = TypeVar("T")


class CheckpointBlobs:
    """Blobs of the checkpoints of a job while this process has its lease.

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

    def load(self, parse: Callable[[str], T]) -> T | None:
        """Return the parsed text of the last checkpoint of the job; None if it is lost or damaged.

        Parameters
        ----------
        parse : callable
            Raises an `IslandsError`, KeyError, TypeError or ValueError if the text is no checkpoint of the
            job.

        Raises
        ------
        JobDeclinedError
            A newer version of islands wrote the checkpoint, and this one cannot read it.
        OSError, StoreError
            The file cannot be read now.
        """
        job = self._job
        if job.checkpoint is None:
            return None
        try:
            return parse(gzip.decompress(self._blobs.read(job.checkpoint)).decode())
        except StoreError:
            raise
        except _LOSS_ERRORS as error:
            check_readable(job.versions["checkpoint"], "checkpoint", error)
            log.error("checkpoint lost", job=job.id, reason=str(error))
            return None

    def save(self, text: str) -> str:
        """Write the text of a checkpoint; return its blob.

        Raises
        ------
        StorageFullError, ObjectStoreError
        """
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
