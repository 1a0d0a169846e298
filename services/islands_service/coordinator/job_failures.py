"""Failures of jobs: which may pass, and the messages to the owner of a job.

A message for an owner never contains a path of the data folder or of the machine.
"""

import re
from collections.abc import Mapping
from types import MappingProxyType

from islands.errors import IslandsError
from islands_service.domain.job import ISLANDS_VERSION
from islands_service.store.blobs import BlobNotFoundError

#: Errors of the machine, which may pass: the job is tried again. An import fails if there is no memory for
#: the library, or while the packages of the machine are replaced.
TRANSIENT_ERRORS = (OSError, MemoryError, ImportError)

#: Seconds until the second attempt after a transient error; doubled by every further one.
RETRY_BACKOFF = 2.0

#: Problem types of errors that the input of a job can cause, by class name.
PROBLEM_TYPES: Mapping[str, str] = MappingProxyType(
    {
        "RecordError": "invalid-record",
        "SettingsError": "invalid-settings",
        "JobMemoryError": "insufficient-memory",
        "RunTimeLimitError": "run-time-limit",
        "ModelError": "invalid-model",
        "DatasetNotFoundError": "no-such-dataset",
        "MonitorNotFoundError": "no-such-monitor",
        "BlobNotFoundError": "no-such-blob",
    }
)


class JobDeclinedError(IslandsError):
    """A newer version of islands wrote the job, and this one cannot read it."""


def is_newer(other: str | None) -> bool:
    """Return whether a version is newer than that of this process; None, an unknown one, is not.

    Only the numbers count: ``1.2.0rc1`` is neither newer nor older than ``1.2.0``.
    """
    return other is not None and _numbers(other) > _numbers(ISLANDS_VERSION)


def _numbers(version: str) -> tuple[int, ...]:
    match = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(number) for number in match[0].split(".")) if match else ()


def check_readable(version: str | None, what: str, error: Exception) -> None:
    """Decline a job whose unreadable part was written by a newer version of islands.

    Raises
    ------
    JobDeclinedError
    """
    if is_newer(version):
        raise JobDeclinedError(
            f"waiting for a coordinator of islands {version}, which wrote the {what}: version "
            f"{ISLANDS_VERSION} cannot read it"
        ) from error


def make_problem_document(error: Exception) -> dict[str, str]:
    """Describe to the owner of a job why it failed."""
    if not isinstance(error, IslandsError):
        detail = f"{type(error).__name__}: the log of the service has the details"
        return {
            "type": "defect",
            "title": "The job met a defect of the service",
            "detail": f"{detail}. Please report it with the job's id.",
        }
    # The message names the folder.
    detail = str(error.__doc__ if isinstance(error, BlobNotFoundError) else error)
    kind = PROBLEM_TYPES.get(type(error).__name__, "job-failed")
    return {"type": kind, "title": "The job failed", "detail": detail}


def describe_interruption(error: Exception) -> str:
    """Describe to the owner of a job the error after which it is tried again."""
    reason = (isinstance(error, OSError) and error.strerror) or type(error).__name__
    return f"an attempt was interrupted by an error of the machine ({reason}): the job is tried again"
