"""Jobs and their states, as values without behaviour.

::

    submit            claim             finish
    ------> QUEUED --------> RUNNING ----------> SUCCEEDED
              ^  |            |  |  '----------> FAILED ------.
              |  '--cancel-.  |  '-- cancel ---> CANCELLED ---|
              |            '--|------------------^            |
              '--- release ---'                               |
              '------------------ resume ---------------------'

* claim: a coordinator takes a lease of the job. It may take over a running job whose lease has expired.
* release: a coordinator that stops or cannot continue returns the job to the queue. The next attempt
  continues from the last checkpoint.
* cancel: a queued job is cancelled at once, a running one as soon as its coordinator has released it.
* stop: the search of a job ends early, and the job succeeds with the best models so far.
* resume: a failed or cancelled job is queued again and continues from its last checkpoint, if it has one.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from typing import Any

from islands.distribution import read_version
from islands.errors import IslandsError
from islands.progress import TimeLeft
from islands_service.domain.monitoring import MonitorUpdate

#: Version of islands of this process.
ISLANDS_VERSION = read_version()


class JobState(StrEnum):
    """State of a job."""

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"


#: States of finished jobs. Only a resume changes them.
TERMINAL = (JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED)

#: States that count towards the quota of the owner.
ACTIVE = (JobState.QUEUED, JobState.RUNNING)

#: States from which a job can be resumed.
RESUMABLE = (JobState.FAILED, JobState.CANCELLED)

#: Why a search ended that was stopped at the limit of its run time, or by its owner, in its result.
RUN_TIME, BY_OWNER = "run time", "stopped by its owner"

#: Kind of a job that identifies a model; a key of ``JOB_RUNNERS`` in
#: `islands_service.coordinator.main_loop`.
IDENTIFICATION = "identification"

#: Class of the models that a search finds, `islands.persistence.models.NARX`, whose import would take long.
SEARCHED = "narx"

#: Kind of a job that diagnoses a simulation.
DISCREPANCY = "discrepancy"

#: Kind of a job that analyses a record of a monitor.
MONITORING = "monitoring"

#: Kinds of jobs.
KINDS = (IDENTIFICATION, DISCREPANCY, MONITORING)

#: Artefact with the HTML report of a result.
REPORT = "report.html"

#: Artefact of a model: the model as FMU, below its rank.
FMU = "model.fmu"

#: Artefact of a model with its free run over the validation data as numbers, below its rank.
FREE_RUN = "free-run.json"

#: Artefact of a running search with the free run of its best model so far.
SEARCH_FREE_RUN = "search-free-run.json"

#: Artefact of a discrepancy job with the simulation extended by the effects found.
EXTENDED = "extended.json"

#: Artefact of a discrepancy job with the measured and the simulated outputs.
OUTPUTS = "outputs.npy"

#: Artefact of a discrepancy job with the input of the next experiment.
NEXT_EXPERIMENT = "next-experiment.csv"

#: Kind of the event of a new name or new tags, the only one that is no step of the job.
LABELLED = "labelled"

#: Phase of a queued job whose last attempt has ended early. The note of its progress has the reason.
WAITING_PHASE = "waiting"

#: Valid priorities.
PRIORITIES = range(-100, 101)

#: Largest length of the name of a job.
MAX_NAME_LENGTH = 200

#: Largest number of tags of a job, and largest length of a tag. A tag has no comma.
MAX_TAGS, MAX_TAG_LENGTH = 20, 40


class JobNotFoundError(IslandsError):
    """The owner has no such job."""


class JobStateError(IslandsError):
    """The state of a job does not allow the operation. The message names the state."""


class IdempotencyError(IslandsError):
    """An idempotency key was used before with a different request."""


class DatasetDeletedError(IslandsError):
    """A data set that the job needs was deleted."""


class JobDeletedError(IslandsError):
    """The job of an idempotency key was deleted."""


class QuotaError(IslandsError):
    """An owner has reached the limit of active jobs or of stored data."""


class LeaseLostError(IslandsError):
    """The lease is no longer valid: the job was claimed again, or is finished. The holder must not write."""


@dataclass(frozen=True, slots=True)
class Requester:
    """Origin of a request that changes something, for the audit trail.

    Attributes
    ----------
    address : str
        Address of the client, or ``command line``.
    key : str or None
        Id of the key; None if the request needed none.
    """

    address: str
    key: str | None = None


@dataclass(frozen=True, slots=True)
class Submission:
    """Request for a job.

    Attributes
    ----------
    owner : str
        Owner of the job.
    spec : mapping
        Specification that determines the result: see `islands_service.domain.job_spec`.
    kind : str
        `IDENTIFICATION`, `DISCREPANCY` or `MONITORING`.
    name : str
        Display name.
    priority : int
        Of the jobs of an owner, those of higher priority run first; one of `PRIORITIES`.
    idempotency_key : str, optional
        A repeated request with the same key returns the same job.
    islands : int
        Islands that run at once, which count towards the quota of the owner.
    monitor : str, optional
        Monitor whose record the job analyses, after the records that were submitted before.
    tags : tuple of str
        Words of the owner by which it finds its jobs.
    """

    owner: str
    spec: Mapping[str, Any]
    kind: str = IDENTIFICATION
    name: str = ""
    priority: int = 0
    idempotency_key: str | None = None
    islands: int = 1
    monitor: str | None = None
    tags: tuple[str, ...] = ()

    @property
    def request(self) -> str:
        """The request as canonical text: equal texts are equal requests."""
        asked = {"kind": self.kind, "spec": self.spec, "name": self.name, "priority": self.priority}
        return json.dumps({**asked, "tags": self.tags}, sort_keys=True)


@dataclass(frozen=True, slots=True)
class Job:
    """A job as it is stored.

    Attributes
    ----------
    version : int
        Number of the last event; raised by every change that clients can see.
    attempt : int
        Number of times that a coordinator has claimed the job.
    stop_requested : bool
        Whether its search ends early, with the best models so far.
    progress : mapping or None
        Last progress report.
    checkpoint : str or None
        Blob from which the job continues.
    summary : mapping or None
        Main figures of the result.
    problem : mapping or None
        Reason of the failure.
    run_seconds : float
        Seconds for which coordinators have run the job since its submission or its resume.
    max_run_seconds : int or None
        Limit of ``run_seconds`` of its owner; None is the default of the settings.
    created, updated, started, finished : float
        Seconds since 1970 by the clock of the database.
    versions : mapping
        Version of islands that accepted the ``job``, and that wrote its ``checkpoint`` and its ``result``.
    tags : tuple of str
        In the order in which the owner gave them.
    dataset_name : str or None
        Name of the data set at the submission; None if it is unknown.
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
    stop_requested: bool
    progress: Mapping[str, Any] | None
    checkpoint: str | None
    summary: Mapping[str, Any] | None
    problem: Mapping[str, Any] | None
    run_seconds: float
    max_run_seconds: int | None
    created: float
    updated: float
    started: float | None
    finished: float | None
    versions: Mapping[str, str | None]
    tags: tuple[str, ...] = ()
    dataset_name: str | None = None

    @property
    def datasets(self) -> tuple[str, ...]:
        """Data sets that the specification names, also one that this version cannot parse."""
        return find_datasets(self.spec)

    @property
    def has_search(self) -> bool:
        """Whether a search finds its models, which can end early with the best ones."""
        return self.kind == IDENTIFICATION and self.spec.get("model", SEARCHED) == SEARCHED


def find_datasets(spec: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the data sets that the specification of a job names, then its FMU."""
    parts = [spec, spec.get("validation"), *(spec.get("recordings") or ())]
    named = [part.get("dataset") for part in parts if isinstance(part, dict)]
    simulation = spec.get("simulation")
    if isinstance(simulation, dict) and simulation.get("kind") == "fmu":
        named.append(simulation.get("file"))
    return tuple(dict.fromkeys(name for name in named if isinstance(name, str)))


def name_free_run_artefacts(rank: int, outputs: int = 1) -> list[str]:
    """Return the name of the artefact with the free run of every output; several are numbered from 1."""
    if outputs == 1:
        return [f"{rank}/{FREE_RUN}"]
    return [f"{rank}/free-run-{number}.json" for number in range(1, outputs + 1)]


@dataclass(frozen=True, slots=True)
class Lease:
    """Right of a coordinator to a job, valid until a newer lease exists.

    Attributes
    ----------
    job : Job
        The job at the time of the claim.
    epoch : int
        Fencing token, raised by every claim: writes with an older epoch are rejected.
    is_last : bool
        Whether the job is given up if this attempt ends without progress, as the attempts before it.
    """

    job: Job
    epoch: int
    is_last: bool = False


@dataclass(frozen=True, slots=True)
class Renewal:
    """State of a job when its lease was renewed.

    Attributes
    ----------
    cancel_requested, stop_requested : bool
    run_seconds, max_run_seconds
        See `Job`.
    """

    cancel_requested: bool
    stop_requested: bool
    run_seconds: float
    max_run_seconds: int | None


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a job; ``number`` is the version of the job after it."""

    job: str
    number: int
    kind: str
    data: Mapping[str, Any]
    at: float


@dataclass(frozen=True, slots=True)
class JobOutcome:
    """Final state of a job, and its result.

    Attributes
    ----------
    state : JobState
        One of `TERMINAL`.
    document : mapping, optional
        Result document without its models.
    models : tuple of (mapping, str)
        Entry in the result document, and model file, of each model.
    artefacts : mapping of str to str
        Further files of the result: blobs by name.
    monitor : MonitorUpdate, optional
        Change of the monitor whose record the job has analysed.
    summary, problem : mapping, optional
        See `Job`.
    """

    state: JobState
    document: Mapping[str, Any] | None = None
    models: tuple[tuple[Mapping[str, Any], str], ...] = ()
    summary: Mapping[str, Any] | None = None
    problem: Mapping[str, Any] | None = None
    artefacts: Mapping[str, str] = field(default_factory=dict)
    monitor: MonitorUpdate | None = None


@dataclass(frozen=True, slots=True)
class ProgressReport:
    """Progress of a running job.

    Attributes
    ----------
    progress : mapping
        Shown to clients.
    points : tuple
        Points of the history: generation, evaluations, best by size, best by island.
    checkpoint : str, optional
        New blob from which the job can continue; None keeps the previous one.
    after : int
        The points replace all stored points after this generation.
    artefacts : mapping of str to str
        Files for clients until the job has a result, as in `JobOutcome`; they replace those of equal names.
    """

    progress: Mapping[str, Any]
    points: tuple[tuple[int, int, Mapping[Any, float], tuple[float | None, ...]], ...] = ()
    checkpoint: str | None = None
    after: int = -1
    artefacts: Mapping[str, str] = field(default_factory=dict)


def find_seconds_left(progress: Mapping[str, Any], reported: float, at: float) -> float | None:
    """Return the time left of a running job, less the time since its report; None if it is unknown.

    Parameters
    ----------
    progress : mapping
        Its last report.
    reported, at : float
        Time of the report, and that of the question, in seconds by the same clock.
    """
    if progress.get("seconds_left") is None:
        return None
    left = TimeLeft(-inf)
    left.expect(progress["seconds_left"], reported)
    return left.at(max(at, reported))
