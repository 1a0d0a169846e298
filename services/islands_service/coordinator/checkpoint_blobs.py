"""Checkpoints of a job as blobs: read, written, and deleted when they are superseded."""

import gzip
import zlib
from collections.abc import Callable, Iterable
from typing import TextIO, TypeVar

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

    def load(self, parse: Callable[[TextIO], T]) -> T | None:
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
            # Unlike `gzip.decompress`, the time of this is linear in the number of members.
            with (
                self._blobs.open(job.checkpoint) as stream,
                gzip.open(stream, "rt", encoding="utf-8") as text,
            ):
                return parse(text)
        except StoreError:
            raise
        except _LOSS_ERRORS as error:
            check_readable(job.versions["checkpoint"], "checkpoint", error)
            log.error("checkpoint lost", job=job.id, reason=str(error))
            return None

    def save(self, parts: Iterable[bytes]) -> str:
        """Write a checkpoint; return its blob.

        Parameters
        ----------
        parts : iterable of bytes
            Parts of a gzip file.

        Raises
        ------
        StorageFullError, ObjectStoreError
        """
        with self._blobs.receiving() as stream:
            stream.writelines(parts)
            return self._blobs.keep(stream)

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
