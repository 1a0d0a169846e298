"""Jobs: what somebody asks for, and the states that it goes through. Pure values; the store keeps them.

::

    submit            claim             finish
    ------> QUEUED --------> RUNNING ----------> SUCCEEDED
              ^  |            |  |  '----------> FAILED ------.
              |  '--cancel-.  |  '-- cancel ---> CANCELLED ---|
              |            '--|------------------^            |
              '--- release ---'                               |
              '------------------ resume ---------------------'

* claim: a coordinator takes a lease of the job; it may take over a running one whose lease has expired.
* release: the coordinator is told to stop; the job goes on elsewhere, from its last checkpoint.
* cancel: a queued job is cancelled at once, a running one as soon as its coordinator has let go of it.
* resume: a job that failed or was cancelled goes on from its last checkpoint, if it has one.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from islands.errors import IslandsError


class JobState(StrEnum):
    """Where a job stands."""

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"


#: States in which nothing happens any more, unless somebody resumes the job.
TERMINAL = (JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED)

#: States in which a job takes up room in its owner's quota.
ACTIVE = (JobState.QUEUED, JobState.RUNNING)

#: States that a job may be resumed from.
RESUMABLE = (JobState.FAILED, JobState.CANCELLED)

#: Kinds of jobs: the entries of ``WORK`` in `islands_service.coordinator.coordinator`.
IDENTIFICATION, DISCREPANCY = "identification", "discrepancy"

#: Artefacts of a result: the page that says it all, and of a discrepancy the simulation with its effects.
REPORT, EXTENDED = "report.html", "extended.json"

#: The greatest and the least priority.
PRIORITIES = range(-100, 101)


class JobNotFoundError(IslandsError):
    """There is no such job for this owner."""


class JobStateError(IslandsError):
    """A job's state does not allow what is asked: the message says which state it is in."""


class IdempotencyError(IslandsError):
    """An idempotency key was used before, with another request."""


class QuotaError(IslandsError):
    """An owner has as many jobs, or as much data, as it may have."""


class LeaseLostError(IslandsError):
    """The job is another coordinator's by now, or finished: whoever gets this writes nothing more."""


@dataclass(frozen=True, slots=True)
class Submission:
    """What somebody asks for.

    Attributes
    ----------
    owner : str
        Who will see the job.
    spec : mapping
        What determines the result: see `islands_service.domain.job_spec`.
    kind : str
        `IDENTIFICATION` or `DISCREPANCY`.
    name : str
        For people.
    priority : int
        Higher ones go first; one of `PRIORITIES`.
    idempotency_key : str, optional
        The same key with the same request is the same job.
    """

    owner: str
    spec: Mapping[str, Any]
    kind: str = IDENTIFICATION
    name: str = ""
    priority: int = 0
    idempotency_key: str | None = None

    @property
    def request(self) -> str:
        """The request as text: two that are equal ask for the same."""
        asked = {"kind": self.kind, "spec": self.spec, "name": self.name, "priority": self.priority}
        return json.dumps(asked, sort_keys=True)


@dataclass(frozen=True, slots=True)
class Job:
    """A job as the store has it.

    Attributes
    ----------
    version : int
        Rises with every change that a watcher sees; the number of the job's last event.
    attempt : int
        How often a coordinator has taken it.
    progress : mapping or None
        What the coordinator told last.
    checkpoint : str or None
        The blob that it goes on from.
    summary : mapping or None
        The result at a glance.
    problem : mapping or None
        Why it failed.
    created, updated, started, finished : float
        Seconds since 1970, by the database's clock.
    """

    id: str
    owner: str
    kind: str
    name: str
    spec: Mapping[str, Any]
    priority: int
    state: JobState
    version: int
    attempt: int
    cancel_requested: bool
    progress: Mapping[str, Any] | None
    checkpoint: str | None
    summary: Mapping[str, Any] | None
    problem: Mapping[str, Any] | None
    created: float
    updated: float
    started: float | None
    finished: float | None


@dataclass(frozen=True, slots=True)
class Lease:
    """A coordinator's right to a job, as long as no other one has a newer lease.

    Attributes
    ----------
    job : Job
        As it was when it was claimed.
    epoch : int
        Rises with every claim: what is written under an older one is refused.
    """

    job: Job
    epoch: int


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a job; ``number`` is the job's version after it."""

    job: str
    number: int
    kind: str
    data: Mapping[str, Any]
    at: float


@dataclass(frozen=True, slots=True)
class JobOutcome:
    """How a job ended, and what it brought.

    Attributes
    ----------
    state : JobState
        One of `TERMINAL`.
    document : mapping, optional
        The result without its models.
    models : tuple of (mapping, str)
        Every model's entry of the result, and its model file.
    artefacts : mapping of str to str
        What belongs to the result beside the document, by name: blobs.
    summary, problem : mapping, optional
        See `Job`.
    """

    state: JobState
    document: Mapping[str, Any] | None = None
    models: tuple[tuple[Mapping[str, Any], str], ...] = ()
    summary: Mapping[str, Any] | None = None
    problem: Mapping[str, Any] | None = None
    artefacts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ProgressReport:
    """What a coordinator tells of a running job.

    Attributes
    ----------
    progress : mapping
        For whoever watches.
    points : tuple
        Points of the history: generation, evaluations, best by size, best by island.
    checkpoint : str, optional
        A new blob to go on from; None leaves the one that is there.
    after : int
        The generation behind which the points take the place of those that are there.
    """

    progress: Mapping[str, Any]
    points: tuple[tuple[int, int, Mapping[Any, float], tuple[float | None, ...]], ...] = ()
    checkpoint: str | None = None
    after: int = -1
